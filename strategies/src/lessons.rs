//! What instructors said of which round: one latest word per instructor and round, so that what is heard twice, late
//! or in another order comes to the same.

use std::collections::BTreeMap;
use std::hash::Hasher;

use gestalt_protocol::{ClassId, InstructorId, Lesson, MAX_LESSONS, RoundId, Word};
use siphasher::sip::SipHasher24;

use crate::candidates::Candidates;

/// The most instructors of one round: beyond, those who were heard of first, on whatever round, are kept. Names made up
/// later lock nobody out.
pub(crate) const MAX_INSTRUCTORS: usize = 16;

/// The most instructors of whom it is known who was heard of first.
const MAX_FAMILIAR: usize = 256;

/// How far a count may lie beyond the highest known on its round: nobody says so much that others hear none of it.
const COUNT_LEAP: u64 = 1 << 32;

/// The highest count taken in on a round of which nothing is known. There are as many beyond it.
const FIRST_COUNT: u64 = u64::MAX / 2;

/// The count, the time and the word of an instructor on a round; the greatest counts.
type Said = (u64, u64, Word);

/// Which gestures a round may have shown, by all that was said of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nobody said anything.
    Unsaid,
    /// It was this one.
    Class(ClassId),
    /// It was one of several.
    Among(Candidates),
    /// All that was said was taken back.
    Retracted,
}

/// What came of a lesson.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LessonReceipt {
    /// It changed what is known.
    New,
    /// It, or a later word of the same instructor, was known.
    Known,
    /// There is no room: more instructors of one round than are kept, or a round older than all kept.
    Full,
    /// Its round, or its count, lies too far ahead of all that is known.
    FarAhead,
}

/// What every instructor said of every round, as far as it is kept: the latest [`MAX_LESSONS`] rounds, of each the words of
/// 16 instructors.
#[derive(Clone, Debug, Default)]
pub struct LessonBook {
    rounds: BTreeMap<RoundId, BTreeMap<InstructorId, Said>>,
    /// In which order the first [`MAX_FAMILIAR`] instructors were heard of.
    familiar: BTreeMap<InstructorId, usize>,
}

impl LessonBook {
    /// Takes in one lesson. Of two words of one count and time the greater counts, so that all robots keep the same.
    pub fn hear(&mut self, lesson: &Lesson) -> LessonReceipt {
        self.hear_among(lesson, |_| false).0
    }

    /// The same for a robot that lived through some rounds: words on those are taken in before words on others, so that
    /// made-up rounds keep nobody from teaching. Says also which round was forgotten for it.
    pub fn hear_among(
        &mut self,
        lesson: &Lesson,
        lived: impl Fn(RoundId) -> bool,
    ) -> (LessonReceipt, Option<RoundId>) {
        let said = (lesson.count, lesson.at, lesson.word);
        let highest = match self.highest_count([lesson.round]) {
            0 => FIRST_COUNT,
            known => known.saturating_add(COUNT_LEAP),
        };
        if lesson.count > highest {
            return (LessonReceipt::FarAhead, None);
        }
        let (mut replaced, mut forgotten) = (None, None);
        match self.rounds.get(&lesson.round) {
            Some(words) => match words.get(&lesson.instructor) {
                Some(known) if *known >= said => return (LessonReceipt::Known, None),
                None if words.len() >= MAX_INSTRUCTORS => {
                    let latest = words.keys().max_by_key(|name| self.standing(name)).cloned();
                    if latest.as_ref().is_some_and(|l| self.standing(l) <= self.standing(&lesson.instructor))
                    {
                        return (LessonReceipt::Full, None);
                    }
                    replaced = latest;
                }
                _ => {}
            },
            None if self.rounds.len() >= MAX_LESSONS => {
                let strange = self.rounds.keys().find(|round| !lived(**round)).copied();
                let gives_way = match strange.or(self.oldest()) {
                    Some(strange) if lived(lesson.round) || strange < lesson.round => strange,
                    _ => return (LessonReceipt::Full, None),
                };
                self.forget(gives_way);
                forgotten = Some(gives_way);
            }
            None => {}
        }
        let words = self.rounds.entry(lesson.round).or_default();
        if let Some(replaced) = replaced {
            words.remove(&replaced);
        }
        words.insert(lesson.instructor.clone(), said);
        if self.familiar.len() < MAX_FAMILIAR {
            let next = self.familiar.len();
            self.familiar.entry(lesson.instructor.clone()).or_insert(next);
        }
        (LessonReceipt::New, forgotten)
    }

    /// The smaller, the longer that instructor is known.
    fn standing(&self, instructor: &InstructorId) -> usize {
        self.familiar.get(instructor).copied().unwrap_or(MAX_FAMILIAR)
    }

    /// The highest count of any word on a round, by all its names; 0 if there is none.
    #[must_use]
    pub fn highest_count(&self, names: impl IntoIterator<Item = RoundId>) -> u64 {
        let words = names.into_iter().filter_map(|name| self.rounds.get(&name)).flatten();
        words.map(|(_, (count, ..))| *count).max().unwrap_or(0)
    }

    /// Forgets what was said of rounds with higher counters; says of which.
    pub(crate) fn forget_beyond(&mut self, counter: u32) -> Vec<RoundId> {
        let beyond = |round: &&RoundId| round.counter > counter;
        let rounds: Vec<RoundId> = self.rounds.keys().rev().take_while(beyond).copied().collect();
        rounds.iter().for_each(|round| self.forget(*round));
        rounds
    }

    pub(crate) fn forget_oldest(&mut self) {
        if let Some(oldest) = self.oldest() {
            self.forget(oldest);
        }
    }

    /// Forgets what was said of a round.
    pub(crate) fn forget(&mut self, round: RoundId) {
        self.rounds.remove(&round);
    }

    /// What all that was said of a round comes to, where these are the gestures there are. Where instructors contradict
    /// each other the latest word counts alone.
    #[must_use]
    pub fn verdict(&self, round: RoundId, classes: &Candidates) -> Verdict {
        self.verdict_by_names([round], classes)
    }

    /// The same of a round that has several names: of what an instructor said under any of them, the latest counts.
    #[must_use]
    pub fn verdict_by_names(
        &self,
        names: impl IntoIterator<Item = RoundId>,
        classes: &Candidates,
    ) -> Verdict {
        let mut words: BTreeMap<&InstructorId, Said> = BTreeMap::new();
        for (instructor, said) in names.into_iter().filter_map(|name| self.rounds.get(&name)).flatten() {
            words.entry(instructor).and_modify(|known| *known = *said.max(known)).or_insert(*said);
        }
        if words.is_empty() {
            return Verdict::Unsaid;
        }
        let valid = words.values().filter(|(.., word)| *word != Word::Retracted);
        let Some((.., latest)) = valid.clone().max() else { return Verdict::Retracted };
        // What was shown has a name, also where nobody uses that any more, or this robot has not heard of it.
        let named = match latest {
            Word::Was(class) if class.is_named() => Some(*class),
            _ => None,
        };
        let mut candidates = classes.clone();
        candidates.0.extend(named);
        valid.for_each(|(.., word)| candidates.restrict(*word));
        if candidates.0.is_empty() {
            candidates = classes.clone();
            candidates.0.extend(named);
            candidates.restrict(*latest);
        }
        match candidates.only() {
            Some(class) => Verdict::Class(class),
            None if candidates.0.is_empty() => Verdict::Unsaid,
            None => Verdict::Among(candidates),
        }
    }

    /// Every lesson about a round, the latest first: who takes that in takes in the others.
    pub fn of(&self, round: RoundId) -> impl Iterator<Item = Lesson> + '_ {
        let mut lessons: Vec<Lesson> = self.all_of(round).collect();
        lessons.sort_by_key(|lesson| std::cmp::Reverse(lesson.count));
        lessons.into_iter()
    }

    fn all_of(&self, round: RoundId) -> impl Iterator<Item = Lesson> + '_ {
        self.rounds.get(&round).into_iter().flatten().map(move |(instructor, (count, at, word))| Lesson {
            round,
            instructor: instructor.clone(),
            count: *count,
            at: *at,
            word: *word,
        })
    }

    /// The latest word of one instructor on a round that has several names, with its count and time.
    #[must_use]
    pub fn latest(
        &self,
        names: impl IntoIterator<Item = RoundId>,
        instructor: &InstructorId,
    ) -> Option<(u64, u64, Word)> {
        let words = names.into_iter().filter_map(|name| self.rounds.get(&name)?.get(instructor));
        words.max().copied()
    }

    /// The rounds of which something is known, each with a digest of what under that key.
    pub fn rounds(&self, key: u64) -> impl Iterator<Item = (RoundId, u64)> + '_ {
        self.rounds.keys().map(move |round| (*round, self.digest_of(*round, key)))
    }

    /// The oldest round of which something is known.
    #[must_use]
    pub fn oldest(&self) -> Option<RoundId> {
        self.rounds.keys().next().copied()
    }

    /// Whether anything is known of a round.
    #[must_use]
    pub fn contains(&self, round: RoundId) -> bool {
        self.rounds.contains_key(&round)
    }

    /// Of how many rounds something is known.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rounds.len()
    }

    /// Whether nothing is known of any.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rounds.is_empty()
    }

    /// A digest of everything under a key: the same lessons, heard in whatever order, give the same.
    #[must_use]
    pub fn digest(&self, key: u64) -> u64 {
        self.rounds(key).fold(0, |digest, (_, of_round)| digest ^ of_round)
    }

    /// The digest of what is known of one round under a key, 0 for nothing.
    #[must_use]
    pub fn digest_of(&self, round: RoundId, key: u64) -> u64 {
        let Some(words) = self.rounds.get(&round) else { return 0 };
        let mut sip = SipHasher24::new_with_keys(key, u64::from_le_bytes(*b"lessons "));
        [round.counter, round.opener.0, round.life].iter().for_each(|part| sip.write(&part.to_le_bytes()));
        for (instructor, (count, at, word)) in words {
            let (kind, class) = match word {
                Word::Was(class) => (1_u8, class.0),
                Word::Not(class) => (2, class.0),
                Word::Retracted => (3, 0),
            };
            let name = instructor.to_string();
            sip.write(&[name.len() as u8]);
            sip.write(name.as_bytes());
            [count, at].into_iter().for_each(|when| sip.write(&when.to_le_bytes()));
            sip.write(&[kind]);
            sip.write(&class.to_le_bytes());
        }
        sip.finish()
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;
    use proptest::prelude::*;

    use super::*;

    fn lesson(counter: u32, who: &str, count: u64, word: Word) -> Lesson {
        let round = RoundId { counter, opener: RobotId(1), life: 0 };
        Lesson { round, instructor: who.parse().unwrap(), count, at: 7, word }
    }

    fn six() -> Candidates {
        Candidates::of((0..6).map(ClassId))
    }

    fn was(class: u32) -> Word {
        Word::Was(ClassId(class))
    }

    fn not(class: u32) -> Word {
        Word::Not(ClassId(class))
    }

    fn verdict(words: &[(&str, u64, Word)]) -> Verdict {
        let mut book = LessonBook::default();
        for (who, at, word) in words {
            book.hear(&lesson(1, who, *at, *word));
        }
        book.verdict(RoundId { counter: 1, opener: RobotId(1), life: 0 }, &six())
    }

    #[test]
    fn words_add_up_and_the_latest_settles_a_contradiction() {
        let class = |class| Verdict::Class(ClassId(class));
        assert_eq!(verdict(&[]), Verdict::Unsaid);
        assert_eq!(verdict(&[("ada", 1, was(3))]), class(3));
        assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, was(4))]), class(4));
        assert_eq!(verdict(&[("ada", 1, was(3)), ("bob", 2, was(4))]), class(4));
        assert_eq!(verdict(&[("ada", 1, was(3)), ("bob", 2, not(4))]), class(3), "no contradiction");
        assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, Word::Retracted)]), Verdict::Retracted);
        assert_eq!(verdict(&[("ada", 1, was(3)), ("ada", 2, Word::Retracted), ("bob", 1, was(2))]), class(2));
        let Verdict::Among(candidates) = verdict(&[("ada", 1, not(3)), ("bob", 2, not(5))]) else {
            panic!("not one alone")
        };
        let left: Vec<u32> = (0..8).filter(|class| candidates.contains(ClassId(*class))).collect();
        assert_eq!(left, [0, 1, 2, 4]);
        let four = [("a", 1, not(0)), ("b", 1, not(1)), ("c", 1, not(2)), ("d", 1, not(3)), ("e", 1, not(5))];
        assert_eq!(verdict(&four), class(4), "only one is left");
    }

    proptest! {
        #[test]
        fn the_order_and_repetition_of_lessons_make_no_difference(
            lessons in prop::collection::vec((0..4_u32, 0..3_usize, 0..5_u64, 0..3_u32, any::<bool>()), 0..40),
            order in any::<prop::sample::Index>(),
        ) {
            let lessons: Vec<Lesson> = lessons
                .into_iter()
                .map(|(round, who, at, class, is)| {
                    lesson(round, ["ada", "bob", "cyn"][who], at, if is { was(class) } else { not(class) })
                })
                .collect();
            let mut forwards = LessonBook::default();
            lessons.iter().for_each(|lesson| { forwards.hear(lesson); });
            let mut turned = LessonBook::default();
            let middle = order.index(lessons.len() + 1);
            let twice = lessons[middle..].iter().chain(&lessons[..middle]).rev().chain(&lessons);
            twice.for_each(|lesson| { turned.hear(lesson); });
            prop_assert_eq!(forwards.digest(7), turned.digest(7));
            prop_assert_eq!(forwards.rounds, turned.rounds);
        }
    }

    #[test]
    fn the_oldest_rounds_are_forgotten_and_not_taken_up_again() {
        let mut book = LessonBook::default();
        for counter in 0..MAX_LESSONS as u32 + 10 {
            assert_eq!(book.hear(&lesson(counter + 5, "ada", 1, was(1))), LessonReceipt::New);
        }
        assert_eq!(book.len(), MAX_LESSONS);
        assert_eq!(book.hear(&lesson(1, "ada", 1, was(1))), LessonReceipt::Full);
        let mut fresh = LessonBook::default();
        book.rounds.keys().for_each(|round| {
            fresh.hear(&lesson(round.counter, "ada", 1, was(1)));
        });
        assert_eq!(book.digest(7), fresh.digest(7), "the digest is of what is kept");
    }

    #[test]
    fn a_round_has_only_so_many_instructors_and_none_heard_before_is_locked_out() {
        let mut book = LessonBook::default();
        assert_eq!(book.hear(&lesson(1, "ada", 1, was(1))), LessonReceipt::New);
        for i in 0..MAX_INSTRUCTORS {
            assert_eq!(book.hear(&lesson(2, &format!("i{i}"), 1, was(1))), LessonReceipt::New);
        }
        assert_eq!(book.hear(&lesson(2, "one-more", 1, was(1))), LessonReceipt::Full);
        assert_eq!(
            book.hear(&lesson(2, "i3", 2, was(2))),
            LessonReceipt::New,
            "who is known may speak again"
        );
        assert_eq!(book.hear(&lesson(2, "ada", 3, was(4))), LessonReceipt::New, "the newest name gives way");
        let round = lesson(2, "ada", 1, was(1)).round;
        assert_eq!(book.of(round).count(), MAX_INSTRUCTORS);
        assert_eq!(book.verdict(round, &six()), Verdict::Class(ClassId(4)));
        for i in 0..2 * MAX_FAMILIAR {
            book.hear(&lesson(3 + i as u32 / 10, &format!("flood{i}"), 1, was(1)));
        }
        assert_eq!(book.familiar.len(), MAX_FAMILIAR);
    }

    #[test]
    fn no_word_is_beyond_correction() {
        let mut book = LessonBook::default();
        let round = lesson(1, "ada", 1, was(1)).round;
        assert_eq!(book.hear(&lesson(1, "ada", u64::MAX, Word::Retracted)), LessonReceipt::FarAhead);
        // As far as may be, and at a time that no clock comes to.
        for _ in 0..100 {
            let count = book.highest_count([round]) + COUNT_LEAP;
            let forged = Lesson { at: u64::MAX, ..lesson(1, "ada", count, Word::Retracted) };
            assert_eq!(book.hear(&forged), LessonReceipt::New);
            let count = book.highest_count([round]) + 1;
            assert_eq!(book.hear(&lesson(1, "ada", count, was(2))), LessonReceipt::New);
            assert_eq!(book.verdict(round, &six()), Verdict::Class(ClassId(2)));
        }
    }

    #[test]
    fn made_up_rounds_keep_nobody_from_teaching() {
        let mut book = LessonBook::default();
        let lived = |round: RoundId| round.life == 0;
        let made_up = |i: u32| {
            let round = RoundId { counter: 9, opener: RobotId(u32::MAX), life: 1 + i };
            Lesson { round, ..lesson(9, "eve", 1, was(1)) }
        };
        for i in 0..2 * MAX_LESSONS as u32 {
            book.hear_among(&made_up(i), lived);
        }
        assert_eq!(book.len(), MAX_LESSONS);
        for counter in 1..9 {
            assert_eq!(book.hear_among(&lesson(counter, "ada", 1, was(3)), lived).0, LessonReceipt::New);
        }
        for i in 0..2 * MAX_LESSONS as u32 {
            book.hear_among(&made_up(u32::MAX / 2 + i), lived);
        }
        assert_eq!(book.len(), MAX_LESSONS);
        assert!((1..9).all(|counter| book.contains(lesson(counter, "ada", 1, was(3)).round)));
    }
}
