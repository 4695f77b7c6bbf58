//! What perception hands to the mind.

/// One frame's worth of perception: what the hand in it looked like.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The raw feature vector, one finite value per feature of the set that perception was told to compute.
    pub features: Vec<f32>,
    /// How far perception trusts its own segmentation, `0.0..=1.0`; scales the weight of the frame. Learned eyes say how likely it is a hand at all, and
    /// a classifier of theirs finds what hardly is one unknown.
    pub quality: f32,
}
