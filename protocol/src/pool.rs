//! How far a correlated pool believes that robots repeat each other.

use serde::{Deserialize, Serialize};

/// The parameters of a correlated pool, as a certificate names them: with them and the votes anybody finds the same probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pool {
    /// ρ, `0.0..=1.0`: how alike the evidence of two robots is that look at one hand. With 0 each is a witness of its own, with 1 all together are one.
    pub likeness: f64,
    /// T, `0.1..=10.0`: by how much the evidence of a single robot overstates itself.
    pub temperature: f64,
    /// How many rounds that instructors confirmed these two rest on; 0 for what is believed before any.
    pub rounds: u16,
}

impl Pool {
    /// What is believed before anything is known. Between what was measured of views of one pose (likeness .93) and of robots around a hand.
    pub const PRIOR: Self = Self { likeness: 0.5, temperature: 1.25, rounds: 0 };

    /// Whether both parameters are within their ranges.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        (0.0..=1.0).contains(&self.likeness) && (0.1..=10.0).contains(&self.temperature)
    }
}
