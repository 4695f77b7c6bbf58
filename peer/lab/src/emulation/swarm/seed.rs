//! The streams of a seed that the emulation has besides those of the robots' lives.

pub(super) use gestalt_strategies::streams::stream;

/// What the network does to messages.
pub(super) const NETWORK: u64 = u64::MAX;
/// The course of events.
pub(super) const COURSE: u64 = u64::MAX - 1;
/// What is asked by chance, and which answers are wrong.
pub(super) const ANSWERS: u64 = u64::MAX - 2;
/// The first of those that poisoners draw from.
const POISON: u64 = 1 << 61;

/// What a robot sees of the `n`th showing: all fusion rules are shown the same frames.
pub(super) fn frames(n: u32, robot: usize) -> u64 {
    u64::from(n) << 32 | robot as u64
}

/// How a robot poisons.
pub(super) fn poison(robot: u32) -> u64 {
    POISON | u64::from(robot)
}
