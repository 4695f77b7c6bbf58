//! What it takes to prove a decision of a hundred robots: every vote's signature, and that the decision follows from the votes.
//! `cargo bench --workspace --bench proof`

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use gestalt_peer::proof;
use gestalt_protocol::{Announcement, Decision, Envelope, RobotId, Signature, Stamp};
use gestalt_strategies::{
    Classify, ClassifyError, Input, Life, Mind, MindConfig, Observation, Output, Quorum, Sign, Vocabulary,
};
use gestalt_trust::{Identity, Membership, Roster, SwarmId, statement};

const ROBOTS: u32 = 100;

fn main() {
    divan::main();
}

/// Believes its features.
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

fn identity(robot: u32) -> Identity {
    let mut secret = [1; 32];
    secret[..4].copy_from_slice(&robot.to_le_bytes());
    Identity::from_bytes(&secret)
}

fn roster() -> Roster {
    let robots: BTreeMap<_, _> = (0..ROBOTS).map(|k| (RobotId(k), identity(k).public_key())).collect();
    let members = Membership { swarm: "bench".to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&identity(u32::MAX)).expect("members that go together")
}

/// What robots decide that all see the same, by everybody's vote.
fn decided(roster: &Roster) -> Decision {
    let everybody = Arc::new((0..ROBOTS).map(RobotId).collect());
    let config = MindConfig { quorum: Quorum::Evidence(ROBOTS), ..MindConfig::default() };
    let classifier = Arc::new(Verbatim(Vocabulary::new(["a", "b"]).expect("two labels")));
    let mut minds: Vec<Mind> = (0..ROBOTS)
        .map(|k| {
            let mind = Mind::new(RobotId(k), Life { boot: 1, nonce: 7 }, config.clone()).expect("defaults");
            mind.signed_by(Arc::new(Signer(identity(k), roster.swarm_id())))
        })
        .collect();
    let mut due: Vec<(usize, Input)> = Vec::new();
    for k in 0..minds.len() {
        due.push((k, Input::Learned(classifier.clone())));
        due.push((k, Input::Alive(Arc::clone(&everybody))));
        due.push((k, Input::Open));
        due.push((k, Input::Observed(Observation { features: vec![0.01, 0.99], quality: 1.0 })));
    }
    for now in (1..3000).map(Duration::from_millis) {
        let ticks = (0..minds.len()).map(|k| (k, Input::Tick));
        for (k, input) in std::mem::take(&mut due).into_iter().chain(ticks) {
            for output in minds[k].handle(now, input) {
                match output {
                    Output::Broadcast(said) => due.extend(
                        (0..ROBOTS as usize).filter(|j| *j != k).map(|j| (j, Input::Received(said.clone()))),
                    ),
                    Output::Hold(decision) => return decision,
                    _ => {}
                }
            }
        }
    }
    panic!("nothing was decided");
}

#[divan::bench]
fn prove_a_decision(bencher: divan::Bencher) {
    let roster = roster();
    let decision = decided(&roster);
    let votes = decision.certificate.votes.len();
    assert_eq!(votes, ROBOTS as usize);
    let (announcer, stamp) = (RobotId(0), Stamp { boot: 1, sequence: 900 });
    let label = Some("b".to_owned());
    let unsigned = Announcement { decision, label, announcer, stamp, signature: None };
    let signer = Signer(identity(0), roster.swarm_id());
    let signature = Some(signer.sign(&Envelope::from(unsigned.clone()).statement()));
    let announcement = Announcement { signature, ..unsigned };
    let rounds = MindConfig { quorum: Quorum::Evidence(ROBOTS), ..MindConfig::default() };
    let proven = || proof::check(divan::black_box(&announcement), &roster, &rounds, ROBOTS);
    bencher.bench(|| proven().expect("a true decision"));
}
