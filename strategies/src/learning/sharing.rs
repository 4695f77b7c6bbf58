//! Which samples are told to others, within the bounds of a round, and once they are remembered as shared.

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::{
    Batches as BatchesTold, ClassId, Envelope, FeatureSpaceId, HeldBatch, MAX_BATCHES, MAX_SAMPLES, Message,
    RobotId, RoundId, SampleId, Samples, SharedSample, Signature, Stamp,
};
use gestalt_rounds::Classify;
use gestalt_svm::FeatureSpace;

use super::config::LearningConfig;
use super::memory::Item;
#[cfg(test)]
use super::memory::RobotMemory;
use super::setup::LearningError;
use super::state::{Learning, MAX_UNSENT};
use crate::sample::SetPart;
use crate::training_set::SetChange;
use crate::vector_codec::{Precision, decode_vector};

/// About how many bytes of vectors one batch takes, so that a vote never waits long behind it.
const BATCH_BYTES: usize = 16 * 1024;

impl Learning {
    /// Chooses what to share, within the bounds, in batches that `stamp` makes this robot's statements, and signs if it says so. While much waits for
    /// a disk that does not keep up, nothing: it stays personal, and owed.
    pub fn share(
        &mut self,
        classifier: Option<&dyn Classify>,
        signs: bool,
        stamp: impl FnMut(Samples) -> HeldBatch,
    ) {
        if self.unsent.len() >= MAX_UNSENT {
            return;
        }
        // A hair more than a whole: tenths do not add up to one exactly.
        let by_fraction = (self.credit + 1e-9).floor() as usize;
        self.shared = self.shared.in_round(self.newest.unwrap_or_default());
        let by_number = self.config.share_samples.map_or(usize::MAX, |most| self.shared.samples_left(most));
        let of_swarm = |budget| self.shared.left_of_swarm(budget, self.set.robots(), self.me);
        let by_budget = self.config.share_per_round.map_or(usize::MAX, of_swarm);
        let n = self.most_by_bytes(by_fraction.min(by_number).min(by_budget), signs);
        // What the other bounds withhold is not owed.
        self.credit = (self.credit - by_fraction as f64).max(0.0);
        if n == 0 {
            return;
        }
        let (space, precision) = (self.space.clone(), self.config.precision);
        let is_certified = self.groups().is_some();
        let as_sent = move |vector: &[f32]| {
            // Which samples are shared depends on what others sent: this robot's own stay as they are all the same.
            if is_certified {
                return vector.to_vec();
            }
            decode_vector(&precision.encode(vector, &space), &space)
                .expect("what was encoded in a space is a vector of that space")
        };
        let changes = self.set.share(n, classifier, &as_sent, &mut *self.rng);
        let ids = changes.iter().filter_map(|change| match change {
            SetChange::Shared(_, id) => Some(*id),
            _ => None,
        });
        let shared: Vec<SharedSample> = ids.filter_map(|id| self.as_shared(id)).collect();
        self.absorb(changes);
        let batches = shared.chunks(self.most_of_batch());
        let batches = batches.map(|some| Samples { space: self.space_id, samples: some.to_vec() });
        for batch in batches.map(stamp).collect::<Vec<_>>() {
            self.shared.add(batch.samples.samples.len(), Envelope::from(batch.clone()).encode().len());
            self.unsent.extend(batch.samples.first().map(|first| (self.revision + 1, first)));
            self.keep_batch(batch);
        }
    }

    /// A sample of this robot's, as it travels. Its coordinates are already what the others will read.
    fn as_shared(&self, id: SampleId) -> Option<SharedSample> {
        let sample = self.set.find(id)?;
        let vector = self.config.precision.encode(&sample.vector, &self.space);
        Some(SharedSample { id, class: sample.class, round: sample.round, vector })
    }

    /// How many samples one batch has at most.
    fn most_of_batch(&self) -> usize {
        let each = self.config.precision.bytes() * self.space.components();
        (BATCH_BYTES / each.max(1)).clamp(1, MAX_SAMPLES)
    }

    /// How many of so many samples fit in what is left of the bytes of a round, whichever they are.
    fn most_by_bytes(&self, n: usize, signs: bool) -> usize {
        let Some(bytes) = self.config.share_bytes.filter(|_| n > 0) else { return n };
        let mut round = RoundId { counter: 0, opener: RobotId(0), life: 0 };
        let mut class = ClassId(0);
        for sample in self.set.iter().filter(|sample| sample.part == SetPart::Personal) {
            round.counter = round.counter.max(sample.round.counter);
            round.opener = round.opener.max(sample.round.opener);
            round.life = round.life.max(sample.round.life);
            class = class.max(sample.class);
        }
        let beyond = u32::try_from(n.max(64)).unwrap_or(u32::MAX);
        let id = self.set.series().sample(self.set.next_number().saturating_add(beyond));
        let sample = (id, class, round);
        let (empty, each) = lengths((self.me, signs), self.config.precision, &self.space, sample);
        let (most, left) = (self.most_of_batch(), self.shared.bytes_left(bytes));
        let full = empty + most * each;
        n.min(left / full * most + most.min((left % full).saturating_sub(empty) / each))
    }

    /// A batch that may be sent now: shared, and remembered as such.
    pub fn take_unsent(&mut self) -> Option<HeldBatch> {
        while self.unsent.front().is_some_and(|(revision, _)| *revision <= self.remembered)
            && let Some((_, first)) = self.unsent.pop_front()
        {
            if let Some(batch) = self.batches.get(first) {
                return Some(batch.clone());
            }
        }
        None
    }

    /// The batches of which a sample is held, also aside, that `lacks` says another robot has not had; in messages of about so many
    /// bytes.
    pub fn lacking(
        &self,
        lacks: impl Fn(SampleId) -> bool,
        bytes: usize,
    ) -> impl Iterator<Item = BatchesTold> {
        let held = self.set.common().filter_map(|sample| sample.id);
        let aside = self.aside.iter().filter_map(|(_, aside)| aside.shared);
        let lacking = held.chain(aside).filter(|id| lacks(*id));
        let firsts: BTreeSet<SampleId> = lacking.filter_map(|id| self.batches.of(id)).collect();
        let may_tell = firsts.into_iter().filter(|first| self.may_tell(*first));
        // In turns: what one author shared does not keep that of the others back.
        let mut turns: BTreeMap<RobotId, usize> = BTreeMap::new();
        let mut in_turns: Vec<(usize, SampleId)> = may_tell
            .map(|first| {
                let turn = turns.entry(first.author).or_default();
                *turn += 1;
                (*turn, first)
            })
            .collect();
        in_turns.sort_unstable();
        let batches = in_turns.into_iter().filter_map(|(_, first)| self.batches.get(first));
        let mut batches = batches.peekable();
        std::iter::from_fn(move || {
            let (mut told, mut length) = (Vec::new(), 0);
            while let Some(batch) = batches.next_if(|batch| {
                told.is_empty() || (told.len() < MAX_BATCHES && length + size(batch) <= bytes)
            }) {
                length += size(batch);
                told.push(batch.clone());
            }
            (!told.is_empty()).then_some(BatchesTold { batches: told })
        })
    }

    /// The batch kept here that gives another sample the number of one in that batch, if both are signed.
    pub fn contradicted(&self, batch: &HeldBatch) -> Option<&HeldBatch> {
        batch.signature?;
        let mut held = batch.samples.samples.iter().filter_map(|sample| {
            let held = self.batches.get(self.batches.of(sample.id)?)?;
            let same = held.samples.space == batch.samples.space && held.samples.samples.contains(sample);
            (!same && held.signature.is_some()).then_some(held)
        });
        held.next()
    }

    /// Keeps a batch some of whose samples were news, while one of them is held.
    pub fn keep_batch(&mut self, batch: HeldBatch) {
        let Some(first) = batch.samples.first() else { return };
        if let Some(first) = self.batches.keep(self.shelf.batch(first, batch)) {
            self.dirty.insert(Item::Batch(first));
            self.thinned.insert(first);
        }
    }

    /// A sample that may have been shared is held no more.
    pub(super) fn note_gone(&mut self, id: Option<SampleId>) {
        self.thinned.extend(id.and_then(|id| self.batches.of(id)));
    }

    /// Lets go of the batches of which nothing is held any more.
    pub(super) fn tidy_batches(&mut self) {
        if self.thinned.is_empty() {
            return;
        }
        let aside: BTreeSet<SampleId> = self.aside.iter().filter_map(|(_, aside)| aside.shared).collect();
        let set = &self.set;
        let is_held = |id| set.find(id).is_some() || aside.contains(&id);
        let gone = self.batches.let_go(std::mem::take(&mut self.thinned), is_held);
        self.dirty.extend(gone.into_iter().map(Item::Batch));
    }

    /// Every shared sample held can be passed on, nothing else is kept, and the disk has the same.
    #[cfg(test)]
    pub fn check_batches(&self, memory: RobotMemory) {
        let held = self.set.common().filter_map(|sample| sample.id);
        let held: BTreeSet<SampleId> =
            held.chain(self.aside.iter().filter_map(|(_, aside)| aside.shared)).collect();
        let of: BTreeSet<SampleId> =
            held.iter().map(|id| self.batches.of(*id).expect("it came in a batch")).collect();
        let kept: Vec<&HeldBatch> = self.batches.iter().collect();
        assert_eq!(kept.iter().filter_map(|batch| batch.samples.first()).collect::<BTreeSet<_>>(), of);
        assert_eq!(memory.batches.iter().collect::<Vec<_>>(), kept);
    }

    /// Whether a shared sample is not told to others yet.
    pub fn withholds(&self) -> bool {
        self.unsent.iter().any(|(revision, _)| *revision > self.remembered)
    }

    /// Whether a batch may be told to others: an own one only once it is remembered as shared.
    fn may_tell(&self, first: SampleId) -> bool {
        !self.unsent.iter().any(|(revision, unsent)| *revision > self.remembered && *unsent == first)
    }
}

impl LearningConfig {
    /// Whether what a round may share is enough for one sample of that space, whatever it is called and where robots sign, with its signature: below that nothing would
    /// be shared, ever.
    ///
    /// # Errors
    /// [`LearningError::ShareBytes`] names the least that is enough.
    pub fn check_share_bytes(&self, space: &FeatureSpace, signs: bool) -> Result<(), LearningError> {
        let Some(given) = self.share_bytes else { return Ok(()) };
        // What is never to be shared need not fit.
        if self.share_fraction == 0.0 || self.share_samples == Some(0) || self.share_per_round == Some(0) {
            return Ok(());
        }
        // Greater numbers take more bytes.
        let robot = RobotId(u32::MAX);
        let id = SampleId { author: robot, life: u32::MAX, number: u32::MAX };
        let round = RoundId { counter: u32::MAX, opener: robot, life: u32::MAX };
        let (empty, each) = lengths((robot, signs), self.precision, space, (id, ClassId(u32::MAX), round));
        let least = empty + each;
        if given as usize >= least { Ok(()) } else { Err(LearningError::ShareBytes { given, least }) }
    }
}

/// How many bytes an envelope of that robot takes without the samples of its batch, and how many one of them does that is called so, at most. Every space is named by
/// as many.
fn lengths(
    (author, signs): (RobotId, bool),
    precision: Precision,
    space: &FeatureSpace,
    (id, class, round): (SampleId, ClassId, RoundId),
) -> (usize, usize) {
    let vector = precision.encode(&vec![0.0; space.components()], space);
    let length = |samples: Vec<SharedSample>| {
        let message = Message::Samples(Samples { space: FeatureSpaceId(0), samples });
        let stamp = Stamp { boot: u32::MAX, sequence: u32::MAX };
        Envelope { author, stamp, message, signature: None }.encode().len()
    };
    let unsigned = length(Vec::new());
    let each = (length(vec![SharedSample { id, class, round, vector }]) - unsigned).max(1);
    (unsigned + if signs { Signature::LENGTH } else { 0 }, each)
}

/// About how many bytes a batch takes.
fn size(batch: &HeldBatch) -> usize {
    let samples = &batch.samples.samples;
    96 + samples.iter().map(|sample| 32 + sample.vector.bytes()).sum::<usize>()
}
