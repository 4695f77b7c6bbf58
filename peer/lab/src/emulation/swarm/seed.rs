//! The streams of a seed: what depends on chance in one place does not change the chances elsewhere.

use gestalt_strategies::Life;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What the network does to messages.
pub(super) const NETWORK: u64 = u64::MAX;
/// The course of events.
pub(super) const COURSE: u64 = u64::MAX - 1;
/// What is asked by chance, and which answers are wrong.
pub(super) const ANSWERS: u64 = u64::MAX - 2;
/// The first of those by which robots share and forget, one for each life of each robot.
const LEARNING: u64 = 1 << 63;
/// The first of those that lives draw their numbers from.
const LIFE: u64 = 1 << 62;

/// The first of those that poisoners draw from.
const POISON: u64 = 1 << 61;

/// The generator of one stream of a seed.
pub(super) fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// What a robot sees of the `n`th showing: all fusion rules are shown the same frames.
pub(super) fn frames(n: u32, robot: usize) -> u64 {
    u64::from(n) << 32 | robot as u64
}

/// One of a robot's lives.
pub(super) fn life(seed: u64, robot: usize, boot: u32) -> Life {
    Life { boot, nonce: stream(seed, LIFE | u64::from(boot) << 32 | robot as u64).next_u32() }
}

/// How a robot poisons.
pub(super) fn poison(robot: u32) -> u64 {
    POISON | u64::from(robot)
}

/// How a robot shares and forgets in one of its lives.
pub(super) fn learning(robot: usize, boot: u32) -> u64 {
    LEARNING | u64::from(boot) << 32 | robot as u64
}
