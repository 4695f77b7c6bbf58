//! What was shown, as sums that depend on no order.

use std::collections::{BTreeMap, BTreeSet};

use crate::scatter::{Covariance, entries, is_wide};

/// Steps of a coordinate in the greatest standard deviation of the space. Integers add up exactly: whatever came first, and whatever came and went.
const STEPS: f64 = 65_536.0;
/// Coordinates farther out than so many of these deviations count as if they lay there: products of 2²² steps fit into 64 bits 2¹⁹ times.
const FARTHEST: f64 = 64.0;
/// Steps of the mean of a showing in one of a coordinate.
const FINER: i64 = 256;

/// Samples by showing, as classes of one shared covariance need them: how many showings there are of each class, where their mean lies, and one sum of
/// squares for all. A showing counts once, however many samples it has.
///
/// Adding, taking out and merging commute, to the last bit: the sums are of integers, each showing's part in them follows from its samples alone.
/// Coordinates are rounded to 2⁻¹⁶ of the greatest standard deviation of the space. A showing that changed costs a product of d² / 2 for each of its
/// samples, once for all changes between two times that the sums are [settled](Self::settle).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sums<K> {
    spread: Vec<f32>,
    /// Steps in one unit of a coordinate.
    unit: f64,
    /// Where each sample counts.
    places: BTreeMap<K, (usize, u64)>,
    classes: BTreeMap<usize, OfClass<K>>,
    /// The lower triangle of Σ x·xᵀ, row by row, or its diagonal: of each showing the mean.
    squares: Vec<i64>,
    /// The showings that changed, by class: what they were was taken off the sums, what they are was not added yet.
    changed: BTreeSet<(usize, u64)>,
}

/// The samples of a showing, in steps.
type Samples<K> = BTreeMap<K, Vec<i64>>;

/// A class with a sample.
#[derive(Clone, Debug, PartialEq)]
struct OfClass<K> {
    showings: BTreeMap<u64, Samples<K>>,
    /// The sum of the means of its showings, in finer steps.
    sum: Vec<i64>,
}

/// A class as its sums tell it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cloud {
    pub class: usize,
    pub showings: u32,
    pub mean: Vec<f64>,
}

impl<K: Copy + Ord> Sums<K> {
    /// Of nothing, in a space whose coordinates spread so far.
    pub fn new(spread: &[f32]) -> Self {
        let greatest = spread.iter().copied().fold(0.0_f32, f32::max);
        // Where nothing varies any unit will do.
        let unit = if greatest > 0.0 { STEPS / f64::from(greatest) } else { STEPS };
        let squares = vec![0; entries(spread.len())];
        let (spread, changed) = (spread.to_vec(), BTreeSet::new());
        Self { spread, unit, places: BTreeMap::new(), classes: BTreeMap::new(), squares, changed }
    }

    pub fn spread(&self) -> &[f32] {
        &self.spread
    }

    /// Takes in a sample of a showing; one of that key is replaced.
    pub fn insert(&mut self, key: K, class: usize, showing: u64, vector: &[f32]) {
        self.remove(key);
        let farthest = FARTHEST * STEPS;
        let steps = |x: &f32| (f64::from(*x) * self.unit).round().clamp(-farthest, farthest) as i64;
        let mut steps: Vec<i64> = vector.iter().map(steps).collect();
        steps.resize(self.spread.len(), 0);
        self.places.insert(key, (class, showing));
        self.change(class, showing, |samples| drop(samples.insert(key, steps)));
    }

    /// Takes out a sample; whether it was there.
    pub fn remove(&mut self, key: K) -> bool {
        let Some((class, showing)) = self.places.remove(&key) else { return false };
        self.change(class, showing, |samples| drop(samples.remove(&key)));
        true
    }

    /// Gives a sample another class; whether it was there.
    pub fn relabel(&mut self, key: K, class: usize) -> bool {
        let Some((old, showing)) = self.places.get(&key).copied() else { return false };
        let mut taken = None;
        self.change(old, showing, |samples| taken = samples.remove(&key));
        if let Some(steps) = taken {
            self.places.insert(key, (class, showing));
            self.change(class, showing, |samples| drop(samples.insert(key, steps)));
        }
        true
    }

    /// How many showings there are of a class.
    pub fn showings(&self, class: usize) -> usize {
        self.classes.get(&class).map_or(0, |of_class| of_class.showings.len())
    }

    /// Changes the samples of a showing. What it was is taken off the sums with the first change.
    fn change(&mut self, class: usize, showing: u64, change: impl FnOnce(&mut Samples<K>)) {
        let width = self.spread.len();
        let new = || OfClass { showings: BTreeMap::new(), sum: vec![0; width] };
        let of_class = self.classes.entry(class).or_insert_with(new);
        let samples = of_class.showings.entry(showing).or_default();
        if self.changed.insert((class, showing)) {
            add(samples, &mut self.squares, &mut of_class.sum, -1);
        }
        change(samples);
        if samples.is_empty() {
            of_class.showings.remove(&showing);
            self.changed.remove(&(class, showing));
        }
        if of_class.showings.is_empty() {
            self.classes.remove(&class);
        }
    }

    /// Adds what the showings that changed have become: before anybody reads the sums. A showing of which a hundred samples come one after the other is
    /// so added up once, not a hundred times.
    pub fn settle(&mut self) {
        for (class, showing) in std::mem::take(&mut self.changed) {
            let Some(of_class) = self.classes.get_mut(&class) else { continue };
            if let Some(samples) = of_class.showings.get(&showing) {
                add(samples, &mut self.squares, &mut of_class.sum, 1);
            }
        }
    }

    /// Classes with a sample, in their order, once all is settled.
    pub fn clouds(&self) -> Vec<Cloud> {
        debug_assert!(self.changed.is_empty(), "sums are read once they are settled");
        let cloud = |(class, of_class): (&usize, &OfClass<K>)| {
            let showings = of_class.showings.len();
            let finer = self.unit * FINER as f64 * showings as f64;
            let mean = of_class.sum.iter().map(|sum| *sum as f64 / finer).collect();
            Cloud { class: *class, showings: showings as u32, mean }
        };
        self.classes.iter().map(cloud).collect()
    }

    /// How showings scatter about their classes, once all is settled.
    pub fn covariance(&self, clouds: &[Cloud]) -> Covariance {
        debug_assert!(self.changed.is_empty(), "sums are read once they are settled");
        let mut covariance = Covariance::new(&self.spread);
        let squared = self.unit * self.unit;
        covariance.add_squares(self.squares.iter().map(|sum| *sum as f64 / squared));
        for cloud in clouds {
            covariance.add_square(-f64::from(cloud.showings), &cloud.mean);
            covariance.free(f64::from(cloud.showings) - 1.0);
        }
        covariance
    }
}

/// Adds what a showing of these samples is to the sums, or takes it off.
fn add<K>(samples: &Samples<K>, squares: &mut [i64], sum: &mut [i64], sign: i64) {
    if samples.is_empty() {
        return;
    }
    let count = samples.len() as i64;
    let width = sum.len();
    let mut total = vec![0; width];
    let mut of_showing = vec![0; squares.len()];
    for sample in samples.values() {
        total.iter_mut().zip(sample).for_each(|(total, x)| *total += x);
        if is_wide(width) {
            of_showing.iter_mut().zip(sample).for_each(|(sum, x)| *sum += x * x);
            continue;
        }
        let mut rest = of_showing.as_mut_slice();
        for (k, a) in sample.iter().enumerate() {
            let (row, after) = rest.split_at_mut(k + 1);
            row.iter_mut().zip(sample).for_each(|(sum, b)| *sum += a * b);
            rest = after;
        }
    }
    sum.iter_mut().zip(&total).for_each(|(sum, total)| *sum += sign * (total * FINER / count));
    squares.iter_mut().zip(&of_showing).for_each(|(sum, total)| *sum += sign * (total / count));
}
