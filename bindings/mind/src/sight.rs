//! What the numbers that a host observes mean: the features of a hand, or the probabilities of a classifier of its own.

use gestalt_strategies::{Classify, ClassifyError, Input, Judgement, Observation, Vocabulary};

use crate::error::MindError;

/// How far the sum of a host's probabilities may be from 1: single precision, and then some.
const TOLERANCE: f64 = 1e-3;

/// What observed numbers mean.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Sight {
    Nothing,
    /// Of so many gestures.
    Probabilities(usize),
    /// So many.
    Features(usize),
}

impl Sight {
    /// What the mind is told of them.
    pub(crate) fn input(self, values: &[f64], quality: f32) -> Result<Input, MindError> {
        match self {
            Self::Nothing => Err(MindError::Sightless),
            Self::Probabilities(classes) => {
                let probabilities = probabilities(values, classes)?;
                Ok(Input::Judged(Judgement { probabilities, unknown: None, view: None }, quality))
            }
            Self::Features(expected) if values.len() != expected => {
                Err(ClassifyError::Length { found: values.len(), expected }.into())
            }
            Self::Features(_) => {
                let features: Vec<f32> = values.iter().map(|x| *x as f32).collect();
                match features.iter().position(|x| !x.is_finite()) {
                    Some(place) => Err(ClassifyError::NotFinite(place).into()),
                    None => Ok(Input::Observed(Observation { features, quality })),
                }
            }
        }
    }
}

/// Names the gestures; it is never asked to judge.
#[derive(Debug)]
pub(crate) struct Verbatim(pub Vocabulary);

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Err(ClassifyError::Length { found: features.len(), expected: 0 })
    }
}

/// These as a probability for each of so many classes. What sums to 1 but for rounding in double precision is taken as it is,
/// bit for bit; what was rounded more coarsely is divided by its sum.
fn probabilities(values: &[f64], classes: usize) -> Result<Vec<f64>, MindError> {
    let wrong = |cause| Err(MindError::Probabilities(cause));
    if values.len() != classes {
        return wrong(format!("{} values, the vocabulary has {classes} gestures", values.len()));
    }
    // NaN is in no range.
    if let Some(place) = values.iter().position(|p| !(0.0..=1.0).contains(p)) {
        return wrong(format!("value {place} is {}, not from 0 to 1", values[place]));
    }
    let sum: f64 = values.iter().sum();
    let off = (sum - 1.0).abs();
    if off > TOLERANCE {
        return wrong(format!("they sum to {sum}, not to 1"));
    }
    let rounding = classes as f64 * f64::EPSILON;
    Ok(if off <= rounding { values.to_vec() } else { values.iter().map(|p| p / sum).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_sums_to_one_in_double_precision_is_taken_bit_for_bit_and_singles_are_divided() {
        let thirds = [1.0 / 3.0, 1.0 / 3.0, 1.0 - 2.0 / 3.0];
        assert_eq!(probabilities(&thirds, 3).unwrap(), thirds);
        let singles = [f64::from(0.1_f32), f64::from(0.9_f32)];
        let sum: f64 = singles.iter().sum();
        assert_ne!(sum, 1.0);
        assert_eq!(probabilities(&singles, 2).unwrap(), singles.map(|p| p / sum));
    }
}
