//! The samples a robot holds, found by key, by identifier, by class and by part.

use std::collections::BTreeMap;

use gestalt_protocol::{ClassId, RobotId, SampleId};
use rand::{Rng, RngExt};

use super::grow::insert;
use super::held::{HeldSample, SetPart};
use super::in_order::InOrder;

/// The samples held, as selection and forgetting rules see them. Every list is in the order of the keys, so what a
/// rule picks depends on what is held and not on how it came to be.
#[derive(Debug, Default)]
pub struct HeldSamples {
    held: InOrder,
    /// Those that have a name in the swarm, in the order of the names, and their keys: half of what a map from name to key takes.
    named: Vec<(SampleId, u64)>,
    classes: BTreeMap<ClassId, ClassKeys>,
    /// How many external ones there are, by author. Of most authors there are few, so there are many authors: a tree of them would be twice as large.
    authors: Vec<(RobotId, u32)>,
    /// The same the other way round: who has most is asked for each sample that comes into a full set.
    by_number: Vec<(u32, RobotId)>,
    arrivals: u64,
}

/// The keys of one class, ascending: in all and by part.
#[derive(Debug, Default)]
struct ClassKeys {
    all: Vec<u64>,
    parts: [Vec<u64>; 3],
}

impl HeldSamples {
    /// The sample with that key.
    #[must_use]
    pub fn get(&self, key: u64) -> Option<&HeldSample> {
        self.held.get(key)
    }

    /// The sample with that name.
    #[must_use]
    pub fn find(&self, id: SampleId) -> Option<&HeldSample> {
        self.get(self.named[self.place_of(id).ok()?].1)
    }

    /// Where that name is among the names; where it would be, if it is not.
    fn place_of(&self, id: SampleId) -> Result<usize, usize> {
        self.named.binary_search_by_key(&id, |(named, _)| *named)
    }

    /// All samples, by key.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &HeldSample> {
        self.held.iter()
    }

    /// Shared and external samples, by key: what the swarm knows together.
    pub fn common(&self) -> impl Iterator<Item = &HeldSample> {
        self.iter().filter(|sample| sample.part != SetPart::Personal)
    }

    /// How many samples are held.
    #[must_use]
    pub fn len(&self) -> usize {
        self.held.len()
    }

    /// Whether no sample is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.held.len() == 0
    }

    /// How many samples ever came in, held or not.
    #[must_use]
    pub fn arrivals(&self) -> u64 {
        self.arrivals
    }

    /// The other robots of whom a sample is held, ascending, each with how many.
    pub fn authors(&self) -> impl Iterator<Item = (RobotId, usize)> + '_ {
        self.authors.iter().map(|(author, held)| (*author, *held as usize))
    }

    /// The same in the order of how many, the most first; of equals the greater name first.
    pub(crate) fn authors_of_most(&self) -> impl Iterator<Item = (RobotId, usize)> + '_ {
        self.by_number.iter().rev().map(|(held, author)| (*author, *held as usize))
    }

    /// One more external sample of that author, or one less.
    fn count_author(&mut self, author: RobotId, comes: bool) {
        let place = self.authors.binary_search_by_key(&author, |(author, _)| *author);
        let before = place.map_or(0, |place| self.authors[place].1);
        let held = if comes { before + 1 } else { before.saturating_sub(1) };
        match place {
            Ok(place) if held == 0 => drop(self.authors.remove(place)),
            Ok(place) => self.authors[place].1 = held,
            Err(place) if held > 0 => self.authors.insert(place, (author, held)),
            Err(_) => {}
        }
        if let Ok(place) = self.by_number.binary_search(&(before, author)) {
            self.by_number.remove(place);
        }
        if let (true, Err(place)) = (held > 0, self.by_number.binary_search(&(held, author))) {
            self.by_number.insert(place, (held, author));
        }
    }

    /// How many samples of a class are in a part.
    #[must_use]
    pub fn count(&self, part: SetPart, class: ClassId) -> usize {
        self.part_keys(part, class).len()
    }

    /// How many samples are in a part.
    #[must_use]
    pub fn total(&self, part: SetPart) -> usize {
        self.classes.values().map(|keys| keys.parts[part as usize].len()).sum()
    }

    /// How many samples of a class are held.
    #[must_use]
    pub fn class_count(&self, class: ClassId) -> usize {
        self.class_keys(class).len()
    }

    /// The classes of which a sample is held, ascending.
    pub fn classes(&self) -> impl Iterator<Item = ClassId> + '_ {
        self.classes.keys().copied()
    }

    /// The keys of a class, ascending.
    #[must_use]
    pub fn class_keys(&self, class: ClassId) -> &[u64] {
        self.classes.get(&class).map_or(&[], |keys| &keys.all)
    }

    /// The keys of a class in a part, ascending.
    #[must_use]
    pub fn part_keys(&self, part: SetPart, class: ClassId) -> &[u64] {
        self.classes.get(&class).map_or(&[], |keys| &keys.parts[part as usize])
    }

    /// The samples with these keys, in their order; a key that is not held is passed over.
    pub fn with_keys<'a>(
        &'a self,
        keys: &'a [u64],
    ) -> impl DoubleEndedIterator<Item = &'a HeldSample> + Clone {
        keys.iter().filter_map(|key| self.get(*key))
    }

    /// A class at random among those with personal samples: where selection begins.
    pub fn draw_personal_class(&self, rng: &mut dyn Rng) -> Option<ClassId> {
        let candidates: Vec<ClassId> =
            self.classes().filter(|class| self.count(SetPart::Personal, *class) > 0).collect();
        draw(&candidates, rng)
    }

    /// The class with the most samples, ties at random: where forgetting begins.
    pub fn draw_largest_class(&self, rng: &mut dyn Rng) -> Option<ClassId> {
        let most = self.classes.values().map(|keys| keys.all.len()).max()?;
        let candidates: Vec<ClassId> =
            self.classes().filter(|class| self.class_count(*class) == most).collect();
        draw(&candidates, rng)
    }

    /// Takes a sample in under a key that is not held.
    pub(crate) fn insert(&mut self, sample: HeldSample) {
        self.arrivals = self.arrivals.max(sample.key);
        if let Some(id) = sample.id {
            match self.place_of(id) {
                Ok(place) => self.named[place].1 = sample.key,
                Err(place) => insert(&mut self.named, place, (id, sample.key)),
            }
            if sample.part == SetPart::External {
                self.count_author(id.author, true);
            }
        }
        let keys = self.classes.entry(sample.class).or_default();
        for list in [&mut keys.all, &mut keys.parts[sample.part as usize]] {
            insert(list, list.partition_point(|key| *key < sample.key), sample.key);
        }
        self.held.insert(sample);
    }

    /// Takes a sample out.
    pub(crate) fn remove(&mut self, key: u64) -> Option<HeldSample> {
        if let Some(Ok(place)) = self.get(key)?.id.map(|id| self.place_of(id)) {
            self.named.remove(place);
        }
        let sample = self.held.remove(key)?;
        if let (Some(id), SetPart::External) = (sample.id, sample.part) {
            self.count_author(id.author, false);
        }
        if let Some(keys) = self.classes.get_mut(&sample.class) {
            for list in [&mut keys.all, &mut keys.parts[sample.part as usize]] {
                if let Ok(place) = list.binary_search(&key) {
                    list.remove(place);
                }
            }
            if keys.all.is_empty() {
                self.classes.remove(&sample.class);
            }
        }
        Some(sample)
    }

    /// Makes up for the samples that came and went before a restart.
    pub(crate) fn set_arrivals(&mut self, arrivals: u64) {
        self.arrivals = arrivals;
    }
}

/// One of the items at random, each as likely as the others.
pub fn draw<T: Copy>(items: &[T], rng: &mut dyn Rng) -> Option<T> {
    // As u64, so that machines of all word sizes draw the same.
    if items.is_empty() { None } else { Some(items[rng.random_range(0..items.len() as u64) as usize]) }
}
