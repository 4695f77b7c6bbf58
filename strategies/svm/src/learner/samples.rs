//! The samples of a learner by class, and the kernel between every two of them.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use super::kernel::{kernel, push, roomy};
use super::shared::{Row, SharedKernel};

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
    pub vector: Arc<[f32]>,
    /// For each class, the kernel with its samples, in their order: what a pair of classes needs of the matrix lies
    /// side by side. Each is worked out when it is first asked for: of most samples no machine ever asks, and of the others few ask for all classes.
    kernel: Vec<OnceLock<Vec<f32>>>,
}

impl KernelRow {
    pub fn new(key: Key, vector: Arc<[f32]>, classes: usize) -> Self {
        Self { key, vector, kernel: vec![OnceLock::new(); classes] }
    }
}

/// Where a sample stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub class: usize,
    /// In the order of its class, which changes: the last sample takes the place of one that goes.
    pub position: usize,
}

/// The samples by class. The kernel matrix costs n² · 4 bytes for n samples if all of it is asked for, and up to an eighth more to grow into.
#[derive(Debug)]
pub(super) struct KernelMatrix {
    gamma: f32,
    classes: Vec<Vec<KernelRow>>,
    /// The places that those have in the kernel of several learners, side by side: a row is mostly looked up there.
    shared: Vec<Vec<Option<u32>>>,
    places: BTreeMap<Key, Place>,
    /// As many samples there will be at least, by class.
    room: Vec<usize>,
    /// Whether the kernel of any sample with those of a class is there: where it is not, a sample that comes or goes need not look at all others for it.
    is_there: Vec<OnceLock<()>>,
    /// What other learners have worked out already.
    known: Option<Arc<SharedKernel>>,
}

impl KernelMatrix {
    pub fn new(classes: usize, gamma: f32) -> Self {
        let (places, room) = (BTreeMap::new(), vec![0; classes]);
        let (shared, is_there) = (vec![Vec::new(); classes], vec![OnceLock::new(); classes]);
        let classes = (0..classes).map(|_| Vec::new()).collect();
        Self { gamma, classes, shared, places, room, is_there, known: None }
    }

    /// From now on looks there first.
    pub fn share(&mut self, known: Arc<SharedKernel>) {
        let places_of = |samples: &Vec<KernelRow>| {
            let places = samples.iter().map(|sample| known.place(&sample.vector));
            places.collect()
        };
        self.shared = self.classes.iter().map(places_of).collect();
        self.known = Some(known);
    }

    /// So many samples of each class are about to come: from now on rows are made as long as they will be, and those of the new ones when they are asked for.
    pub fn make_room(&mut self, more: &[usize]) {
        for ((room, samples), more) in self.room.iter_mut().zip(&self.classes).zip(more) {
            *room = samples.len() + more;
        }
    }

    /// Makes room for one more class.
    pub fn add_class(&mut self) {
        self.classes.iter_mut().flatten().for_each(|sample| sample.kernel.push(OnceLock::new()));
        self.classes.push(Vec::new());
        self.shared.push(Vec::new());
        self.room.push(0);
        self.is_there.push(OnceLock::new());
    }

    /// The samples of a class, in its order.
    pub fn of(&self, class: usize) -> &[KernelRow] {
        &self.classes[class]
    }

    pub fn at(&self, place: Place) -> &KernelRow {
        &self.classes[place.class][place.position]
    }

    /// The kernel of the sample there with those of a class, in their order.
    pub fn row(&self, place: Place, class: usize) -> &[f32] {
        self.at(place).kernel[class].get_or_init(|| {
            self.is_there[class].get_or_init(|| ());
            self.work_out(place, class)
        })
    }

    /// Lets go of all rows: each is worked out again when it is asked for.
    pub fn let_rows_go(&mut self) {
        self.classes
            .iter_mut()
            .flatten()
            .flat_map(|sample| &mut sample.kernel)
            .for_each(|row| drop(row.take()));
        self.is_there.fill(OnceLock::new());
    }

    /// Of how many samples and classes the kernel is there.
    #[cfg(test)]
    pub fn rows_held(&self) -> usize {
        let rows = self.classes.iter().flatten().flat_map(|sample| &sample.kernel);
        rows.filter(|row| row.get().is_some()).count()
    }

    pub fn place(&self, key: Key) -> Option<Place> {
        self.places.get(&key).copied()
    }

    /// All samples by key.
    pub fn places(&self) -> &BTreeMap<Key, Place> {
        &self.places
    }

    /// Puts a sample at the end of its class.
    pub fn insert(&mut self, key: Key, class: usize, vector: Arc<[f32]>) -> Place {
        let shared = self.known.as_ref().and_then(|known| known.place(&vector));
        let new = KernelRow::new(key, vector, self.classes.len());
        if self.is_there[class].get().is_none() {
            return self.append(class, new, shared);
        }
        // Where all others have the kernel with its class it has its own at once, from the same products. Of many that come together most are never asked for.
        let is_last = count(&self.classes) + 1 >= self.room.iter().sum();
        let known = self.known.as_ref().map(|known| known.row(shared));
        let values = known.as_ref().map_or(&[][..], Row::values);
        for (of, (samples, places)) in self.classes.iter_mut().zip(&self.shared).enumerate() {
            let length = roomy_for(samples.len() + 1, self.room[of]);
            let mut own = is_last.then(|| Vec::with_capacity(length));
            for (sample, place) in samples.iter_mut().zip(places) {
                let Some(row) = sample.kernel[class].get_mut() else {
                    own = None;
                    continue;
                };
                let value = look_up(values, *place);
                let value = value.unwrap_or_else(|| kernel(self.gamma, &sample.vector, &new.vector));
                push(row, value);
                if let Some(own) = &mut own {
                    own.push(value);
                }
            }
            if let Some(mut own) = own {
                if of == class {
                    own.push(1.0);
                }
                self.is_there[of].get_or_init(|| ());
                // It has none yet.
                let _ = new.kernel[of].set(own);
            }
        }
        drop(known);
        self.append(class, new, shared)
    }

    /// Takes a sample out.
    pub fn remove(&mut self, place: Place) {
        let Place { class, position } = place;
        let gone = self.classes[class].swap_remove(position);
        self.shared[class].swap_remove(position);
        if self.is_there[class].get().is_some() {
            for row in self.classes.iter_mut().flatten().filter_map(|sample| sample.kernel[class].get_mut()) {
                row.swap_remove(position);
            }
        }
        self.places.remove(&gone.key);
        self.moved(place);
    }

    /// Moves a sample to the end of another class.
    pub fn relabel(&mut self, place: Place, class: usize) -> Place {
        for sample in self.classes.iter_mut().flatten() {
            let value = sample.kernel[place.class].get_mut().map(|row| row.swap_remove(place.position));
            match (value, sample.kernel[class].get_mut()) {
                (Some(value), Some(row)) => push(row, value),
                // It is worked out again when it is asked for.
                (None, Some(_)) => drop(sample.kernel[class].take()),
                (_, None) => {}
            }
        }
        let sample = self.classes[place.class].swap_remove(place.position);
        let shared = self.shared[place.class].swap_remove(place.position);
        self.moved(place);
        self.append(class, sample, shared)
    }

    fn append(&mut self, class: usize, sample: KernelRow, shared: Option<u32>) -> Place {
        let place = Place { class, position: self.classes[class].len() };
        self.places.insert(sample.key, place);
        self.classes[class].push(sample);
        self.shared[class].push(shared);
        place
    }

    /// Notes that the last sample of a class has taken the place of one that has gone.
    fn moved(&mut self, place: Place) {
        if let Some(sample) = self.classes[place.class].get(place.position) {
            self.places.insert(sample.key, place);
        }
    }

    /// The kernel of a sample with those of a class: what others have of it already is looked up.
    fn work_out(&self, place: Place, class: usize) -> Vec<f32> {
        let (of, its) = (self.at(place), self.shared[place.class][place.position]);
        let known = self.known.as_ref().map(|known| known.row(its));
        let values = known.as_ref().map_or(&[][..], Row::values);
        let theirs = |other: &KernelRow| other.kernel[place.class].get().map(|row| row[place.position]);
        let reckoned = |other: &KernelRow| kernel(self.gamma, &other.vector, &of.vector);
        let (samples, places) = (&self.classes[class], &self.shared[class]);
        let mut row = Vec::with_capacity(roomy_for(samples.len(), self.room[class]));
        row.extend(places.iter().zip(samples).map(|(place, other)| {
            look_up(values, *place).or_else(|| theirs(other)).unwrap_or_else(|| reckoned(other))
        }));
        row
    }
}

fn count(classes: &[Vec<KernelRow>]) -> usize {
    classes.iter().map(Vec::len).sum()
}

/// What stands at that place of a row of the shared kernel.
fn look_up(values: &[f32], place: Option<u32>) -> Option<f32> {
    values.get(place? as usize).copied()
}

fn roomy_for(length: usize, room: usize) -> usize {
    if length <= room { room } else { roomy(length) }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::tests::{generator, vector};
    use super::*;
    use crate::vector::squared_distance;

    #[test]
    fn the_matrix_stays_true_and_small_whatever_comes_and_goes() {
        let mut rng = generator(1);
        let mut samples = KernelMatrix::new(3, 0.3);
        let mut peak = 0;
        for step in 0..600 {
            let keys: Vec<Key> = samples.places().keys().copied().collect();
            let any = keys.get(rng.random_range(0..keys.len().max(1) as u64) as usize);
            let class = rng.random_range(0..3_u64) as usize;
            // Of some the kernel with some classes is there.
            if let Some(place) = any.and_then(|key| samples.place(*key)).filter(|_| step % 3 == 0) {
                samples.row(place, class);
            }
            match (rng.random_range(0..5_u64), any.and_then(|key| samples.place(*key))) {
                (0 | 1, Some(place)) => samples.remove(place),
                (2, Some(place)) if place.class != class => drop(samples.relabel(place, class)),
                _ => drop(samples.insert(Key::Inserted(step), class, vector(class, &mut rng).into())),
            }
            peak = peak.max(samples.places().len());
        }
        assert!(peak > 30);
        let mut held = 0;
        for (key, place) in samples.places() {
            let sample = samples.at(*place);
            assert_eq!(sample.key, *key);
            for class in 0..3 {
                let row = samples.row(*place, class);
                held += sample.kernel[class].get().map_or(0, Vec::capacity);
                let expected: Vec<f32> = samples
                    .of(class)
                    .iter()
                    .map(|other| (-0.3 * squared_distance(&sample.vector, &other.vector)).exp())
                    .collect();
                assert_eq!(row, expected);
            }
        }
        assert!(held <= samples.places().len() * (peak + peak / 8 + 3 * 4), "{held} for {peak}");
    }
}
