//! Learning on the spot: support vector machines that are brought up to date, not trained again.

mod folds;
mod growing;
mod options;
mod pair;
mod samples;
mod simd;
mod solution;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};

use folds::folds;
pub use options::{LearnError, LearnerOptions};
use pair::Pair;
use samples::{KernelMatrix, Key, Place};

use crate::calibration::Calibration;
use crate::classifier::Classifier;
use crate::familiarity::{Familiarity, Shown};
use crate::feature_space::FeatureSpace;
use crate::machine::{MAX_COORDINATE, Machine, pairs};

/// Learns from samples that come and go, in one feature space.
///
/// A soft-margin machine for each pair of classes, as the offline trainer makes them. It keeps the kernel of
/// every two samples (n² · 4 bytes for n samples) and the last solution of each pair, from which a change sets out.
///
/// Cross-validation takes each sample for itself. Samples that repeat each other, such as the frames of one showing,
/// make the probabilities too sure: thin them out before.
#[derive(Debug)]
pub struct Learner {
    space: Arc<FeatureSpace>,
    vocabulary: Vocabulary,
    options: LearnerOptions,
    gamma: f32,
    samples: KernelMatrix,
    /// Of which showing each inserted sample is.
    showings: BTreeMap<u64, u64>,
    supports: u32,
    /// All pairs of the vocabulary.
    pairs: Vec<Pair>,
    /// Classes whose samples changed since the classifier was made.
    touched: Vec<bool>,
    /// The fold of each sample, by class.
    folds: Vec<Vec<usize>>,
    classifier: Option<Arc<Classifier>>,
}

impl Learner {
    /// A learner that knows nothing.
    ///
    /// # Errors
    /// An option out of range, or a space in which nothing varies.
    pub fn new(
        space: Arc<FeatureSpace>,
        vocabulary: Vocabulary,
        options: LearnerOptions,
    ) -> Result<Self, LearnError> {
        options.validate()?;
        let gamma = (options.gamma / space.variance()) as f32;
        if !(gamma > 0.0 && gamma.is_finite()) {
            return Err(LearnError::NoVariance);
        }
        let classes = vocabulary.classes();
        Ok(Self {
            gamma,
            samples: KernelMatrix::new(classes, gamma),
            showings: BTreeMap::new(),
            supports: 0,
            pairs: pairs(classes).map(|(i, j)| Pair::new([i, j])).collect(),
            touched: vec![false; classes],
            folds: vec![Vec::new(); classes],
            classifier: None,
            space,
            vocabulary,
            options,
        })
    }

    /// The space it learns in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// Starts from what a classifier knows: its support vectors, with their classes, are kept as samples of their
    /// own, which nothing removes but another call.
    ///
    /// N. A. Syed, H. Liu, K. K. Sung, "Incremental learning with support vector machines", IJCAI workshop on
    /// support vector machines (1999).
    ///
    /// # Errors
    /// A classifier of another space or vocabulary.
    pub fn build_on(&mut self, classifier: &Classifier) -> Result<(), LearnError> {
        let vocabulary = classifier.vocabulary();
        if vocabulary.labels() != self.vocabulary.labels() || !vocabulary.named().is_empty() {
            return Err(LearnError::Vocabulary);
        }
        if classifier.space().id() != self.space.id() {
            return Err(LearnError::Space);
        }
        for index in 0..std::mem::take(&mut self.supports) {
            if let Some(place) = self.samples.place(Key::Support(index)) {
                self.take(place);
            }
        }
        for (class, vector) in classifier.vectors() {
            self.put(Key::Support(self.supports), class.index(), vector);
            self.supports += 1;
        }
        Ok(())
    }

    /// Takes in a sample: coordinates in the learner's space. `key` is any number that names it; a sample of that
    /// key is replaced. It is of a showing of its own.
    ///
    /// # Errors
    /// A vector of another length, with a coordinate out of range, or a class that is not on the list. A gesture that was named is met by its first
    /// sample, while there is room.
    pub fn insert(&mut self, key: u64, class: ClassId, vector: &[f32]) -> Result<(), LearnError> {
        self.insert_shown(key, class, vector, key)
    }

    /// The same of one that has its showing in common with others, which repeat it: any number that names that.
    ///
    /// # Errors
    /// As of [`Self::insert`].
    pub fn insert_shown(
        &mut self,
        key: u64,
        class: ClassId,
        vector: &[f32],
        showing: u64,
    ) -> Result<(), LearnError> {
        if vector.len() != self.space.components() {
            return Err(LearnError::Length { found: vector.len(), expected: self.space.components() });
        }
        // NaN is in no range.
        let range = -MAX_COORDINATE..=MAX_COORDINATE;
        if let Some(coordinate) = vector.iter().position(|x| !range.contains(x)) {
            return Err(LearnError::Range(coordinate));
        }
        let class = self.place_for(class)?;
        self.showings.insert(key, showing);
        let key = Key::Inserted(key);
        if let Some(place) = self.samples.place(key) {
            if place.class == class && self.samples.at(place).vector == vector {
                return Ok(());
            }
            self.take(place);
        }
        self.put(key, class, vector);
        Ok(())
    }

    /// Takes out a sample; whether it was there.
    pub fn remove(&mut self, key: u64) -> bool {
        let place = self.samples.place(Key::Inserted(key));
        self.showings.remove(&key);
        if let Some(place) = place {
            self.take(place);
        }
        place.is_some()
    }

    /// Gives a sample another class; whether it was there.
    ///
    /// # Errors
    /// As of [`Self::insert`].
    pub fn relabel(&mut self, key: u64, class: ClassId) -> Result<bool, LearnError> {
        let class = self.place_for(class)?;
        let Some(place) = self.samples.place(Key::Inserted(key)) else { return Ok(false) };
        if place.class != class {
            self.leave(place);
            let place = self.samples.relabel(place, class);
            self.join(place);
        }
        Ok(true)
    }

    /// How many samples were inserted and not removed; the support vectors built on do not count.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples.places().len() - self.supports as usize
    }

    /// Whether no sample is there.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Brings the machines up to date and gives a classifier that judges as they do.
    ///
    /// Only pairs of classes with changed samples are trained again, from where they stand.
    ///
    /// # Errors
    /// None: it always has a solution. A solver that can fail would say so here.
    pub fn learn(&mut self) -> Result<Arc<Classifier>, LearnError> {
        if let (Some(classifier), false) = (&self.classifier, self.touched.contains(&true)) {
            return Ok(classifier.clone());
        }
        let (cost, count) = (self.options.cost, self.options.folds);
        for class in 0..self.touched.len() {
            if self.touched[class] {
                self.folds[class] = folds(self.samples.of(class), count);
            }
        }
        for pair in &mut self.pairs {
            if pair.classes.iter().any(|class| self.touched[*class]) {
                pair.solve(&self.samples, cost);
            }
        }
        self.calibrate();
        self.touched.fill(false);
        let present = self.present();
        let sigmoids = self.trained().map(|pair| pair.sigmoid).collect();
        let calibration = Calibration { sigmoids, sharpness: 1.0 };
        // A gesture that was named and is no longer shown is none that this robot tells apart; those of the list always are.
        let mut vocabulary = self.vocabulary.clone();
        vocabulary.keep_named(|place| present.contains(&place));
        let listed = vocabulary.labels().len();
        let kept = self.classes().filter(|place| *place < listed || present.contains(place));
        let learned = kept.map(|class| self.samples.of(class).len() as u32).collect();
        let machine = self.machine(&present);
        let classifier = Classifier::new(
            vocabulary,
            self.space.clone(),
            learned,
            machine,
            calibration,
            self.familiarity(),
        );
        Ok(self.classifier.insert(Arc::new(classifier)).clone())
    }

    /// Calibrates pairs that are stale, the stalest first: an eighth of them at a time, so that no call has to do all;
    /// and those that are twice as stale.
    fn calibrate(&mut self) {
        let LearnerOptions { cost, folds, staleness: limit, .. } = self.options;
        let trained = self.pairs.iter().enumerate().filter(|(_, pair)| !pair.is_empty(&self.samples));
        let staleness = trained.map(|(index, pair)| (pair.staleness(&self.samples), index));
        let mut stale: Vec<(f64, usize)> = staleness.filter(|(staleness, _)| *staleness > limit).collect();
        stale.sort_by(|a, b| b.0.total_cmp(&a.0));
        let some = stale.len().div_ceil(8);
        for (rank, (staleness, index)) in stale.iter().enumerate() {
            if rank < some || *staleness > 2.0 * limit {
                self.pairs[*index].calibrate(&self.samples, cost, &self.folds, folds);
            }
        }
    }

    fn familiarity(&self) -> Option<Familiarity> {
        let shown = self.samples.places().iter().map(|(key, place)| {
            let showing = match key {
                Key::Inserted(key) => self.showings.get(key).copied().unwrap_or(*key),
                Key::Support(index) => !u64::from(*index),
            };
            Shown { class: place.class, showing, vector: &self.samples.at(*place).vector }
        });
        Familiarity::learn(&shown.collect::<Vec<_>>(), self.space.spread())
    }

    /// The machines of all pairs with a sample each.
    fn machine(&self, present: &[usize]) -> Machine {
        let mut used: Vec<Vec<bool>> =
            self.classes().map(|class| vec![false; self.samples.of(class).len()]).collect();
        for pair in self.trained() {
            for (side, class) in pair.classes.into_iter().enumerate() {
                for (used, weight) in used[class].iter_mut().zip(pair.solution.weights(side)) {
                    *used |= *weight as f32 != 0.0;
                }
            }
        }
        let mut weights = Vec::new();
        for pair in self.trained() {
            for (side, class) in pair.classes.into_iter().enumerate() {
                let kept = pair.solution.weights(side).iter().zip(&used[class]).filter(|(_, used)| **used);
                weights.extend(kept.map(|(weight, _)| *weight as f32));
            }
        }
        let mut vectors = Vec::new();
        for &class in present {
            let kept = self.samples.of(class).iter().zip(&used[class]).filter(|(_, used)| **used);
            vectors.extend(kept.flat_map(|(sample, _)| &sample.vector));
        }
        Machine {
            gamma: self.gamma,
            width: self.space.components(),
            vectors,
            counts: present.iter().map(|&class| used[class].iter().filter(|used| **used).count()).collect(),
            weights,
            offsets: self.trained().map(|pair| pair.solution.offset()).collect(),
        }
    }

    fn classes(&self) -> std::ops::Range<usize> {
        0..self.vocabulary.classes()
    }

    /// The classes with samples.
    fn present(&self) -> Vec<usize> {
        self.classes().filter(|class| !self.samples.of(*class).is_empty()).collect()
    }

    /// The pairs of classes with samples, in the order used everywhere.
    fn trained(&self) -> impl Iterator<Item = &Pair> {
        self.pairs.iter().filter(|pair| !pair.is_empty(&self.samples))
    }

    fn put(&mut self, key: Key, class: usize, vector: &[f32]) {
        let place = self.samples.insert(key, class, vector);
        self.join(place);
    }

    fn take(&mut self, place: Place) {
        self.leave(place);
        self.samples.remove(place);
    }

    /// Tells the pairs of the sample that now stands at `place`.
    fn join(&mut self, place: Place) {
        self.touched[place.class] = true;
        self.pairs.iter_mut().for_each(|pair| pair.insert(&self.samples, place));
    }

    /// Tells the pairs that the sample at `place` goes.
    fn leave(&mut self, place: Place) {
        self.touched[place.class] = true;
        self.pairs.iter_mut().for_each(|pair| pair.remove(&self.samples, place));
    }
}
