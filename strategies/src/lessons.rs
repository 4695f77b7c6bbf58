//! What instructors said of which round: one latest word per instructor and round, so that what is heard twice, late
//! or in another order comes to the same.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::hash::Hasher;

use gestalt_protocol::{ClassId, InstructorId, Lesson, MAX_LESSONS, RobotId, RoundId, SignedWord, Word};
use siphasher::sip::SipHasher24;

use crate::believe::Standing;
use crate::candidates::Candidates;

/// The most instructors of one round: beyond, those of the higher standing are kept; of these the first by name, so that all robots keep the same. In an open
/// swarm it is who was heard of first, on whatever round: names made up later lock nobody out.
pub(crate) const MAX_INSTRUCTORS: usize = 16;

/// The most instructors of whom it is known who was heard of first.
const MAX_FAMILIAR: usize = 256;

/// How far a count that nobody signed may lie beyond the highest known on its round: nobody says so much that others hear none of it.
const COUNT_LEAP: u64 = 1 << 32;

/// The highest such count taken in on a round of which nothing is known. There are as many beyond it.
const FIRST_COUNT: u64 = u64::MAX / 2;

/// What an instructor said of a round, and by which right.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Said {
    standing: Standing,
    count: u64,
    at: u64,
    word: Word,
    proof: Option<SignedWord>,
}

impl Said {
    fn new(lesson: &Lesson, standing: Standing) -> Self {
        let Lesson { count, at, word, said: ref proof, .. } = *lesson;
        Self { standing, count, at, word, proof: proof.clone() }
    }

    /// Of one instructor's words the greatest counts; what is proven before what is not.
    fn order(&self) -> (bool, u64, u64, Word) {
        (self.is_proven(), self.count, self.at, self.word)
    }

    fn is_proven(&self) -> bool {
        self.standing > Standing::Unproven
    }

    /// Whether an instructor with a key said it.
    fn is_signed(&self) -> bool {
        self.standing > Standing::Vouched
    }

    fn of(&self, round: RoundId, instructor: &InstructorId) -> Lesson {
        let Self { count, at, word, proof, .. } = self;
        Lesson {
            round,
            instructor: instructor.clone(),
            count: *count,
            at: *at,
            word: *word,
            said: proof.clone(),
        }
    }
}

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
    /// Nothing shows that its instructor said that, or may.
    Unproven,
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
    /// Takes in one lesson, as in an open swarm. Of two words of one count and time the greater counts, so that all robots keep the same.
    pub fn hear(&mut self, lesson: &Lesson) -> LessonReceipt {
        self.hear_among(self.highest_count([lesson.round]), lesson, None, |_| false).0
    }

    /// The same for a robot that lived through some rounds: rounds of which somebody with a key spoke are kept before others, and of these those it lived through, so
    /// that made-up rounds keep nobody from teaching. Says also which round was forgotten for it. `known` is the highest count known of its round, by whichever
    /// name. In a sealed swarm a word has a `standing`, and its count was signed.
    pub fn hear_among(
        &mut self,
        known: u64,
        lesson: &Lesson,
        standing: Option<Standing>,
        lived: impl Fn(RoundId) -> bool,
    ) -> (LessonReceipt, Option<RoundId>) {
        let highest = if known == 0 { FIRST_COUNT } else { known.saturating_add(COUNT_LEAP) };
        if standing.is_none() && lesson.count > highest {
            return (LessonReceipt::FarAhead, None);
        }
        self.take_in(lesson, standing, lived)
    }

    /// Takes in what this robot knew before, whatever its count.
    pub(crate) fn hear_again(&mut self, lesson: &Lesson) {
        self.take_in(lesson, None, |_| false);
    }

    fn take_in(
        &mut self,
        lesson: &Lesson,
        standing: Option<Standing>,
        lived: impl Fn(RoundId) -> bool,
    ) -> (LessonReceipt, Option<RoundId>) {
        let said = Said::new(lesson, standing.unwrap_or(Standing::Overrules));
        let (mut replaced, mut forgotten) = (None, None);
        match self.rounds.get(&lesson.round) {
            Some(words) => match words.get(&lesson.instructor) {
                Some(known) if known.order() >= said.order() => return (LessonReceipt::Known, None),
                None if words.len() >= MAX_INSTRUCTORS => {
                    let familiarity = |name| if standing.is_none() { self.familiarity(name) } else { 0 };
                    let new = (&lesson.instructor, &said);
                    let last = words
                        .iter()
                        .chain([new])
                        .max_by_key(|(name, said)| (Reverse(said.standing), familiarity(name), *name));
                    match last {
                        Some((name, _)) if *name != lesson.instructor => replaced = Some(name.clone()),
                        _ => return (LessonReceipt::Full, None),
                    }
                }
                _ => {}
            },
            None if self.rounds.len() >= MAX_LESSONS => {
                let place = |round, signed: bool| (signed, lived(round), round);
                let known = self.rounds.iter();
                let known = known.map(|(round, words)| place(*round, words.values().any(Said::is_signed)));
                let last = known.min().filter(|last| *last < place(lesson.round, said.is_signed()));
                let Some((_, _, last)) = last else { return (LessonReceipt::Full, None) };
                self.forget(last);
                forgotten = Some(last);
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
    fn familiarity(&self, instructor: &InstructorId) -> usize {
        self.familiar.get(instructor).copied().unwrap_or(MAX_FAMILIAR)
    }

    /// Whether that lesson, or a later one of the same instructor, is known and can be shown to others.
    pub(crate) fn is_known(&self, lesson: &Lesson) -> bool {
        let known = self.rounds.get(&lesson.round).and_then(|words| words.get(&lesson.instructor));
        known.is_some_and(|known| {
            known.is_proven() && (known.count, known.at, known.word) >= (lesson.count, lesson.at, lesson.word)
        })
    }

    /// Asks anew by which right each word was said; gives the rounds of which a word has another standing now.
    pub(crate) fn judge_again(&mut self, standing: impl Fn(&Lesson) -> Standing) -> Vec<RoundId> {
        let mut changed = Vec::new();
        for (round, words) in &mut self.rounds {
            for (instructor, said) in words {
                let now = standing(&said.of(*round, instructor));
                if std::mem::replace(&mut said.standing, now) != now && changed.last() != Some(round) {
                    changed.push(*round);
                }
            }
        }
        changed
    }

    /// The highest count of any word on a round, by all its names; 0 if there is none.
    #[must_use]
    pub fn highest_count(&self, names: impl IntoIterator<Item = RoundId>) -> u64 {
        let words = names.into_iter().filter_map(|name| self.rounds.get(&name)).flatten();
        words.map(|(_, said)| said.count).max().unwrap_or(0)
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

    /// What all that was said of a round comes to, where these are the gestures there are. Words of the highest standing count. Where instructors who may
    /// overrule contradict each other, the latest word counts alone; of those who may not, the earliest that stands does.
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
        let words = self.by_instructor(names);
        if words.is_empty() {
            return Verdict::Unsaid;
        }
        let leading = leading(&words);
        let Some((_, latest)) = leading.last() else { return Verdict::Retracted };
        // What was shown has a name, also where nobody uses that any more, or this robot has not heard of it.
        let named = |said: &Said| match said.word {
            Word::Was(class) if class.is_named() => Some(class),
            _ => None,
        };
        // By what gestures are now, somebody said the same later: it says nothing more until they are told apart again.
        let is_said_again = |place: usize, said: &Said| {
            leading[place + 1..].iter().any(|(_, later)| match (said.word, later.word) {
                (Word::Was(one), Word::Was(other)) => classes.are_one(one, other),
                _ => false,
            })
        };
        let mut candidates = classes.clone();
        candidates.classes.extend(leading.iter().filter_map(|(_, said)| named(said)));
        for (place, (_, said)) in leading.iter().enumerate() {
            if !is_said_again(place, said) {
                candidates.restrict(said.word);
            }
        }
        if candidates.classes.is_empty() {
            candidates = classes.clone();
            candidates.classes.extend(named(latest));
            candidates.restrict(latest.word);
        }
        match candidates.only() {
            Some(class) => Verdict::Class(class),
            None if candidates.classes.is_empty() => Verdict::Unsaid,
            None => Verdict::Among(candidates),
        }
    }

    /// Whether what that instructor said of a round that has several names counts there: not where somebody else's word goes before it.
    #[must_use]
    pub fn is_heeded(&self, names: impl IntoIterator<Item = RoundId>, instructor: &InstructorId) -> bool {
        let words = self.by_instructor(names);
        leading(&words).iter().any(|(name, _)| *name == instructor)
    }

    /// Whether a word of that standing, by that instructor, comes after one that counts: who may not overrule says what was shown where nobody else has. Asked
    /// when it is said, for what is said of when that was is its instructor's own.
    #[must_use]
    pub fn is_preceded(
        &self,
        names: impl IntoIterator<Item = RoundId>,
        instructor: &InstructorId,
        standing: Standing,
    ) -> bool {
        let words = self.by_instructor(names);
        let first = leading(&words);
        let goes_before = |(name, said): &(&InstructorId, &Said)| {
            *name != instructor && said.is_proven() && said.standing >= standing
        };
        standing < Standing::Overrules && !first.is_empty() && first.iter().all(goes_before)
    }

    /// The latest word of each instructor on a round that has several names.
    fn by_instructor(&self, names: impl IntoIterator<Item = RoundId>) -> BTreeMap<&InstructorId, &Said> {
        let mut words: BTreeMap<&InstructorId, &Said> = BTreeMap::new();
        for (instructor, said) in names.into_iter().filter_map(|name| self.rounds.get(&name)).flatten() {
            let known = words.entry(instructor).or_insert(said);
            if known.order() < said.order() {
                *known = said;
            }
        }
        words
    }

    /// Every lesson about a round, the latest first: who takes that in takes in the others.
    pub fn of(&self, round: RoundId) -> impl Iterator<Item = Lesson> + '_ {
        self.those_of(round, |_| true)
    }

    /// Those of them that can be shown to others.
    pub fn told_of(&self, round: RoundId) -> impl Iterator<Item = Lesson> + '_ {
        self.those_of(round, Said::is_proven)
    }

    fn those_of(
        &self,
        round: RoundId,
        is_wanted: impl Fn(&Said) -> bool,
    ) -> impl Iterator<Item = Lesson> + '_ {
        let words = self.rounds.get(&round).into_iter().flatten().filter(|(_, said)| is_wanted(said));
        let mut lessons: Vec<Lesson> = words.map(|(instructor, said)| said.of(round, instructor)).collect();
        lessons.sort_by_key(|lesson| Reverse(lesson.count));
        lessons.into_iter()
    }

    /// The latest word of one instructor on a round that has several names, with its count and time.
    #[must_use]
    pub fn latest(
        &self,
        names: impl IntoIterator<Item = RoundId>,
        instructor: &InstructorId,
    ) -> Option<(u64, u64, Word)> {
        let words = names.into_iter().filter_map(|name| self.rounds.get(&name)?.get(instructor));
        words.max_by_key(|said| said.order()).map(|said| (said.count, said.at, said.word))
    }

    /// The rounds of which something is known that can be shown to others, each with a digest of what under that key.
    pub fn rounds(&self, key: u64) -> impl Iterator<Item = (RoundId, u64)> + '_ {
        let told = self.rounds.iter().filter(|(_, words)| words.values().any(Said::is_proven));
        told.map(move |(round, _)| (*round, self.digest_of(*round, key)))
    }

    /// The rounds of which anything is known.
    pub(crate) fn all_rounds(&self) -> impl Iterator<Item = RoundId> + '_ {
        self.rounds.keys().copied()
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

    /// Whether an instructor with a key spoke of a round; in an open swarm everybody counts for one.
    pub(crate) fn is_signed(&self, round: RoundId) -> bool {
        self.rounds.get(&round).is_some_and(|words| words.values().any(Said::is_signed))
    }

    /// The rounds under that count of which something is known.
    pub fn under(&self, counter: u32) -> impl Iterator<Item = RoundId> + '_ {
        let name = |most| RoundId { counter, opener: RobotId(most), life: most };
        self.rounds.range(name(0)..=name(u32::MAX)).map(|(round, _)| *round)
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

    /// A digest of everything that can be shown to others under a key: the same lessons, heard in whatever order, give the same.
    #[must_use]
    pub fn digest(&self, key: u64) -> u64 {
        self.rounds(key).fold(0, |digest, (_, of_round)| digest ^ of_round)
    }

    /// The same of one round, 0 for nothing.
    #[must_use]
    pub fn digest_of(&self, round: RoundId, key: u64) -> u64 {
        let words = self.rounds.get(&round).into_iter().flatten().filter(|(_, said)| said.is_proven());
        let mut words = words.peekable();
        if words.peek().is_none() {
            return 0;
        }
        let mut sip = SipHasher24::new_with_keys(key, u64::from_le_bytes(*b"lessons "));
        [round.counter, round.opener.0, round.life].iter().for_each(|part| sip.write(&part.to_le_bytes()));
        for (instructor, Said { count, at, word, .. }) in words {
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

/// The words that count, by when they were said: of those that were not taken back, the ones of the highest standing. Who may not overrule is heard where
/// nobody else has spoken: of several such the earliest is the one.
fn leading<'a>(words: &BTreeMap<&'a InstructorId, &'a Said>) -> Vec<(&'a InstructorId, &'a Said)> {
    let valid = words.iter().filter(|(_, said)| said.word != Word::Retracted);
    let Some(standing) = valid.clone().map(|(_, said)| said.standing).max() else { return Vec::new() };
    let of_that = valid.filter(|(_, said)| said.standing == standing);
    let mut leading: Vec<_> = of_that.map(|(name, said)| (*name, *said)).collect();
    leading.sort_by_key(|(_, said)| said.order());
    if matches!(standing, Standing::Vouched | Standing::Teaches) {
        leading.truncate(1);
    }
    leading
}

#[cfg(test)]
mod tests;
