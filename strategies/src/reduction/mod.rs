//! Fewer components that carry almost all of the variance.

mod pca;
mod subspace;

pub use pca::{Components, Pca};
