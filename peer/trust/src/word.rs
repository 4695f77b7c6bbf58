//! The words of instructors, signed: by their own key, or by the robot whose own computer they were said on.
//!
//! The word itself stays the JSON that it is; beside it travels an attachment.
//!
//! ```text
//! 1 ‖ count: u64 ‖ signature: 64 bytes                    by the instructor's key
//! 2 ‖ robot: u32 ‖ count: u64 ‖ signature: 64 bytes       by that robot's key
//! signed: "gestalt-word-1\0" ‖ swarm: 32 bytes ‖ the attachment up to the signature ‖ length of the name: u8 ‖ name ‖ word
//! ```
//!
//! Numbers are little-endian. The count of a key grows with every word, so that none counts twice.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::time::Duration;

use gestalt_protocol::{InstructorId, RobotId, Signature};

use crate::budget::{Bucket, Budget};
use crate::distrust::Distrust;
use crate::identity::Identity;
use crate::roles::Roles;
use crate::roster::Roster;
use crate::scheme::{Ed25519, Scheme};
use crate::statement::SwarmId;

/// Stands first under every signature of a word.
pub const WORD_DOMAIN: &[u8; 15] = b"gestalt-word-1\0";

/// Who signed a word.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Speaker {
    /// The instructor.
    Own(InstructorId),
    /// A robot, for whoever works on its own computer.
    For(RobotId),
}

/// A word as its attachment describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WordHeading {
    /// Who signed it.
    pub speaker: Speaker,
    /// Its place among all that are signed with that key.
    pub count: u64,
}

/// Signs a word in an instructor's name; gives the attachment.
#[must_use]
pub fn sign<S: Scheme>(
    identity: &Identity<S>,
    swarm: &SwarmId,
    by: &InstructorId,
    heading: &WordHeading,
    word: &[u8],
) -> Vec<u8> {
    let mut attachment = match &heading.speaker {
        Speaker::Own(_) => vec![1],
        Speaker::For(robot) => [&[2], robot.0.to_le_bytes().as_slice()].concat(),
    };
    attachment.extend(heading.count.to_le_bytes());
    let signature = identity.sign(&signed_bytes(swarm, &attachment, by, word));
    attachment.extend(signature.as_bytes());
    attachment
}

fn signed_bytes(swarm: &SwarmId, head: &[u8], by: &InstructorId, word: &[u8]) -> Vec<u8> {
    let name = by.to_string();
    // Of at most 32 bytes.
    let length = [name.len() as u8];
    [WORD_DOMAIN.as_slice(), swarm.as_bytes(), head, &length, name.as_bytes(), word].concat()
}

/// The heading, the part of the attachment that is signed, and the signature.
fn read<'a>(by: &InstructorId, attachment: &'a [u8]) -> Option<(WordHeading, &'a [u8], Signature)> {
    let (head, signature) = attachment.split_last_chunk::<{ Signature::LENGTH }>()?;
    let (speaker, count) = match head {
        [1, count @ ..] => (Speaker::Own(by.clone()), count),
        [2, rest @ ..] => {
            let (robot, count) = rest.split_first_chunk::<4>()?;
            (Speaker::For(RobotId(u32::from_le_bytes(*robot))), count)
        }
        _ => return None,
    };
    let count = u64::from_le_bytes(count.try_into().ok()?);
    Some((WordHeading { speaker, count }, head, Signature::from_bytes(*signature)))
}

impl<S: Scheme> Roster<S> {
    /// Who signed that word, said in that name, and what they may do.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn check_word(
        &self,
        by: &InstructorId,
        word: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(WordHeading, Roles), Distrust> {
        let attachment = attachment.ok_or(Distrust::Unsigned)?;
        let (heading, head, signature) = read(by, attachment).ok_or(Distrust::Malformed)?;
        let members = self.members();
        let (key, roles) = match &heading.speaker {
            Speaker::Own(name) => {
                let it = members.instructors.get(name).ok_or(Distrust::Stranger)?;
                (&it.key, it.roles)
            }
            // A robot speaks for nobody who has a key.
            Speaker::For(_) if members.instructors.contains_key(by) => return Err(Distrust::Forged),
            Speaker::For(robot) => {
                let expelled = members.expelled.contains_key(robot);
                let unknown = if expelled { Distrust::Expelled } else { Distrust::Stranger };
                (members.robots.get(robot).ok_or(unknown)?, members.local)
            }
        };
        let key = S::key(key).ok_or(Distrust::Forged)?;
        if S::verify(&key, &signed_bytes(&self.swarm_id(), head, by, word), &signature) {
            Ok((heading, roles))
        } else {
            Err(Distrust::Forged)
        }
    }
}

/// How many words of one speaker are heeded: more than anybody says. As many are checked in one name where all together are used up.
const OF_WORDS: Budget = Budget::of(32, 8, 1);

/// How many words are checked in all names together: made-up ones in an instructor's name cost these, and not its own.
const OF_ALL: Budget = Budget::of(1000, 1000, 1);

/// What is kept so that no word counts twice, and nobody's words keep a robot busy: of each speaker that is on the roster, budgets and the
/// highest count.
#[derive(Clone, Debug)]
pub struct Attention<S: Scheme = Ed25519> {
    speakers: BTreeMap<Speaker, Heeded>,
    left: Option<Bucket>,
    scheme: PhantomData<fn() -> S>,
}

#[derive(Clone, Debug)]
struct Heeded {
    /// What is left to be heeded.
    words: Bucket,
    /// What is left to be checked in this name, beyond what is in all.
    checks: Bucket,
    highest: Option<u64>,
}

impl<S: Scheme> Default for Attention<S> {
    fn default() -> Self {
        Self { speakers: BTreeMap::new(), left: None, scheme: PhantomData }
    }
}

impl<S: Scheme> Attention<S> {
    /// Whether to heed that word: who said it, by which right, and as which of theirs. Memory is bounded by the roster.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets; [`Distrust::Repeated`] for one that was heeded before, or is older than one that was.
    pub fn heed(
        &mut self,
        now: Duration,
        roster: &Roster<S>,
        by: &InstructorId,
        word: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(WordHeading, Roles), Distrust> {
        let (claimed, ..) =
            attachment.and_then(|attachment| read(by, attachment)).ok_or(match attachment {
                Some(_) => Distrust::Malformed,
                None => Distrust::Unsigned,
            })?;
        let known = match &claimed.speaker {
            Speaker::Own(name) => roster.members().instructors.contains_key(name),
            Speaker::For(robot) => roster.members().robots.contains_key(robot),
        };
        if !known {
            // Of a stranger nothing is checked but the name.
            return roster.check_word(by, word, attachment);
        }
        let new = || {
            let full = Bucket::new(&OF_WORDS, now);
            Heeded { words: full.clone(), checks: full, highest: None }
        };
        let heeded = self.speakers.entry(claimed.speaker).or_insert_with(new);
        if heeded.highest.is_some_and(|highest| highest >= claimed.count) {
            return Err(Distrust::Repeated);
        }
        let left = self.left.get_or_insert_with(|| Bucket::new(&OF_ALL, now));
        if !left.take(&OF_ALL, now) && !heeded.checks.take(&OF_WORDS, now) {
            return Err(Distrust::TooFast);
        }
        let (heading, roles) = roster.check_word(by, word, attachment)?;
        if !heeded.words.take(&OF_WORDS, now) {
            return Err(Distrust::TooFast);
        }
        heeded.highest = Some(heading.count);
        Ok((heading, roles))
    }

    /// Forgets who is not on the roster that follows, or has another key there.
    pub fn follow(&mut self, before: &Roster<S>, after: &Roster<S>) {
        self.speakers.retain(|speaker, _| match speaker {
            Speaker::For(robot) => after.keeps_key(before, *robot),
            Speaker::Own(name) => {
                let key = |of: &Roster<S>| of.members().instructors.get(name).map(|it| it.key);
                key(after).is_some() && key(after) == key(before)
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::MAX_ATTACHMENT;

    use super::*;
    use crate::membership::Instructor;
    use crate::roles::Role;
    use crate::testing::{authority, members, robot};

    fn roster() -> Roster {
        let mut members = members(1);
        members.local = Roles::up_to(Role::Open);
        let ada = Instructor { key: robot(90).public_key(), roles: Roles::up_to(Role::Teach) };
        members.instructors.insert("ada".parse().unwrap(), ada);
        members.sign(&authority()).unwrap()
    }

    fn name(name: &str) -> InstructorId {
        name.parse().unwrap()
    }

    fn said(by: &str, key: u32, speaker: Speaker, count: u64, word: &[u8]) -> Vec<u8> {
        sign(&robot(key), &roster().swarm_id(), &name(by), &WordHeading { speaker, count }, word)
    }

    #[test]
    fn a_word_is_its_instructors_or_a_robots_for_one_without_a_key() {
        let check = |by: &str, attachment: &[u8]| roster().check_word(&name(by), b"open", Some(attachment));
        let own = said("ada", 90, Speaker::Own(name("ada")), 7, b"open");
        let heading = WordHeading { speaker: Speaker::Own(name("ada")), count: 7 };
        assert_eq!(check("ada", &own), Ok((heading, Roles::up_to(Role::Teach))));
        let local = said("console", 2, Speaker::For(RobotId(2)), 7, b"open");
        let heading = WordHeading { speaker: Speaker::For(RobotId(2)), count: 7 };
        assert_eq!(check("console", &local), Ok((heading, Roles::up_to(Role::Open))));
        assert!(own.len() < MAX_ATTACHMENT && local.len() == MAX_ATTACHMENT);
    }

    #[test]
    fn nobody_speaks_for_another() {
        let check = |by: &str, word: &[u8], attachment: Option<&[u8]>| {
            roster().check_word(&name(by), word, attachment).unwrap_err()
        };
        let own = said("ada", 90, Speaker::Own(name("ada")), 7, b"open");
        assert_eq!(check("ada", b"open", None), Distrust::Unsigned);
        assert_eq!(check("ada", b"shut", Some(&own)), Distrust::Forged);
        assert_eq!(check("bob", b"open", Some(&own)), Distrust::Stranger);
        assert_eq!(check("ada", b"open", Some(&own[1..])), Distrust::Malformed);
        assert_eq!(check("ada", b"open", Some(&[])), Distrust::Malformed);
        let mut later = own.clone();
        later[1] += 1;
        assert_eq!(check("ada", b"open", Some(&later)), Distrust::Forged);
        // A robot, in the name of one who has a key; in another robot's; one who is no robot.
        let of_robot = |by, key, of: u32| said(by, key, Speaker::For(RobotId(of)), 7, b"open");
        assert_eq!(check("ada", b"open", Some(&of_robot("ada", 2, 2))), Distrust::Forged);
        assert_eq!(check("eve", b"open", Some(&of_robot("eve", 3, 2))), Distrust::Forged);
        assert_eq!(check("eve", b"open", Some(&of_robot("eve", 50, 50))), Distrust::Stranger);
        // What robot 2 signed for one it cannot have said for another.
        assert_eq!(check("bob", b"open", Some(&of_robot("eve", 2, 2))), Distrust::Forged);
    }

    #[test]
    fn no_word_counts_twice() {
        let mut attention = Attention::default();
        let mut heed = |count, word: &[u8]| {
            let attachment = said("ada", 90, Speaker::Own(name("ada")), count, word);
            attention
                .heed(Duration::ZERO, &roster(), &name("ada"), word, Some(&attachment))
                .map(|(it, _)| it.count)
        };
        assert_eq!(heed(7, b"open"), Ok(7));
        assert_eq!(heed(7, b"open"), Err(Distrust::Repeated));
        assert_eq!(heed(6, b"was"), Err(Distrust::Repeated));
        assert_eq!(heed(9, b"was"), Ok(9));
    }

    #[test]
    fn who_says_too_much_is_not_heeded_and_costs_nobody_else() {
        let mut attention = Attention::default();
        let mut heed = |by: &str, key, speaker: Speaker, count| {
            let attachment = said(by, key, speaker, count, b"open");
            attention.heed(Duration::ZERO, &roster(), &name(by), b"open", Some(&attachment)).map(drop)
        };
        let answers: Vec<_> =
            (1..=40).map(|count| heed("ada", 90, Speaker::Own(name("ada")), count)).collect();
        assert_eq!(answers.iter().filter(|it| it.is_ok()).count(), 32);
        assert_eq!(answers.last(), Some(&Err(Distrust::TooFast)));
        assert_eq!(heed("bob", 2, Speaker::For(RobotId(2)), 1), Ok(()));
    }

    #[test]
    fn words_made_up_in_an_instructors_name_silence_nobody() {
        let mut attention = Attention::default();
        let mut heed = |now: Duration, key, count| {
            let attachment = said("ada", key, Speaker::Own(name("ada")), count, b"open");
            attention.heed(now, &roster(), &name("ada"), b"open", Some(&attachment)).map(drop)
        };
        for second in 1..=3 {
            let at = |n: u64| Duration::from_millis(1000 * second + n);
            for n in 0..400 {
                let forged = heed(at(n), 91, u64::MAX - n);
                assert_eq!(forged, Err(Distrust::Forged));
            }
            assert_eq!(heed(at(401), 90, second), Ok(()), "in second {second}");
        }
        // More than all that is checked of anybody.
        let beyond = (0..1100).map(|n| heed(Duration::from_secs(20), 91, u64::MAX - n));
        assert_eq!(beyond.filter(|it| *it == Err(Distrust::Forged)).count(), 1032);
    }

    #[test]
    fn a_new_key_counts_anew() {
        let mut attention = Attention::default();
        let attachment = said("ada", 90, Speaker::Own(name("ada")), u64::MAX, b"open");
        attention.heed(Duration::ZERO, &roster(), &name("ada"), b"open", Some(&attachment)).unwrap();
        let mut after = roster().members().clone();
        after.epoch += 1;
        after.instructors.get_mut(&name("ada")).unwrap().key = robot(91).public_key();
        let after = after.sign(&authority()).unwrap();
        attention.follow(&roster(), &after);
        let attachment = said("ada", 91, Speaker::Own(name("ada")), 1, b"open");
        assert!(attention.heed(Duration::ZERO, &after, &name("ada"), b"open", Some(&attachment)).is_ok());
    }

    #[test]
    fn what_is_signed_never_changes() {
        let attachment = said("ada", 90, Speaker::Own(name("ada")), 7, b"{\"say\":\"open\"}");
        let golden = "0107000000000000007c47c725a1657f8dc88d8c531bf3446393f8b25cc7ac42399ba22430c14a4582855a5999a460861d1790a2eb960b25389091e916b5032df1e84507c68a7a0e0c";
        assert_eq!(gestalt_protocol::hex::Hex(&attachment).to_string(), golden);
    }
}
