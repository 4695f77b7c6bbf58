//! The heterogeneity layer: what makes frames of different cameras alike before anything is measured in them.

pub use crate::config::LayerConfig;
