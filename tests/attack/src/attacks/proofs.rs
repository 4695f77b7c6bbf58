//! What a client is shown as a decision.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use gestalt_protocol::{
    CountedVote, Decision, Envelope, Give, Message, RobotId, RoundId, Stamp, decode_json,
};
use gestalt_strategies::{MindConfig, follows};
use gestalt_trust::Roster;

use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::forged;
use crate::swarm::world::{key, members, roster};
use crate::swarm::{Plan, Swarm};

pub const ALL: &[Attack] = &[
    Attack {
        number: "29",
        what: "flips one bit of every byte of a decision, in JSON and in postcard",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that says another gesture, other votes or another probability",
        counted: Counted::Some(&["no decision", "a signature", "it does not follow"]),
        gap: None,
        play: |seed| flips(seed, what_is_proven),
    },
    Attack {
        number: "29",
        what: "flips one bit of what an author says beside the votes",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that differs in anything",
        counted: Counted::Some(&["no decision", "a signature", "it does not follow"]),
        gap: Some(
            "no vote covers what its author says beside the votes: opener and life in the name of the round, n, q, author, \
                   milliseconds, `final`, and weight and class beside each vote",
        ),
        play: |seed| flips(seed, |decision| decision),
    },
    Attack {
        number: "29",
        what: "takes the gesture out of a decision",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "it is not proven that nothing was decided",
        counted: Counted::None("none of it is refused"),
        gap: Some(
            "any votes prove `no decision`, also those that decide: `follows` asks nothing of a decision without a gesture",
        ),
        play: without_gesture,
    },
    Attack {
        number: "29",
        what: "shows examples/verify.py every byte of a decision flipped",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that says another gesture, other votes or another probability",
        counted: Counted::None("it ends with the first cause that it meets, and names it"),
        gap: None,
        play: by_python,
    },
    Attack {
        number: "29",
        what: "a vote twice, one of another round, one of a stranger, another roster, no number, out of order",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "none is proven; one whose last bits another processor rounded is",
        counted: Counted::Some(&["no decision", "a signature", "it does not follow"]),
        gap: None,
        play: put_together,
    },
];

/// A decision of five sealed robots.
fn decided(seed: u64) -> Decision {
    let mut swarm = Swarm::new(&Plan::sealed(), seed, true);
    swarm.show((seed % 6) as u8);
    swarm.mind(1).held().cloned().expect("five robots that see the same decide")
}

/// What `gestalt verify` does: whether every vote was signed by a member, and the decision follows from them.
fn prove(decision: &Decision, roster: &Roster) -> Result<(), &'static str> {
    let certificate = &decision.certificate;
    let votes = certificate.votes.iter().map(CountedVote::held).chain(certificate.others.iter().cloned());
    for held in votes {
        let envelope = Envelope::from(held);
        let signature = envelope.signature.ok_or("a signature")?;
        roster.check(&envelope.statement(), &signature).map_err(|_| "a signature")?;
    }
    let rounds = MindConfig::default();
    if certificate.rule == rounds.rule && follows(decision, &rounds.rule, &rounds, certificate.robots) {
        Ok(())
    } else {
        Err("it does not follow")
    }
}

/// A decision without what its author says beside the votes, which nobody has to believe, and without the digits of its
/// probabilities beyond those that other processors agree on.
fn what_is_proven(mut decision: Decision) -> Decision {
    (decision.author, decision.is_final) = (RobotId(0), false);
    (decision.round.opener, decision.round.life) = (RobotId(0), 0);
    let certificate = &mut decision.certificate;
    (certificate.robots, certificate.quorum, certificate.elapsed_ms) = (0, 0, 0);
    for counted in &mut certificate.votes {
        (counted.class, counted.weight) = (gestalt_protocol::ClassId(0), 0.0);
    }
    let rounded = |p: f64| (p * 1e6).round() / 1e6;
    decision.confidence = rounded(decision.confidence);
    certificate.probabilities.iter_mut().for_each(|p| *p = rounded(*p));
    decision
}

fn flips(seed: u64, proven: fn(Decision) -> Decision) -> Played {
    let (decision, roster) = (decided(seed), roster(5));
    let original = proven(decision.clone());
    let (mut refused, mut reached) =
        (BTreeMap::<String, u64>::new(), prove(&decision, &roster).map_err(str::to_owned));
    let mut judge = |read: Option<Decision>, place: String| {
        if reached.is_err() {
            return;
        }
        let cause = match read.map(|read| (prove(&read, &roster), read)) {
            None => "no decision",
            Some((Err(cause), _)) => cause,
            Some((Ok(()), read)) => {
                // What becomes of those without a gesture is another line of the table.
                if proven(read.clone()) != original && read.class.is_some() {
                    reached = Err(format!("{place} makes another decision, which is proven"));
                }
                return;
            }
        };
        *refused.entry(cause.to_owned()).or_default() += 1;
    };
    let json = serde_json::to_vec(&decision).expect("a decision is JSON");
    let bit = 1 << (seed % 8);
    for place in 0..json.len() {
        let mut json = json.clone();
        json[place] ^= bit;
        let read = decode_json::<Decision>(&json).ok().filter(|decision| decision.check().is_ok());
        judge(read, format!("byte {place} of the JSON"));
    }
    let give = Message::Give(Give { decision: Some(decision), votes: Vec::new() });
    let stamp = Stamp { boot: 1, sequence: 1 };
    let bytes = Envelope { author: RobotId(1), stamp, message: give, signature: None }.encode();
    for place in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[place] ^= bit;
        let read = Envelope::decode(&bytes).ok().and_then(|envelope| match envelope.message {
            Message::Give(give) => give.decision,
            _ => None,
        });
        judge(read, format!("byte {place} in postcard"));
    }
    Played { reached, refused, silent: 0 }
}

fn without_gesture(seed: u64) -> Played {
    let undecided = Decision { class: None, ..decided(seed) };
    let reached = match prove(&undecided, &roster(5)) {
        Err(_) => Ok(()),
        Ok(()) => Err("votes of five robots for one gesture prove that nothing was decided".to_owned()),
    };
    Played { reached, refused: BTreeMap::new(), silent: 0 }
}

/// In one process, with the first seed alone: it takes some seconds.
fn by_python(seed: u64) -> Played {
    let skipped = || Played { reached: Ok(()), refused: BTreeMap::new(), silent: 0 };
    let has_cryptography = || {
        let asked =
            Command::new("python3").args(["-c", "import cryptography"]).stderr(Stdio::null()).status();
        asked.is_ok_and(|status| status.success())
    };
    if seed > 1 {
        return skipped();
    }
    if !has_cryptography() {
        eprintln!("skipped: flips.py: python3 has no package cryptography");
        return skipped();
    }
    let shown = serde_json::json!({ "decision": decided(seed), "roster": roster(5).to_json() });
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("flips.py");
    let mut child = match Command::new("python3")
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
    {
        Ok(child) => child,
        Err(error) => return Played { reached: Err(error.to_string()), ..skipped() },
    };
    if let Some(stdin) = child.stdin.take() {
        // What it does not read it does not prove: its status says so.
        let _ = serde_json::to_writer(stdin, &shown);
    }
    let reached = match child.wait_with_output() {
        Ok(ran) if ran.status.success() => Ok(()),
        Ok(ran) => Err(String::from_utf8_lossy(&ran.stderr).into_owned()),
        Err(error) => Err(error.to_string()),
    };
    Played { reached, ..skipped() }
}

fn put_together(seed: u64) -> Played {
    let (decision, roster) = (decided(seed), roster(5));
    let earlier = decided(seed + 100);
    let changed = |change: &dyn Fn(&mut Decision)| {
        let mut decision = decision.clone();
        change(&mut decision);
        decision
    };
    let stranger = |decision: &mut Decision| {
        let round = decision.round;
        let said = forged::said(9, Stamp { boot: 1, sequence: 1 }, forged::vote(round, 4, 1.0));
        let votes = decision.certificate.votes.iter().map(CountedVote::held);
        let votes = votes.chain([forged::held(forged::signed(said, &key(9), &roster.swarm_id()))]).collect();
        *decision = forged::decision(round, votes, 1);
    };
    let of_another_round = |decision: &mut Decision| {
        let round = RoundId { counter: decision.round.counter + 1, ..decision.round };
        let said = forged::said(1, Stamp { boot: 1, sequence: 99 }, forged::vote(round, 4, 1.0));
        let mut votes: Vec<_> = decision.certificate.votes.iter().map(CountedVote::held).collect();
        votes[0] = forged::held(forged::signed(said, &key(1), &roster.swarm_id()));
        *decision = forged::decision(decision.round, votes, 1);
    };
    let forgeries = [
        changed(&|d| d.certificate.votes[1] = d.certificate.votes[0].clone()),
        changed(&of_another_round),
        changed(&stranger),
        changed(&|d| d.certificate.votes.swap(0, 1)),
        changed(&|d| d.confidence = f64::NAN),
        changed(&|d| d.certificate.votes[0].vote.evidence[0] = f32::INFINITY),
        changed(&|d| d.certificate.votes[0].signature = None),
        changed(&|d| d.certificate.votes[0].signature = earlier.certificate.votes[1].signature),
        changed(&|d| d.certificate.votes.truncate(2)),
        changed(&|d| d.confidence += 1e-6),
    ];
    let mut refused = BTreeMap::<String, u64>::new();
    let mut reached = Ok(());
    let mut judge = |n: usize, decision: &Decision, roster: &Roster| {
        let sound = decision.check().map_err(|_| "no decision");
        match sound.and_then(|()| prove(decision, roster)) {
            Err(cause) => *refused.entry(cause.to_owned()).or_default() += 1,
            Ok(()) => reached = Err(format!("forgery {n} is proven")),
        }
    };
    forgeries.iter().enumerate().for_each(|(n, forgery)| judge(n, forgery, &roster));
    // An epoch in which robot 2 has another key.
    let mut later = members(5, 2);
    later.robots.insert(RobotId(2), key(92).public_key());
    let later = later.sign(&crate::swarm::world::authority()).expect("members that go together");
    judge(100, &decision, &later);
    // Another mathematical library.
    let rounded = changed(&|d| {
        d.confidence = (d.confidence - 1e-12).max(0.0);
        d.certificate.probabilities.iter_mut().for_each(|p| *p = (*p - 1e-12).max(0.0));
    });
    if prove(&rounded, &roster).is_err() {
        reached = Err("a rounding apart, and not proven".to_owned());
    }
    Played { reached, refused, silent: 0 }
}
