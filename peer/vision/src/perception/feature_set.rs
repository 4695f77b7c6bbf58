//! The feature vectors that perception can compute.

use std::str::FromStr;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::features::FEATURES;
use super::hog;
use crate::config::Glove;
use crate::network::{EMBEDDING, shipped};

/// Which feature vector perception computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FeatureSet {
    /// The 110 hand-crafted features of [`features()`](super::features()).
    Shape,
    /// The histogram of oriented gradients of the canonical crop, 1,764 values.
    Hog,
    /// What learned eyes see in the hand, 24 values: see [`eyes`](crate::eyes).
    Embedding,
}

impl FeatureSet {
    /// All sets.
    pub const ALL: [Self; 3] = [Self::Shape, Self::Hog, Self::Embedding];

    /// What drawn hands wear for these eyes to see them: learned ones know bare hands.
    #[must_use]
    pub fn glove(self) -> Glove {
        match self {
            Self::Embedding => Glove::Skin,
            Self::Shape | Self::Hog => Glove::Cyan,
        }
    }

    /// Names the set and its version: vectors of sets with different names never mix. Embeddings of other weights are
    /// another version.
    #[must_use]
    pub fn name(self) -> &'static str {
        static EMBEDDING_NAME: LazyLock<String> = LazyLock::new(|| embedding_name(shipped::checksum()));
        match self {
            Self::Shape => "shape-2",
            Self::Hog => "hog-2",
            Self::Embedding => &EMBEDDING_NAME,
        }
    }

    /// How many values a feature vector of this set has.
    #[must_use]
    pub fn length(self) -> usize {
        match self {
            Self::Shape => FEATURES,
            Self::Hog => hog::LENGTH,
            Self::Embedding => EMBEDDING,
        }
    }
}

/// What [`FeatureSet::Embedding`] is called with weights of this [`checksum`](crate::network::checksum).
#[must_use]
pub fn embedding_name(weights: u32) -> String {
    format!("embedding-1-{weights:08x}")
}

/// A text that names no feature set.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no feature set: say 'shape', 'hog' or 'embedding'")]
pub struct FeatureSetError(String);

impl FromStr for FeatureSet {
    type Err = FeatureSetError;

    /// Reads `shape`, `hog` or `embedding`, or the full name with its version as [`FeatureSet::name`] gives it.
    fn from_str(text: &str) -> Result<Self, FeatureSetError> {
        let bare = |set: Self| set.name().split('-').next().unwrap_or_default();
        Self::ALL
            .into_iter()
            .find(|&set| text == set.name() || text == bare(set))
            .ok_or_else(|| FeatureSetError(text.to_owned()))
    }
}
