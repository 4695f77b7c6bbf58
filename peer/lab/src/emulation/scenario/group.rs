//! The robots of a swarm, and what they see.

use serde::{Deserialize, Serialize};

use crate::emulation::poison::Poison;

/// Robots of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// A name for people.
    pub name: String,
    /// How many.
    pub count: usize,
    /// What they see; none for robots that only relay, fuse and decide.
    #[serde(default)]
    pub view: Option<View>,
    /// How they lie, if they do. All liars of a swarm are in league, and have no mind: what they see does not matter.
    #[serde(default)]
    pub lies: Option<Lies>,
    /// What they share in place of what they saw, if they poison. They take part in rounds in earnest.
    #[serde(default)]
    pub poison: Option<Poison>,
}

/// What liars do. They know what is shown, hear what all hear, and vote for the other gesture that has most in its favour, with the
/// greatest evidence that the clip allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lies {
    /// They vote alike.
    Together,
    /// They say one thing to every other robot and another to the rest, under one stamp.
    TwoFaced,
    /// They vote alike, decide on whichever votes suit them, stale ones among them, and announce it; they say that they and everybody else hold
    /// it.
    Choosing,
}

/// A statistical view: class scores, the shown class raised by `signal`, each with Gaussian noise of variance 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Frames per second.
    pub fps: f64,
    /// How far the shown class stands out, in standard deviations of the noise.
    pub signal: f64,
    /// The share of the noise's variance that stays the same for a whole showing, `0.0..=1.0`: at 1 every frame
    /// of a showing errs alike.
    #[serde(default)]
    pub persistence: f64,
    /// The share of that lasting noise which is the same for all robots, `0.0..=1.0`: at 1 all robots err alike, for they look at one hand in one
    /// light.
    #[serde(default)]
    pub likeness: f64,
}
