//! What a client is shown as a decision.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use gestalt_protocol::{
    Announcement, CountedVote, Decision, Envelope, Give, Message, RobotId, RoundId, Stamp, Topic, decode_json,
};
use gestalt_strategies::{MindConfig, follows};

use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::forged;
use crate::swarm::world::{key, members, roster};
use crate::swarm::{Plan, Swarm};
use crate::trust::Roster;

pub const ALL: &[Attack] = &[
    Attack {
        number: "29",
        what: "flips one bit of every byte of what is announced, in JSON and as its announcer signed it",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that differs in anything",
        counted: Counted::Some(&["no decision", "a signature"]),
        gap: None,
        play: announcements,
    },
    Attack {
        number: "29",
        what: "flips one bit of every byte of a decision that a robot gives to another",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that says another gesture, other votes or another probability",
        counted: Counted::Some(&["no decision", "a signature", "it does not follow"]),
        gap: None,
        play: given,
    },
    Attack {
        number: "29",
        what: "takes the gesture out of a decision",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "it is not proven that nothing was decided",
        counted: Counted::Some(&["a signature"]),
        gap: None,
        play: |seed| without_gesture(seed, None),
    },
    Attack {
        number: "29",
        what: "an enrolled robot announces a decision out of which it has taken the gesture",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "it is not proven that nothing was decided",
        counted: Counted::Some(&["it does not follow"]),
        gap: None,
        play: |seed| without_gesture(seed, Some(2)),
    },
    Attack {
        number: "29",
        what: "shows examples/verify.py every byte of what is announced flipped",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "none is proven that differs in anything",
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

/// What one of five sealed robots announces.
fn announced(seed: u64) -> Announcement {
    let mut swarm = Swarm::new(&Plan::sealed(), seed, true);
    swarm.show((seed % 6) as u32);
    let mut said = swarm.air().iter().filter(|parcel| swarm.topic(&parcel.key) == Some(Topic::Decision));
    let said = said.next_back().and_then(|parcel| decode_json(&parcel.bytes).ok());
    said.expect("five robots that see the same decide")
}

/// What `gestalt verify` does: whether a member announced it so, and [`prove_votes`].
fn prove(announcement: &Announcement, roster: &Roster) -> Result<(), &'static str> {
    announcement.decision.check().map_err(|_| "no decision")?;
    prove_signed(announcement.clone().into(), roster)?;
    prove_votes(&announcement.decision, roster)
}

fn prove_signed(envelope: Envelope, roster: &Roster) -> Result<(), &'static str> {
    let signature = envelope.signature.ok_or("a signature")?;
    roster.check(&envelope.statement(), &signature).map(drop).map_err(|_| "a signature")
}

/// Whether every vote was signed by a member, and the decision follows from them.
fn prove_votes(decision: &Decision, roster: &Roster) -> Result<(), &'static str> {
    let certificate = &decision.certificate;
    let votes = certificate.votes.iter().map(CountedVote::held).chain(certificate.others.iter().cloned());
    for held in votes {
        prove_signed(held.into(), roster)?;
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
    certificate.pool.iter_mut().for_each(|pool| pool.rounds = 0);
    for counted in &mut certificate.votes {
        (counted.class, counted.weight) = (gestalt_protocol::ClassId(0), 0.0);
    }
    let rounded = |p: f64| (p * 1e6).round() / 1e6;
    decision.confidence = rounded(decision.confidence);
    certificate.probabilities.iter_mut().for_each(|p| *p = rounded(*p));
    decision
}

/// What became of everything that was flipped: why it was refused, unless it is what it was.
struct Flips<T> {
    original: T,
    played: Played,
}

impl<T: PartialEq> Flips<T> {
    fn new(original: T, proven: Result<(), &'static str>) -> Self {
        let reached = proven.map_err(str::to_owned);
        Self { original, played: Played { reached, refused: BTreeMap::new(), silent: 0 } }
    }

    fn judge(&mut self, proven: Result<T, &'static str>, place: &str) {
        match proven {
            Err(cause) => *self.played.refused.entry(cause.to_owned()).or_default() += 1,
            Ok(proven) if proven == self.original => {}
            Ok(_) => {
                let reached = Err(format!("{place} makes another one, which is proven"));
                self.played.reached = self.played.reached.clone().and(reached);
            }
        }
    }
}

/// The same bytes with one bit flipped, of each byte in turn.
fn flipped(bytes: &[u8], seed: u64) -> impl Iterator<Item = (usize, Vec<u8>)> {
    (0..bytes.len()).map(move |place| {
        let mut bytes = bytes.to_vec();
        bytes[place] ^= 1 << (seed % 8);
        (place, bytes)
    })
}

fn announcements(seed: u64) -> Played {
    let (said, roster) = (announced(seed), roster(5));
    let mut flips = Flips::new(said.clone(), prove(&said, &roster));
    let judged = |read: Option<Announcement>| {
        let read = read.ok_or("no decision")?;
        prove(&read, &roster).map(|()| read)
    };
    let json = serde_json::to_vec(&said).expect("an announcement is JSON");
    for (place, json) in flipped(&json, seed) {
        flips.judge(judged(decode_json(&json).ok()), &format!("byte {place} of the JSON"));
    }
    for (place, bytes) in flipped(&Envelope::from(said).encode(), seed) {
        let read = Envelope::decode(&bytes).ok().and_then(Announcement::of);
        flips.judge(judged(read), &format!("byte {place} as it was signed"));
    }
    flips.played
}

fn given(seed: u64) -> Played {
    let (decision, roster) = (announced(seed).decision, roster(5));
    let mut flips = Flips::new(what_is_proven(decision.clone()), prove_votes(&decision, &roster));
    let give = Give { decision: Some(decision), votes: Vec::new(), holders: Vec::new() };
    let stamp = Stamp { boot: 1, sequence: 1 };
    let bytes =
        Envelope { author: RobotId(1), stamp, message: Message::Give(give), signature: None }.encode();
    for (place, bytes) in flipped(&bytes, seed) {
        let read = Envelope::decode(&bytes).ok().and_then(|envelope| match envelope.message {
            Message::Give(give) => give.decision,
            _ => None,
        });
        let judged = read.ok_or("no decision");
        let judged = judged.and_then(|read| prove_votes(&read, &roster).map(|()| what_is_proven(read)));
        flips.judge(judged, &format!("byte {place}"));
    }
    flips.played
}

/// `by`: the member that signs it, if one does.
fn without_gesture(seed: u64, by: Option<u32>) -> Played {
    let (mut said, roster) = (announced(seed), roster(5));
    (said.decision.class, said.label) = (None, None);
    if let Some(by) = by {
        said.announcer = RobotId(by);
        let signed = forged::signed(said.into(), &key(by), &roster.swarm_id());
        said = Announcement::of(signed).expect("an announcement");
    }
    let (mut refused, mut reached) = (BTreeMap::new(), Ok(()));
    match prove(&said, &roster) {
        Err(cause) => drop(refused.insert(cause.to_owned(), 1)),
        Ok(()) => {
            reached = Err("votes of five robots for one gesture prove that nothing was decided".to_owned());
        }
    }
    Played { reached, refused, silent: 0 }
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
    let shown = serde_json::json!({ "decision": announced(seed), "roster": roster(5).to_json() });
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
    let (decision, roster) = (announced(seed).decision, roster(5));
    let earlier = announced(seed + 100).decision;
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
        match sound.and_then(|()| prove_votes(decision, roster)) {
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
    if prove_votes(&rounded, &roster).is_err() {
        reached = Err("a rounding apart, and not proven".to_owned());
    }
    Played { reached, refused, silent: 0 }
}
