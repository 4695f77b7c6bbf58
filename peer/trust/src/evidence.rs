//! Proof that somebody lies: two different statements under one stamp, two samples under one number, or a decision that does not follow from its votes.

use std::fmt;

use gestalt_protocol::{
    Announced, Decision, DecodeError, Envelope, Give, HeldBatch, MAX_MESSAGE, Message, RobotId, Samples,
    SharedSample, Signature, Stamp,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::public_key::PublicKey;
use crate::roster::Roster;
use crate::scheme::Scheme;
use crate::signed::{MAX_EVIDENT, MAX_SIGNED, Signed};
use crate::statement::{self, Heading};

/// The longest statement that can be one of two batches, in bytes: robots share half a kilobyte to sixteen at once.
const MAX_BATCH: usize = 2 * MAX_EVIDENT;

/// The version byte in front of encoded evidence.
const VERSION: u8 = 2;

/// Whether a decision contradicts the votes that it brings with it, whoever asks: `is_refuted` of `gestalt-rounds`, of which nothing is known here. It says
/// the same of the same decision everywhere, or robots would not agree on who lied.
pub type Refutes = fn(&Decision) -> bool;

/// Evidence that proves nothing, or not yet.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum EvidenceError {
    /// Not the encoding of evidence, or of something that has no author.
    #[error("malformed evidence: {0}")]
    Malformed(#[from] DecodeError),
    /// Twice the same statement: robots repeat themselves by design.
    #[error("the same statement twice, which robots do by design")]
    Repeated,
    /// By two authors, or under two stamps.
    #[error("two statements of different authors or stamps, which may well differ")]
    Unrelated,
    /// Two batches of samples that may stand side by side: no number is in both, or the same sample is.
    #[error("two statements in which no two samples have one number")]
    Compatible,
    /// A single statement that gives no decision.
    #[error("one statement, and no decision in it")]
    Undecided,
    /// A decision that may well follow from its votes, by the terms that it states.
    #[error("a decision that may well follow from its votes")]
    Founded,
    /// Against a robot that is not on the roster.
    #[error("robot {0} is not on the roster: bring the newest roster here")]
    Stranger(RobotId),
    /// What it rests on was not signed by that robot's key, or not all of it.
    #[error("robot {0} did not sign all of it with its key of today")]
    Forged(RobotId),
    /// More evidence against that robot than is checked.
    #[error("more evidence against robot {0} than is checked: it is looked at when it comes again")]
    TooFast(RobotId),
}

/// What lies are proven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lie {
    /// One thing here and another there.
    TwoThings,
    /// One sample here and another there, as one.
    TwoSamples,
    /// A decision that the votes it brings do not make.
    Unfounded,
}

impl fmt::Display for Lie {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TwoThings => "said two things under one stamp: it lies, or its key is in two hands",
            Self::TwoSamples => "shared two samples under one number: it lies, or its key is in two hands",
            Self::Unfounded => {
                "gave a decision that does not follow from its votes: it lies, or runs a program that is not Gestalt's"
            }
        })
    }
}

/// Two different statements of one author under one stamp, each with its signature: the author said one thing here and another
/// there. Stamps count over all that a robot says, of whatever kind, so an honest robot never does that; nor can anybody else make
/// it look so. A robot whose memory was copied to a second one does: then its key is in two hands.
///
/// Or two batches of one author in which one number is that of different samples: robots number what they share in a life whose number was drawn at random,
/// so that two lives do not meet.
///
/// Or a decision that its author gave or announced, and signed, which contradicts the votes that it brings: whoever concluded it, robots pass on what they have
/// looked into. Whether those votes were cast does not matter.
///
/// It speaks for itself: everybody with the roster checks it, whoever brought it. At most [`Evidence::MAX_LENGTH`] bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Proof")]
pub struct Evidence(Proof);

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Proof {
    TwoThings { first: Signed, second: Signed },
    Unfounded(Signed),
    TwoSamples { first: Signed, second: Signed },
}

impl TryFrom<Proof> for Evidence {
    type Error = DecodeError;

    fn try_from(proof: Proof) -> Result<Self, DecodeError> {
        let (first, second, limit) = match &proof {
            Proof::TwoThings { first, second } => (first, second, MAX_EVIDENT),
            Proof::TwoSamples { first, second } => (first, second, MAX_BATCH),
            Proof::Unfounded(_) => return Ok(Self(proof)),
        };
        let length = first.statement.len().max(second.statement.len());
        if length > limit { Err(DecodeError::TooLong { length, limit }) } else { Ok(Self(proof)) }
    }
}

/// What evidence proves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conviction {
    /// Who lied.
    pub robot: RobotId,
    /// The key it lied with. With a new key a robot begins anew.
    pub key: PublicKey,
    /// The stamp on what it said.
    pub stamp: Stamp,
    /// What the lie was.
    pub lie: Lie,
}

impl Evidence {
    /// The longest encoding: that of a decision with a little less than what fits in a message.
    pub const MAX_LENGTH: usize = MAX_MESSAGE;

    /// The evidence of these two, in whichever order they were met.
    pub(crate) fn of_two(one: Signed, other: Signed) -> Self {
        let (first, second) = in_order(one, other);
        Self(Proof::TwoThings { first, second })
    }

    /// That of two batches of one author, which share two samples under one number; `None` if one is not signed, or too long to be passed on.
    #[must_use]
    pub fn of_batches(one: HeldBatch, other: HeldBatch) -> Option<Self> {
        let said = |batch: HeldBatch| {
            let said = Envelope::from(batch);
            Some(Signed { statement: said.statement(), signature: said.signature? })
        };
        let (first, second) = in_order(said(one)?, said(other)?);
        Self::try_from(Proof::TwoSamples { first, second }).ok()
    }

    /// That of a statement that gives or announces a decision, with its author's signature.
    #[must_use]
    pub fn of_decision(statement: Vec<u8>, signature: Signature) -> Self {
        Self(Proof::Unfounded(Signed { statement, signature }))
    }

    /// What lie it is evidence of.
    #[must_use]
    pub fn lie(&self) -> Lie {
        match self.0 {
            Proof::TwoThings { .. } => Lie::TwoThings,
            Proof::TwoSamples { .. } => Lie::TwoSamples,
            Proof::Unfounded(_) => Lie::Unfounded,
        }
    }

    /// How many bytes its statements have.
    pub(crate) fn length(&self) -> usize {
        match &self.0 {
            Proof::TwoThings { first, second } | Proof::TwoSamples { first, second } => {
                first.statement.len() + second.statement.len()
            }
            Proof::Unfounded(said) => said.statement.len(),
        }
    }

    /// The bytes that travel: a version byte, then postcard.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        postcard::to_extend(self, vec![VERSION])
            .expect("memory is the only thing that writing to a vector can lack")
    }

    /// Reads what [`Evidence::encode`] wrote. Whether it proves anything is found by [`Evidence::check`].
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        if bytes.len() > Self::MAX_LENGTH {
            return Err(DecodeError::TooLong { length: bytes.len(), limit: Self::MAX_LENGTH });
        }
        let (&version, body) = bytes.split_first().ok_or(DecodeError::Empty)?;
        if version != VERSION {
            return Err(DecodeError::Impossible("another version of evidence"));
        }
        let (evidence, rest) = postcard::take_from_bytes::<Self>(body)
            .map_err(|error| DecodeError::Malformed(error.to_string()))?;
        if rest.is_empty() { Ok(evidence) } else { Err(DecodeError::Trailing(rest.len())) }
    }

    /// Whom it is against, and under which stamp, by its own words.
    ///
    /// # Errors
    /// [`EvidenceError`] for two statements that may well stand side by side, whoever signed them.
    pub fn heading(&self) -> Result<Heading, EvidenceError> {
        match &self.0 {
            Proof::TwoThings { first, second } => {
                let heading = statement::heading(&first.statement)?;
                if statement::heading(&second.statement)? != heading {
                    return Err(EvidenceError::Unrelated);
                }
                if first.statement == second.statement {
                    return Err(EvidenceError::Repeated);
                }
                Ok(heading)
            }
            Proof::TwoSamples { first, second } => {
                let heading = statement::heading(&first.statement)?;
                if statement::heading(&second.statement)?.author != heading.author {
                    return Err(EvidenceError::Unrelated);
                }
                Ok(heading)
            }
            Proof::Unfounded(said) if said.statement.len() > MAX_SIGNED => {
                Err(DecodeError::TooLong { length: said.statement.len(), limit: MAX_SIGNED }.into())
            }
            Proof::Unfounded(said) => Ok(statement::heading(&said.statement)?),
        }
    }

    /// Whether it proves that a robot on that roster lied, with the key it has there. A decision is looked into last, once it is known who gave it.
    ///
    /// # Errors
    /// The [`EvidenceError`] that says what it lacks.
    pub fn check<S: Scheme>(
        &self,
        roster: &Roster<S>,
        refutes: Refutes,
    ) -> Result<Conviction, EvidenceError> {
        let Heading { author: robot, stamp } = self.heading()?;
        let key = *roster.members().robots.get(&robot).ok_or(EvidenceError::Stranger(robot))?;
        let is_signed = |said: &Signed| roster.check(&said.statement, &said.signature).is_ok();
        let signed = match &self.0 {
            Proof::TwoThings { first, second } | Proof::TwoSamples { first, second } => {
                is_signed(first) && is_signed(second)
            }
            Proof::Unfounded(said) => is_signed(said),
        };
        if !signed {
            return Err(EvidenceError::Forged(robot));
        }
        if let Proof::Unfounded(said) = &self.0
            && !refutes(&decision_in(&said.statement)?)
        {
            return Err(EvidenceError::Founded);
        }
        if let Proof::TwoSamples { first, second } = &self.0
            && !contradict(&samples_in(&first.statement)?, &samples_in(&second.statement)?)
        {
            return Err(EvidenceError::Compatible);
        }
        Ok(Conviction { robot, key, stamp, lie: self.lie() })
    }
}

fn in_order(one: Signed, other: Signed) -> (Signed, Signed) {
    if one <= other { (one, other) } else { (other, one) }
}

fn samples_in(statement: &[u8]) -> Result<Samples, EvidenceError> {
    match statement::read(statement)?.message {
        Message::Samples(samples) => Ok(samples),
        _ => Err(EvidenceError::Compatible),
    }
}

/// Whether a sample of the one batch and another one of the other have one name.
fn contradict(one: &Samples, other: &Samples) -> bool {
    let differs = |sample: &SharedSample| one.space != other.space || !other.samples.contains(sample);
    let in_both = |sample: &SharedSample| other.samples.iter().any(|theirs| theirs.id == sample.id);
    one.samples.iter().any(|sample| in_both(sample) && differs(sample))
}

/// The decision that a statement gives or announces.
fn decision_in(statement: &[u8]) -> Result<Decision, EvidenceError> {
    match statement::read(statement)?.message {
        Message::Give(Give { decision: Some(decision), .. })
        | Message::Announced(Announced { decision, .. }) => Ok(decision),
        _ => Err(EvidenceError::Undecided),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{authority, decision, have, members, robot, roster, vote};

    fn signed(statement: Vec<u8>, by: u32) -> Signed {
        let signature = statement::sign(&robot(by), &roster(1).swarm_id(), &statement);
        Signed { statement, signature }
    }

    fn lie() -> Evidence {
        Evidence::of_two(signed(vote(2, 5, 1.0), 2), signed(vote(2, 5, -1.0), 2))
    }

    #[test]
    fn whoever_reads_of_a_lie_reads_which_it_is() {
        let told = [Lie::TwoThings, Lie::Unfounded, Lie::TwoSamples].map(|lie| lie.to_string());
        assert!(told[0].contains("two things under one stamp"), "{told:?}");
        assert!(told[1].contains("does not follow from its votes"), "{told:?}");
        assert!(told[2].contains("two samples under one number"), "{told:?}");
    }

    #[test]
    fn it_convicts_the_key_that_lied() {
        let stamp = Stamp { boot: 1, sequence: 5 };
        let key = robot(2).public_key();
        assert_eq!(
            lie().check(&roster(1), |_| false),
            Ok(Conviction { robot: RobotId(2), key, stamp, lie: Lie::TwoThings })
        );
        // After the robot was enrolled anew, it proves nothing against the new key.
        let mut later = members(2);
        later.robots.insert(RobotId(2), robot(22).public_key());
        assert_eq!(
            lie().check(&later.sign(&authority()).unwrap(), |_| false),
            Err(EvidenceError::Forged(RobotId(2)))
        );
        let mut gone = members(2);
        gone.robots.remove(&RobotId(2));
        assert_eq!(
            lie().check(&gone.sign(&authority()).unwrap(), |_| false),
            Err(EvidenceError::Stranger(RobotId(2)))
        );
    }

    #[test]
    fn nobody_can_make_an_honest_robot_look_like_a_liar() {
        let said = signed(vote(2, 5, 1.0), 2);
        let check = |other| Evidence::of_two(said.clone(), other).check(&roster(1), |_| false);
        assert_eq!(check(said.clone()), Err(EvidenceError::Repeated));
        assert_eq!(check(signed(vote(2, 6, -1.0), 2)), Err(EvidenceError::Unrelated));
        assert_eq!(check(signed(vote(3, 5, -1.0), 3)), Err(EvidenceError::Unrelated));
        assert_eq!(check(signed(vote(2, 5, -1.0), 3)), Err(EvidenceError::Forged(RobotId(2))));
        // A second valid signature under the same statement is no second statement.
        let again = Signed { signature: Signature::from_bytes([1; 64]), ..said.clone() };
        assert_eq!(check(again), Err(EvidenceError::Repeated));
        let junk = Signed { statement: vec![1, 2, 3], ..said.clone() };
        assert!(matches!(check(junk), Err(EvidenceError::Malformed(_))));
        // Said in another swarm under the same stamp.
        let elsewhere = gestalt_protocol::Envelope::decode(&vote(2, 5, -1.0)).unwrap().encode();
        let swarm = statement::SwarmId::new(&authority().public_key(), "other");
        let signature = statement::sign(&robot(2), &swarm, &elsewhere);
        let elsewhere = Signed { statement: elsewhere, signature };
        assert_eq!(check(elsewhere), Err(EvidenceError::Forged(RobotId(2))));
    }

    /// What that robot gives, decided by nobody; of so many milliseconds, which say here whether it follows.
    fn gives(author: u32, elapsed_ms: u32) -> Vec<u8> {
        let message = Message::Give(Give {
            decision: Some(decision(elapsed_ms)),
            votes: Vec::new(),
            holders: Vec::new(),
        });
        let stamp = Stamp { boot: 1, sequence: 7 };
        gestalt_protocol::Envelope { author: RobotId(author), stamp, message, signature: None }.statement()
    }

    fn refutes(decision: &Decision) -> bool {
        decision.certificate.elapsed_ms == 13
    }

    #[test]
    fn what_does_not_follow_convicts_who_gave_it_and_nobody_else() {
        let check = |statement: Vec<u8>, by| {
            let signed = signed(statement, by);
            let evidence = Evidence::of_decision(signed.statement, signed.signature);
            assert_eq!(Evidence::decode(&evidence.encode()), Ok(evidence.clone()));
            evidence.check(&roster(1), refutes)
        };
        let (stamp, key) = (Stamp { boot: 1, sequence: 7 }, robot(2).public_key());
        let proven = Conviction { robot: RobotId(2), key, stamp, lie: Lie::Unfounded };
        assert_eq!(check(gives(2, 13), 2), Ok(proven));
        assert_eq!(check(gives(2, 12), 2), Err(EvidenceError::Founded), "it may well follow");
        // By the author of the decision, which is robot 0, nothing of it was given.
        assert_eq!(check(gives(2, 13), 3), Err(EvidenceError::Forged(RobotId(2))));
        assert_eq!(check(gives(0, 13), 2), Err(EvidenceError::Forged(RobotId(0))));
        assert_eq!(check(gives(77, 13), 77), Err(EvidenceError::Stranger(RobotId(77))));
        assert_eq!(check(vote(2, 5, 1.0), 2), Err(EvidenceError::Undecided));
        assert!(matches!(check(vec![1, 2, 3], 2), Err(EvidenceError::Malformed(_))));
        // In a longer spelling it is not what was signed.
        let mut longer = gives(2, 13);
        longer.splice(1..2, [0x82, 0x00]);
        assert!(matches!(check(longer, 2), Err(EvidenceError::Malformed(_))));
    }

    /// A batch of that robot's under a stamp, with these samples: a number and a coordinate each.
    fn batch(author: u32, sequence: u32, samples: &[(u32, i8)]) -> HeldBatch {
        let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
        let sample = |(number, at): &(u32, i8)| SharedSample {
            id: gestalt_protocol::SampleId { author: RobotId(author), life: 9, number: *number },
            class: gestalt_protocol::ClassId(0),
            round,
            vector: gestalt_protocol::Vector::I8(vec![*at]),
        };
        let space = gestalt_protocol::FeatureSpaceId(4);
        let samples = Samples { space, samples: samples.iter().map(sample).collect() };
        let stamp = Stamp { boot: 1, sequence };
        let unsigned = HeldBatch { robot: RobotId(author), stamp, samples, signature: None };
        let signature = signed(Envelope::from(unsigned.clone()).statement(), author).signature;
        HeldBatch { signature: Some(signature), ..unsigned }
    }

    #[test]
    fn two_samples_under_one_number_convict_who_shared_them_and_nobody_else() {
        let check = |one: HeldBatch, other: HeldBatch| {
            let evidence = Evidence::of_batches(one.clone(), other.clone()).unwrap();
            assert_eq!(Evidence::of_batches(other, one), Some(evidence.clone()), "in whichever order");
            assert_eq!(Evidence::decode(&evidence.encode()), Ok(evidence.clone()));
            let json = serde_json::to_string(&evidence).unwrap();
            assert_eq!(serde_json::from_str::<Evidence>(&json).unwrap(), evidence);
            assert_eq!(evidence.lie(), Lie::TwoSamples);
            evidence.check(&roster(1), |_| true).map(|proven| (proven.robot, proven.lie))
        };
        let held = batch(2, 5, &[(1, 10), (2, 20)]);
        let proven = Ok((RobotId(2), Lie::TwoSamples));
        assert_eq!(check(held.clone(), batch(2, 6, &[(2, 21)])), proven);
        let mut elsewhere = batch(2, 6, &[(2, 20)]);
        elsewhere.samples.space = gestalt_protocol::FeatureSpaceId(5);
        let said = Envelope::from(HeldBatch { signature: None, ..elsewhere.clone() }).statement();
        elsewhere.signature = Some(signed(said, 2).signature);
        assert_eq!(check(held.clone(), elsewhere), proven, "in another feature space it is another sample");
        // The same again, by itself or among others, and others beside it.
        for honest in [batch(2, 6, &[(2, 20)]), held.clone(), batch(2, 6, &[(3, 30)])] {
            assert_eq!(check(held.clone(), honest), Err(EvidenceError::Compatible));
        }
        assert_eq!(check(held.clone(), batch(3, 6, &[(2, 21)])), Err(EvidenceError::Unrelated));
        let framed = HeldBatch { signature: batch(3, 6, &[(2, 21)]).signature, ..batch(2, 6, &[(2, 21)]) };
        assert_eq!(check(held.clone(), framed), Err(EvidenceError::Forged(RobotId(2))));
        assert_eq!(Evidence::of_batches(held.clone(), HeldBatch { signature: None, ..held }), None);
    }

    #[test]
    fn it_travels_in_bytes_and_in_text() {
        let bytes = lie().encode();
        assert_eq!(Evidence::decode(&bytes), Ok(lie()));
        assert_eq!(bytes.len(), 2 + 2 * (1 + vote(2, 5, 1.0).len() + 64));
        let json = serde_json::to_string(&lie()).unwrap();
        assert_eq!(serde_json::from_str::<Evidence>(&json).unwrap(), lie());
        assert!(serde_json::from_str::<Evidence>(&json.replace("\"03", "\"3")).is_err());
        for cut in 0..bytes.len() {
            assert!(Evidence::decode(&bytes[..cut]).is_err(), "{cut}");
        }
        assert_eq!(Evidence::decode(&[bytes.as_slice(), &[0]].concat()), Err(DecodeError::Trailing(1)));
        assert!(matches!(Evidence::decode(&[1]), Err(DecodeError::Impossible(_))));
    }

    #[test]
    fn it_is_bounded() {
        let mut statement = vote(2, 5, 1.0);
        statement.resize(MAX_EVIDENT, 0);
        let two =
            |statement: &[u8]| Evidence::of_two(signed(statement.to_vec(), 2), signed(vote(2, 5, 1.0), 2));
        assert_eq!(Evidence::decode(&two(&statement).encode()), Ok(two(&statement)));
        statement.push(0);
        assert!(Evidence::decode(&two(&statement).encode()).is_err());
        assert!(serde_json::from_str::<Evidence>(&serde_json::to_string(&two(&statement)).unwrap()).is_err());
        // A decision may be almost as long as a message.
        let one = |statement: &[u8]| {
            Evidence::of_decision(statement.to_vec(), Signature::from_bytes([7; Signature::LENGTH]))
        };
        statement.resize(MAX_SIGNED, 0);
        let largest = one(&statement).encode();
        assert!(largest.len() <= Evidence::MAX_LENGTH);
        assert_eq!(Evidence::decode(&largest), Ok(one(&statement)));
        statement.push(0);
        assert!(Evidence::decode(&one(&statement).encode()).is_err());
        assert!(serde_json::from_str::<Evidence>(&serde_json::to_string(&one(&statement)).unwrap()).is_err());
        let mut long = vec![VERSION; Evidence::MAX_LENGTH + 1];
        assert!(matches!(Evidence::decode(&long), Err(DecodeError::TooLong { .. })));
        long.pop();
        assert!(matches!(Evidence::decode(&long), Err(DecodeError::Trailing(_))));
    }

    #[test]
    fn a_decision_that_does_not_fit_in_a_message_is_not_looked_into() {
        let of_length = |length| {
            let mut statement = vote(2, 5, 1.0);
            statement.resize(length, 0);
            Evidence::of_decision(statement, Signature::from_bytes([7; Signature::LENGTH])).heading()
        };
        let heading = Heading { author: RobotId(2), stamp: Stamp { boot: 1, sequence: 5 } };
        assert_eq!(of_length(MAX_SIGNED), Ok(heading));
        for length in [MAX_SIGNED + 1, MAX_SIGNED + 2] {
            let too_long = DecodeError::TooLong { length, limit: MAX_SIGNED };
            assert_eq!(of_length(length), Err(EvidenceError::Malformed(too_long)));
        }
    }

    #[test]
    fn two_statements_are_the_same_evidence_in_whichever_order_they_were_met() {
        let (one, other) = (signed(vote(2, 5, 1.0), 2), signed(have(2, 5), 2));
        assert_eq!(
            Evidence::of_two(one.clone(), other.clone()),
            Evidence::of_two(other.clone(), one.clone())
        );
        let Proof::TwoThings { first, second } = Evidence::of_two(one.clone(), other.clone()).0 else {
            unreachable!()
        };
        assert!(first < second, "by their bytes");
        let length = one.statement.len() + other.statement.len();
        assert_eq!(Evidence::of_two(one, other.clone()).length(), length);
        assert_eq!(
            Evidence::of_decision(other.statement.clone(), other.signature).length(),
            other.statement.len()
        );
    }
}
