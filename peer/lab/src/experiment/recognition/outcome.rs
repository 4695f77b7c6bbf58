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
    /// First frames, one of each robot and gesture, in which the robot found the gesture shown likeliest, of those with a hand; none where no robot
    /// found any.
    pub frames_right: Option<f64>,
    /// Seconds from the showing until the first robot held a class, over the decided ones; none where none was decided.
    pub decided_s: Option<f64>,
}
