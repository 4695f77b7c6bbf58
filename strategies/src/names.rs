//! Gestures that instructors named while the swarm works: one latest word on each, so that what is heard twice, late or in another order comes to the
//! same.

mod merged;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::Hasher;

use gestalt_protocol::{ClassId, Fate, Instruction, InstructorId, MAX_NAMED, Naming};
use siphasher::sip::SipHasher24;

use gestalt_rounds::Called;

use crate::believe::Standing;

/// How far a count that nobody signed may lie beyond the highest known of its gesture: nobody says so much that others hear none of it.
const COUNT_LEAP: u64 = 1 << 32;

/// The highest such count taken in on a gesture that is known, however far beyond. The counts of a sealed swarm are times, which lie below it until 2038: what was
/// named there is heard where that swarm was opened.
const HIGHEST_COUNT: u64 = u64::MAX / 2;

/// The highest on a gesture of which nothing is known: whoever comes later takes in what others say after a forged word.
const FIRST_COUNT: u64 = u64::MAX / 4 * 3;

/// What came of a word on a gesture that was named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamingReceipt {
    /// It changed what is known.
    New,
    /// It, or a later word on the same gesture, was known.
    Known,
    /// There is no room: as many gestures that go before it are kept as can be.
    Full,
    /// Its count lies too far ahead of all that is known.
    FarAhead,
    /// Nothing shows that who is said to have said it did, or may.
    Unproven,
}

/// All gestures that were named, with what became of each: at most [`MAX_NAMED`]. Those that somebody with a key spoke of go before others. Of these the first
/// of each who named any go before the second ones and so on, by their numbers: so all robots keep the same, whoever may only vouch makes nobody else's give
/// way, and whoever names ever so many makes most of its own do so, also where all of them are retired.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NameBook {
    namings: BTreeMap<ClassId, Said>,
}

/// The latest word on a gesture, and by which right it was said.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Said {
    naming: Naming,
    standing: Standing,
    /// The signed word by which it was named, if the latest is another: without it, whoever was away believes none that came later.
    first: Option<Box<Naming>>,
}

impl Said {
    fn is_proven(&self) -> bool {
        self.standing > Standing::Unproven
    }
}

impl NameBook {
    /// Takes in what was said of a gesture, as in an open swarm. Of two words of one count and time the greater counts.
    pub fn hear(&mut self, naming: &Naming) -> NamingReceipt {
        self.hear_by(naming, None)
    }

    /// The same in a sealed swarm, where a word has a `standing` and its count was signed.
    pub(crate) fn hear_by(&mut self, naming: &Naming, standing: Option<Standing>) -> NamingReceipt {
        let receipt = self.would_hear(naming, standing);
        if receipt == NamingReceipt::New {
            self.take_in(naming, standing);
        }
        receipt
    }

    /// Takes in a word that is [new](Self::would_hear). Gives the gesture that gives way to it, if one does.
    pub(crate) fn take_in(&mut self, naming: &Naming, standing: Option<Standing>) -> Option<ClassId> {
        self.put(naming, standing.unwrap_or(Standing::Overrules));
        let (.., last) = (self.namings.len() > MAX_NAMED).then(|| places(self.all()).pop())??;
        self.namings.remove(&last);
        Some(last)
    }

    fn put(&mut self, naming: &Naming, standing: Standing) {
        let before =
            self.namings.remove(&naming.gesture()).filter(|before| is_of_one(&before.naming, naming));
        let first = before.and_then(|Said { naming, first, .. }| {
            first.or_else(|| is_named_by(&naming).then(|| Box::new(naming)))
        });
        let said = Said { naming: naming.clone(), standing, first: first.filter(|_| !is_named_by(naming)) };
        self.namings.insert(naming.gesture(), said);
    }

    /// Whether a word names a gesture that is known by later ones alone.
    pub(crate) fn lacks_first(&self, naming: &Naming) -> bool {
        let known = self.namings.get(&naming.gesture()).filter(|known| is_of_one(&known.naming, naming));
        // A word is read last: the one that is known comes again and again.
        known.is_some_and(|known| {
            known.first.is_none() && known.naming != *naming && !is_named_by(&known.naming)
        }) && is_named_by(naming)
    }

    /// Keeps the word by which a gesture was named that is known by later ones alone.
    pub(crate) fn keep_first(&mut self, naming: &Naming) {
        if self.lacks_first(naming)
            && let Some(known) = self.namings.get_mut(&naming.gesture())
        {
            known.first = Some(Box::new(naming.clone()));
        }
    }

    /// The signed word by which a gesture was named, where the latest on it is another.
    pub(crate) fn first(&self, gesture: ClassId) -> Option<&Naming> {
        self.namings.get(&gesture)?.first.as_deref()
    }

    /// Whether a gesture is known that the same instructor named so.
    pub(crate) fn is_named(&self, naming: &Naming) -> bool {
        self.get(naming.gesture()).is_some_and(|known| is_of_one(known, naming))
    }

    /// What each of them takes its place by.
    fn all(&self) -> impl Iterator<Item = Candidate<'_>> {
        self.namings.iter().map(|(gesture, said)| (&said.naming.by, said.standing, *gesture))
    }

    /// Whether a gesture that is new would be the first to give way.
    fn would_be_last(&self, naming: &Naming, standing: Standing) -> bool {
        let (by, gesture) = (&naming.by, naming.gesture());
        places(self.all().chain([(by, standing, gesture)])).pop().is_some_and(|(.., last)| last == gesture)
    }

    /// What would come of it.
    pub(crate) fn would_hear(&self, naming: &Naming, standing: Option<Standing>) -> NamingReceipt {
        let gesture = naming.gesture();
        let known = self.namings.get(&gesture);
        let standing_here = standing.unwrap_or(Standing::Overrules);
        let highest = known
            .map_or(FIRST_COUNT, |known| known.naming.count.saturating_add(COUNT_LEAP).max(HIGHEST_COUNT));
        let rank = (right(standing_here), order(naming));
        if known.is_some_and(|known| (right(known.standing), order(&known.naming)) >= rank) {
            NamingReceipt::Known
        } else if standing.is_none() && naming.count > highest {
            NamingReceipt::FarAhead
        } else if known.is_none()
            && self.namings.len() >= MAX_NAMED
            && self.would_be_last(naming, standing_here)
        {
            NamingReceipt::Full
        } else {
            NamingReceipt::New
        }
    }

    /// Takes in what this robot knew before, whatever its count.
    pub(crate) fn hear_again(&mut self, naming: &Naming) {
        self.put(naming, Standing::Overrules);
    }

    /// Whether that word, or one that goes before it by whichever right it was said, is known and can be shown to others.
    pub(crate) fn is_known(&self, naming: &Naming) -> bool {
        let Some(known) = self.namings.get(&naming.gesture()) else { return false };
        // An earlier word goes before one that somebody without a key said.
        let by_right = right(known.standing) == Standing::Teaches;
        known.is_proven() && (known.naming == *naming || by_right && order(&known.naming) >= order(naming))
    }

    /// Asks anew by which right each word was said; gives the gestures on which a word has another standing now.
    pub(crate) fn judge_again(&mut self, standing: impl Fn(&Naming) -> Standing) -> Vec<ClassId> {
        let mut changed = Vec::new();
        for (gesture, said) in &mut self.namings {
            let now = standing(&said.naming);
            let before = std::mem::replace(&mut said.standing, now);
            changed.extend((before != now).then_some(*gesture));
        }
        changed
    }

    /// What is known of a gesture.
    #[must_use]
    pub fn get(&self, gesture: ClassId) -> Option<&Naming> {
        self.namings.get(&gesture).map(|said| &said.naming)
    }

    /// All of it, by number.
    pub fn iter(&self) -> impl Iterator<Item = &Naming> {
        self.namings.values().map(|said| &said.naming)
    }

    /// The words that others are to hear first, of those that can be shown to them.
    pub(crate) fn told_first(&self) -> impl Iterator<Item = &Naming> {
        self.namings.values().filter(|said| said.is_proven()).filter_map(|said| said.first.as_deref())
    }

    /// What of it can be shown to others.
    pub(crate) fn told(&self) -> impl Iterator<Item = &Naming> {
        self.namings.values().filter(|said| said.is_proven()).map(|said| &said.naming)
    }

    /// Whether nothing was named.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.namings.is_empty()
    }

    /// The gestures of their own, at most so many: those that go before the others.
    #[must_use]
    pub fn in_use(&self, room: usize) -> BTreeSet<ClassId> {
        places(self.all_in_use()).into_iter().take(room).map(|(.., gesture)| gesture).collect()
    }

    /// Whether that word leaves no more gestures in use than so many, or than there were, of those that do not give way to what is said by that right.
    pub(crate) fn has_room(&self, room: usize, naming: &Naming, standing: Option<Standing>) -> bool {
        let standing = standing.unwrap_or(Standing::Overrules);
        let mut after = self.clone();
        after.put(naming, standing);
        let beside = |book: &Self| {
            let in_use = book.all_in_use();
            in_use.filter(|(_, other, _)| right(*other) >= right(standing)).count()
        };
        beside(&after) <= room.max(beside(self))
    }

    fn all_in_use(&self) -> impl Iterator<Item = Candidate<'_>> {
        let now = self.all_stand_for();
        self.all().filter(move |(.., gesture)| now.get(gesture) == Some(&Some(*gesture)))
    }

    fn is_in_use(&self, gesture: ClassId) -> bool {
        self.stands_for(gesture) == Some(gesture)
    }

    /// The gesture that an instructor means by a label: `circle (ana)` is the one that ana named circle, `circle` the instructor's own, or else the
    /// only one of that label that is in use.
    #[must_use]
    pub fn find(&self, label: &str, by: &InstructorId) -> Option<ClassId> {
        let theirs = of_somebody(label).map(|(label, whose)| ClassId::named(&whose, label));
        let mut first = [theirs, Some(ClassId::named(by, label))].into_iter().flatten();
        if let Some(known) = first.find(|gesture| self.namings.contains_key(gesture)) {
            return Some(known);
        }
        self.only_in_use(label)
    }

    /// The gesture that an instructor means who says that it was shown: not what is retired, or merged into another, where there is one of that
    /// label that is in use, for that one is shown under it.
    #[must_use]
    pub fn find_shown(&self, label: &str, by: &InstructorId) -> Option<ClassId> {
        let found = self.find(label, by);
        found.filter(|gesture| self.is_in_use(*gesture)).or_else(|| self.only_in_use(label)).or(found)
    }

    fn only_in_use(&self, label: &str) -> Option<ClassId> {
        let of_label = self.namings.iter().filter(|(_, said)| said.naming.label == label);
        let mut of_label = of_label.map(|(gesture, _)| *gesture).filter(|gesture| self.is_in_use(*gesture));
        let only = of_label.next();
        only.filter(|_| of_label.next().is_none())
    }

    /// Whether an instructor can have meant that gesture by a label that is not of the list: whichever of those that bear it. One that nobody named was meant
    /// by nobody.
    pub(crate) fn can_mean(&self, label: &str, by: &InstructorId, gesture: ClassId) -> bool {
        let theirs = of_somebody(label).map(|(label, whose)| ClassId::named(&whose, label));
        self.get(gesture).is_some_and(|naming| {
            ClassId::named(by, label) == gesture || theirs == Some(gesture) || naming.label == label
        })
    }

    /// What each gesture is called: by its label, and where another in use, or of the list, has the same, or can be called so, by who named it too.
    /// One that is the same as another is called as that.
    #[must_use]
    pub fn titles(&self, listed: &[String]) -> BTreeMap<ClassId, String> {
        let now = self.all_stand_for();
        let mut times: BTreeMap<String, usize> = listed.iter().map(|label| (label.clone(), 1)).collect();
        for naming in now.iter().filter(|(of, now)| **now == Some(**of)).filter_map(|(of, _)| self.get(*of)) {
            for title in [naming.label.clone(), with_namer(naming)] {
                *times.entry(title).or_default() += 1;
            }
        }
        let title = |naming: &Naming| match times.get(naming.label.as_str()) {
            Some(2..) => with_namer(naming),
            _ => naming.label.clone(),
        };
        let called = |gesture: ClassId| match self.get(gesture) {
            Some(naming) => Some(title(naming)),
            None => listed.get(gesture.index()).cloned(),
        };
        now.into_iter()
            .filter_map(|(gesture, now)| Some((gesture, called(now.unwrap_or(gesture))?)))
            .collect()
    }

    /// The same, with what robots that know of more or of fewer names call each.
    #[must_use]
    pub fn called(&self, listed: &[String]) -> BTreeMap<ClassId, Called> {
        let now = self.all_stand_for();
        let also = |gesture: ClassId| {
            let namings = [Some(gesture), now.get(&gesture).copied().flatten()].into_iter().flatten();
            let namings = namings.filter_map(|gesture| self.get(gesture));
            namings.flat_map(|naming| [naming.label.clone(), with_namer(naming)]).collect()
        };
        let titles = self.titles(listed).into_iter();
        titles.map(|(gesture, title)| (gesture, Called { title, also: also(gesture) })).collect()
    }

    /// A digest of everything that can be shown to others under a key: the same words, heard in whatever order, give the same; 0 for nothing.
    #[must_use]
    pub fn digest(&self, key: u64) -> u64 {
        let mut told = self.told().peekable();
        if told.peek().is_none() {
            return 0;
        }
        let mut sip = SipHasher24::new_with_keys(key, u64::from_le_bytes(*b"names   "));
        for naming in told {
            let Naming { count, at, said_by, fate, .. } = naming;
            sip.write(&naming.gesture().0.to_le_bytes());
            sip.write(&count.to_le_bytes());
            sip.write(&at.to_le_bytes());
            let name = said_by.to_string();
            sip.write(&[name.len() as u8]);
            sip.write(name.as_bytes());
            let (kind, other) = match fate {
                Fate::InUse => (0, 0),
                Fate::Same(other) => (1, other.0),
                Fate::Retired => (2, 0),
            };
            sip.write(&[kind]);
            sip.write(&other.to_le_bytes());
        }
        sip.finish()
    }
}

/// A gesture's label, and who named it.
fn with_namer(Naming { label, by, .. }: &Naming) -> String {
    format!("{label} ({by})")
}

/// Whose gesture is meant by `circle (ana)`, and by which label; `None` where a label says nothing of who named it. Nobody names a gesture so, for it
/// would be called as another's can be.
pub(crate) fn of_somebody(label: &str) -> Option<(&str, InstructorId)> {
    let (label, whose) = label.strip_suffix(')')?.rsplit_once(" (")?;
    Some((label, whose.parse().ok()?))
}

/// Whether two words are of a gesture that one instructor named so: of two of one number one was not.
fn is_of_one(one: &Naming, other: &Naming) -> bool {
    one.by == other.by && one.label == other.label
}

/// Whether that word names the gesture, and is signed.
fn is_named_by(naming: &Naming) -> bool {
    let said = naming.said.as_ref().and_then(|said| said.instruction().ok());
    let names = |instruction| matches!(instruction, Instruction::New { label, .. } if label == naming.label);
    naming.by == naming.said_by && said.is_some_and(names)
}

/// The later word is the greater. Of two names that make one number, which chance gives once in many thousand swarms, the greater is kept.
fn order(naming: &Naming) -> (u64, u64, &InstructorId, Fate, &InstructorId, &str) {
    let Naming { by, label, count, at, said_by, fate, .. } = naming;
    (*count, *at, said_by, *fate, by, label)
}

/// What a gesture takes its place by: who named it, by which right it was last spoken of, its number.
type Candidate<'a> = (&'a InstructorId, Standing, ClassId);

/// Where a gesture stands among others: the smaller first. By the right, by how many of whoever named it stand before it, by its number.
type Place = (Reverse<Standing>, usize, ClassId);

/// The places of these gestures among each other, in order. Whatever else is heard, before none there stand fewer than did, unless it is itself spoken of by a
/// greater right: so what gave way once would do so again, and the order in which robots hear makes no difference.
fn places<'a>(gestures: impl Iterator<Item = Candidate<'a>>) -> Vec<Place> {
    let by_namer = gestures.map(|(by, standing, gesture)| (by, Reverse(right(standing)), gesture));
    let mut by_namer: Vec<_> = by_namer.collect();
    by_namer.sort_unstable();
    let of_one = by_namer.chunk_by(|one, other| one.0 == other.0);
    let places =
        of_one.flat_map(|own| (0..).zip(own).map(|(nth, (_, right, gesture))| (*right, nth, *gesture)));
    let mut places: Vec<Place> = places.collect();
    places.sort_unstable();
    places
}

/// What was named may be merged, retired and restored by anybody who teaches; without a key, as long as nobody with one has spoken of it.
fn right(standing: Standing) -> Standing {
    standing.min(Standing::Teaches)
}

#[cfg(test)]
mod tests;
