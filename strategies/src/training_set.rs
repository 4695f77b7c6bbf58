//! The samples a robot learns from: personal, shared, external, and never more than it can train on.
//!
//! ```text
//!            keep              share                       receive
//! own sample ────► personal ─────────► shared        ─────────────► external
//!                     └──────────────────┴───── forget when full ─────┘
//! ```

mod changes;
mod lives;
mod restore_error;
mod room;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::Arc;

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId, SampleSeries};
use gestalt_rounds::Classify;
use rand::Rng;

pub use changes::{SampleReceipt, SetChange};
use lives::Lives;
pub use restore_error::RestoreError;

use crate::forgetting::Forgetting;
use crate::groups::Groups;
use crate::sample::{HeldSample, HeldSamples, SeenSamples, SetPart};
use crate::selection::Selection;
use crate::shares::Shares;

/// Among so many samples more than there is room for the rule of forgetting chooses: what some rules do for a first one takes time by the square of how many there are.
const MOST_CHOSEN: usize = 10_000;

/// No key read from a store is greater.
const LAST_KEY: u64 = u64::MAX / 2;

/// The bounded set of samples of one robot.
///
/// A sample is in one [`SetPart`] at a time. It is shared at most once, under a number that counts up without gaps in the
/// [life](Self::in_life) of the robot, and
/// taken in at most once under one name, also after it was forgotten. After [`keep`](Self::keep) and
/// [`receive`](Self::receive) at most `capacity` samples are held: the [`Forgetting`] rule says which one goes.
///
/// Vectors are coordinates in one feature space: the caller has checked their length and that they are finite.
/// Everything that can be asked is asked through [`HeldSamples`], which the set dereferences to.
#[derive(Debug)]
pub struct TrainingSet {
    /// Under which this robot shares.
    series: SampleSeries,
    capacity: usize,
    selection: Box<dyn Selection>,
    forgetting: Box<dyn Forgetting>,
    samples: HeldSamples,
    seen: SeenSamples,
    lives: Lives,
    shares: Shares,
    groups: Option<Groups>,
    next_key: u64,
}

impl Deref for TrainingSet {
    type Target = HeldSamples;

    fn deref(&self) -> &HeldSamples {
        &self.samples
    }
}

impl TrainingSet {
    /// An empty set of at most `capacity` samples; 0 is taken as 1.
    #[must_use]
    pub fn new(
        me: RobotId,
        capacity: usize,
        selection: Box<dyn Selection>,
        forgetting: Box<dyn Forgetting>,
    ) -> Self {
        Self {
            series: SampleSeries { author: me, life: 0 },
            capacity: capacity.max(1),
            selection,
            forgetting,
            samples: HeldSamples::default(),
            seen: SeenSamples::default(),
            lives: Lives::default(),
            shares: Shares::default(),
            groups: None,
            next_key: 1,
        }
    }

    /// The same set, that shares under the number which this life of the robot drew at random: whatever it knows or forgot
    /// of the samples of earlier lives, it gives no name twice.
    #[must_use]
    pub fn in_life(mut self, life: u32) -> Self {
        self.series.life = life;
        self
    }

    /// The same set with room of its own for each of so many groups of authors, and for this robot: what is held of one does not depend on what others send. The
    /// oldest sample of the gesture that a group has most of goes; the rule of forgetting is not asked.
    #[must_use]
    pub(crate) fn in_groups(mut self, groups: Option<Groups>) -> Self {
        self.groups = groups;
        self
    }

    /// The same set without shares of its room: what the rule of forgetting names goes, whosever it is. Who sends most pushes out what others sent.
    #[must_use]
    pub(crate) fn without_shares(mut self) -> Self {
        self.shares = Shares::none();
        self
    }

    /// These other robots are alive now. From then on no author's samples push out those of the others when the set is full,
    /// and when more series were seen than are kept track of, those of robots that are not there give way, or where all are
    /// there the oldest life of the robot that has most: each other robot has at most max(5, ⌈1.25 · capacity / robots⌉)
    /// samples, all strangers together a quarter, and an own share stays. Gives those that were not alive before.
    pub fn meet(&mut self, alive: Arc<BTreeSet<RobotId>>) -> BTreeSet<RobotId> {
        self.shares.meet(self.me(), alive)
    }

    /// Those of the living say nothing, and may be names without robots: they count for no room, and give way as those do that are not there. Gives
    /// those that said nothing until now.
    pub fn pass_over(&mut self, silent: &BTreeSet<RobotId>) -> BTreeSet<RobotId> {
        self.shares.pass_over(silent)
    }

    /// How many robots there are, this one included, as far as it was told, and as they say something.
    #[must_use]
    pub fn robots(&self) -> usize {
        self.shares.robots().unwrap_or(1)
    }

    /// Takes up a set as it was when stored, into one that is still empty: samples with their keys and parts, what
    /// was seen, and the next key. If more samples were stored than the capacity, [`trim`](Self::trim) brings them down.
    ///
    /// # Errors
    /// See [`RestoreError`].
    ///
    /// # Panics
    /// If the set is not empty.
    pub fn restore(
        &mut self,
        samples: Vec<HeldSample>,
        seen: SeenSamples,
        next_key: u64,
    ) -> Result<(), RestoreError> {
        assert!(self.samples.is_empty(), "a stored set is taken up before anything is added");
        if next_key > LAST_KEY {
            return Err(RestoreError::NextKey(next_key));
        }
        let mut restored = HeldSamples::default();
        for sample in samples {
            let key = sample.key;
            if key >= next_key {
                return Err(RestoreError::KeyAhead { key, next: next_key });
            }
            if restored.get(key).is_some() {
                return Err(RestoreError::Key(key));
            }
            let fits = match (sample.part, sample.id) {
                (SetPart::Personal, id) => id.is_none(),
                (part, id) => id.is_some_and(|id| part == self.part_of(id)),
            };
            if !fits {
                return Err(RestoreError::Part(key));
            }
            if let Some(id) = sample.id {
                if restored.find(id).is_some() {
                    return Err(RestoreError::Name(id));
                }
                if !seen.contains(id) {
                    return Err(RestoreError::Unseen(id));
                }
            }
            restored.insert(sample);
        }
        restored.set_arrivals(next_key.saturating_sub(1));
        for sample in restored.iter() {
            self.selection.inserted(sample);
            self.forgetting.inserted(sample);
        }
        self.samples = restored;
        self.shares.recount();
        self.lives = Lives::of(&seen, &self.samples);
        self.seen = seen;
        self.next_key = next_key.max(1);
        Ok(())
    }

    /// Takes an own sample in; it becomes personal. Then forgets while there are more than the capacity.
    pub fn keep(
        &mut self,
        class: ClassId,
        round: RoundId,
        vector: Vec<f32>,
        rng: &mut dyn Rng,
    ) -> Vec<SetChange> {
        self.add(SetPart::Personal, None, class, round, vector.into(), rng)
    }

    /// Selects up to `n` personal samples, one after the other: each choice sees the effect of the one before. Each
    /// gets the next number of this robot and becomes shared.
    ///
    /// `as_sent` is what the vector becomes on its way (rounded to what travels): the author holds what the others
    /// get. `classifier` is for rules that ask how sure it is.
    pub fn share(
        &mut self,
        n: usize,
        classifier: Option<&dyn Classify>,
        as_sent: &dyn Fn(&[f32]) -> Vec<f32>,
        rng: &mut dyn Rng,
    ) -> Vec<SetChange> {
        let mut seen = self.make_room(self.series);
        let mut changes = Vec::new();
        while changes.len() < n {
            let Some(key) = self.selection.select(&self.samples, classifier, rng) else { break };
            let Some(sample) = self.samples.get(key).filter(|sample| sample.part == SetPart::Personal) else {
                break;
            };
            let id = self.series.sample(self.next_number());
            let Ok(Some(others)) = self.seen.insert_and_tell(id) else { break };
            self.lives.note(self.series, sample.round.counter, &self.seen, &self.samples);
            seen.extend(others.into_iter().map(SetChange::Seen));
            let vector = Arc::from(as_sent(&sample.vector));
            self.replace(HeldSample { part: SetPart::Shared, id: Some(id), vector, ..sample.clone() });
            changes.push(SetChange::Shared(key, id));
        }
        seen.extend(changes);
        seen
    }

    /// Takes a shared sample in, unless it was seen before. Then forgets while there are more than the capacity.
    ///
    /// Another's sample becomes external. A robot that lost its memory gets its own samples of earlier lives back this
    /// way: they become shared.
    pub fn receive(
        &mut self,
        id: SampleId,
        class: ClassId,
        round: RoundId,
        vector: impl Into<Arc<[f32]>>,
        rng: &mut dyn Rng,
    ) -> SampleReceipt {
        let mut receipt = self.note(id, round);
        if let SampleReceipt::New(changes) = &mut receipt {
            changes.extend(self.add(self.part_of(id), Some(id), class, round, vector.into(), rng));
        }
        receipt
    }

    /// Notes a shared sample as seen without holding it, as it is not known yet what it shows. [`Self::take_back`] takes it in later.
    pub(crate) fn note(&mut self, id: SampleId, round: RoundId) -> SampleReceipt {
        if let Err(error) = self.may_receive(id, round) {
            return SampleReceipt::Refused(error);
        }
        let mut changes = self.make_room(id.series());
        match self.seen.insert_and_tell(id) {
            Err(error) => return SampleReceipt::Refused(error),
            Ok(None) => return SampleReceipt::Known,
            Ok(Some(others)) => changes.extend(others.into_iter().map(SetChange::Seen)),
        }
        self.lives.note(id.series(), round.counter, &self.seen, &self.samples);
        SampleReceipt::New(changes)
    }

    /// Takes a shared sample in again that was [retracted](Self::retract), under the class it turned out to have. One
    /// that is held, or was never seen, is left as it is.
    pub fn take_back(
        &mut self,
        id: SampleId,
        class: ClassId,
        round: RoundId,
        vector: Arc<[f32]>,
        rng: &mut dyn Rng,
    ) -> Vec<SetChange> {
        if self.find(id).is_some() || !self.seen.contains(id) {
            return Vec::new();
        }
        self.add(self.part_of(id), Some(id), class, round, vector, rng)
    }

    /// Gives all samples of a round another class, whatever part they are in.
    pub fn relabel(&mut self, round: RoundId, class: ClassId) -> Vec<SetChange> {
        let wrong = self.of_round(round).filter(|sample| sample.class != class);
        let wrong: Vec<_> = wrong.cloned().collect();
        let relabelled = wrong.into_iter().map(|sample| {
            let change = SetChange::Relabelled(sample.key, sample.class);
            self.replace(HeldSample { class, ..sample });
            change
        });
        relabelled.collect()
    }

    /// Removes all samples of a round. They stay seen: they are not taken in again.
    pub fn retract(&mut self, round: RoundId) -> Vec<SetChange> {
        let keys: Vec<u64> = self.of_round(round).map(|sample| sample.key).collect();
        keys.into_iter().filter_map(|key| self.remove(key)).map(SetChange::Removed).collect()
    }

    /// Forgets while there are more samples than the capacity: only after a set was taken up that was stored under a
    /// greater one.
    ///
    /// The bound stands whatever the rule says: if it names no sample that is held, the oldest goes. It is asked for the last 10,000 to go; before these, the oldest of the
    /// gesture that there are most of.
    pub fn trim(&mut self, rng: &mut dyn Rng) -> Vec<SetChange> {
        let mut changes = Vec::new();
        if let Some(groups) = self.groups {
            let victims = groups.above(&self.samples, self.capacity).into_iter();
            return victims.filter_map(|victim| self.remove(victim)).map(SetChange::Removed).collect();
        }
        while self.samples.len() > self.capacity {
            let gone = match self.shares.above(&self.samples, self.capacity) {
                // It counts as never come: whoever floods a robot changes little of what its rule goes by.
                Some(excess) => self.remove(excess),
                None if self.samples.len() - self.capacity > MOST_CHOSEN => {
                    self.oldest_of_most().and_then(|oldest| self.forget(oldest))
                }
                None => self.victim(rng).and_then(|victim| self.forget(victim)),
            };
            let Some(gone) = gone else { break };
            changes.push(SetChange::Removed(gone));
        }
        changes
    }

    fn oldest_of_most(&self) -> Option<u64> {
        let order = |class: &ClassId| (self.samples.class_count(*class), Reverse(*class));
        self.samples.class_keys(self.samples.classes().max_by_key(order)?).first().copied()
    }

    /// The sample to forget where no author has more than its share.
    fn victim(&mut self, rng: &mut dyn Rng) -> Option<u64> {
        let oldest = self.samples.iter().next().map(|sample| sample.key);
        let named = self.forgetting.victim(&self.samples, rng).or(oldest);
        let named = named.and_then(|key| self.samples.get(key));
        let instead = named.and_then(|named| self.shares.in_place_of(named, &self.samples, self.capacity));
        let victim = instead.or(named.map(|named| named.key)).or(oldest)?;
        let class = self.samples.get(victim)?.class;
        Some(self.shares.in_place_of_young(class, &self.samples, self.capacity).unwrap_or(victim))
    }

    /// The most samples that are held.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Which shared samples this robot ever had, its own included.
    #[must_use]
    pub fn seen(&self) -> &SeenSamples {
        &self.seen
    }

    /// The key of the next sample that comes in.
    #[must_use]
    pub fn next_key(&self) -> u64 {
        self.next_key
    }

    /// The number of the next sample that this robot shares.
    #[must_use]
    pub fn next_number(&self) -> u32 {
        self.seen.intervals(self.series).last().map_or(1, |(_, last)| last.saturating_add(1))
    }

    /// Under which this robot shares.
    #[must_use]
    pub fn series(&self) -> SampleSeries {
        self.series
    }

    fn me(&self) -> RobotId {
        self.series.author
    }

    fn of_round(&self, round: RoundId) -> impl Iterator<Item = &HeldSample> {
        self.samples.iter().filter(move |sample| sample.round == round)
    }

    pub(crate) fn part_of(&self, id: SampleId) -> SetPart {
        if id.author == self.me() { SetPart::Shared } else { SetPart::External }
    }

    fn add(
        &mut self,
        part: SetPart,
        id: Option<SampleId>,
        class: ClassId,
        round: RoundId,
        vector: Arc<[f32]>,
        rng: &mut dyn Rng,
    ) -> Vec<SetChange> {
        let key = self.next_key;
        self.next_key += 1;
        let sample = HeldSample { key, part, id, class, round, vector };
        self.selection.inserted(&sample);
        self.forgetting.inserted(&sample);
        self.shares.came(&sample);
        self.samples.insert(sample);
        let mut changes = vec![SetChange::Added(key)];
        changes.append(&mut self.trim(rng));
        changes
    }

    fn replace(&mut self, after: HeldSample) {
        let Some(before) = self.samples.remove(after.key) else { return };
        self.selection.replaced(&before, &after);
        self.forgetting.replaced(&before, &after);
        self.samples.insert(after);
    }

    fn remove(&mut self, key: u64) -> Option<HeldSample> {
        let sample = self.take_out(key)?;
        self.forgetting.removed(&sample);
        Some(sample)
    }

    fn forget(&mut self, key: u64) -> Option<HeldSample> {
        let sample = self.take_out(key)?;
        self.forgetting.forgotten(&sample);
        Some(sample)
    }

    fn take_out(&mut self, key: u64) -> Option<HeldSample> {
        let sample = self.samples.remove(key)?;
        self.shares.went(&sample);
        self.selection.removed(&sample);
        Some(sample)
    }
}
