//! Decisions that nobody made.

use std::collections::BTreeSet;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, ClassId, Decision, Envelope, Give, Have, HeldVote, Holder, Message, RobotId, Stamp, Topic,
};

use super::WHOEVER_SAYS_SO;
use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, decided_alike, decided_in_time, unmoved};
use crate::forged;
use crate::swarm::world::{CLASSES, STRANGER, key};
use crate::swarm::{Parcel, Plan, Swarm};

const MS: Duration = Duration::from_millis(1);

/// The gesture that is shown, and the one that the adversary wants.
pub(super) const TRUE: u32 = 2;
pub(super) const FALSE: u32 = 4;
const OTHER: u32 = 5;

pub const ALL: &[Attack] = &[
    Attack {
        number: "A1",
        what: "announces a decision of 4,096 made-up votes that does not follow from them, also of the next round",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "nothing",
        counted: Counted::All(&["refused_unfounded_decision"]),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, unfounded, unmoved),
    },
    Attack {
        number: "A1 · 2",
        what: "announces a decision that follows from 4,096 made-up votes, unsigned and signed by a stranger",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_decision_unsigned", "refused_decision_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| made_up(swarm, &announced_aloud), unmoved),
    },
    Attack {
        number: "A1 · 2",
        what: "announces a decision that follows from 4,096 made-up votes",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "the true decision stands everywhere",
        counted: Counted::None("the votes of robots that nobody knows are taken for true"),
        gap: Some(WHOEVER_SAYS_SO),
        play: |seed| beside(&Plan::open(), seed, |swarm| made_up(swarm, &announced_aloud), decided_in_time),
    },
    Attack {
        number: "A2",
        what: "gives that decision to one robot after the other, as a neighbour does",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| made_up(swarm, &given), unmoved),
    },
    Attack {
        number: "2",
        what: "an enrolled robot gives that decision to one robot after the other",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_unsigned", "refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| made_up(swarm, &given_by_liar), unmoved),
    },
    Attack {
        number: "2",
        what: "an enrolled robot announces a decision of votes that it made up for the others and signed itself",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_decision_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, in_their_names, unmoved),
    },
    Attack {
        number: "A3",
        what: "says for f + 1 robots that they hold a greater decision, which nobody has",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_robot_decision_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().withstanding(1), seed, |swarm| hearsay(swarm, &[2, 3]), unmoved),
    },
    Attack {
        number: "A3",
        what: "an enrolled robot says for itself and others that they hold a greater decision, which nobody has",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nobody holds another; announced within 0.5 s of the usual",
        counted: Counted::Some(&["refused_robot_decision_unsigned"]),
        gap: None,
        play: |seed| beside(&eight(), seed, |swarm| hearsay(swarm, &[2, 3, 9]), half_a_second_later),
    },
    Attack {
        number: "A3",
        what: "says to a robot that was cut off that the others hold what it holds, in their names, as their neighbour, and by its authors",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "it is not announced as final",
        counted: Counted::All(&["refused_robot_decision_unsigned", "refused_repair_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, false_finality, final_as_in_peace),
    },
    Attack {
        number: "A3 · 7",
        what: "says to a robot that was cut off again what the others said they hold in the round before",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "it is not announced as final",
        counted: Counted::None("they are true words on another round"),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, finality_of_before, final_as_in_peace),
    },
    Attack {
        number: "A4 · 11",
        what: "an enrolled robot decides on the earliest votes of the others and one of its own, of 16 looks, that it withheld",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "no other gesture is decided",
        counted: Counted::None(
            "its own votes and those of the others are true, and so is what follows from them",
        ),
        gap: None,
        play: |seed| beside(&eight(), seed, chosen, same_gesture),
    },
    Attack {
        number: "A16",
        what: "contradicts every 150 ms with a lesser decision that does not follow",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "nothing",
        counted: Counted::All(&["refused_unfounded_decision"]),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, contradicting, unmoved),
    },
    Attack {
        number: "A16",
        what: "contradicts every 150 ms with a lesser decision of made-up votes",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_decision_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, contradicting, unmoved),
    },
    Attack {
        number: "A16",
        what: "announces the true decision to the robots alone, as final, before one of them does",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_decision_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, announced_to_robots, unmoved),
    },
];

/// Enough honest robots to outvote the liar among them with the margin that one liar needs.
pub(super) fn eight() -> Plan {
    Plan { honest: 8, ..Plan::sealed().liars(1).withstanding(1) }
}

/// Begins a round, lets the adversary act in its midst, ends it.
pub(super) fn amid_a_round(swarm: &mut Swarm, act: &dyn Fn(&mut Swarm)) {
    let began = swarm.now();
    swarm.begin(TRUE);
    swarm.pass(50 * MS);
    if swarm.at_war() {
        act(swarm);
    }
    swarm.end(began);
}

/// Votes of robots that do not exist.
fn of_nobody(swarm: &Swarm, robots: u32, signs: bool) -> Vec<HeldVote> {
    let (round, id) = (swarm.round(), swarm.id());
    let votes = (0..robots).map(|n| {
        let vote = forged::vote(round, FALSE, 16.0);
        let said = forged::said(10_000 + n, Stamp { boot: 1, sequence: 1 }, vote);
        // Signing all of them would only cost time: the first one that is refused ends it.
        forged::held(if signs && n == 0 { forged::signed(said, &key(STRANGER), &id) } else { said })
    });
    votes.collect()
}

fn unfounded(swarm: &mut Swarm) {
    amid_a_round(swarm, &|swarm| {
        for ahead in 0..2 {
            let mut round = swarm.round();
            round.counter += ahead;
            let mut decision = forged::decision(round, of_nobody(swarm, 4096, false), 0);
            // They are all for another gesture than it claims.
            for counted in &mut decision.certificate.votes {
                counted.vote = forged::vote(round, OTHER, 16.0);
            }
            decision.class = Some(ClassId(FALSE));
            decision.confidence = 1.0;
            decision.certificate.probabilities = vec![0.0; CLASSES as usize];
            decision.certificate.probabilities[FALSE as usize] = 1.0;
            swarm.put_decision(&decision);
        }
    });
}

fn made_up(swarm: &mut Swarm, way: &dyn Fn(&mut Swarm, Vec<HeldVote>)) {
    amid_a_round(swarm, &|swarm| {
        for signs in [false, true] {
            let votes = of_nobody(swarm, 4096, signs);
            way(swarm, votes);
        }
    });
}

fn announced_aloud(swarm: &mut Swarm, votes: Vec<HeldVote>) {
    let signs = votes.iter().any(|held| held.signature.is_some());
    let decision = forged::decision(swarm.round(), votes, 0);
    if !signs {
        return swarm.put_decision(&decision);
    }
    let (announcer, stamp) = (RobotId(10_000), Stamp { boot: 1, sequence: 2 });
    let said = Announcement { decision, label: None, announcer, stamp, signature: None };
    let said = forged::signed(said.into(), &key(STRANGER), &swarm.id());
    swarm.put_announcement(said);
}

fn given(swarm: &mut Swarm, votes: Vec<HeldVote>) {
    let signs = votes.iter().any(|held| held.signature.is_some());
    let message = forged::given(forged::decision(swarm.round(), votes, 0));
    if !signs {
        return swarm.whisper(50, &message);
    }
    let stamp = Stamp { boot: 1, sequence: 3 };
    let said = Envelope { author: RobotId(50), stamp, message, signature: None };
    let said = forged::signed(said, &key(STRANGER), &swarm.id());
    for to in 1..=swarm.honest() {
        swarm.put_to(to, &Topic::Repair(RobotId(to)), &said.encode());
    }
}

fn given_by_liar(swarm: &mut Swarm, votes: Vec<HeldVote>) {
    swarm.whisper(swarm.liar(), &forged::given(forged::decision(swarm.round(), votes, 0)));
}

fn in_their_names(swarm: &mut Swarm) {
    amid_a_round(swarm, &|swarm| {
        let (round, id, liar) = (swarm.round(), swarm.id(), key(6));
        let vote = |robot| forged::said(robot, forged::LAST, forged::vote(round, FALSE, 16.0));
        let votes = (1..=6).map(|robot| forged::held(forged::signed(vote(robot), &liar, &id)));
        swarm.put_decision(&forged::decision(round, votes.collect(), 6));
    });
}

/// Whom the others seem to contradict waits to see whether they do.
fn half_a_second_later(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_alike(peace, war, Duration::from_millis(500))
}

fn hearsay(swarm: &mut Swarm, in_whose_names: &[u32]) {
    amid_a_round(swarm, &|swarm| {
        let decision = forged::decision(swarm.round(), of_nobody(swarm, 100, false), 0);
        for robot in in_whose_names {
            for to in 1..=swarm.honest() {
                swarm.put_holding(to, *robot, &decision);
            }
        }
    });
}

/// How many robots have said a vote with evidence.
fn voted(swarm: &Swarm) -> usize {
    voted_in(swarm, Duration::ZERO)
}

/// The same since then.
fn voted_in(swarm: &Swarm, since: Duration) -> usize {
    let votes = swarm.votes_since(since).into_iter().filter(|held| !held.vote.evidence.is_empty());
    votes.map(|held| held.robot).collect::<BTreeSet<_>>().len()
}

fn announced_to_robots(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(TRUE);
    while voted(swarm) < 5 && swarm.now() < began + 1000 * MS {
        swarm.pass(MS);
    }
    let votes = swarm.votes().into_iter().filter(|held| !held.vote.evidence.is_empty()).collect();
    let decision = forged::decision(swarm.round(), votes, 1);
    swarm.pass(20 * MS);
    swarm.put_decision(&decision);
    swarm.end(began);
}

/// Robot 1 is cut off when all have voted, and before anybody says what it holds.
fn false_finality(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(TRUE);
    while voted(swarm) < 5 && swarm.now() < began + 1000 * MS {
        swarm.pass(MS / 10);
    }
    swarm.cut([1]);
    swarm.pass(50 * MS);
    if let Some(held) = swarm.mind(1).held().cloned() {
        for robot in [3, 4, 5] {
            swarm.put_holding(1, robot, &held);
            let decision = Some(held.rank());
            let (votes, knowledge) = (Vec::new(), None);
            let have = Have { round: Some(held.round), decision, holders: 0, votes, knowledge, answer: true };
            swarm.whisper_to(1, robot, &Message::Have(have));
            let by_another = Decision { author: RobotId(robot), ..held.clone() };
            let stamp = Stamp { boot: 10, sequence: 1 };
            let holder =
                Holder { robot: RobotId(robot), stamp, holding: held.holding(false), signature: None };
            let give = Give { decision: Some(by_another), votes: Vec::new(), holders: vec![holder] };
            swarm.whisper_to(1, robot, &Message::Give(give));
        }
    }
    swarm.end(began);
    swarm.pass(5000 * MS);
}

/// The same with words that were true once.
fn finality_of_before(swarm: &mut Swarm) {
    swarm.show(TRUE);
    let of_holding = |parcel: &&Parcel| matches!(swarm.topic(&parcel.key), Some(Topic::RobotDecision(_)));
    let recorded: Vec<Parcel> = swarm.air().iter().filter(of_holding).cloned().collect();
    swarm.pass(6000 * MS);
    let began = swarm.now();
    swarm.begin(TRUE);
    while voted_in(swarm, began) < 5 && swarm.now() < began + 1000 * MS {
        swarm.pass(MS / 10);
    }
    swarm.cut([1]);
    swarm.pass(50 * MS);
    for parcel in &recorded {
        swarm.replay_to(1, parcel);
    }
    swarm.end(began);
    swarm.pass(5000 * MS);
}

fn final_as_in_peace(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let said = |swarm: &Swarm| -> Vec<bool> {
        let by_one = swarm.announced().iter().filter(|(_, by, _)| *by == RobotId(1));
        by_one.map(|(.., decision)| decision.is_final).collect()
    };
    match said(war) == said(peace) {
        true => Ok(()),
        false => Err(format!("announced as final: {:?}, in peace {:?}", said(war), said(peace))),
    }
}

/// What the liar decides by the first vote with evidence of each other.
pub(super) fn of_chosen_votes(swarm: &Swarm) -> Decision {
    let (round, id) = (swarm.round(), swarm.id());
    let liar = swarm.liar();
    let own = forged::said(liar, Stamp { boot: 1, sequence: 1 }, forged::vote(round, FALSE, 16.0));
    let mut votes = vec![forged::held(forged::signed(own, &key(liar), &id))];
    for held in swarm.votes() {
        let new = votes.iter().all(|known| known.robot != held.robot);
        if new && !held.vote.evidence.is_empty() && held.vote.round.counter == round.counter {
            votes.push(held);
        }
    }
    let mut decision = forged::decision(round, votes, liar);
    let certificate = &mut decision.certificate;
    certificate.terms = swarm.rounds().terms();
    certificate.quorum = swarm.rounds().needs(certificate.robots);
    decision
}

/// Waits until everybody has voted.
pub(super) fn once_all_voted(swarm: &mut Swarm, act: &dyn Fn(&mut Swarm)) {
    let began = swarm.now();
    swarm.begin(TRUE);
    swarm.pass(340 * MS);
    act(swarm);
    swarm.end(began);
}

fn chosen(swarm: &mut Swarm) {
    once_all_voted(swarm, &|swarm| {
        let decision = of_chosen_votes(swarm);
        swarm.give(swarm.liar(), Some(decision), Vec::new());
    });
}

/// Whether no vote of the liar is in any ballot.
pub fn liar_is_out(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let counting = war
        .minds()
        .filter(|mind| mind.ballot().is_some_and(|ballot| ballot.stamp(RobotId(war.liar())).is_some()));
    match counting.count() {
        0 => Ok(()),
        robots => Err(format!("its vote is counted by {robots} robots")),
    }
}

/// No robot holds another gesture than in peace; which votes it rests on may differ.
pub(super) fn same_gesture(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_alike(peace, war, 1000 * MS)
}

fn contradicting(swarm: &mut Swarm) {
    amid_a_round(swarm, &|swarm| {
        for _ in 0..13 {
            let mut decision = forged::decision(swarm.round(), of_nobody(swarm, 3, false), 99);
            decision.confidence = 0.96;
            swarm.put_decision(&decision);
            swarm.pass(150 * MS);
        }
    });
}
