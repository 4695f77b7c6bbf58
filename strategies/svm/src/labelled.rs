//! Samples as the offline trainer learns from them and evaluations judge them.

use gestalt_protocol::ClassId;

/// A labelled feature vector.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledFeatures {
    /// The raw features.
    pub features: Vec<f32>,
    /// The gesture shown.
    pub class: ClassId,
    /// Who showed it, if known: cross-validation keeps a person's samples together.
    pub group: Option<u32>,
    /// The raw features of variations of it, such as its picture mirrored. They are learned wherever it is and nowhere else,
    /// and no score counts them. May be empty.
    pub variations: Vec<Vec<f32>>,
}

impl LabelledFeatures {
    /// One without variations.
    #[must_use]
    pub fn new(features: Vec<f32>, class: ClassId, group: Option<u32>) -> Self {
        Self { features, class, group, variations: Vec::new() }
    }
}
