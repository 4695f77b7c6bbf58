//! The robots of a swarm, and what they see.

use serde::{Deserialize, Serialize};

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
}
