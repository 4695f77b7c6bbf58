//! Learning on the spot: support vector machines that are brought up to date, not trained again.

mod few;
mod folds;
mod groups;
mod growing;
mod kernel;
mod options;
mod pair;
mod samples;
mod shared;
mod simd;
mod solution;
mod start;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};

use few::FewShowings;
use folds::folds;
pub use options::{LearnError, LearnerOptions};
use pair::Pair;
use samples::{KernelMatrix, Key, Place};
pub use shared::SharedKernel;

use crate::calibration::Calibration;
use crate::classifier::Classifier;
use crate::feature_space::FeatureSpace;
use crate::head::{Blend, Losses, Teach, YOUNG};
use crate::machine::{MAX_COORDINATE, Machine, pairs};

/// Learns from samples that come and go, in one feature space.
///
/// A soft-margin machine for each pair of classes, as the offline trainer makes them. It keeps the kernel of
/// every two samples (up to n² · 4 bytes for n samples: what its machines asked for) and the last solution of each pair, from which a change sets out.
///
/// Beside the machines stands a [`Head`](crate::Head) for few showings: it answers alone for pairs with a class that was shown once, and for the
/// others together with the machine, in the part that loses least over showings that neither has met.
///
/// Cross-validation holds out whole showings: samples of one repeat each other. Who does not say of which showing a sample is has each taken for a showing
/// of its own, and probabilities too sure where frames repeat each other.
#[derive(Debug)]
pub struct Learner {
    space: Arc<FeatureSpace>,
    vocabulary: Vocabulary,
    options: LearnerOptions,
    gamma: f32,
    samples: KernelMatrix,
    few: FewShowings,
    supports: u32,
    /// All pairs of the vocabulary.
    pairs: Vec<Pair>,
    /// Classes whose samples changed since the classifier was made.
    touched: Vec<bool>,
    /// The fold of each sample, by class.
    folds: Vec<Vec<usize>>,
    classifier: Option<Arc<Classifier>>,
    /// One for each group of authors, which learn in its place; none where one learns from all.
    members: Vec<Self>,
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
            few: FewShowings::new(&space),
            supports: 0,
            pairs: pairs(classes).map(|(i, j)| Pair::new([i, j])).collect(),
            touched: vec![false; classes],
            folds: vec![Vec::new(); classes],
            classifier: None,
            members: Self::members(&space, &vocabulary, &options)?,
            space,
            vocabulary,
            options,
        })
    }

    /// The same with a head of one's own for few showings, in place of the discriminant. It is not part of what [`Classifier::encode`] writes: who reads
    /// that has the machines alone, until they learn again.
    #[must_use]
    pub fn with_head(mut self, own: Arc<dyn Teach>) -> Self {
        self.members = self.members.into_iter().map(|member| member.with_head(own.clone())).collect();
        self.few.own = Some(own);
        self.touched.fill(true);
        self
    }

    /// The space it learns in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// Starts from what a classifier knows: its support vectors, with their classes, are kept as samples of their
    /// own, which nothing removes but another call. They keep their weight in the machines. The head for few showings, and what is unknown, go by what is
    /// shown here as soon as each of their gestures was, and take them for a few showings more; a [head of one's own](Self::with_head) is taught all of them.
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
        for member in &mut self.members {
            member.build_on(classifier)?;
        }
        if !self.members.is_empty() {
            return Ok(());
        }
        for index in 0..std::mem::take(&mut self.supports) {
            if let Some(place) = self.samples.place(Key::Support(index)) {
                self.take(place);
            }
        }
        for (class, vector) in classifier.vectors() {
            self.put(Key::Support(self.supports), class.index(), vector.into());
            self.supports += 1;
        }
        let vectors: Vec<(usize, &[f32])> =
            classifier.vectors().map(|(class, vector)| (class.index(), vector)).collect();
        self.few.begin(&vectors);
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
        self.insert_held(key, class, vector.into(), showing)
    }

    /// The same of a vector that others hold as well.
    ///
    /// # Errors
    /// As of [`Self::insert`].
    pub fn insert_held(
        &mut self,
        key: u64,
        class: ClassId,
        vector: Arc<[f32]>,
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
        if !self.members.is_empty() {
            return self.insert_by_members(None, key, class, &vector, showing);
        }
        let class = self.place_for(class)?;
        let shown_before = self.few.showing(Key::Inserted(key));
        self.few.note(key, showing);
        let key = Key::Inserted(key);
        if let Some(place) = self.samples.place(key) {
            if place.class == class && self.samples.at(place).vector == vector && shown_before == showing {
                return Ok(());
            }
            self.take(place);
        }
        self.put(key, class, vector);
        Ok(())
    }

    /// Samples of these gestures are about to be inserted, one of each: the room for their kernel is made at once.
    pub fn make_room(&mut self, classes: impl IntoIterator<Item = ClassId>) {
        if !self.members.is_empty() {
            return;
        }
        let mut more = vec![0; self.vocabulary.classes()];
        for place in classes.into_iter().filter_map(|class| self.vocabulary.place(class)) {
            more[place] += 1;
        }
        self.samples.make_room(&more);
    }

    /// Takes out a sample; whether it was there.
    pub fn remove(&mut self, key: u64) -> bool {
        if !self.members.is_empty() {
            return self.remove_by_members(key);
        }
        let place = self.samples.place(Key::Inserted(key));
        if let Some(place) = place {
            self.take(place);
        }
        self.few.forget(key);
        place.is_some()
    }

    /// Gives a sample another class; whether it was there.
    ///
    /// # Errors
    /// As of [`Self::insert`].
    pub fn relabel(&mut self, key: u64, class: ClassId) -> Result<bool, LearnError> {
        if !self.members.is_empty() {
            return self.relabel_by_members(key, class);
        }
        let class = self.place_for(class)?;
        let Some(place) = self.samples.place(Key::Inserted(key)) else { return Ok(false) };
        if place.class != class {
            self.leave(place);
            let place = self.samples.relabel(place, class);
            self.few.sums.relabel(Key::Inserted(key), class);
            self.join(place);
        }
        Ok(true)
    }

    /// How many samples were inserted and not removed; the support vectors built on do not count.
    #[must_use]
    pub fn len(&self) -> usize {
        if !self.members.is_empty() {
            return self.keys_of_members().len();
        }
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
        if !self.members.is_empty() {
            return self.learn_by_members();
        }
        if let (Some(classifier), false) = (&self.classifier, self.touched.contains(&true)) {
            return Ok(classifier.clone());
        }
        let (cost, count) = (self.options.cost, self.options.folds);
        for class in 0..self.touched.len() {
            if self.touched[class] {
                let few = &self.few;
                self.folds[class] = folds(self.samples.of(class), count, |key| few.showing(key));
            }
        }
        for pair in &mut self.pairs {
            if pair.classes.iter().any(|class| self.touched[*class]) {
                pair.solve(&self.samples, cost);
            }
        }
        let present = self.present();
        self.few.sums.settle();
        if self.few.weighs_anew() {
            self.pairs.iter_mut().for_each(|pair| pair.grow_stale(&self.samples));
        }
        let scatter = self.few.scatter(&self.samples);
        let found = scatter.as_ref().map(|scatter| self.few.familiarity(scatter, self.touched.len()));
        let (familiarity, said) = found.unzip();
        // A head of the classes of these places.
        let head = |few: &FewShowings, places: &[usize]| {
            let familiarity = familiarity.as_ref()?;
            Some(few.head(&self.samples, familiarity, &present, (places, &self.space)))
        };
        let (stale, all) = (self.stale(), self.classes().collect::<Vec<_>>());
        if let (Some(scatter), Some(said), false) = (&scatter, said, stale.is_empty()) {
            let left_out = self.few.left_out(&self.samples, (scatter, said), &self.folds, &self.space);
            for index in stale {
                self.pairs[index].calibrate(&self.samples, cost, (&self.folds, count), &left_out);
            }
        }
        self.touched.fill(false);
        let sigmoids = self.trained().map(|pair| pair.sigmoid).collect();
        let calibration = Calibration { sigmoids, sharpness: 1.0 };
        // A gesture that was named and is no longer shown is none that this robot tells apart; those of the list always are.
        let mut vocabulary = self.vocabulary.clone();
        vocabulary.keep_named(|place| present.contains(&place));
        let listed = vocabulary.labels().len();
        let kept: Vec<usize> =
            all.into_iter().filter(|place| *place < listed || present.contains(place)).collect();
        let learned = kept.iter().map(|class| self.samples.of(*class).len() as u32).collect();
        let machine = self.machine(&present);
        let shares = self.shares(present.len());
        let blend = head(&self.few, &kept).map(|few| Blend { few, shares });
        let space = self.space.clone();
        let classifier = Classifier::new(vocabulary, space, learned, machine, calibration, familiarity);
        Ok(self.classifier.insert(Arc::new(classifier.blended(blend))).clone())
    }

    /// The part of each pair's machine in its odds: none where a class is young, else the mean of what is best for either class.
    fn shares(&self, met: usize) -> Vec<f64> {
        let of_class = |class: usize| {
            let sides = self.trained().flat_map(|pair| pair.classes.iter().zip(&pair.losses));
            let sides = sides.filter(|(of, _)| **of == class).map(|(_, losses)| losses);
            let young = self.few.known(class) < YOUNG;
            (!young).then(|| Losses::share(sides, met.saturating_sub(1)))
        };
        let of_classes: Vec<Option<f64>> = self.classes().map(of_class).collect();
        let share = |pair: &Pair| {
            let [first, second] = pair.classes.map(|class| of_classes[class]);
            first.zip(second).map_or(0.0, |(first, second)| f64::midpoint(first, second))
        };
        self.trained().map(share).collect()
    }

    /// The pairs that are to be calibrated, the stalest first: an eighth of those that are stale at a time, so that no call has to do all; and those that
    /// are twice as stale.
    fn stale(&self) -> Vec<usize> {
        let limit = self.options.staleness;
        let trained = self.pairs.iter().enumerate().filter(|(_, pair)| !pair.is_empty(&self.samples));
        let staleness = trained.map(|(index, pair)| (pair.staleness(&self.samples), index));
        let mut stale: Vec<(f64, usize)> = staleness.filter(|(staleness, _)| *staleness > limit).collect();
        stale.sort_by(|a, b| b.0.total_cmp(&a.0));
        let some = stale.len().div_ceil(8);
        let ranked = stale.iter().enumerate();
        let now = ranked.filter(|(rank, (staleness, _))| *rank < some || *staleness > 2.0 * limit);
        now.map(|(_, (_, index))| *index).collect()
    }

    /// Lets go of the kernel, most of what it takes, until it learns again: of many learners in one process few learn at a time.
    pub fn slim_down(&mut self) {
        self.members.iter_mut().for_each(Self::slim_down);
        self.samples.let_rows_go();
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
            vectors.extend(kept.flat_map(|(sample, _)| sample.vector.iter()));
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

    fn put(&mut self, key: Key, class: usize, vector: Arc<[f32]>) {
        if matches!(key, Key::Inserted(_)) {
            self.few.sums.insert(key, class, self.few.showing(key), &vector);
        }
        let place = self.samples.insert(key, class, vector);
        self.join(place);
    }

    fn take(&mut self, place: Place) {
        self.leave(place);
        self.few.sums.remove(self.samples.at(place).key);
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
