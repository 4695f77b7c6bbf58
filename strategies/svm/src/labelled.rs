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
}
