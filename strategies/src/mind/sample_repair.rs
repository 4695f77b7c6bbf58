//! The sure way for samples and lessons: neighbours compare digests of all they know, and give each other what one of
//! them lacks.

use std::collections::BTreeMap;

use gestalt_protocol::{
    Digest, HeldBatch, Know, Known, Lesson, Lessons, MAX_INTERVALS, MAX_LESSONS, MAX_MESSAGE, MAX_ROBOTS,
    Message, Naming, Namings, RobotId, RoundId, SharedSample,
};
use gestalt_rounds::Refusal;

use super::machine::Mind;
use super::output::Output;
use crate::learning::Declined;
use crate::lessons::{LessonBook, LessonReceipt, MAX_INSTRUCTORS};
use crate::names::NameBook;
use crate::sample::{MAX_GAPS, MAX_INTERVALS_IN_ALL, MAX_SERIES, SeenSamples};
use crate::vector_codec::VectorError;

/// About how many bytes of samples, or of lessons, one message takes, so that a vote never waits long behind it.
const CHUNK: usize = 16 * 1024;

/// The most messages given at once; the next comparison brings more.
const MAX_CHUNKS: usize = 32;

/// The most lessons given at once.
const MAX_TOLD: usize = 256;

/// How many words of one message may turn out to be nobody's: what stands behind them is not looked at. Checking a signature is work.
pub(super) const MAX_UNPROVEN: usize = 16;

/// How many contradictions wait to be looked at: one convicts its author.
const MAX_CONTRADICTIONS: usize = 8;

// What is kept of samples and lessons can be told, all of it in one message: an interval takes 10 bytes at most, a series 11
// beside its intervals, a round of lessons 25, all else 64.
const _: () = assert!(MAX_GAPS <= MAX_INTERVALS && MAX_SERIES <= MAX_ROBOTS);
const _: () = assert!(10 * MAX_INTERVALS_IN_ALL + 11 * MAX_SERIES + 25 * MAX_LESSONS + 64 < MAX_MESSAGE);

/// All that was named, if anything was: it is little, and seldom differs. First by which words, then what became of it.
fn names_to_give(names: &NameBook) -> impl Iterator<Item = Message> {
    let parts: [Vec<Naming>; 2] = [names.told_first().cloned().collect(), names.told().cloned().collect()];
    let given = parts.into_iter().filter(|namings| !namings.is_empty());
    given.map(|namings| Message::Namings(Namings { namings }))
}

/// What is said of these rounds, in messages: all of a round in one, so that it is known to be all. Says also which was the last, if there is no room for
/// those behind it. Where words may be refused, so few are in a message that none stands behind too many of these to be looked at.
fn lessons_to_give(
    book: &LessonBook,
    rounds: &[RoundId],
    may_be_refused: bool,
) -> (Vec<Message>, Option<RoundId>) {
    let (mut messages, mut lessons, mut told, mut bytes) = (Vec::new(), Vec::new(), 0, 0);
    let (mut last, mut ended) = (None, None);
    for round in rounds {
        if told + MAX_INSTRUCTORS > MAX_TOLD {
            ended = last;
            break;
        }
        let mut of_round: Vec<Lesson> = book.told_of(*round).collect();
        let is_long = may_be_refused && lessons.len() + of_round.len() > MAX_UNPROVEN;
        if (is_long || bytes >= CHUNK) && !lessons.is_empty() {
            messages.push(Message::Lessons(Lessons { lessons: std::mem::take(&mut lessons) }));
            bytes = 0;
        }
        let signed =
            |lesson: &Lesson| lesson.said.as_ref().map_or(0, |it| it.word.len() + it.attachment.len());
        told += of_round.len();
        bytes += of_round.iter().map(|lesson| 64 + signed(lesson)).sum::<usize>();
        lessons.append(&mut of_round);
        last = Some(*round);
    }
    if !lessons.is_empty() {
        messages.push(Message::Lessons(Lessons { lessons }));
    }
    (messages, ended)
}

impl Mind {
    /// A neighbour says what it knows in short; if that differs, this robot says what it knows at length, unless that was
    /// of no use before.
    pub(super) fn compare_knowledge(&mut self, from: RobotId, theirs: Option<Digest>, out: &mut Vec<Output>) {
        let (Some(theirs), Some(learning)) = (theirs, &self.learning) else { return };
        let same = learning.digest_under(theirs.key) == theirs;
        if !same && !self.exchanges.is_at_rest(from, learning.digest(), theirs) && self.may_answer(from) {
            self.exchanges.spend(from, 1);
            self.tell_know(from, theirs, false, out);
            // This and what comes of it may be lost.
            self.rounds.hurry_repair();
        }
    }

    fn tell_know(&mut self, to: RobotId, theirs: Digest, answer: bool, out: &mut Vec<Output>) {
        let Some(learning) = &self.learning else { return };
        let (mine, here) = (learning.digest(), learning.digest_under(theirs.key));
        let samples = if here.samples == theirs.samples {
            Vec::new()
        } else {
            let seen = self.exchanges.told_to(to, learning.set().seen());
            let known = |series| Known { series, numbers: seen.intervals(series).to_vec() };
            seen.series().map(known).collect()
        };
        let lessons = if here.lessons == theirs.lessons {
            Vec::new()
        } else {
            let mut rounds: BTreeMap<RoundId, u64> = learning.lessons().rounds(mine.key).collect();
            rounds.append(&mut self.exchanges.declined_rounds(to, mine.key));
            rounds.into_iter().rev().take(MAX_LESSONS).collect()
        };
        let named = learning.names().digest(mine.key);
        let know = Know { samples, lessons, named, digest: mine, answer, nothing_for: None };
        self.tell(to, Message::Know(know), out);
    }

    /// A neighbour says what it knows: gives what it lacks, and asks for what this robot lacks.
    pub(super) fn on_know(&mut self, from: RobotId, know: &Know, out: &mut Vec<Output>) {
        let Some(learning) = &self.learning else { return };
        let mine = learning.digest();
        if let Some(asked) = know.nothing_for {
            if asked == mine {
                self.exchanges.rest(from, mine, know.digest);
            }
            return;
        }
        let here = learning.digest_under(know.digest.key);
        if here == know.digest && know.samples.is_empty() && know.lessons.is_empty() {
            return;
        }
        if !self.may_answer(from) {
            return;
        }
        let chunks = self.exchanges.allowance(self.rounds.now(), from).min(MAX_CHUNKS);
        let Some(learning) = &self.learning else { return };
        let mut lacking_here = false;
        let mut given = Vec::new();
        if here.samples != know.digest.samples || !know.samples.is_empty() {
            let theirs = know.samples.iter().map(|known| (known.series, known.numbers.clone()));
            let Ok(theirs) = SeenSamples::from_intervals(theirs) else {
                return self.rounds.note_refusal(Refusal::SampleNumber);
            };
            lacking_here |= self.exchanges.told_to(from, learning.set().seen()).lacks(&theirs);
            let lacking = learning.lacking(|id| !theirs.contains(id), CHUNK);
            given.extend(lacking.take(chunks).map(Message::Batches));
            let digests = (here.samples, know.digest.samples);
            if !given.is_empty() && !self.exchanges.may_give_samples(from, digests) {
                given.clear();
            }
        }
        if here.lessons != know.digest.lessons || !know.lessons.is_empty() {
            let theirs: BTreeMap<RoundId, u64> = know.lessons.iter().copied().collect();
            let book = learning.lessons();
            let key = know.digest.key;
            let declined = self.exchanges.declined_rounds(from, key);
            lacking_here |= theirs.iter().any(|(round, digest)| {
                book.digest_of(*round, key) != *digest && declined.get(round) != Some(digest)
            });
            // What lies before all of a full list was left out of it, or would be, unless it is kept before others.
            let first = theirs.keys().next().filter(|_| theirs.len() >= MAX_LESSONS);
            let lacking = book.rounds(key).filter(|(round, digest)| {
                first.is_none_or(|first| round >= first || learning.keeps_before_others(*round))
                    && theirs.get(round) != Some(digest)
            });
            let lacking: Vec<RoundId> = lacking.map(|(round, _)| round).collect();
            // First the names: lessons may speak of them.
            let names = learning.names();
            if names.digest(key) != know.named {
                lacking_here |= know.named != 0;
                let again = self.exchanges.may_give_names(from, (names.digest(0), know.named));
                given.extend(names_to_give(names).filter(|_| again));
            }
            let digests = (here.lessons, know.digest.lessons);
            let turn = self.exchanges.turn_of_lessons(from, digests, lacking);
            let (messages, ended) = lessons_to_give(book, &turn, learning.is_sealed());
            self.exchanges.end_turn_of_lessons(from, ended);
            given.extend(messages);
        }
        let settled = given.is_empty() && !learning.withholds();
        self.exchanges.spend(from, given.len() + 1);
        for message in given {
            self.tell(from, message, out);
        }
        if settled {
            let (samples, lessons) = (Vec::new(), Vec::new());
            let nothing_for = Some(know.digest);
            let know = Know { samples, lessons, digest: mine, answer: true, nothing_for, named: 0 };
            self.tell(from, Message::Know(know), out);
        }
        if lacking_here && !know.answer && !self.exchanges.is_at_rest(from, mine, know.digest) {
            self.tell_know(from, know.digest, true, out);
        }
    }

    /// Takes in samples, from their author or from a neighbour that had them.
    pub(super) fn on_batch(&mut self, from: RobotId, batch: HeldBatch) {
        let is_neighbour = self.compares_with(from);
        let author = batch.robot;
        // In another's name, whom nobody would believe that passes it on.
        if !batch.samples.are_by(author) {
            return self.rounds.note_refusal(Refusal::Impossible);
        }
        let Some(learning) = &mut self.learning else { return };
        if self.contradictions.len() < MAX_CONTRADICTIONS
            && let Some(held) = learning.contradicted(&batch)
        {
            self.contradictions.push((held.clone(), batch.clone()));
        }
        let (mut news, mut refused) = (false, Vec::new());
        let space = batch.samples.space;
        for sample in &batch.samples.samples {
            match learning.receive(space, sample) {
                Ok(new) => news |= new,
                Err(declined) => refused.push((sample, declined)),
            }
        }
        // Of many lives of its author there may be room for this one since one of them was taken in.
        let is_refused = |(sample, declined): &mut (&SharedSample, Declined)| {
            *declined != Declined::Number || learning.receive(space, sample).is_err()
        };
        if news {
            refused.retain_mut(is_refused);
        }
        for (sample, declined) in refused {
            if is_neighbour {
                self.exchanges.decline(from, sample.id);
            }
            self.rounds.note_refusal(match declined {
                Declined::Vector(VectorError::Space { .. }) => Refusal::OtherSpace,
                Declined::Vector(_) => Refusal::BadVector,
                Declined::Class => Refusal::UnknownClass,
                Declined::Number => Refusal::SampleNumber,
            });
        }
        if news {
            learning.keep_batch(batch);
        }
        if news && author != from {
            // The other neighbours may lack it too.
            self.rounds.pass_on_soon(from);
        }
    }

    /// Whether that robot is answered: a neighbour, and not too often. Whoever asks in the name of another brings no flood
    /// upon it.
    fn may_answer(&mut self, from: RobotId) -> bool {
        let refusal = if !self.compares_with(from) {
            Refusal::Stranger
        } else if self.exchanges.allowance(self.rounds.now(), from) == 0 {
            Refusal::TooOften
        } else {
            return true;
        };
        self.rounds.note_refusal(refusal);
        false
    }

    /// Whether that robot is one to compare knowledge with: a neighbour, or anyone while none is known.
    fn compares_with(&self, robot: RobotId) -> bool {
        let mut neighbours = self.rounds.neighbours();
        neighbours.len() == 0 || neighbours.any(|neighbour| neighbour == robot)
    }

    /// What was declined may be taken now.
    pub(super) fn ask_again_for_lessons(&mut self) {
        if self.exchanges.forget_declined_lessons()
            && let Some(learning) = &mut self.learning
        {
            learning.ask_again();
        }
    }

    /// Takes in what instructors said and this robot had not heard.
    pub(super) fn on_lessons(&mut self, from: RobotId, lessons: &[Lesson]) {
        let is_neighbour = self.compares_with(from);
        let Some(learning) = &mut self.learning else { return };
        let (mut news, mut unproven) = (false, 0);
        for of_round in lessons.chunk_by(|a, b| a.round == b.round) {
            if unproven >= MAX_UNPROVEN {
                break;
            }
            let mut refused = false;
            for lesson in of_round {
                match learning.hear(lesson) {
                    LessonReceipt::New => news = true,
                    LessonReceipt::Known => {}
                    LessonReceipt::Full => {
                        refused = true;
                        self.rounds.note_refusal(Refusal::LessonFull);
                    }
                    LessonReceipt::FarAhead => {
                        refused = true;
                        self.rounds.note_refusal(Refusal::LessonFarAhead);
                    }
                    LessonReceipt::Unproven => {
                        (refused, unproven) = (true, unproven + 1);
                        self.rounds.note_refusal(Refusal::LessonUnproven);
                    }
                }
            }
            if refused && is_neighbour {
                self.exchanges.decline_lessons(from, of_round.iter());
            }
        }
        if news {
            self.rounds.pass_on_soon(from);
            self.share();
        }
    }
}
