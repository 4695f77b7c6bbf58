//! Whether a decision was really made: checked offline, by whoever has the roster.

use gestalt_protocol::{
    Announcement, Decision, DecodeError, Envelope, FusionRule, HeldVote, RobotId, decode_json,
};
use gestalt_strategies::{MindConfig, follows};
use gestalt_trust::{Distrust, Roster, RosterError};
use rayon::prelude::*;
use serde_json::Value;
use thiserror::Error;

/// What keeps a decision from being one.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Unproven {
    /// No decision at all.
    #[error("no decision: {0}")]
    Decision(#[from] DecodeError),
    /// One that robots write otherwise.
    #[error(
        "a field is lacking, or is there beside those there are, or is written otherwise than robots write it"
    )]
    Spelling,
    /// No member of the roster announced it, or not so.
    #[error("it is not what robot {robot} announced: {cause}")]
    Announcement {
        /// In whose name it stands.
        robot: RobotId,
        /// Why it is not believed.
        cause: Distrust,
    },
    /// A vote that no member of the roster cast.
    #[error("the vote of robot {robot}: {cause}")]
    Vote {
        /// In whose name it stands.
        robot: RobotId,
        /// Why it is not believed.
        cause: Distrust,
    },
    /// Another fusion rule than the swarm's.
    #[error("it was fused by {found}, and the swarm's rule is {expected}: give the configuration of one of its robots", found = found.name(), expected = expected.name())]
    Rule {
        /// The one it names.
        found: FusionRule,
        /// The one of the configuration.
        expected: FusionRule,
    },
    /// The votes are true, and do not make this decision.
    #[error("it does not follow from its votes: robots of this configuration would not decide so")]
    Follows,
}

/// How `gestalt watch --json` begins and ends a line of a decision.
const LINE: [&[u8]; 2] = [b"{\"decision\":", b",\"event\":\"decision\"}"];

/// Reads a decision that is to be proven, or a line of `gestalt watch --json` with one: each of its fields, once, and nothing beside them. A robot passes over what it does not know, for a later release
/// may say more; but whoever is shown a file that was proven, and reads it by other means, is to find nothing in it that nobody proved.
///
/// # Errors
/// [`Unproven::Decision`] and [`Unproven::Spelling`].
pub fn read(json: &[u8]) -> Result<Announcement, Unproven> {
    let of_line = trimmed(json).strip_prefix(LINE[0]).and_then(|rest| rest.strip_suffix(LINE[1]));
    let json = of_line.unwrap_or(json);
    let announcement: Announcement = decode_json(json)?;
    let written = serde_json::to_value(&announcement).ok().zip(serde_json::from_slice(json).ok());
    written
        .is_some_and(|(meant, found)| is_spelt(&found, &meant))
        .then_some(announcement)
        .ok_or(Unproven::Spelling)
}

/// Without the space that JSON may have around it.
fn trimmed(json: &[u8]) -> &[u8] {
    let is_space = |byte: &u8| b" \t\n\r".contains(byte);
    let start = json.iter().position(|byte| !is_space(byte)).unwrap_or(json.len());
    let end = json.iter().rposition(|byte| !is_space(byte)).map_or(start, |last| last + 1);
    &json[start..end]
}

/// The same of the roster, of which members that there are none of may be left out.
///
/// # Errors
/// [`RosterError`].
pub fn read_roster(json: &[u8]) -> Result<Roster, RosterError> {
    let roster = Roster::parse(json)?;
    let written =
        serde_json::from_str::<Value>(&roster.to_json()).ok().zip(serde_json::from_slice(json).ok());
    let same = written.is_some_and(|(meant, found): (_, Value)| {
        found
            .as_object()
            .is_some_and(|found| found.iter().all(|(field, value)| meant.get(field) == Some(value)))
    });
    same.then_some(roster)
        .ok_or_else(|| RosterError::Malformed("written otherwise than 'gestalt trust' writes it".to_owned()))
}

/// Whether that has the form of what it was taken for. Numbers have many spellings, and are none the less the same.
fn is_spelt(found: &Value, meant: &Value) -> bool {
    match (found, meant) {
        (Value::Object(found), Value::Object(meant)) => {
            let is_field = |(field, value)| meant.get(field).is_some_and(|meant| is_spelt(value, meant));
            found.len() == meant.len() && found.iter().all(is_field)
        }
        (Value::Array(found), Value::Array(meant)) => {
            found.len() == meant.len() && found.iter().zip(meant).all(|(found, meant)| is_spelt(found, meant))
        }
        (found, meant) => std::mem::discriminant(found) == std::mem::discriminant(meant),
    }
}

/// Whether a member of the swarm announced that, to the last word; every vote that it rests on was signed by a member, and it follows from
/// them by the rounds of that configuration, in a swarm of at least so many `robots`. Who drew it, how long that took, of how many more robots, what its
/// gesture is called, and whether it is final is its announcer's word alone: for a robot that says it is alone, its own vote suffices.
///
/// # Errors
/// The first [`Unproven`] found.
pub fn check(
    announcement: &Announcement,
    roster: &Roster,
    rounds: &MindConfig,
    robots: u32,
) -> Result<(), Unproven> {
    let robot = announcement.announcer;
    let said = Envelope::from(announcement.clone());
    let signature = said.signature.ok_or(Unproven::Announcement { robot, cause: Distrust::Unsigned })?;
    let checked = roster.check(&said.statement(), &signature);
    checked.map_err(|cause| Unproven::Announcement { robot, cause })?;
    // No robot would take it: see `Refusal::Label`.
    announcement.check()?;
    if announcement.label.is_some() && announcement.decision.class.is_none() {
        return Err(DecodeError::Impossible("a label, where nothing was decided").into());
    }
    check_votes(&announcement.decision, roster, rounds, robots)
}

fn check_votes(
    decision: &Decision,
    roster: &Roster,
    rounds: &MindConfig,
    robots: u32,
) -> Result<(), Unproven> {
    let certificate = &decision.certificate;
    let votes: Vec<HeldVote> = certificate.held_votes().collect();
    // On all cores: signatures are nearly all of the work.
    let unproven = votes.into_par_iter().find_map_first(|held| {
        let robot = held.robot;
        was_cast(held, roster).err().map(|cause| Unproven::Vote { robot, cause })
    });
    unproven.map_or(Ok(()), Err)?;
    if certificate.rule != rounds.rule {
        return Err(Unproven::Rule { found: certificate.rule, expected: rounds.rule });
    }
    match follows(decision, &rounds.rule, rounds, certificate.robots.max(robots)) {
        true => Ok(()),
        false => Err(Unproven::Follows),
    }
}

/// Whether a member signed that vote.
fn was_cast(held: HeldVote, roster: &Roster) -> Result<(), Distrust> {
    let envelope = Envelope::from(held);
    let signature = envelope.signature.ok_or(Distrust::Unsigned)?;
    roster.check(&envelope.statement(), &signature).map(drop)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use gestalt_protocol::{ClassId, Message, Signature, decode_json};
    use gestalt_strategies::{
        Classify, ClassifyError, Input, Life, Mind, Observation, Output, Sign, Vocabulary,
    };
    use gestalt_trust::{Identity, Membership, SwarmId, statement};

    use super::*;

    #[derive(Debug)]
    struct Verbatim(Vocabulary);

    impl Classify for Verbatim {
        fn vocabulary(&self) -> &Vocabulary {
            &self.0
        }

        fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
            Ok(features.iter().map(|p| f64::from(*p)).collect())
        }
    }

    #[derive(Debug)]
    struct Signer(Identity, SwarmId);

    impl Sign for Signer {
        fn sign(&self, words: &[u8]) -> Signature {
            statement::sign(&self.0, &self.1, words)
        }
    }

    /// What four robots decide, one of which sees nothing.
    fn decided() -> (Decision, Roster) {
        let identity = |k: u8| Identity::from_bytes(&[k; 32]);
        let robots = (1..=4).map(|k| (RobotId(u32::from(k)), identity(k).public_key())).collect();
        let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
        let roster = members.sign(&identity(99)).unwrap();
        let mut minds: Vec<Mind> = (1..=4)
            .map(|k| {
                let life = Life { boot: 1, nonce: 7 };
                let mind = Mind::new(RobotId(u32::from(k)), life, MindConfig::default()).unwrap();
                mind.signed_by(Arc::new(Signer(identity(k), roster.swarm_id())))
            })
            .collect();
        let mut due: Vec<(usize, Input)> = Vec::new();
        for k in 0..4 {
            let vocabulary = Vocabulary::new(["a", "b"]).unwrap();
            due.push((k, Input::Learned(Arc::new(Verbatim(vocabulary)))));
            due.push((k, Input::Alive(Arc::new((1..=4).map(RobotId).collect()))));
            due.push((k, Input::Blind(k == 3)));
            due.push((k, Input::Open));
            if k < 3 {
                due.push((k, Input::Observed(Observation { features: vec![0.01, 0.99], quality: 1.0 })));
            }
        }
        for ms in 1..3000 {
            for (k, input) in std::mem::take(&mut due).into_iter().chain((0..4).map(|k| (k, Input::Tick))) {
                for output in minds[k].handle(Duration::from_millis(ms), input) {
                    match output {
                        Output::Broadcast(envelope) => {
                            due.extend(
                                (0..4).filter(|j| *j != k).map(|j| (j, Input::Received(envelope.clone()))),
                            );
                        }
                        Output::Hold(decision) => return (decision, roster),
                        _ => {}
                    }
                }
            }
        }
        panic!("nothing was decided");
    }

    #[test]
    fn a_decision_is_proven_by_its_votes_and_by_nothing_else() {
        let (decision, roster) = decided();
        let rounds = MindConfig::default();
        assert_eq!((decision.class, decision.certificate.votes.len()), (Some(ClassId(1)), 3));
        assert_eq!(decision.certificate.others.len(), 1, "who saw nothing took part");
        assert_eq!(check_votes(&decision, &roster, &rounds, 1), Ok(()));
        // What its author says of itself is not part of that.
        let mut vain = decision.clone();
        (vain.author, vain.certificate.elapsed_ms, vain.is_final) = (RobotId(4), 0, true);
        assert_eq!(check_votes(&vain, &roster, &rounds, 1), Ok(()));
        assert_eq!(check_votes(&decision, &roster, &rounds, 7), Ok(()), "four of seven");
        let of_more = check_votes(&decision, &roster, &rounds, 8);
        assert_eq!(of_more, Err(Unproven::Follows), "whatever it says of how many there were");
        let unproven = |change: &dyn Fn(&mut Decision)| {
            let mut decision = decision.clone();
            change(&mut decision);
            check_votes(&decision, &roster, &rounds, 1).unwrap_err()
        };
        assert_eq!(unproven(&|d| d.class = Some(ClassId(0))), Unproven::Follows);
        assert_eq!(unproven(&|d| d.confidence += 1e-6), Unproven::Follows);
        assert_eq!(unproven(&|d| d.certificate.robots = 8), Unproven::Follows, "no majority");
        assert_eq!(unproven(&|d| drop(d.certificate.votes.pop())), Unproven::Follows);
        assert!(matches!(unproven(&|d| d.certificate.rule = FusionRule::Majority), Unproven::Rule { .. }));
        let unsigned = unproven(&|d| d.certificate.votes[0].signature = None);
        assert_eq!(unsigned, Unproven::Vote { robot: RobotId(1), cause: Distrust::Unsigned });
        let stranger = unproven(&|d| d.certificate.votes[2].robot = RobotId(5));
        assert_eq!(stranger, Unproven::Vote { robot: RobotId(5), cause: Distrust::Stranger });
    }

    #[test]
    fn what_is_beside_the_votes_is_its_announcers_word() {
        let (decision, roster) = decided();
        let rounds = MindConfig::default();
        let said = |decision: Decision, by: u8| {
            let (announcer, stamp) = (RobotId(2), gestalt_protocol::Stamp { boot: 1, sequence: 900 });
            let label = decision.class.map(|_| "b".to_owned());
            let unsigned = Announcement { decision, label, announcer, stamp, signature: None };
            let signer = Signer(Identity::from_bytes(&[by; 32]), roster.swarm_id());
            let signature = Some(signer.sign(&Envelope::from(unsigned.clone()).statement()));
            Announcement { signature, ..unsigned }
        };
        let announced = said(decision.clone(), 2);
        assert_eq!(check(&announced, &roster, &rounds, 1), Ok(()));
        // As a client reads it.
        let json = serde_json::to_vec(&announced).unwrap();
        assert_eq!(check(&decode_json(&json).unwrap(), &roster, &rounds, 1), Ok(()));
        let robot = RobotId(2);
        let refused = |cause| Err(Unproven::Announcement { robot, cause });
        assert_eq!(check(&said(decision.clone(), 3), &roster, &rounds, 1), refused(Distrust::Forged));
        let unsigned = Announcement { signature: None, ..announced.clone() };
        assert_eq!(check(&unsigned, &roster, &rounds, 1), refused(Distrust::Unsigned));
        type Change = fn(&mut Decision);
        let changes: [Change; 7] = [
            |d| d.is_final ^= true,
            |d| d.author = RobotId(4),
            |d| d.round.life ^= 1,
            |d| d.certificate.elapsed_ms += 1,
            |d| d.certificate.quorum += 1,
            |d| d.certificate.votes[0].weight += 1.0,
            |d| d.class = None,
        ];
        for change in changes {
            let mut changed = announced.clone();
            change(&mut changed.decision);
            assert_eq!(check(&changed, &roster, &rounds, 1), refused(Distrust::Forged), "{changed:?}");
        }
        // Nor can a member say that votes which decide decide nothing.
        let undecided = said(Decision { class: None, ..decision }, 2);
        assert_eq!(check(&undecided, &roster, &rounds, 1), Err(Unproven::Follows));
    }

    #[test]
    fn no_byte_of_the_votes_can_be_another() {
        let (decision, roster) = decided();
        let mut read = 0;
        for vote in 0..decision.certificate.votes.len() {
            let bytes = Envelope::from(decision.certificate.votes[vote].held()).encode();
            for place in 0..bytes.len() {
                let mut bytes = bytes.clone();
                bytes[place] ^= 1;
                let Ok(Envelope { author, stamp, message: Message::Vote(said), signature }) =
                    Envelope::decode(&bytes)
                else {
                    continue;
                };
                read += 1;
                let mut forged = decision.clone();
                let counted = &mut forged.certificate.votes[vote];
                (counted.robot, counted.stamp, counted.vote, counted.signature) =
                    (author, stamp, said, signature);
                assert!(
                    check_votes(&forged, &roster, &MindConfig::default(), 1).is_err(),
                    "byte {place} of vote {vote}"
                );
            }
        }
        assert!(read > 200, "{read} forgeries were votes at all");
    }
}
