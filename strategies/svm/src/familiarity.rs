//! How much what is seen looks like any gesture that was ever taught.
//!
//! One-vs-one machines cannot say: their probabilities always sum to 1 over the gestures they know. Classes of one shared covariance can (SLDA: T. L.
//! Hayes, C. Kanan, "Lifelong machine learning with deep streaming linear discriminant analysis", CVPR workshops 2020): the distance to the nearest
//! class tells another hand from a known one, the lead over the second nearest a blurred thing from a clear one.

mod calibrating;
mod scatter;
#[cfg(test)]
mod tests;

use std::f64::consts::LN_2;

use serde::{Deserialize, Serialize};

use calibrating::{Calibrated, TERMS, log_ratio};
pub(crate) use scatter::{LogsLeftOut, Scatter, Seen};

use crate::head::{Discriminant, Shown};
use crate::scatter::{entries, whiten};

/// The logarithm of how much less often another gesture is shown than is found: what is left out is farther from the rest than what will be shown. One of the digits 0–5
/// of five sets of real hands not being taught, to robots that knew ten pictures of each other digit of that set, or forty of each of the other sets, it was found 1.7 and
/// 1.5 times as often as it was shown; with this 1.4 and 1.2 times.
const LEFT_OUT: f64 = -LN_2;

/// How classes lie in a feature space, and what distances say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Familiarity {
    width: usize,
    /// The inverse of the Cholesky factor of the shared covariance, row by row; its diagonal alone in a wide space.
    whitening: Vec<f32>,
    /// The mean of each class met, whitened, by class.
    means: Vec<f32>,
    /// How many showings each of them rests on.
    showings: Vec<u32>,
    /// Of the logarithm of P(x | unknown) / P(x | known): offset, of the distance, of the lead.
    weights: [f64; 3],
    /// How far it may go either way: nobody has seen more of what is known, and of what is not, than so many showings tell.
    bounds: [f64; 2],
    /// What follows from a discriminant. It is written beside it.
    #[serde(skip)]
    pub by_margin: ByMargin,
}

/// What the margin between the two likeliest classes says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ByMargin {
    /// Its weight in the logarithm of P(x | unknown) / P(x | known); 0 without a discriminant.
    pub weight: f64,
    /// All weights in that of P(x | another gesture) / P(x | known): what lies between gestures is none. `None` where they are the same, or not known.
    pub of_gesture: Option<[f64; TERMS]>,
}

/// The logarithms of what a view is as, by as much as it is likelier to be so than to be of a gesture that was taught.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Unfamiliar {
    /// P(x | unknown) / P(x | known): another gesture, or something between gestures.
    pub any: f64,
    /// P(x | another gesture) / P(x | known).
    pub gesture: f64,
}

/// What a view says of being known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Score {
    /// The logarithm of the squared Mahalanobis distance to the nearest class, a coordinate.
    pub distance: f64,
    /// By how much the second nearest is farther, `0.0..=1.0`; `None` where there is none.
    pub lead: Option<f64>,
    /// By how much a plain discriminant finds the likeliest class likelier than the second, in logarithms; `None` where it was not asked.
    pub margin: Option<f64>,
}

impl Score {
    /// Of squared distances to classes, a coordinate.
    fn of(distances: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut first, mut second) = (f64::INFINITY, f64::INFINITY);
        for distance in distances {
            if distance < first {
                (first, second) = (distance, first);
            } else if distance < second {
                second = distance;
            }
        }
        let lead = second.is_finite().then(|| (second - first) / (second + first).max(f64::MIN_POSITIVE));
        first.is_finite().then(|| Self { distance: first.max(1e-6).ln(), lead, margin: None })
    }
}

impl ByMargin {
    /// Whether its numbers lie where sums of them stay finite.
    pub fn check(&self) -> bool {
        let of_gesture = self.of_gesture.iter().flatten();
        of_gesture.chain([&self.weight]).all(|weight| weight.abs() <= 1e6)
    }
}

impl Familiarity {
    /// Learns how the classes lie, in a space whose coordinates spread so far; and calibrates what distances say by leaving out, of what is
    /// known, one showing, and of what is not, a whole class. `None` where there is no sample.
    pub fn learn(samples: &[Shown<'_>], spread: &[f32]) -> Option<Self> {
        Some(Self::of(&Scatter::of(samples, spread)?, None))
    }

    /// The same of classes that were found to lie so, and of what a plain discriminant makes of them.
    pub fn of(scatter: &Scatter, plain: Option<(&Discriminant, &LogsLeftOut)>) -> Self {
        let (known, unknown) = scatter.left_out(plain);
        let between = plain.map(|(plain, _)| scatter.between(plain));
        let Calibrated { any: [offset, distance, lead, margin], gesture, bounds } =
            Calibrated::by(&known, &unknown, between.as_ref());
        Self {
            width: scatter.width,
            whitening: scatter.whitening.clone(),
            means: scatter.means(),
            showings: scatter.showings(),
            weights: [offset, distance, lead],
            bounds,
            by_margin: ByMargin { weight: margin, of_gesture: between.map(|_| gesture) },
        }
    }

    /// The discriminant of the same classes, which are these of so many.
    pub fn discriminant(&self, met: &[usize], classes: usize) -> Discriminant {
        Discriminant::of(&self.whitening, &self.means, &self.showings, met, classes)
    }

    /// How unfamiliar a view is, as far as that is known; given the margin that a plain discriminant finds.
    pub fn judge(&self, vector: &[f32], margin: Option<f64>) -> Unfamiliar {
        let white = whiten(&self.whitening, vector);
        let class = |(mean, showings): (&[f32], &u32)| {
            let squared: f64 = mean.iter().zip(&white).map(|(m, x)| (f64::from(*m) - x).powi(2)).sum();
            scatter::a_coordinate(squared, self.width, f64::from(*showings))
        };
        let distances = self.means.chunks_exact(self.width).zip(&self.showings).map(class);
        let Some(score) = Score::of(distances) else { return Unfamiliar::default() };
        let by = |weights: &[f64; TERMS]| log_ratio(weights, Score { margin, ..score });
        let within = |log: f64| log.clamp(-self.bounds[0], self.bounds[1]);
        let [offset, distance, lead] = self.weights;
        let any = [offset, distance, lead, self.by_margin.weight];
        let gesture = self.by_margin.of_gesture.as_ref().unwrap_or(&any);
        Unfamiliar { any: within(by(&any)), gesture: within(by(gesture) + LEFT_OUT) }
    }

    /// Whether it fits so many classes in a space of that width, and its numbers lie where sums of them stay finite.
    pub fn check(&self, classes: usize, width: usize) -> bool {
        let within = |values: &[f32]| values.iter().all(|v| v.abs() <= 1e9);
        self.width == width
            && width > 0
            && self.whitening.len() == entries(width)
            && self.showings.len() == classes
            && self.showings.iter().all(|showings| *showings > 0)
            && self.means.len() == classes.saturating_mul(width)
            && within(&self.whitening)
            && within(&self.means)
            && self.weights.iter().all(|w| w.abs() <= 1e6)
            && self.by_margin.check()
            && self.bounds.iter().all(|bound| (0.0..=100.0).contains(bound))
    }
}
