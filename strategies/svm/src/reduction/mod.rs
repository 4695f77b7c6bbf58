//! Fewer components that carry almost all that the features say.

mod pca;
mod ranking;
mod subspace;

use serde::{Deserialize, Serialize};

pub use pca::{Components, Pca};
pub use ranking::Ranking;
pub(crate) use ranking::best;

/// How many scaled features become few components.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reduction {
    /// Coordinates along principal components.
    Pca(Pca),
    /// Some of the features themselves, by rank.
    Selected {
        /// Features it takes.
        width: usize,
        /// Which of them it keeps, each at most once.
        kept: Vec<u32>,
    },
}

impl Reduction {
    /// Components of the vectors it takes.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::Pca(pca) => pca.width(),
            Self::Selected { width, .. } => *width,
        }
    }

    /// Components of the vectors it gives.
    #[must_use]
    pub fn kept(&self) -> usize {
        match self {
            Self::Pca(pca) => pca.kept(),
            Self::Selected { kept, .. } => kept.len(),
        }
    }

    /// Writes what a scaled vector becomes over `coordinates`.
    pub(crate) fn project(&self, scaled: &[f32], coordinates: &mut Vec<f32>) {
        match self {
            Self::Pca(pca) => pca.project(scaled, coordinates),
            Self::Selected { kept, .. } => {
                coordinates.clear();
                coordinates.extend(kept.iter().map(|index| scaled[*index as usize]));
            }
        }
    }

    /// What tells it from another, in a fixed order.
    pub(crate) fn bytes(&self) -> impl Iterator<Item = u8> + '_ {
        let (basis, kept) = match self {
            Self::Pca(pca) => (pca.basis.as_slice(), [].as_slice()),
            Self::Selected { kept, .. } => ([].as_slice(), kept.as_slice()),
        };
        let basis = basis.iter().flat_map(|value| value.to_le_bytes());
        basis.chain(kept.iter().flat_map(|index| index.to_le_bytes()))
    }

    /// Whether it can be applied to any vector of its width.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        match self {
            Self::Pca(pca) => pca.check(),
            Self::Selected { width, kept } => {
                let within = kept.iter().all(|index| (*index as usize) < *width);
                if kept.is_empty() || kept.len() > *width || !within {
                    return Err("selected features that do not exist");
                }
                Ok(())
            }
        }
    }
}
