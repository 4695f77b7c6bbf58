//! Saying more than can be checked.

use std::time::Duration;

use gestalt_protocol::{Envelope, Give, Message, RobotId, Signature, Stamp, Topic};

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, decided_in_time};
use crate::forged;
use crate::swarm::world::key;
use crate::swarm::{Plan, Swarm};

const MS: Duration = Duration::from_millis(1);

pub const ALL: &[Attack] = &[
    Attack {
        number: "16",
        what: "an enrolled robot says 4,000 votes a second, each truly signed and different",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "the others decide no later; at most 1,016 are checked at once and 1,008 a second",
        counted: Counted::Some(&["refused_vote_too_fast"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, own_flood, few_checked),
    },
    Attack {
        number: "17",
        what: "1,000 votes a second in robot 3's name, with the newest stamps and made-up signatures",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::Some(&["refused_vote_forged"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed(), seed, |swarm| in_its_name(swarm, Way::Said, 1), third_is_counted)
        },
    },
    Attack {
        number: "17",
        what: "8,000 votes a second in robot 3's name, with the newest stamps and made-up signatures",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::Some(&["refused_vote_forged", "refused_vote_too_fast"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed(), seed, |swarm| in_its_name(swarm, Way::Said, 8), third_is_counted)
        },
    },
    Attack {
        number: "17",
        what: "20,000 votes a second in robot 3's name, with the newest stamps and made-up signatures",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::Some(&["refused_vote_forged", "refused_vote_too_fast"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed(), seed, |swarm| in_its_name(swarm, Way::Said, 20), third_is_counted)
        },
    },
    Attack {
        number: "17",
        what: "gives 8,000 such votes a second in the names of its neighbours",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::All(&["refused_repair_forged"]),
        gap: None,
        play: |seed| {
            let flood = |swarm: &mut Swarm| in_its_name(swarm, Way::Given(&[(1, 2), (2, 1)]), 8);
            beside(&Plan::sealed(), seed, flood, third_is_counted)
        },
    },
    Attack {
        number: "17",
        what: "an enrolled robot gives 8,000 such votes a second",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::Some(&["refused_repair_forged", "refused_repair_too_fast"]),
        gap: None,
        play: |seed| {
            let flood = |swarm: &mut Swarm| in_its_name(swarm, Way::Given(BY_LIARS), 8);
            beside(&Plan::sealed().liars(1), seed, flood, third_is_counted)
        },
    },
    Attack {
        number: "17",
        what: "two enrolled robots say and give 8,000 such votes a second each",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: COUNTED,
        counted: Counted::Some(&[
            "refused_vote_forged",
            "refused_vote_too_fast",
            "refused_repair_forged",
            "refused_repair_too_fast",
        ]),
        gap: None,
        play: |seed| {
            let flood = |swarm: &mut Swarm| in_its_name(swarm, Way::Both(BY_TWO_LIARS), 8);
            beside(&Plan::sealed().liars(2), seed, flood, third_is_counted)
        },
    },
];

/// Of a robot in whose name others speak.
const COUNTED: &str = "after 1 s of the round, and of the flood, robot 3 is counted everywhere";

/// How votes come that were made up.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// As their author says them,
    Said,
    /// to these robots as those pass them on,
    Given(&'static [(u32, u32)]),
    /// or so many by each.
    Both(&'static [(u32, u32)]),
}

/// To robots 1 and 2, by the first liar or by the second as well.
const BY_LIARS: &[(u32, u32)] = &[(1, 6), (2, 6)];
const BY_TWO_LIARS: &[(u32, u32)] = &[(1, 6), (2, 6), (1, 7), (2, 7)];

/// How many votes the enrolled robot says, in half a second.
const FLOOD: u32 = 2000;

fn own_flood(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    let liar = key(6);
    for sequence in 1..=FLOOD {
        swarm.pass(MS / 4);
        if !swarm.at_war() {
            continue;
        }
        let (round, id) = (swarm.round(), swarm.id());
        let vote = forged::vote_of(round, 4, 1.0, sequence as f32 / 1e3);
        let said = forged::said(6, Stamp { boot: 1, sequence }, vote);
        let bytes = forged::signed(said, &liar, &id).encode();
        // To one robot: what that checks of it is most of the work.
        swarm.put_to(1, &Topic::Vote(RobotId(6)), &bytes);
    }
    swarm.end(began);
}

fn few_checked(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_in_time(peace, war)?;
    let refused = war.refused().get("refused_vote_too_fast").copied().unwrap_or(0);
    let checked = u64::from(FLOOD) - refused;
    // 16 + 1,000 at once, and 8 + 1,000 a second.
    if checked <= 1016 + 504 { Ok(()) } else { Err(format!("{checked} were checked")) }
}

/// So many votes a millisecond.
fn in_its_name(swarm: &mut Swarm, way: Way, rate: u32) {
    let flood = |swarm: &mut Swarm, from: u32, time: u32| {
        for ms in from..from + time {
            // Spread over the millisecond, or all in one message.
            if let Way::Said | Way::Both(_) = way {
                for n in ms * rate..(ms + 1) * rate {
                    swarm.pass(MS / rate);
                    if swarm.at_war() {
                        let bytes = made_up(swarm, n).encode();
                        [1, 2]
                            .into_iter()
                            .for_each(|robot| swarm.put_to(robot, &Topic::Vote(RobotId(3)), &bytes));
                    }
                }
            } else {
                swarm.pass(MS);
            }
            if let Way::Given(by) | Way::Both(by) = way
                && swarm.at_war()
            {
                let votes = (ms * rate..(ms + 1) * rate).map(|n| forged::held(made_up(swarm, !n))).collect();
                let give = Message::Give(Give { decision: None, votes, holders: Vec::new() });
                by.iter().for_each(|(to, from)| swarm.whisper_to(*to, *from, &give));
            }
        }
    };
    // It goes on before the round, so that nothing is left of the robot's own burst.
    flood(swarm, 0, 200);
    swarm.begin(1);
    // Where this ends it is looked who is counted.
    flood(swarm, 200, 1000);
}

/// A vote in robot 3's name that it did not cast.
fn made_up(swarm: &Swarm, n: u32) -> Envelope {
    let vote = forged::vote(swarm.round(), 4, 16.0);
    let said = forged::said(3, Stamp { boot: u32::MAX, sequence: n }, vote);
    let mut bytes = [0x5a; 64];
    bytes[..4].copy_from_slice(&n.to_le_bytes());
    // Below the order of the group, so that all of the check is made.
    bytes[63] = 0x01;
    Envelope { signature: Some(Signature::from_bytes(bytes)), ..said }
}

/// It is on every robot's ballot by its own word, and in every decision that is held.
fn third_is_counted(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let counts = |mind: &gestalt_strategies::Mind| {
        let stamp = mind.ballot().and_then(|ballot| ballot.stamp(RobotId(3)));
        let in_decision = mind
            .held()
            .is_none_or(|held| held.certificate.votes.iter().any(|counted| counted.robot == RobotId(3)));
        stamp.is_some_and(|stamp| stamp.boot < u32::MAX) && in_decision
    };
    match war.minds().filter(|mind| !counts(mind)).count() {
        0 => Ok(()),
        robots => Err(format!("{robots} robots of 5 do not count robot 3")),
    }
}
