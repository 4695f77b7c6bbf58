//! The samples of a learner by class, and the kernel between every two of them.

use std::collections::BTreeMap;

use crate::vector::squared_distance;

/// Names a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Key {
    /// One that was inserted, by the caller's number.
    Inserted(u64),
    /// One of the support vectors of the classifier that was built on.
    Support(u32),
}

/// A sample, and its kernel with all samples.
#[derive(Debug)]
pub(super) struct KernelRow {
    pub key: Key,
    pub vector: Vec<f32>,
    /// For each class, the kernel with its samples, in their order: what a pair of classes needs of the matrix lies
    /// side by side.
    pub kernel: Vec<Vec<f32>>,
}

/// Where a sample stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub class: usize,
    /// In the order of its class, which changes: the last sample takes the place of one that goes.
    pub position: usize,
}

/// The samples by class. The kernel matrix costs n² · 4 bytes for n samples, and up to an eighth more to grow into.
///
/// The kernel of what comes is worked out when it is [asked for](Self::fill): of many samples at once, row by row.
#[derive(Debug)]
pub(super) struct KernelMatrix {
    gamma: f32,
    classes: Vec<Vec<KernelRow>>,
    /// So many samples of each class have their kernel; those behind them came since.
    filled: Vec<usize>,
    places: BTreeMap<Key, Place>,
    /// As many samples there will be at least, by class.
    room: Vec<usize>,
}

impl KernelMatrix {
    pub fn new(classes: usize, gamma: f32) -> Self {
        let (places, filled, room) = (BTreeMap::new(), vec![0; classes], vec![0; classes]);
        Self { gamma, classes: (0..classes).map(|_| Vec::new()).collect(), filled, places, room }
    }

    /// So many samples of each class are about to come: from now on rows are made as long as they will be.
    pub fn make_room(&mut self, more: &[usize]) {
        for ((room, samples), more) in self.room.iter_mut().zip(&self.classes).zip(more) {
            *room = samples.len() + more;
        }
    }

    /// Makes room for one more class.
    pub fn add_class(&mut self) {
        self.classes.iter_mut().flatten().for_each(|sample| sample.kernel.push(Vec::new()));
        self.classes.push(Vec::new());
        self.filled.push(0);
        self.room.push(0);
    }

    /// The samples of a class, in its order.
    pub fn of(&self, class: usize) -> &[KernelRow] {
        &self.classes[class]
    }

    pub fn at(&self, place: Place) -> &KernelRow {
        &self.classes[place.class][place.position]
    }

    pub fn place(&self, key: Key) -> Option<Place> {
        self.places.get(&key).copied()
    }

    /// All samples by key.
    pub fn places(&self) -> &BTreeMap<Key, Place> {
        &self.places
    }

    /// Puts a sample at the end of its class, without its kernel yet.
    pub fn insert(&mut self, key: Key, class: usize, vector: &[f32]) -> Place {
        let kernel = vec![Vec::new(); self.classes.len()];
        self.append(class, KernelRow { key, vector: vector.to_vec(), kernel })
    }

    /// Works out the kernel of all samples that came since with all others.
    pub fn fill(&mut self) {
        let counts: Vec<usize> = self.classes.iter().map(Vec::len).collect();
        if self.filled == counts {
            return;
        }
        for class in 0..counts.len() {
            for position in 0..counts[class] {
                for other in 0..counts.len() {
                    self.fill_row(Place { class, position }, other);
                }
            }
        }
        self.filled = counts;
    }

    /// Works out what a sample lacks of its kernel with those of a class. The rows before its own have theirs.
    fn fill_row(&mut self, Place { class, position }: Place, other: usize) {
        let count = self.classes[other].len();
        let from = if position < self.filled[class] { self.filled[other] } else { 0 };
        if from == count {
            return;
        }
        let mut row = std::mem::take(&mut self.classes[class][position].kernel[other]);
        let room = if count <= self.room[other] { self.room[other] } else { roomy(count) };
        if row.capacity() < count {
            row.reserve_exact(room - row.len());
        }
        let (sample, others) = (&self.classes[class][position], &self.classes[other]);
        // It is the same both ways: of a row that comes before it is there.
        let known = if other < class { count } else { position.min(count) * usize::from(other == class) };
        let known = known.max(from);
        row.extend(others[from..known].iter().map(|other| other.kernel[class][position]));
        let value = |other: &KernelRow| (-self.gamma * squared_distance(&other.vector, &sample.vector)).exp();
        row.extend(others[known..].iter().map(value));
        self.classes[class][position].kernel[other] = row;
    }

    /// Takes a sample out.
    pub fn remove(&mut self, place: Place) {
        self.fill();
        let Place { class, position } = place;
        let gone = self.classes[class].swap_remove(position);
        self.filled[class] -= 1;
        for sample in self.classes.iter_mut().flatten() {
            sample.kernel[class].swap_remove(position);
        }
        self.places.remove(&gone.key);
        self.moved(place);
    }

    /// Moves a sample to the end of another class.
    pub fn relabel(&mut self, place: Place, class: usize) -> Place {
        self.fill();
        for sample in self.classes.iter_mut().flatten() {
            let value = sample.kernel[place.class].swap_remove(place.position);
            push(&mut sample.kernel[class], value);
        }
        let sample = self.classes[place.class].swap_remove(place.position);
        self.filled[place.class] -= 1;
        self.filled[class] += 1;
        self.moved(place);
        self.append(class, sample)
    }

    fn append(&mut self, class: usize, sample: KernelRow) -> Place {
        let place = Place { class, position: self.classes[class].len() };
        self.places.insert(sample.key, place);
        self.classes[class].push(sample);
        place
    }

    /// Notes that the last sample of a class has taken the place of one that has gone.
    fn moved(&mut self, place: Place) {
        if let Some(sample) = self.classes[place.class].get(place.position) {
            self.places.insert(sample.key, place);
        }
    }
}

/// Pushes into a vector that grows by an eighth, not by the half: there are as many as samples.
fn push(row: &mut Vec<f32>, value: f32) {
    if row.len() == row.capacity() {
        row.reserve_exact(roomy(row.len()) - row.len());
    }
    row.push(value);
}

fn roomy(length: usize) -> usize {
    length + length / 8 + 4
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::tests::{generator, vector};
    use super::*;

    #[test]
    fn the_matrix_stays_true_and_small_whatever_comes_and_goes() {
        let mut rng = generator(1);
        let mut samples = KernelMatrix::new(3, 0.3);
        let mut peak = 0;
        for step in 0..600 {
            let keys: Vec<Key> = samples.places().keys().copied().collect();
            let any = keys.get(rng.random_range(0..keys.len().max(1) as u64) as usize);
            let class = rng.random_range(0..3_u64) as usize;
            match (rng.random_range(0..5_u64), any.and_then(|key| samples.place(*key))) {
                (0 | 1, Some(place)) => samples.remove(place),
                (2, Some(place)) if place.class != class => drop(samples.relabel(place, class)),
                _ => drop(samples.insert(Key::Inserted(step), class, &vector(class, &mut rng))),
            }
            peak = peak.max(samples.places().len());
        }
        samples.fill();
        assert!(peak > 30);
        let mut held = 0;
        for (key, place) in samples.places() {
            let sample = samples.at(*place);
            assert_eq!(sample.key, *key);
            for class in 0..3 {
                let row = &sample.kernel[class];
                held += row.capacity();
                let expected: Vec<f32> = samples
                    .of(class)
                    .iter()
                    .map(|other| (-0.3 * squared_distance(&sample.vector, &other.vector)).exp())
                    .collect();
                assert_eq!(*row, expected);
            }
        }
        assert!(held <= samples.places().len() * (peak + peak / 8 + 3 * 4), "{held} for {peak}");
    }
}
