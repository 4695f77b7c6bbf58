//! Robots' answers to instructors, signed.
//!
//! The answer itself stays the JSON that it is; beside it travels the signature of the robot that it names.
//!
//! ```text
//! signed: "gestalt-answer-1\0" ‖ swarm: 32 bytes ‖ robot: u32, little-endian ‖ length of the instructor's name: u8 ‖ name ‖ answer
//! ```
//!
//! A robot that hears an answer keeps its own to itself: whoever could make one up could leave an instructor without any. An answer says to
//! which word it is, and that word's time, so an old one answers nothing new.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::time::Duration;

use gestalt_protocol::{InstructorId, RobotId, Signature};

use crate::budget::{Bucket, Budget};
use crate::distrust::Distrust;
use crate::identity::Identity;
use crate::roster::Roster;
use crate::scheme::{Ed25519, Scheme};
use crate::statement::SwarmId;

/// Stands first under every signature of an answer.
pub const ANSWER_DOMAIN: &[u8; 17] = b"gestalt-answer-1\0";

/// Signs an answer to that instructor in the name of a robot; gives the attachment.
#[must_use]
pub fn sign<S: Scheme>(
    identity: &Identity<S>,
    swarm: &SwarmId,
    robot: RobotId,
    to: &InstructorId,
    answer: &[u8],
) -> Signature {
    identity.sign(&signed_bytes(swarm, robot, to, answer))
}

fn signed_bytes(swarm: &SwarmId, robot: RobotId, to: &InstructorId, answer: &[u8]) -> Vec<u8> {
    let name = to.to_string();
    // Of at most 32 bytes.
    let length = [name.len() as u8];
    let robot = robot.0.to_le_bytes();
    [ANSWER_DOMAIN.as_slice(), swarm.as_bytes(), &robot, &length, name.as_bytes(), answer].concat()
}

impl<S: Scheme> Roster<S> {
    /// Whether that robot gave this answer to that instructor.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn check_answer(
        &self,
        robot: RobotId,
        to: &InstructorId,
        answer: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(), Distrust> {
        let signature = attachment.ok_or(Distrust::Unsigned)?;
        let signature: [u8; Signature::LENGTH] = signature.try_into().map_err(|_| Distrust::Malformed)?;
        let members = self.members();
        let expelled = members.expelled.contains_key(&robot);
        let unknown = if expelled { Distrust::Expelled } else { Distrust::Stranger };
        let key = S::key(members.robots.get(&robot).ok_or(unknown)?).ok_or(Distrust::Forged)?;
        let signed = signed_bytes(&self.swarm_id(), robot, to, answer);
        if S::verify(&key, &signed, &Signature::from_bytes(signature)) {
            Ok(())
        } else {
            Err(Distrust::Forged)
        }
    }
}

/// How many answers of one robot are checked: more than instructors say words.
const OF_ANSWERS: Budget = Budget::of(32, 8, 1);

/// What is kept so that nobody's answers keep a robot busy: a budget of each robot on the roster.
#[derive(Clone, Debug)]
pub struct Answers<S: Scheme = Ed25519> {
    budgets: BTreeMap<RobotId, Bucket>,
    scheme: PhantomData<fn() -> S>,
}

impl<S: Scheme> Default for Answers<S> {
    fn default() -> Self {
        Self { budgets: BTreeMap::new(), scheme: PhantomData }
    }
}

impl<S: Scheme> Answers<S> {
    /// As [`Roster::check_answer`], at a bounded rate.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets; [`Distrust::TooFast`] leaves it open whether the robot said it.
    pub fn check(
        &mut self,
        now: Duration,
        roster: &Roster<S>,
        robot: RobotId,
        to: &InstructorId,
        answer: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(), Distrust> {
        if attachment.is_some() && roster.members().robots.contains_key(&robot) {
            let bucket = self.budgets.entry(robot).or_insert_with(|| Bucket::new(&OF_ANSWERS, now));
            if !bucket.take(&OF_ANSWERS, now) {
                return Err(Distrust::TooFast);
            }
        }
        roster.check_answer(robot, to, answer, attachment)
    }

    /// Forgets who is not on the roster that follows, or has another key there.
    pub(crate) fn follow(&mut self, before: &Roster<S>, after: &Roster<S>) {
        self.budgets.retain(|robot, _| after.keeps_key(before, *robot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{authority, members, robot, roster};

    const NOW: Duration = Duration::from_secs(1000);

    fn ada() -> InstructorId {
        "ada".parse().unwrap()
    }

    fn signed(by: u32) -> Vec<u8> {
        sign(&robot(by), &roster(1).swarm_id(), RobotId(1), &ada(), b"yes").as_bytes().to_vec()
    }

    #[test]
    fn an_answer_is_its_robots_to_that_instructor_in_these_words() {
        let roster = roster(1);
        let check = |robot, to: &str, answer: &[u8], attachment: Option<&[u8]>| {
            roster.check_answer(RobotId(robot), &to.parse().unwrap(), answer, attachment)
        };
        let true_one = signed(1);
        assert_eq!(check(1, "ada", b"yes", Some(&true_one)), Ok(()));
        assert_eq!(check(1, "ada", b"yes", None), Err(Distrust::Unsigned));
        assert_eq!(check(1, "ada", b"yes", Some(&true_one[1..])), Err(Distrust::Malformed));
        assert_eq!(check(1, "ada", b"yes", Some(&signed(2))), Err(Distrust::Forged));
        assert_eq!(check(2, "ada", b"yes", Some(&true_one)), Err(Distrust::Forged));
        assert_eq!(check(1, "bob", b"yes", Some(&true_one)), Err(Distrust::Forged));
        assert_eq!(check(1, "ada", b"no", Some(&true_one)), Err(Distrust::Forged));
        assert_eq!(check(9, "ada", b"yes", Some(&true_one)), Err(Distrust::Stranger));
        let other_swarm = members(1).sign(&robot(77)).unwrap().swarm_id();
        let elsewhere = sign(&robot(1), &other_swarm, RobotId(1), &ada(), b"yes");
        assert_eq!(check(1, "ada", b"yes", Some(elsewhere.as_bytes())), Err(Distrust::Forged));
    }

    #[test]
    fn so_many_are_checked_of_each_robot_and_no_stranger_takes_room() {
        let (mut answers, roster) = (Answers::default(), roster(1));
        let mut check = |robot, attachment: &[u8]| {
            answers.check(NOW, &roster, RobotId(robot), &ada(), b"yes", Some(attachment))
        };
        for _ in 0..32 {
            assert_eq!(check(1, &signed(2)), Err(Distrust::Forged));
        }
        assert_eq!(check(1, &signed(1)), Err(Distrust::TooFast));
        assert_eq!(check(2, &signed(1)), Err(Distrust::Forged), "another's budget is its own");
        for stranger in 100..200 {
            assert_eq!(check(stranger, &signed(1)), Err(Distrust::Stranger));
        }
        assert_eq!(answers.budgets.len(), 2);
    }

    #[test]
    fn a_new_key_has_a_budget_of_its_own_and_an_old_one_goes_on_with_its() {
        let (mut answers, before) = (Answers::default(), roster(1));
        let forged = signed(9);
        for robot in [1, 2].repeat(33) {
            assert!(answers.check(NOW, &before, RobotId(robot), &ada(), b"yes", Some(&forged)).is_err());
        }
        let mut after = members(2);
        after.robots.insert(RobotId(1), robot(11).public_key());
        let after = after.sign(&authority()).unwrap();
        answers.follow(&before, &after);
        let mut check = |robot| answers.check(NOW, &after, RobotId(robot), &ada(), b"yes", Some(&forged));
        assert_eq!(check(1), Err(Distrust::Forged));
        assert_eq!(check(2), Err(Distrust::TooFast));
    }
}
