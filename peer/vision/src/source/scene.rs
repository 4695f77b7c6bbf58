//! What there is to see.

/// What the human shows at the moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scene {
    /// How many fingers are raised, 0 to 5, or the number of a gesture where the human shows those of a vocabulary; `None`: no
    /// hand is in view.
    pub gesture: Option<u8>,
    /// Varies the person from round to round: hand, glove, light and background.
    pub seed: u64,
}
