//! Where classes lie, and how far their showings scatter about them.

use std::collections::BTreeMap;

use super::{Score, Shown};
use crate::head::{Discriminant, Room, margin_of};
use crate::scatter::{Covariance, mean_without, whiten};

/// The mean of a showing, and its samples, each with its place among all.
type Showing<'a> = (Vec<f64>, Views<'a>);

/// The showings of each class.
type ByClass<'a> = BTreeMap<usize, Vec<Showing<'a>>>;

/// The samples of a showing, each with its place among all.
type Views<'a> = Vec<(usize, &'a [f32])>;

/// What a discriminant says of samples, each without its showing; `None` where that is all that is known of its class.
pub(crate) type LogsLeftOut = Vec<Option<Vec<f64>>>;

/// What views score, with what each weighs.
pub(super) type Scores = Vec<(Score, f64)>;

/// A class.
#[derive(Debug)]
pub(crate) struct OfClass {
    /// Its number in the vocabulary.
    pub name: usize,
    /// The mean of its showings, whitened.
    pub mean: Vec<f64>,
    /// The mean of each showing, whitened, and what it weighs.
    pub showings: Vec<(Vec<f64>, f64)>,
    /// What all of them weigh.
    pub weight: f64,
}

/// All classes with a sample.
#[derive(Debug)]
pub(crate) struct Scatter {
    pub width: usize,
    pub whitening: Vec<f32>,
    pub classes: Vec<OfClass>,
    pub samples: Vec<Seen>,
}

/// A sample, whitened.
#[derive(Debug)]
pub(crate) struct Seen {
    /// Its place among those it came with.
    pub sample: usize,
    /// Its class and its showing, by their places here.
    pub class: usize,
    pub showing: usize,
    /// Its part of its showing: all of one together are 1.
    pub part: f64,
    /// That part of what its showing weighs.
    pub weight: f64,
    pub white: Vec<f64>,
}

impl Scatter {
    pub fn of(samples: &[Shown<'_>], spread: &[f32]) -> Option<Self> {
        let by_class = by_class(samples, spread.len());
        let width = spread.len();
        if by_class.is_empty() || width == 0 {
            return None;
        }
        let mut covariance = Covariance::new(spread);
        for showings in by_class.values() {
            let center = center(showings.iter().map(|(mean, _)| (mean.as_slice(), 1.0)), width);
            covariance.free(showings.len().saturating_sub(1) as f64);
            for (_, samples) in showings {
                let weight = 1.0 / samples.len() as f64;
                samples.iter().for_each(|(_, vector)| covariance.add(weight, vector, &center));
            }
        }
        Some(Self::whitened(by_class, width, covariance.whitening(), |_| 1.0))
    }

    /// The same in a space of that width, where the covariance is known; and what the showing of each sample weighs, by the place of the sample.
    pub fn by(
        samples: &[Shown<'_>],
        width: usize,
        whitening: Vec<f32>,
        weigh: impl Fn(usize) -> f64,
    ) -> Option<Self> {
        let by_class = by_class(samples, width);
        (!by_class.is_empty() && width > 0).then(|| Self::whitened(by_class, width, whitening, weigh))
    }

    fn whitened(
        by_class: ByClass<'_>,
        width: usize,
        whitening: Vec<f32>,
        weigh: impl Fn(usize) -> f64,
    ) -> Self {
        let mut whitened = Vec::new();
        let classes = by_class.into_iter().enumerate().map(|(class, (name, of_class))| {
            let mut showings = Vec::with_capacity(of_class.len());
            for (showing, (_, samples)) in of_class.into_iter().enumerate() {
                let of_showing = samples.first().map_or(0.0, |(sample, _)| weigh(*sample));
                let part = 1.0 / samples.len() as f64;
                let weight = of_showing * part;
                let white: Vec<(usize, Vec<f64>)> =
                    samples.iter().map(|(sample, vector)| (*sample, whiten(&whitening, vector))).collect();
                showings.push((
                    center(white.iter().map(|(_, white)| (white.as_slice(), 1.0)), width),
                    of_showing,
                ));
                let of_sample = |(sample, white)| Seen { sample, class, showing, part, weight, white };
                whitened.extend(white.into_iter().map(of_sample));
            }
            let weight = showings.iter().map(|(_, weight)| weight).sum();
            let mean = center(showings.iter().map(|(mean, weight)| (mean.as_slice(), *weight)), width);
            OfClass { name, mean, showings, weight }
        });
        let classes = classes.collect();
        Self { width, whitening, classes, samples: whitened }
    }

    /// What views score that lie between gestures: half-way from each sample to a showing of another class. What is no gesture at all, a thing or a hand
    /// on its way, lies there more often than where another gesture would.
    pub fn between(&self, plain: &Discriminant) -> Scores {
        let showings: Vec<(usize, &Vec<f64>)> = self
            .classes
            .iter()
            .enumerate()
            .flat_map(|(class, of)| of.showings.iter().map(move |(showing, _)| (class, showing)))
            .collect();
        let firsts: Vec<usize> = self
            .classes
            .iter()
            .scan(0, |next, class| Some(std::mem::replace(next, *next + class.showings.len())))
            .collect();
        let (mut white, mut room) = (Vec::with_capacity(self.width), Room::default());
        let score = |seen: &Seen| {
            // Showings lie here by class: some fifths of the way round is seldom the same one.
            let (place, count) = (firsts[seen.class] + seen.showing, showings.len());
            let mut others = (1..=4).map(|step| showings[(place + count * step / 5) % count]);
            let (_, other) = others.find(|(class, _)| *class != seen.class)?;
            white.clear();
            white.extend(seen.white.iter().zip(other).map(|(a, b)| f64::midpoint(*a, *b)));
            let to = |of: &OfClass| a_coordinate(squared(&of.mean, &white), self.width, of.weight);
            let score = Score::of(self.classes.iter().map(to))?;
            Some((Score { margin: margin_of(plain.logs_of(&white, &mut room)), ..score }, seen.weight))
        };
        self.samples.iter().filter_map(score).collect()
    }

    /// The means of the classes, one after the other, and how many showings each rests on.
    pub fn means(&self) -> Vec<f32> {
        self.classes.iter().flat_map(|class| class.mean.iter().map(|x| *x as f32)).collect()
    }

    pub fn showings(&self) -> Vec<u32> {
        self.classes.iter().map(|class| class.weight.round().max(1.0) as u32).collect()
    }

    /// The discriminant of the classes, of so many.
    pub fn discriminant(&self, classes: usize) -> Discriminant {
        let met: Vec<usize> = self.classes.iter().map(|class| class.name).collect();
        Discriminant::of(&self.whitening, &self.means(), &self.showings(), &met, classes)
    }

    /// What a discriminant says of each sample that is not all of its class, without its showing: by its place here.
    pub fn logs_left_out(&self, plain: &Discriminant) -> LogsLeftOut {
        let without = |class: &OfClass| -> Vec<_> {
            let showings = class.showings.iter();
            showings.map(|(mean, weight)| plain.class_without(class.name, mean, *weight)).collect()
        };
        let left: Vec<_> = self.classes.iter().map(without).collect();
        let mut room = Room::default();
        let logs = |seen: &Seen| {
            let class = left[seen.class][seen.showing].as_ref()?;
            Some(plain.logs_with(&seen.white, (self.classes[seen.class].name, class), &mut room))
        };
        self.samples.iter().map(logs).collect()
    }

    /// What views of known gestures score, each without its showing, and views of unknown ones, each without its class; with what each weighs.
    pub fn left_out(&self, plain: Option<(&Discriminant, &LogsLeftOut)>) -> (Scores, Scores) {
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        let (mut distances, mut room) = (Vec::<(usize, f64)>::new(), Room::default());
        for (place, Seen { class, showing, weight, white, .. }) in self.samples.iter().enumerate() {
            let to = |(k, of_class): (usize, &OfClass)| {
                let all = of_class.weight;
                if k != *class {
                    return Some((k, a_coordinate(squared(&of_class.mean, white), self.width, all)));
                }
                // Without its own showing.
                let (own, weight) = &of_class.showings[*showing];
                (all > *weight).then(|| {
                    let mean = mean_without((&of_class.mean, all), (own, *weight));
                    let squared = mean.zip(white).map(|(a, b)| (a - b) * (a - b)).sum();
                    (k, a_coordinate(squared, self.width, all - weight))
                })
            };
            distances.clear();
            distances.extend(self.classes.iter().enumerate().filter_map(to));
            let others = distances.iter().filter(|(k, _)| k != class).map(|(_, distance)| *distance);
            let without = plain.and_then(|(_, left_out)| left_out[place].as_ref());
            let margin = plain.and_then(|(plain, _)| {
                // Of the other classes it says the same either way.
                let logs = without.map_or_else(|| plain.logs_of(white, &mut room), Vec::as_slice);
                let name = self.classes[*class].name;
                margin_of(logs.iter().enumerate().filter(|(k, _)| *k != name).map(|(_, log)| log))
            });
            unknown.extend(Score::of(others).map(|score| (Score { margin, ..score }, *weight)));
            if distances.len() == self.classes.len() {
                let margin = without.and_then(margin_of);
                let score = Score::of(distances.iter().map(|(_, d)| *d));
                known.extend(score.map(|score| (Score { margin, ..score }, *weight)));
            }
        }
        (known, unknown)
    }
}

/// A squared distance to the mean of so many showings, a coordinate, in units of what is expected of a view of that class.
pub(super) fn a_coordinate(squared: f64, width: usize, showings: f64) -> f64 {
    squared / (width as f64 * (1.0 + 1.0 / showings))
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn by_class<'a>(samples: &[Shown<'a>], width: usize) -> ByClass<'a> {
    let mut showings: BTreeMap<(usize, u64), Views<'_>> = BTreeMap::new();
    for (place, sample) in samples.iter().enumerate().filter(|(_, sample)| sample.vector.len() == width) {
        showings.entry((sample.class, sample.showing)).or_default().push((place, sample.vector));
    }
    let mut by_class = ByClass::new();
    for ((class, _), samples) in showings {
        by_class.entry(class).or_default().push((mean(&samples, width), samples));
    }
    by_class
}

fn mean(samples: &[(usize, &[f32])], width: usize) -> Vec<f64> {
    let mut sum = vec![0.0; width];
    for (_, vector) in samples {
        sum.iter_mut().zip(*vector).for_each(|(sum, x)| *sum += f64::from(*x));
    }
    sum.iter_mut().for_each(|sum| *sum /= samples.len() as f64);
    sum
}

/// The mean of points that weigh so much.
fn center<'a>(points: impl Iterator<Item = (&'a [f64], f64)>, width: usize) -> Vec<f64> {
    let mut sum = vec![0.0; width];
    let mut all = 0.0;
    for (point, weight) in points {
        sum.iter_mut().zip(point).for_each(|(sum, x)| *sum += weight * x);
        all += weight;
    }
    sum.iter_mut().for_each(|sum| *sum /= f64::max(all, f64::MIN_POSITIVE));
    sum
}
