//! Votes that nobody cast, and votes of those who lie.

use std::time::Duration;

use gestalt_protocol::{FusionRule, RobotId, Stamp, Topic};

use super::WHOEVER_SAYS_SO;
use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::beside::{beside, decided_in_time, unmoved};
use crate::forged;
use crate::swarm::world::{CLASSES, STRANGER, key};
use crate::swarm::{Plan, Swarm};

const MS: Duration = Duration::from_millis(1);

const TRUE: u32 = 1;
const FALSE: u32 = 3;

pub const ALL: &[Attack] = &[
    Attack {
        number: "A5 · 1",
        what: "votes in robot 3's name with the last stamp and evidence of 10³⁰, to all and as a gift, unsigned and with a key of its own",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&[
            "refused_vote_unsigned",
            "refused_vote_forged",
            "refused_vote_author",
            "refused_repair_forged",
        ]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| in_its_name(swarm, STRANGER), unmoved),
    },
    Attack {
        number: "1",
        what: "votes in robot 3's name and signs with the key of another enrolled robot",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_vote_forged", "refused_repair_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| in_its_name(swarm, 6), unmoved),
    },
    Attack {
        number: "A5 · 1",
        what: "votes in robot 3's name with the last stamp",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "robot 3's own vote counts",
        counted: Counted::Some(&["refused_duplicate_id"]),
        gap: Some(WHOEVER_SAYS_SO),
        play: |seed| beside(&Plan::open(), seed, |swarm| in_its_name(swarm, STRANGER), own_vote_counts),
    },
    Attack {
        number: "A6",
        what: "gives 4,096 votes of made-up robots",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| full_ballot(swarm, 50), unmoved),
    },
    Attack {
        number: "A6",
        what: "an enrolled robot gives 4,096 votes of made-up robots",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| full_ballot(swarm, 6), unmoved),
    },
    Attack {
        number: "A6",
        what: "gives 4,096 votes of made-up robots",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "the true robots are counted",
        counted: Counted::Some(&["refused_ballot_full"]),
        gap: Some(WHOEVER_SAYS_SO),
        play: |seed| beside(&Plan::open(), seed, |swarm| full_ballot(swarm, 50), decided_in_time),
    },
    Attack {
        number: "10",
        what: "f robots of 8 vote for the same wrong gesture at the clip, f = 1 and 2, every rule, 6 rounds each",
        tier: Tier::T4,
        setting: Setting::Open,
        expected: "with `liars: f` no wrong decision; none at all is allowed",
        counted: Counted::None("a robot may be wrong: it is outvoted"),
        gap: None,
        play: |seed| wrong_together(seed, true),
    },
    Attack {
        number: "10",
        what: "f robots of 8 vote for the same wrong gesture in a swarm that expects no liars",
        tier: Tier::T4,
        setting: Setting::Open,
        expected: "no wrong decision",
        counted: Counted::None("a robot may be wrong: it is outvoted, or not"),
        gap: Some("`rounds.liars` is 0 by default: who wants liars withstood has to say how many"),
        play: |seed| wrong_together(seed, false),
    },
];

fn in_its_name(swarm: &mut Swarm, by: u32) {
    let began = swarm.now();
    swarm.begin(TRUE);
    swarm.pass(20 * MS);
    let (round, id) = (swarm.round(), swarm.id());
    let mut vote = forged::vote(round, FALSE, 16.0);
    vote.evidence[FALSE as usize] = 1e30;
    let unsigned = forged::said(3, forged::LAST, vote);
    let signed = forged::signed(unsigned.clone(), &key(by), &id);
    for forged in [unsigned, signed] {
        swarm.put_vote(&forged);
        swarm.put(&Topic::Vote(RobotId(4)), &forged.encode());
        swarm.give(2, None, vec![forged::held(forged)]);
    }
    swarm.end(began);
}

/// Whether the vote that everybody holds of robot 3 is the one that it said.
fn own_vote_counts(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let stamps = war.minds().map(|mind| mind.ballot().and_then(|ballot| ballot.stamp(RobotId(3))));
    match stamps.filter(|stamp| *stamp == Some(forged::LAST)).count() {
        0 => Ok(()),
        robots => Err(format!("{robots} robots hold the forged one")),
    }
}

fn full_ballot(swarm: &mut Swarm, from: u32) {
    let began = swarm.now();
    swarm.begin(TRUE);
    swarm.pass(20 * MS);
    let round = swarm.round();
    let vote =
        |n: u32| forged::said(10_000 + n, Stamp { boot: 1, sequence: 1 }, forged::vote(round, FALSE, 16.0));
    let votes: Vec<_> = (0..4096).map(|n| forged::held(vote(n))).collect();
    for to in 1..=5 {
        let give = gestalt_protocol::Give { decision: None, votes: votes.clone(), holders: Vec::new() };
        swarm.whisper_to(to, from, &gestalt_protocol::Message::Give(give));
    }
    swarm.end(began);
}

/// Among honest robots that see wrong in every fourth frame.
fn wrong_together(seed: u64, expected: bool) -> Played {
    let mut wrong = Vec::new();
    for (rule, liars) in FusionRule::ALL.into_iter().flat_map(|rule| [(rule, 1), (rule, 2)]) {
        let mut plan = Plan { honest: 8 - liars, errors: 0.25, ..Plan::open().liars(liars) };
        plan.rounds.liars = if expected { liars } else { 0 };
        plan.rounds.rule = rule;
        let mut swarm = Swarm::new(&plan, seed, false);
        for n in 0..6 {
            let class = n % CLASSES;
            let began = swarm.now();
            swarm.begin(class);
            swarm.pass(100 * MS);
            let round = swarm.round();
            for liar in 0..liars {
                let stamp = Stamp { boot: 1, sequence: n + 1 };
                swarm.put_vote(&forged::said(
                    9 - liars + liar,
                    stamp,
                    forged::vote(round, (class + 3) % CLASSES, 16.0),
                ));
            }
            swarm.end(began);
            // A liar that does not speak of a round that ends undecided would leave it open into the next.
            swarm.pass(3000 * MS);
        }
        for shown in swarm.shown().iter().filter(|shown| shown.is_wrong()) {
            wrong.push(format!("{rule}, f = {liars}, shown {}: {:?}", shown.class, shown.held));
        }
    }
    let reached = if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ")) };
    Played { reached, refused: std::collections::BTreeMap::new(), silent: 0 }
}
