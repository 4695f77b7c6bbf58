//! How to train offline.

use crate::reduction::Components;
use crate::scaling::ScalingMethod;

/// How to train.
///
/// | name | default | meaning | range |
/// |---|---|---|---|
/// | `scaling` | per component | how features are brought to one scale | |
/// | `components` | 60 | principal components kept | ≥ 1, or a part of the variance in 0–1 |
/// | `costs` | 1, 4, 16 | values of C that are tried | > 0 |
/// | `gammas` | ⅛, ¼, ½, 1 | values of γ that are tried, in units of 1 / (variance of the reduced samples) | > 0 |
/// | `folds` | 5 | parts of the cross-validation | 2–20 |
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// How features are brought to one scale.
    pub scaling: ScalingMethod,
    /// How many principal components to keep.
    pub components: Components,
    /// The values of C that are tried: what a sample on the wrong side of the margin costs.
    pub costs: Vec<f64>,
    /// The values of γ that are tried, in units of 1 / (total variance of the reduced samples).
    pub gammas: Vec<f64>,
    /// Parts of the cross-validation.
    pub folds: usize,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            scaling: ScalingMethod::PerComponent,
            components: Components::Count(60),
            costs: vec![1.0, 4.0, 16.0],
            gammas: vec![0.125, 0.25, 0.5, 1.0],
            folds: 5,
        }
    }
}
