//! Which samples are told to others, within the bounds of a round, and once they are remembered as shared.

use gestalt_protocol::{ClassId, Envelope, Message, RoundId, SampleId, Samples, SharedSample, Stamp};
use gestalt_rounds::Classify;

use super::state::{Learning, MAX_UNSENT};
use crate::sample::{HeldSample, ToldAs};
use crate::training_set::SetChange;
use crate::vector_codec::decode_vector;

impl Learning {
    /// Chooses what to share, within the bounds. While much waits for a disk that does not keep up, nothing: it stays
    /// personal, and owed.
    pub fn share(&mut self, classifier: Option<&dyn Classify>) {
        if self.unsent.len() >= MAX_UNSENT {
            return;
        }
        // A hair more than a whole: tenths do not add up to one exactly.
        let by_fraction = (self.credit + 1e-9).floor() as usize;
        let by_number = self.config.share_samples.map_or(usize::MAX, |n| n as usize);
        let n = by_fraction.min(by_number).min(self.most_by_bytes());
        // What the other bounds withhold is not owed.
        self.credit = (self.credit - by_fraction as f64).max(0.0);
        if n == 0 {
            return;
        }
        let (space, precision) = (self.space.clone(), self.config.precision);
        let as_sent = move |vector: &[f32]| {
            decode_vector(&precision.encode(vector, &space), &space)
                .expect("what was encoded in a space is a vector of that space")
        };
        let changes = self.set.share(n, classifier, &as_sent, &mut *self.rng);
        let ids = changes.iter().filter_map(|change| match change {
            SetChange::Shared(_, id) => Some(*id),
            _ => None,
        });
        let ids: Vec<SampleId> = ids.collect();
        for id in &ids {
            if let Some(told) = self.set.find(*id).map(|sample| self.told_as(sample)) {
                self.set.note_told(*id, told);
            }
        }
        self.absorb(changes);
        if !ids.is_empty() {
            self.unsent.push_back((self.revision + 1, ids));
        }
    }

    /// How many samples fit in the bytes of a round.
    fn most_by_bytes(&self) -> usize {
        let Some(bytes) = self.config.share_bytes else { return usize::MAX };
        let vector = vec![0.0; self.space.components()];
        let sample = SharedSample {
            id: self.set.series().sample(self.set.next_number().saturating_add(64)),
            class: ClassId(0),
            round: self.recent.newest().unwrap_or(RoundId { counter: 1, opener: self.me, life: u32::MAX }),
            vector: self.config.precision.encode(&vector, &self.space),
        };
        let length = |samples: Vec<SharedSample>| {
            let message = Message::Samples(Samples { space: self.space_id, samples });
            let stamp = Stamp { boot: u32::MAX, sequence: u32::MAX };
            Envelope { author: self.me, stamp, message, signature: None }.encode().len()
        };
        let empty = length(Vec::new());
        let each = length(vec![sample]) - empty;
        (bytes as usize).saturating_sub(empty) / each.max(1)
    }

    /// The samples that may be sent now: shared, and remembered as such.
    pub fn take_unsent(&mut self) -> Option<Samples> {
        let (revision, _) = self.unsent.front()?;
        if *revision > self.remembered {
            return None;
        }
        let (_, ids) = self.unsent.pop_front()?;
        Some(self.told(ids.iter().filter_map(|id| self.set.find(*id))))
    }

    /// Samples as they travel.
    pub fn told<'a>(&self, samples: impl Iterator<Item = &'a HeldSample>) -> Samples {
        let samples = samples.filter_map(|sample| {
            Some(self.as_told(sample.id?, self.told_as(sample), sample.round, &sample.vector))
        });
        Samples { space: self.space_id, samples: samples.collect() }
    }

    /// How the author of a sample shared it, or this robot does.
    pub(super) fn told_as(&self, sample: &HeldSample) -> ToldAs {
        sample.told.unwrap_or(ToldAs { class: sample.class, precision: self.config.precision })
    }

    /// A sample as its author shared it, byte for byte, whatever this robot holds it for meanwhile: what was said of its
    /// round reaches the others as well.
    fn as_told(&self, id: SampleId, told: ToldAs, round: RoundId, vector: &[f32]) -> SharedSample {
        let ToldAs { class, precision } = told;
        SharedSample { id, class, round, vector: precision.encode_again(vector, &self.space) }
    }

    /// The shared samples held, also those aside, that `lacks` says another robot has not had; in messages of about
    /// so many bytes.
    pub fn lacking<'a>(
        &'a self,
        lacks: impl Fn(SampleId) -> bool + 'a,
        bytes: usize,
    ) -> impl Iterator<Item = Samples> + 'a {
        let held = self.set.common();
        let held =
            held.filter_map(|sample| Some((sample.id?, self.told_as(sample), sample.round, &sample.vector)));
        let aside = self.aside.iter();
        let aside = aside
            .filter_map(|(_, aside)| aside.shared.map(|(id, told)| (id, told, aside.round, &aside.vector)));
        let mut lacking =
            held.chain(aside).filter(move |(id, ..)| lacks(*id) && self.may_tell(*id)).peekable();
        let each = 32 + self.space.components() * self.config.precision.bytes();
        let chunk = (bytes / each).max(1);
        std::iter::from_fn(move || {
            lacking.peek()?;
            let told = lacking.by_ref().take(chunk);
            let samples =
                told.map(|(id, told, round, vector)| self.as_told(id, told, round, vector)).collect();
            Some(Samples { space: self.space_id, samples })
        })
    }

    /// Whether a shared sample is not told to others yet.
    pub fn withholds(&self) -> bool {
        self.unsent.iter().any(|(revision, _)| *revision > self.remembered)
    }

    /// Whether a sample may be told to others: an own one only once it is remembered as shared.
    pub fn may_tell(&self, id: SampleId) -> bool {
        id.author != self.me
            || !self.unsent.iter().any(|(revision, ids)| *revision > self.remembered && ids.contains(&id))
    }
}
