//! What a swarm made of the gestures of a seed.

/// Shares are of the gestures shown, `0.0..=1.0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// It decided for the gesture shown.
    pub right: f64,
    /// It decided for another.
    pub wrong: f64,
    /// It did not decide.
    pub undecided: f64,
    /// Single frames with a hand in which the robot that saw it found the gesture shown likeliest, of such frames.
    pub frames_right: f64,
    /// Seconds from the showing until the first robot held a class, over the decided ones; none where none was decided.
    pub decided_s: Option<f64>,
}
