//! Brings features of different units to one scale.

use serde::{Deserialize, Serialize};

/// How features are brought to one scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ScalingMethod {
    /// Each component to mean 0 and variance 1 (z-score). For features of different units.
    PerComponent,
    /// Each component to mean 0, all divided by the same number so that the mean variance is 1. For features
    /// of one unit, such as the bins of a histogram, whose differences in spread mean something.
    Common,
}

/// A fitted scaling: `(x − mean) · factor`, component by component.
///
/// A component that never varied in training has factor 0: it says nothing about the class, and its first
/// change, in the field, must not swamp the rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scaling {
    pub(crate) mean: Vec<f32>,
    pub(crate) factor: Vec<f32>,
}

/// Scaled values are cut off here, in standard deviations: a measurement that far out is broken, and must not
/// outweigh all the others.
const LIMIT: f64 = 10.0;

impl Scaling {
    /// Fits mean and spread of these rows, all of the same length and finite; at least one row.
    pub(crate) fn fit<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, method: ScalingMethod) -> Self {
        let width = rows.clone().next().map_or(0, <[f32]>::len);
        let count = rows.clone().count() as f64;
        let mut mean = vec![0.0_f64; width];
        for row in rows.clone() {
            for (sum, &x) in mean.iter_mut().zip(row) {
                *sum += f64::from(x);
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= count);
        let mut variance = vec![0.0_f64; width];
        for row in rows {
            for ((sum, &x), &m) in variance.iter_mut().zip(row).zip(&mean) {
                *sum += (f64::from(x) - m).powi(2);
            }
        }
        variance.iter_mut().for_each(|sum| *sum /= count);

        let common = variance.iter().sum::<f64>() / width as f64;
        let factor = variance.iter().zip(&mean).map(|(&v, &m)| {
            // Below this, the spread is the rounding of a constant in f32.
            let varies = v.sqrt() > 1e-6 * m.abs().max(1e-20);
            let spread = match method {
                ScalingMethod::PerComponent => v,
                ScalingMethod::Common => common,
            };
            let factor = (1.0 / spread.sqrt()) as f32;
            if varies && factor.is_finite() { factor } else { 0.0 }
        });
        Self { factor: factor.collect(), mean: mean.iter().map(|&m| m as f32).collect() }
    }

    /// Components it takes and gives.
    #[must_use]
    pub fn width(&self) -> usize {
        self.mean.len()
    }

    /// Writes the scaled `features`, of [`Self::width`] components, over `scaled`; each within ±10.
    pub fn apply(&self, features: &[f32], scaled: &mut Vec<f32>) {
        scaled.clear();
        let components = features.iter().zip(&self.mean).zip(&self.factor);
        scaled.extend(components.map(|((&x, &mean), &factor)| {
            // In f64, where the difference of two finite f32 is finite.
            ((f64::from(x) - f64::from(mean)) * f64::from(factor)).clamp(-LIMIT, LIMIT) as f32
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scaled(rows: &[Vec<f32>], method: ScalingMethod) -> Vec<Vec<f32>> {
        let scaling = Scaling::fit(rows.iter().map(Vec::as_slice), method);
        rows.iter()
            .map(|row| {
                let mut out = Vec::new();
                scaling.apply(row, &mut out);
                out
            })
            .collect()
    }

    #[test]
    fn each_component_gets_mean_0_and_variance_1() {
        let rows = vec![vec![1.0, 100.0], vec![2.0, 300.0], vec![3.0, 500.0]];
        let z = 1.5_f32.sqrt();
        for (row, expected) in scaled(&rows, ScalingMethod::PerComponent).iter().zip([-z, 0.0, z]) {
            assert!(row.iter().all(|x| (x - expected).abs() < 1e-6), "{row:?}");
        }
    }

    #[test]
    fn a_common_scale_keeps_the_ratio_of_spreads() {
        let rows = vec![vec![-1.0, -2.0], vec![1.0, 2.0]];
        let out = scaled(&rows, ScalingMethod::Common);
        assert!((out[1][1] / out[1][0] - 2.0).abs() < 1e-6);
        assert!((out[1][0].powi(2) + out[1][1].powi(2) - 2.0).abs() < 1e-6, "mean variance 1");
    }

    #[test]
    fn an_absurd_measurement_is_cut_off() {
        let rows = [vec![-1.0_f32], vec![1.0]];
        let scaling = Scaling::fit(rows.iter().map(Vec::as_slice), ScalingMethod::PerComponent);
        let mut out = Vec::new();
        scaling.apply(&[f32::MAX], &mut out);
        assert_eq!(out, [10.0]);
    }

    #[test]
    fn a_component_that_never_varied_is_ignored() {
        let rows = [vec![0.1, 1.0], vec![0.1, 2.0], vec![0.1, 3.0]];
        for method in [ScalingMethod::PerComponent, ScalingMethod::Common] {
            let scaling = Scaling::fit(rows.iter().map(Vec::as_slice), method);
            let mut out = Vec::new();
            scaling.apply(&[1e6, 2.0], &mut out);
            assert_eq!(out[0], 0.0, "{method:?}");
        }
    }
}
