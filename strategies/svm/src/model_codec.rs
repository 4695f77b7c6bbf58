//! A classifier as bytes.

use std::sync::Arc;

use gestalt_rounds::Vocabulary;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::calibration::Calibration;
use crate::classifier::Classifier;
use crate::familiarity::{ByMargin, Familiarity};
use crate::feature_space::FeatureSpace;
use crate::head::{Blend, Few};
use crate::machine::{MAX_COORDINATE, Machine, pairs};

/// Longest encoding that is read, in bytes.
pub const MAX_MODEL: usize = 64 * 1024 * 1024;
/// The layout below; another layout gets another number.
const VERSION: u8 = 6;
/// The layout before, which did not tell other gestures from what lies between gestures: it is read too.
const BETWEEN: u8 = 5;
/// The one before that, without a head for few showings: it is read too, and written where there is none.
const WITHOUT_HEAD: u8 = 4;
/// The one before that, which had no familiarity either.
const BEFORE: u8 = 3;

/// Bytes that are no classifier.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModelError {
    /// More than [`MAX_MODEL`] bytes.
    #[error("{0} bytes are more than a classifier takes ({MAX_MODEL})")]
    TooLarge(usize),
    /// Written by another version of the program.
    #[error("the classifier has layout {0}, this program reads layouts {BEFORE} to {VERSION}: train it anew")]
    Version(u8),
    /// Cut short, or not a classifier at all.
    #[error("the classifier is cut short or damaged")]
    Malformed,
    /// Well-formed, but its parts do not fit each other or hold impossible numbers.
    #[error("the classifier is damaged: {0}")]
    Inconsistent(&'static str),
}

#[derive(Serialize, Deserialize)]
struct Parts {
    vocabulary: Vocabulary,
    space: FeatureSpace,
    learned: Vec<u32>,
    machine: Machine,
    calibration: Calibration,
}

/// What follows them since layout 4.
type Since = Option<Familiarity>;

/// What follows since layout 5. The discriminant itself follows from the familiarity.
#[derive(Serialize, Deserialize)]
struct FewParts {
    sharpness: f64,
    shares: Vec<f64>,
    by_margin: ByMargin,
}

/// The same in layout 5: sharpness, shares, and the weight of the margin.
type FewPartsBetween = (f64, Vec<f64>, f64);

impl From<FewPartsBetween> for FewParts {
    fn from((sharpness, shares, weight): FewPartsBetween) -> Self {
        Self { sharpness, shares, by_margin: ByMargin { weight, of_gesture: None } }
    }
}

impl Classifier {
    /// The classifier as bytes: a layout number, then its parts in postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let parts = Parts {
            vocabulary: self.vocabulary.clone(),
            space: FeatureSpace::clone(&self.space),
            learned: self.learned.clone(),
            machine: self.machine.clone(),
            calibration: self.calibration.clone(),
        };
        let since: &Since = &self.familiarity;
        let encoded = match &self.blend {
            Some(Blend { few: Few::Discriminant(discriminant), shares }) => {
                let familiarity = self.familiarity.as_ref();
                let by_margin = familiarity.map_or(ByMargin::default(), |familiarity| familiarity.by_margin);
                let few = FewParts { sharpness: discriminant.sharpness(), shares: shares.clone(), by_margin };
                postcard::to_extend(&(parts, since, few), vec![VERSION])
            }
            Some(Blend { few: Few::Own(_), .. }) | None => {
                postcard::to_extend(&(parts, since), vec![WITHOUT_HEAD])
            }
        };
        encoded.expect("postcard writes every value of known length into a vector")
    }

    /// Reads a classifier. Any bytes give a classifier whose answers are finite, or an error; memory stays
    /// within a small multiple of the bytes.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, ModelError> {
        if bytes.len() > MAX_MODEL {
            return Err(ModelError::TooLarge(bytes.len()));
        }
        let (&version, body) = bytes.split_first().ok_or(ModelError::Malformed)?;
        let ((parts, familiarity, few), rest) = match version {
            VERSION => postcard::take_from_bytes::<(Parts, Since, FewParts)>(body)
                .map(|((parts, since, few), rest)| ((parts, since, Some(few)), rest)),
            BETWEEN => postcard::take_from_bytes::<(Parts, Since, FewPartsBetween)>(body)
                .map(|((parts, since, few), rest)| ((parts, since, Some(few.into())), rest)),
            WITHOUT_HEAD => postcard::take_from_bytes::<(Parts, Since)>(body)
                .map(|((parts, since), rest)| ((parts, since, None), rest)),
            BEFORE => {
                postcard::take_from_bytes::<Parts>(body).map(|(parts, rest)| ((parts, None, None), rest))
            }
            other => return Err(ModelError::Version(other)),
        }
        .map_err(|_| ModelError::Malformed)?;
        if !rest.is_empty() {
            return Err(ModelError::Inconsistent("bytes after its end"));
        }
        parts.check().map_err(ModelError::Inconsistent)?;
        let (classes, width) = (parts.machine.counts.len(), parts.machine.width);
        if !familiarity.as_ref().is_none_or(|familiarity| familiarity.check(classes, width)) {
            return Err(ModelError::Inconsistent("a familiarity with other classes"));
        }
        let Parts { vocabulary, space, learned, machine, calibration } = parts;
        let classifier = Self::new(vocabulary, Arc::new(space), learned, machine, calibration, familiarity);
        if let Some(few) = few {
            return classifier.with_few(few).map_err(ModelError::Inconsistent);
        }
        Ok(if version == BEFORE { classifier.by_its_vectors() } else { classifier })
    }
}

impl Classifier {
    fn with_few(mut self, few: FewParts) -> Result<Self, &'static str> {
        let FewParts { sharpness, shares, by_margin } = few;
        let familiarity = self.familiarity.as_mut().ok_or("a head for few showings of no class")?;
        familiarity.by_margin = by_margin;
        let familiarity = self.familiarity.as_ref().ok_or("a head for few showings of no class")?;
        if shares.len() != self.calibration.sigmoids.len()
            || !shares.iter().all(|share| (0.0..=1.0).contains(share))
            || !(0.01..=100.0).contains(&sharpness)
            || !by_margin.check()
        {
            return Err("a head for few showings of other pairs");
        }
        let met: Vec<usize> = self.met().collect();
        let discriminant = familiarity.discriminant(&met, self.learned.len()).sharpened(sharpness);
        Ok(self.blended(Some(Blend { few: Few::Discriminant(discriminant), shares })))
    }
}

impl Parts {
    /// Whether all dimensions agree, and all numbers lie where sums of them stay finite.
    fn check(&self) -> Result<(), &'static str> {
        if self.learned.len() != self.vocabulary.classes() {
            return Err("samples of another vocabulary");
        }
        let classes = self.learned.iter().filter(|count| **count > 0).count();
        let pairs = pairs(classes).count();
        let machine = &self.machine;
        let all_within = |values: &[f32], limit: f32| values.iter().all(|v| v.abs() <= limit);

        self.space.check()?;
        if machine.width != self.space.components() || machine.counts.len() != classes {
            return Err("machines for another space or vocabulary");
        }
        let vectors = machine.counts.iter().try_fold(0_usize, |sum, &count| sum.checked_add(count));
        let vectors = vectors.filter(|&n| n <= MAX_MODEL).ok_or("too many support vectors")?;
        if machine.vectors.len() != vectors * machine.width
            || machine.weights.len() != vectors * classes.saturating_sub(1)
            || machine.offsets.len() != pairs
            || self.calibration.sigmoids.len() != pairs
        {
            return Err("support vectors, weights and pairs that do not match");
        }
        if machine.gamma.is_nan()
            || machine.gamma <= 0.0
            || machine.gamma.is_infinite()
            || !all_within(&machine.vectors, MAX_COORDINATE)
            || !all_within(&machine.weights, 1e9)
            || !machine.offsets.iter().all(|v| v.abs() <= 1e12)
            || !(0.01..=100.0).contains(&self.calibration.sharpness)
            || !self.calibration.sigmoids.iter().all(|s| s.a.abs() <= 1e12 && s.b.abs() <= 1e12)
        {
            return Err("numbers out of range in the machines");
        }
        Ok(())
    }
}
