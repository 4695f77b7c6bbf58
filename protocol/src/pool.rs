//! How far a correlated pool believes that robots repeat each other.

use serde::{Deserialize, Serialize};

/// The parameters of a correlated pool, as a certificate names them: with them and the votes anybody finds the same probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pool {
    /// ρ, `0.0..=1.0` in steps of .05: how alike the evidence of two robots is that look at one hand. With 0 each is a witness of its own, with 1 all together are one.
    pub likeness: f64,
    /// T, `0.1..=10.0` in steps of .01: by how much the evidence of a single robot overstates itself.
    pub temperature: f64,
    /// How many rounds that instructors confirmed these two rest on; 0 for what is believed before any.
    pub rounds: u16,
}

impl Pool {
    /// What is believed before anything is known: ρ between what was measured of views of one pose (.93) and of robots around a hand, and each robot
    /// nearly at its word.
    pub const PRIOR: Self = Self { likeness: 0.5, temperature: 1.1, rounds: 0 };

    /// Whether both parameters are within their ranges, and in steps that a text holds exactly: ρ in twentieths, T in hundredths. So nobody can say
    /// another pool that makes the same of the votes.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let in_steps = |value: f64, steps: f64| (value * steps).round() / steps == value;
        let Self { likeness, temperature, .. } = *self;
        (0.0..=1.0).contains(&likeness)
            && (0.1..=10.0).contains(&temperature)
            && in_steps(likeness, 20.0)
            && in_steps(temperature, 100.0)
    }
}
