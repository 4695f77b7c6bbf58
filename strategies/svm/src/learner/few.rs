//! The head for few showings, as a learner keeps it up to date.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::samples::{KernelMatrix, Key, Place};
use super::start::Start;
use crate::familiarity::{Familiarity, LogsLeftOut, Scatter, Seen};
use crate::feature_space::FeatureSpace;
use crate::head::{Few, Shown, Sums, Teach, sharpness};

/// What the head for few says of a sample, not having met its showing; and which part of that the sample is.
pub(super) type LeftOut = Option<(f64, Vec<f64>)>;

/// The sums that the discriminant rests on, and a researcher's head in its place.
#[derive(Debug)]
pub(super) struct FewShowings {
    pub sums: Sums<Key>,
    /// What it began with.
    start: Start,
    /// How often the least shown of its gestures had been shown here when it was last asked whether that [weighs anew](Self::weighs_anew).
    weighed: usize,
    /// Of which showing each inserted sample is.
    showings: BTreeMap<u64, u64>,
    pub own: Option<Arc<dyn Teach>>,
    sharpness: f64,
}

impl FewShowings {
    pub fn new(space: &FeatureSpace) -> Self {
        let sharpness = sharpness(std::iter::empty());
        let (sums, start) = (Sums::new(space.spread()), Start::default());
        Self { sums, start, weighed: 0, showings: BTreeMap::new(), own: None, sharpness }
    }

    /// Begins with these samples in place of others. Each is left out by itself.
    pub fn begin(&mut self, samples: &[(usize, &[f32])]) {
        self.start = Start::of(samples, self.sums.spread().len());
    }

    /// How many showings it knows of a class, also of those that it began with.
    pub fn known(&self, class: usize) -> usize {
        self.sums.showings(class) + self.start.count(class)
    }

    /// How often the least shown gesture of what it began with was shown here.
    fn shown_here(&self) -> usize {
        self.start.shown(|class| self.sums.showings(class))
    }

    /// Whether what it began with has come to weigh otherwise since this was last asked, so that all pairs are to be calibrated again.
    pub fn weighs_anew(&mut self) -> bool {
        let now = self.shown_here();
        self.start.differs(std::mem::replace(&mut self.weighed, now), now)
    }

    /// Notes of which showing a sample is.
    pub fn note(&mut self, key: u64, showing: u64) {
        self.showings.insert(key, showing);
    }

    pub fn forget(&mut self, key: u64) {
        self.showings.remove(&key);
    }

    pub fn showing(&self, key: Key) -> u64 {
        match key {
            Key::Inserted(key) => self.showings.get(&key).copied().unwrap_or(key),
            Key::Support(index) => !u64::from(index),
        }
    }

    /// All samples, in the order of their keys.
    fn shown<'a>(&self, samples: &'a KernelMatrix) -> Vec<Shown<'a>> {
        let shown = samples.places().iter().map(|(key, place)| Shown {
            class: place.class,
            showing: self.showing(*key),
            vector: &samples.at(*place).vector,
        });
        shown.collect()
    }

    /// How the classes lie; `None` where there is no sample.
    pub fn scatter(&self, samples: &KernelMatrix) -> Option<Scatter> {
        let mut covariance = self.sums.covariance(&self.sums.clouds());
        let shown = self.shown_here();
        self.start.add_to(&mut covariance, shown);
        let keys: Vec<(&Key, &Place)> = samples.places().iter().collect();
        let weigh = |sample: usize| match keys[sample] {
            (Key::Inserted(_), _) => 1.0,
            (Key::Support(_), place) => self.start.weight(place.class, shown),
        };
        Scatter::by(&self.shown(samples), self.sums.spread().len(), covariance.whitening(), weigh)
    }

    /// What is familiar, of so many classes; with the margins of the discriminant, where that is the head, and what that says of each sample without its showing.
    pub fn familiarity(&self, scatter: &Scatter, classes: usize) -> (Familiarity, Option<LogsLeftOut>) {
        let plain = self.own.is_none().then(|| scatter.discriminant(classes));
        let logs = plain.as_ref().map(|plain| scatter.logs_left_out(plain));
        (Familiarity::of(scatter, plain.as_ref().zip(logs.as_ref())), logs)
    }

    /// The head that knows all samples, of the classes at these places, in that order.
    pub fn head(
        &self,
        samples: &KernelMatrix,
        familiarity: &Familiarity,
        present: &[usize],
        (places, space): (&[usize], &FeatureSpace),
    ) -> Few {
        let number = |class: usize| places.iter().position(|place| *place == class);
        match &self.own {
            Some(own) => {
                let shown = self.shown(samples).into_iter();
                let shown: Vec<Shown<'_>> =
                    shown.filter_map(|shown| Some(Shown { class: number(shown.class)?, ..shown })).collect();
                Few::Own(own.teach(&shown, places.len(), space))
            }
            None => {
                let present: Vec<usize> = present.iter().filter_map(|class| number(*class)).collect();
                Few::Discriminant(familiarity.discriminant(&present, places.len()).sharpened(self.sharpness))
            }
        }
    }

    /// What the head says of each sample without its showing, by class and position: a discriminant has said that already. Settles how sharp it is.
    pub fn left_out(
        &mut self,
        samples: &KernelMatrix,
        (scatter, said): (&Scatter, Option<LogsLeftOut>),
        folds: &[Vec<usize>],
        space: &FeatureSpace,
    ) -> Vec<Vec<LeftOut>> {
        let mut by_place: Vec<Vec<LeftOut>> =
            folds.iter().map(|of_class| vec![None; of_class.len()]).collect();
        let places: Vec<_> = samples.places().values().copied().collect();
        match said {
            Some(logs) => {
                let said = scatter.samples.iter().zip(logs);
                let all: Vec<(&Seen, Vec<f64>)> =
                    said.filter_map(|(seen, logs)| Some((seen, logs?))).collect();
                // In an order that does not depend on what came first.
                self.sharpness =
                    sharpness(all.iter().map(|(seen, logs)| {
                        (scatter.classes[seen.class].name, seen.weight, logs.as_slice())
                    }));
                for (seen, mut logs) in all {
                    let place = places[seen.sample];
                    logs.iter_mut().for_each(|log| *log *= self.sharpness);
                    by_place[place.class][place.position] = Some((seen.part, logs));
                }
            }
            None => {
                let Some(own) = &self.own else { return by_place };
                let shown = self.shown(samples);
                let fold = |place: &Place| folds[place.class][place.position];
                let count = folds.iter().flatten().max().map_or(0, |last| last + 1);
                for left in 0..count {
                    let rest = shown.iter().zip(&places).filter(|(_, place)| fold(place) != left);
                    let rest: Vec<Shown<'_>> = rest.map(|(shown, _)| *shown).collect();
                    let met = |class: usize| rest.iter().any(|shown| shown.class == class);
                    let met: Vec<bool> = (0..folds.len()).map(met).collect();
                    let head = own.teach(&rest, folds.len(), space);
                    for (shown, place) in shown.iter().zip(&places).filter(|(_, place)| fold(place) == left) {
                        let logs = met[place.class].then(|| head.logs(shown.vector));
                        by_place[place.class][place.position] = logs.map(|logs| (1.0, logs));
                    }
                }
                // A showing counts once, however many samples it has.
                for seen in &scatter.samples {
                    let place = places[seen.sample];
                    if let Some((weight, _)) = &mut by_place[place.class][place.position] {
                        *weight = seen.part;
                    }
                }
            }
        }
        by_place
    }
}
