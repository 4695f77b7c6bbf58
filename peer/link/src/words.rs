//! What a robot of a sealed swarm signs for those who speak on its own computer, and what it answers to instructors and whoever asks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use gestalt_protocol::{FrameChallenge, InstructorId, Keys, RobotId, Signature, Topic};
use gestalt_trust::{Identity, Speaker, SwarmId, WordHeading, answer, frame, statement, word};

/// A day, in the units of counts: more than passed between the last word that is remembered and the last that was said.
const UNREMEMBERED: u64 = 86_400 << 32;

/// Signs words in the name of a robot.
pub(crate) struct Words {
    me: RobotId,
    identity: Arc<Identity>,
    swarm: SwarmId,
    keys: Keys,
    /// The count of the last word that was signed here.
    last: u64,
    /// The highest count of a word of its own that came back: out of its memory, or from others.
    returned: Arc<AtomicU64>,
}

/// A word that a robot signed for whoever said it on its own computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Vouched {
    pub key: String,
    pub word: Vec<u8>,
    pub attachment: Vec<u8>,
    pub count: u64,
}

impl Words {
    pub fn new(me: RobotId, identity: Arc<Identity>, swarm: SwarmId, keys: Keys) -> Self {
        Self { me, identity, swarm, keys, last: 0, returned: Arc::default() }
    }

    /// Where the highest count of a word of this robot's own is put that comes back.
    pub fn returned(&self) -> Arc<AtomicU64> {
        self.returned.clone()
    }

    /// Signs a word in the name of whoever said it here.
    pub fn vouch(&mut self, by: &InstructorId, word: Vec<u8>) -> Vouched {
        let returned = self.returned.load(Ordering::Relaxed);
        if returned > self.last {
            // One of before this start. By a clock that was set back since, what is said now would count for nothing beside it.
            self.last = returned;
            if next_count(0) < returned {
                self.last = returned.saturating_add(UNREMEMBERED);
            }
        }
        let count = next_count(self.last);
        self.last = count;
        let heading = WordHeading { speaker: Speaker::For(self.me), count };
        let attachment = word::sign(&self.identity, &self.swarm, by, &heading, &word);
        Vouched { key: self.keys.key(&Topic::Word(by.clone())), word, attachment, count }
    }

    /// Signs this robot's answer.
    pub fn answer(&self, to: &InstructorId, answer: &[u8]) -> Signature {
        answer::sign(&self.identity, &self.swarm, self.me, to, answer)
    }

    /// Signs what this robot asks the camera of another one.
    pub fn challenge(&self, to: RobotId, challenge: u64) -> FrameChallenge {
        frame::challenge(&self.identity, &self.swarm, self.me, to, challenge)
    }

    /// Signs what this robot says to whoever asks.
    pub fn statement(&self, statement: &[u8]) -> Signature {
        statement::sign(&self.identity, &self.swarm, statement)
    }
}

/// The count of the next word under one key: higher than the last, and, as long as the clock is right, than all before the last start. In the units
/// of Zenoh's timestamps, so that words of before and after a swarm was sealed keep their order.
pub(crate) fn next_count(last: u64) -> u64 {
    let span = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let now = (span.as_secs() << 32) | ((u64::from(span.subsec_nanos()) << 32) / 1_000_000_000);
    now.max(last.saturating_add(1))
}

#[cfg(test)]
mod tests {
    use gestalt_trust::{Instructor, Membership, Role, Roles};

    use super::*;

    fn words() -> (Words, gestalt_trust::Roster) {
        let key = |number| Identity::from_bytes(&[number; 32]);
        let robots = [(RobotId(7), key(7).public_key())].into();
        let ada = Instructor { key: key(90).public_key(), roles: Roles::up_to(Role::Teach) };
        let instructors = [("ada".parse().unwrap(), ada)].into();
        let local = Roles::up_to(Role::Open);
        let members = Membership {
            swarm: "demo".to_owned(),
            epoch: 1,
            robots,
            instructors,
            local,
            ..Membership::default()
        };
        let roster = members.sign(&key(100)).unwrap();
        let keys = Keys::new("demo").unwrap();
        (Words::new(RobotId(7), Arc::new(key(7)), roster.swarm_id(), keys), roster)
    }

    #[test]
    fn a_word_that_is_vouched_for_is_believed_and_the_next_one_after_it() {
        let (mut words, roster) = words();
        let bob: InstructorId = "bob".parse().unwrap();
        let [first, second] = [0, 1].map(|_| words.vouch(&bob, b"word".to_vec()));
        assert!(second.count > first.count && first.key == "gestalt/demo/instructor/bob/word");
        let (heading, roles) = roster.check_word(&bob, b"word", Some(&first.attachment)).unwrap();
        assert_eq!((heading.count, roles), (first.count, Roles::up_to(Role::Open)));
        // One of before a start came back, and the clock was set back since: the next comes after all that were said in the day after it.
        let before = second.count + (100 * UNREMEMBERED);
        words.returned().store(before, Ordering::Relaxed);
        let [third, fourth] = [0, 1].map(|_| words.vouch(&bob, b"word".to_vec()));
        assert!(third.count > before + UNREMEMBERED && fourth.count == third.count + 1);
        // Nobody with a key is spoken for.
        let ada = "ada".parse().unwrap();
        let vouched = words.vouch(&ada, b"word".to_vec());
        assert!(roster.check_word(&ada, b"word", Some(&vouched.attachment)).is_err());
    }
}
