//! The sure way for samples and lessons: neighbours compare digests of all they know, and give each other what one of
//! them lacks.

use std::collections::BTreeMap;

use gestalt_protocol::{
    Digest, Know, Known, Lesson, Lessons, MAX_INTERVALS, Message, RobotId, RoundId, SampleId, Samples,
};

use super::learning::Declined;
use super::{Mind, Output, Refusal};
use crate::VectorError;

/// About how many bytes of samples one message takes, so that a vote never waits long behind it.
const CHUNK: usize = 16 * 1024;

/// The most messages given at once; the next comparison brings more.
const MAX_CHUNKS: usize = 32;

/// The most lessons in one message.
const MAX_TOLD: usize = 256;

impl Mind {
    /// What this robot knows, in two numbers.
    pub(super) fn knowledge(&self) -> Option<Digest> {
        self.learning.as_ref().map(|learning| learning.digest())
    }

    /// A neighbour says what it knows in short; if that differs, this robot says what it knows at length.
    pub(super) fn compare_knowledge(&mut self, from: RobotId, theirs: Option<Digest>, out: &mut Vec<Output>) {
        let (Some(theirs), Some(mine)) = (theirs, self.knowledge()) else { return };
        if let Some(learning) = &mut self.learning
            && theirs == mine
        {
            learning.note_heard_from_others();
        }
        if theirs != mine {
            self.tell_know(from, theirs, false, out);
        }
    }

    fn tell_know(&mut self, to: RobotId, theirs: Digest, answer: bool, out: &mut Vec<Output>) {
        let Some(learning) = &self.learning else { return };
        let mine = learning.digest();
        let seen = learning.set().seen();
        let samples = if mine.samples == theirs.samples {
            Vec::new()
        } else {
            let known = |author| {
                let intervals = seen.intervals(author);
                // Of a set in pieces the newest are told; the older ones are given again, and known.
                let newest = &intervals[intervals.len().saturating_sub(MAX_INTERVALS)..];
                Known { author, numbers: newest.to_vec() }
            };
            seen.authors().map(known).collect()
        };
        let lessons =
            if mine.lessons == theirs.lessons { Vec::new() } else { learning.lessons().rounds().collect() };
        self.tell(to, Message::Know(Know { samples, lessons, digest: mine, answer }), out);
    }

    /// A neighbour says what it knows: gives what it lacks, and asks for what this robot lacks.
    pub(super) fn on_know(&mut self, from: RobotId, know: &Know, out: &mut Vec<Output>) {
        let Some(mine) = self.knowledge() else { return };
        let mut lacking_here = false;
        if mine.samples != know.digest.samples {
            lacking_here |= self.lacks_samples(&know.samples);
            self.give_samples(from, &know.samples, out);
        }
        if mine.lessons != know.digest.lessons {
            let Some(learning) = &self.learning else { return };
            let theirs: BTreeMap<RoundId, u64> = know.lessons.iter().copied().collect();
            let book = learning.lessons();
            lacking_here |= theirs.iter().any(|(round, digest)| book.digest_of(*round) != *digest);
            let lacking = book.rounds().filter(|(round, digest)| theirs.get(round) != Some(digest));
            let lessons: Vec<Lesson> = lacking.flat_map(|(round, _)| book.of(round)).take(MAX_TOLD).collect();
            if !lessons.is_empty() {
                self.tell(from, Message::Lessons(Lessons { lessons }), out);
            }
        }
        if lacking_here && !know.answer {
            self.tell_know(from, know.digest, true, out);
        } else if let Some(learning) = &mut self.learning {
            learning.note_heard_from_others();
        }
    }

    fn lacks_samples(&self, theirs: &[Known]) -> bool {
        let Some(learning) = &self.learning else { return false };
        let seen = learning.set().seen();
        theirs.iter().any(|known| {
            let mine = seen.intervals(known.author);
            let covered = |first: u32, last: u32| mine.iter().any(|(from, to)| *from <= first && last <= *to);
            !known.numbers.iter().all(|(first, last)| covered(*first, *last))
        })
    }

    fn give_samples(&mut self, to: RobotId, theirs: &[Known], out: &mut Vec<Output>) {
        let Some(learning) = &self.learning else { return };
        let known: BTreeMap<RobotId, &[(u32, u32)]> =
            theirs.iter().map(|known| (known.author, known.numbers.as_slice())).collect();
        let lacks = move |id: SampleId| {
            let numbers = known.get(&id.author).copied().unwrap_or_default();
            let after = numbers.partition_point(|(_, last)| *last < id.number);
            numbers.get(after).is_none_or(|(first, _)| *first > id.number)
        };
        let told: Vec<Samples> = learning.lacking(lacks, CHUNK).take(MAX_CHUNKS).collect();
        for samples in told {
            self.tell(to, Message::Samples(samples), out);
        }
    }

    /// Takes in samples, from their author or from a neighbour that had them.
    pub(super) fn on_samples(&mut self, from: RobotId, samples: &Samples) {
        let Some(learning) = &mut self.learning else { return };
        let mut repaired = false;
        for sample in &samples.samples {
            match learning.receive(samples.space, sample) {
                Ok(new) => repaired |= new && sample.id.author != from,
                Err(declined) => self.refusals.add(match declined {
                    Declined::Vector(VectorError::Space { .. }) => Refusal::OtherSpace,
                    Declined::Vector(_) => Refusal::BadVector,
                    Declined::Class => Refusal::UnknownClass,
                    Declined::Number => Refusal::SampleNumber,
                }),
            }
        }
        if repaired {
            // The other neighbours may lack it too.
            self.hurry_repair();
        }
    }

    /// Takes in what instructors said and this robot had not heard.
    pub(super) fn on_lessons(&mut self, lessons: &[Lesson]) {
        let Some(learning) = &mut self.learning else { return };
        let mut news = false;
        for lesson in lessons {
            news |= learning.hear(lesson) == crate::Heard::New;
        }
        if news {
            self.hurry_repair();
            self.share();
        }
    }
}
