//! The classifier of a robot: scaling, principal components, one-vs-one support vector machines and a head for few showings, calibrated
//! probabilities.
//!
//! ```text
//! raw features ─► FeatureSpace ─► Machine: a decision per pair ─┐
//!                       └───────► Head: odds of the same pairs ─┴► Blend ─► Calibration: P(k)
//! ```

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, ClassifyError, Judgement, Observation, Vocabulary};

use crate::calibration::Calibration;
use crate::familiarity::{Familiarity, Unfamiliar};
use crate::feature_space::FeatureSpace;
use crate::head::{Blend, Head, Shown};
use crate::machine::Machine;
use crate::no_hand::odds_of_no_hand;
use crate::panel::{Certified, Votes};

/// The squared distance at which two views are at a distance of 1, in units of the space's variance. Measured on drawn hands
/// (3,000 frames, sixteen robots, 72 showings): whether two views of one showing are misjudged correlates by .93, .82, .68,
/// .42, .19, .13, .04 at squared distances of .0035, .01, .035, .15, .3, .6, 1.2 variances; exp(−d² / .17) fits that.
const REPEATS: f64 = 0.17;

/// How much less likely something is shown that is not on the list than a gesture that is, to a robot that was taught all of them.
const RARE: f64 = 0.05;

/// A trained classifier. [`Learner`](crate::Learner) and `train` make one, [`Classifier::decode`] reads one.
///
/// It need not have met all gestures of its vocabulary. One that it has never met is as likely as "unknown": as what is seen would be if it were of
/// no gesture that it has met, by how far it lies from all of those. Before much is known, that says little, and all gestures are nearly as likely.
#[derive(Clone, Debug, PartialEq)]
pub struct Classifier {
    pub(crate) vocabulary: Vocabulary,
    pub(crate) space: Arc<FeatureSpace>,
    /// How many samples of each class it has learned from. Machines and calibration are of those with any.
    pub(crate) learned: Vec<u32>,
    pub(crate) machine: Machine,
    pub(crate) calibration: Calibration,
    /// How much what is seen looks like any gesture met; `None` where none was.
    pub(crate) familiarity: Option<Familiarity>,
    /// A head for few showings beside the machines; `None` where they answer alone.
    pub(crate) blend: Option<Blend>,
    /// The classifiers of groups of authors, which answer in its place; `None` where all samples were learned from together. It is not part of what
    /// [`Self::encode`] writes: who reads that has the first group's, until it learns again.
    panel: Option<Arc<Panel>>,
}

/// The classifiers of groups of authors.
#[derive(Debug, PartialEq)]
struct Panel {
    /// The gestures that any of them has met, and all of the list.
    vocabulary: Vocabulary,
    /// Which of those any of them has met.
    taught: Vec<bool>,
    members: Vec<Arc<Classifier>>,
}

impl Panel {
    fn of(vocabulary: Vocabulary, members: Vec<Arc<Classifier>>) -> Self {
        let mut taught = vec![false; vocabulary.classes()];
        for class in members.iter().flat_map(|member| member.met_classes()) {
            if let Some(place) = vocabulary.place(class) {
                taught[place] = true;
            }
        }
        Self { vocabulary, taught, members }
    }

    fn asked(&self, coordinates: &[f32], no_hand: f64) -> Votes<'_> {
        let mut votes = Votes::of(&self.vocabulary, &self.taught);
        for member in &self.members {
            let (probabilities, unknown) = member.judge_in_space(coordinates, no_hand);
            // What it has not met it takes for unknown, however it is called.
            let met = member.met_classes().zip(member.met().map(|class| probabilities[class]));
            votes.add(met.reduce(|a, b| if b.1 > a.1 { b } else { a }), unknown);
        }
        votes
    }
}

impl Classifier {
    pub(crate) fn new(
        vocabulary: Vocabulary,
        space: Arc<FeatureSpace>,
        learned: Vec<u32>,
        machine: Machine,
        calibration: Calibration,
        familiarity: Option<Familiarity>,
    ) -> Self {
        Self { vocabulary, space, learned, machine, calibration, familiarity, blend: None, panel: None }
    }

    /// The same with a head for few showings beside the machines.
    pub(crate) fn blended(self, blend: Option<Blend>) -> Self {
        Self { blend, ..self }
    }

    /// One that answers as most of these say, in that vocabulary.
    pub(crate) fn of_panel(vocabulary: Vocabulary, first: &Self, members: Vec<Arc<Self>>) -> Self {
        Self { panel: Some(Arc::new(Panel::of(vocabulary, members))), ..first.clone() }
    }

    /// What most groups of authors say of coordinates in its space, and how certain that is; `None` of one that learned from all samples together, and for
    /// coordinates of another length or that are not finite.
    #[must_use]
    pub fn certified(&self, coordinates: &[f32]) -> Option<Certified> {
        self.panel.as_ref().filter(|_| self.fits(coordinates))?.asked(coordinates, 0.0).certified()
    }

    fn fits(&self, coordinates: &[f32]) -> bool {
        coordinates.len() == self.space.components() && coordinates.iter().all(|x| x.is_finite())
    }

    /// The same, where nothing is left of the samples but the support vectors: each counts as a showing of its own. They lie where classes meet, so
    /// it finds more of what is known far away than there is, and less of it unknown.
    pub(crate) fn by_its_vectors(self) -> Self {
        let vectors: Vec<(ClassId, &[f32])> = self.vectors().collect();
        let shown = vectors.iter().zip(0..).map(|((class, vector), showing)| Shown {
            class: class.index(),
            showing,
            vector,
        });
        let familiarity = Familiarity::learn(&shown.collect::<Vec<_>>(), self.space.spread());
        let whole =
            familiarity.filter(|familiarity| familiarity.check(self.met().count(), self.machine.width));
        Self { familiarity: whole, ..self }
    }

    /// The space it judges in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// How many samples of each class it has learned from.
    #[must_use]
    pub fn learned(&self) -> &[u32] {
        &self.learned
    }

    /// Its support vector machines alone, as a head.
    #[must_use]
    pub fn machines(&self) -> Machines<'_> {
        Machines(self)
    }

    /// Its head for few showings alone: the [`Discriminant`](crate::Discriminant), or a researcher's own. `None` for one that was trained at once, or read
    /// from a file without.
    #[must_use]
    pub fn head(&self) -> Option<&dyn Head> {
        self.blend.as_ref().map(|blend| blend.few.head())
    }

    /// How many support vectors all pairs share.
    #[must_use]
    pub fn support_vectors(&self) -> usize {
        self.machine.counts.iter().sum()
    }

    /// The support vectors, in its space, with their classes.
    pub fn vectors(&self) -> impl Iterator<Item = (ClassId, &[f32])> {
        let classes = self.met().zip(&self.machine.counts);
        let classes = classes.flat_map(|(class, &count)| std::iter::repeat_n(ClassId(class as u32), count));
        classes.zip(self.machine.vectors.chunks_exact(self.machine.width))
    }

    /// The classes it has met.
    pub(crate) fn met(&self) -> impl Iterator<Item = usize> {
        self.learned.iter().enumerate().filter(|(_, count)| **count > 0).map(|(class, _)| class)
    }

    /// The same by name.
    fn met_classes(&self) -> impl Iterator<Item = ClassId> {
        self.vocabulary.all().zip(&self.learned).filter(|(_, count)| **count > 0).map(|(class, _)| class)
    }

    /// The probability of each gesture that it has not met.
    ///
    /// All gestures of the list being as likely beforehand, and r = P(x | one that it has not met) / P(x | one met): r / (met + r · unmet).
    /// What is unknown is another gesture or, by these odds, no hand: one or the other, so their odds add up.
    fn of_unknown(&self, coordinates: &[f32], few: Option<(&Blend, &[f64])>, no_hand: f64) -> f64 {
        let (classes, met) = (self.learned.len(), self.met().count());
        let margin = few.and_then(|(blend, logs)| blend.margin(logs));
        let familiarity = self.familiarity.as_ref();
        let unfamiliar = familiarity.map_or(Unfamiliar::default(), |known| known.judge(coordinates, margin));
        // What is on the list and was not taught is shown as often as what was; who was taught all of it is seldom shown what is not on it. No hand at all is
        // seen as often as before.
        let log = if met < classes { unfamiliar.gesture } else { RARE.ln() + unfamiliar.any };
        let ratio = log.exp() + no_hand;
        ratio / (met as f64 + ratio * (classes - met).max(usize::from(met == 0)) as f64)
    }

    fn logs_of_head(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        Some(self.head()?.logs(coordinates))
    }

    /// Judges coordinates in its space, given the odds of no hand: the probabilities of all gestures of the list, and that of one beside it.
    fn judge_in_space(&self, coordinates: &[f32], no_hand: f64) -> (Vec<f64>, f64) {
        if let Some(panel) = &self.panel {
            return panel.asked(coordinates, no_hand).probabilities();
        }
        let (classes, met) = (self.learned.len(), self.met().count());
        let logs = self.logs_of_head(coordinates);
        let few = self.blend.as_ref().zip(logs.as_deref());
        let unmet = self.of_unknown(coordinates, few, no_hand);
        let mut probabilities = vec![unmet; classes];
        if met > 0 {
            let mut decisions = Vec::with_capacity(self.machine.offsets.len());
            self.machine.decide(coordinates, &mut decisions);
            let rest = 1.0 - unmet * (classes - met) as f64;
            let mut of_pairs: Vec<f64> = self.calibration.of_pairs(&decisions).collect();
            if let Some((blend, logs)) = few {
                of_pairs = blend.odds(logs, &self.met().collect::<Vec<_>>(), &of_pairs);
            }
            for (class, p) in self.met().zip(self.calibration.coupled(of_pairs.into_iter(), met)) {
                probabilities[class] = p * rest;
            }
        }
        (probabilities, unmet)
    }

    fn judge_all(&self, features: &[f32], no_hand: f64) -> Result<Judgement, ClassifyError> {
        let coordinates = self.space.project(features)?;
        let (probabilities, unknown) = self.judge_in_space(&coordinates, no_hand);
        let unknown = self.tells_unknown().then_some(unknown);
        Ok(Judgement { probabilities, unknown, view: self.in_view(&coordinates) })
    }

    fn tells_unknown(&self) -> bool {
        self.panel.as_ref().map_or(self.familiarity.is_some(), |panel| {
            panel.members.iter().any(|member| member.familiarity.is_some())
        })
    }

    /// Coordinates in units in which errors about two views correlate by exp(−d²); `None` in a space in which nothing varies.
    fn in_view(&self, coordinates: &[f32]) -> Option<Vec<f32>> {
        let unit = (REPEATS * self.space.variance()).sqrt() as f32;
        (unit > 0.0).then(|| coordinates.iter().map(|coordinate| coordinate / unit).collect())
    }
}

impl Classify for Classifier {
    fn vocabulary(&self) -> &Vocabulary {
        self.panel.as_ref().map_or(&self.vocabulary, |panel| &panel.vocabulary)
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(self.judge_in_space(&self.space.project(features)?, 0.0).0)
    }

    fn unknown(&self, features: &[f32]) -> Option<f64> {
        if !self.tells_unknown() {
            return None;
        }
        let coordinates = self.space.project(features).ok()?;
        if let Some(panel) = &self.panel {
            return Some(panel.asked(&coordinates, 0.0).probabilities().1);
        }
        let logs = self.logs_of_head(&coordinates);
        Some(self.of_unknown(&coordinates, self.blend.as_ref().zip(logs.as_deref()), 0.0))
    }

    fn view(&self, features: &[f32]) -> Option<Vec<f32>> {
        self.in_view(&self.space.project(features).ok()?)
    }

    fn judge(&self, features: &[f32]) -> Result<Judgement, ClassifyError> {
        self.judge_all(features, 0.0)
    }

    fn judge_seen(&self, seen: &Observation) -> Result<Judgement, ClassifyError> {
        let tells = self.space.is_of_learned_eyes();
        self.judge_all(&seen.features, if tells { odds_of_no_hand(seen.quality) } else { 0.0 })
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        self.fits(coordinates).then(|| self.judge_in_space(coordinates, 0.0).0)
    }
}

/// The support vector machines of a classifier, without the head beside them: [`Classifier::machines`].
#[derive(Clone, Copy, Debug)]
pub struct Machines<'a>(&'a Classifier);

impl Head for Machines<'_> {
    fn logs(&self, coordinates: &[f32]) -> Vec<f64> {
        let mut logs = vec![f64::NEG_INFINITY; self.0.learned.len()];
        let met = self.0.met().count();
        if met == 0 {
            return logs;
        }
        let mut decisions = Vec::with_capacity(self.0.machine.offsets.len());
        self.0.machine.decide(coordinates, &mut decisions);
        for (class, p) in self.0.met().zip(self.0.calibration.probabilities(&decisions, met)) {
            logs[class] = p.ln();
        }
        logs
    }
}
