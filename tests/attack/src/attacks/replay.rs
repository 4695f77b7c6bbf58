//! What was true once, said again.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::{ClassId, Envelope, RobotId, Stamp, Topic};
use gestalt_strategies::Mind;

use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::beside::{beside, decided_in_time, unmoved};
use crate::forged;
use crate::swarm::world::{authority, key, members};
use crate::swarm::{Parcel, Plan, Swarm};
use crate::trust::{Membership, SwarmId, statement};

const MS: Duration = Duration::from_millis(1);

/// Why a repeat is not counted.
const NO_REFUSAL: &str =
    "robots repeat themselves by design: a true word that is old changes nothing, and is no refusal";

pub const ALL: &[Attack] = &[
    Attack {
        number: "7",
        what: "replays all votes and decisions of two rounds in a later round",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::None(NO_REFUSAL),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, in_a_later_round, unmoved),
    },
    Attack {
        number: "7",
        what: "replays what robot 3 said before it restarted",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "the rounds after are decided as in peace",
        counted: Counted::None(NO_REFUSAL),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed(), seed, |swarm| after_a_restart(swarm, &[1, 2, 4, 5]), decided_in_time)
        },
    },
    Attack {
        number: "7",
        what: "replays an old round to a robot that has just restarted",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "the rounds after are decided as in peace",
        counted: Counted::None(NO_REFUSAL),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| after_a_restart(swarm, &[3]), decided_in_time),
    },
    Attack {
        number: "7",
        what: "replays votes of the same robots in another swarm of the same name",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_vote_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, of_another_swarm, unmoved),
    },
    Attack {
        number: "7",
        what: "replays votes under the keys of samples and of repair",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_sample_kind", "refused_repair_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, under_other_keys, unmoved),
    },
    Attack {
        number: "7",
        what: "replays the votes of two robots that stayed off, after all lost their memories and count rounds from 1 again",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "no vote of a robot that is off is counted",
        counted: Counted::None(
            "rounds of one counter merge while they are open, and the votes of an earlier life with them",
        ),
        gap: Some(
            "a vote is bound to its round by the counter; robots whose memories hold a taught round open rounds beyond it, \
                   others can be told old votes as new",
        ),
        play: |seed| old_votes_again(seed, &[1, 2, 3, 4, 5]),
    },
    Attack {
        number: "7",
        what: "the same where one robot, which opens rounds, kept its memory",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "no vote of a robot that is off is counted",
        counted: Counted::None(NO_REFUSAL),
        gap: None,
        play: |seed| old_votes_again(seed, &[2, 3, 4, 5]),
    },
    Attack {
        number: "7",
        what: "the same where one robot kept its memory, and one that did not opens rounds",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "no vote of a robot that is off is counted by who remembers what was said of that round",
        counted: Counted::None(NO_REFUSAL),
        gap: None,
        play: |seed| {
            let play = |swarm: &mut Swarm| after_they_forgot(swarm, &[1, 2, 4, 5]);
            beside(&Plan::sealed(), seed, play, who_remembers_counts_none)
        },
    },
    Attack {
        number: "8",
        what: "a thief votes with the last stamp; the robot is enrolled anew with another key, and all start with that roster",
        tier: Tier::T3,
        setting: Setting::Sealed,
        expected: "it counts again from the next round on; the thief does not",
        counted: Counted::Some(&["refused_vote_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, stolen, enrolled_anew_counts),
    },
    Attack {
        number: "8 · 12",
        what: "a thief votes on, with the last stamp too, after the robot is enrolled anew in the midst of a round",
        tier: Tier::T3,
        setting: Setting::Sealed,
        expected: "its vote is taken out of that round, and it counts in none after it; the robot with the new key does",
        counted: Counted::Some(&["refused_vote_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, expelled_live, enrolled_anew_counts),
    },
    Attack {
        number: "8",
        what: "a thief votes, and the robot is enrolled anew while the swarm goes on, and hears nothing of it",
        tier: Tier::T3,
        setting: Setting::Sealed,
        expected: "the thief counts no more: what else it says under the last stamp convicts its key",
        counted: Counted::Some(&["refused_vote_convicted"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, stolen_live, super::decisions::liar_is_out),
    },
];

/// Votes and decisions that were said to all.
fn recorded(swarm: &Swarm) -> Vec<Parcel> {
    let about = |parcel: &&Parcel| parcel.key.ends_with("/vote") || parcel.key.ends_with("/decision");
    swarm.air().iter().filter(about).cloned().collect()
}

fn in_a_later_round(swarm: &mut Swarm) {
    for class in [1, 2] {
        swarm.show(class);
        swarm.pass(6000 * MS);
    }
    let old: Vec<Parcel> = recorded(swarm).into_iter().filter(|parcel| parcel.key.contains("vote")).collect();
    let began = swarm.now();
    swarm.begin(3);
    swarm.pass(100 * MS);
    old.iter().for_each(|parcel| swarm.replay(parcel));
    swarm.end(began);
}

fn after_a_restart(swarm: &mut Swarm, to: &[u32]) {
    let round = swarm.show(1);
    swarm.teach(round, 1);
    let old = recorded(swarm);
    swarm.pass(6000 * MS);
    swarm.restart(3, false);
    let say = |swarm: &mut Swarm| {
        for parcel in &old {
            let Some(topic) = swarm.topic(&parcel.key) else { continue };
            to.iter().for_each(|robot| swarm.put_to(*robot, &topic, &parcel.bytes));
        }
    };
    say(swarm);
    swarm.pass(2000 * MS);
    let began = swarm.now();
    swarm.begin(2);
    swarm.pass(100 * MS);
    say(swarm);
    swarm.end(began);
}

fn of_another_swarm(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    let other = SwarmId::new(&key(2000).public_key(), crate::swarm::world::SWARM);
    for robot in [1, 2, 3] {
        let vote = forged::vote(swarm.round(), 4, 16.0);
        let said = forged::said(robot, Stamp { boot: 1, sequence: 50 }, vote);
        let signature = Some(statement::sign(&key(robot), &other, &said.statement()));
        swarm.put_vote(&Envelope { signature, ..said });
    }
    swarm.end(began);
}

fn under_other_keys(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(200 * MS);
    for held in swarm.votes() {
        let (robot, bytes) = (held.robot, Envelope::from(held).encode());
        swarm.put(&Topic::Sample(robot), &bytes);
        for to in (1..=5).filter(|to| *to != robot.0) {
            swarm.put_to(to, &Topic::Repair(RobotId(to)), &bytes);
        }
    }
    swarm.end(began);
}

/// All start again, these without their memories, and are told the votes of two that stay off.
fn old_votes_again(seed: u64, forget: &[u32]) -> Played {
    beside(&Plan::sealed(), seed, |swarm| after_they_forgot(swarm, forget), off_are_not_counted)
}

fn after_they_forgot(swarm: &mut Swarm, forget: &[u32]) {
    let round = swarm.show(4);
    swarm.teach(round, 4);
    let old: Vec<_> = swarm.votes().into_iter().filter(|held| matches!(held.robot.0, 4 | 5)).collect();
    swarm.pass(10_000 * MS);
    swarm.restart_all(None, |robot| forget.contains(&robot));
    swarm.stop([4, 5]);
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    for held in old {
        swarm.put_vote(&held.into());
    }
    swarm.end(began);
}

fn counts_who_is_off(mind: &Mind) -> bool {
    let votes = mind.held().map(|held| held.certificate.votes.as_slice()).unwrap_or_default();
    votes.iter().any(|counted| matches!(counted.robot.0, 4 | 5))
}

/// The others may be told of it before or after; those who are not yet go by the old name, and are not heard by who remembers: it may have too few votes.
fn who_remembers_counts_none(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let held = war.mind(3).held().and_then(|held| held.class);
    match (counts_who_is_off(war.mind(3)), held) {
        (false, None | Some(ClassId(1))) => Ok(()),
        found => Err(format!("robot 3 counts votes of robots that are off, and holds: {found:?}")),
    }
}

fn off_are_not_counted(_: &Swarm, war: &Swarm) -> Result<(), String> {
    match war.minds().take(3).filter(|mind| counts_who_is_off(mind)).count() {
        0 => Ok(()),
        robots => {
            Err(format!("{robots} robots of 3 count votes of robots that are off, for what was shown before"))
        }
    }
}

/// The thief has robot 6 and its key.
fn steal(swarm: &mut Swarm, class: u32) {
    let began = swarm.now();
    swarm.begin(class);
    swarm.pass(50 * MS);
    let (round, id) = (swarm.round(), swarm.id());
    let said = forged::said(6, forged::LAST, forged::vote(round, 4, 1.0));
    swarm.put_vote(&forged::signed(said, &key(6), &id));
    swarm.end(began);
}

/// The second epoch, in which robot 6 has another key.
fn second_epoch() -> Membership {
    let mut members = members(6, 2);
    members.robots.insert(RobotId(6), key(66).public_key());
    members.expelled = BTreeMap::from([(RobotId(6), key(6).public_key())]);
    members
}

fn stolen(swarm: &mut Swarm) {
    steal(swarm, 1);
    swarm.restart_all(second_epoch().sign(&authority()).ok(), |_| false);
    let began = swarm.now();
    swarm.begin(2);
    swarm.pass(50 * MS);
    let (round, id) = (swarm.round(), swarm.id());
    let said =
        |sequence, nats| forged::said(6, Stamp { boot: 2, sequence }, forged::vote_of(round, 2, nats, 1.0));
    let (thief, robot) = (said(9, 3.0), said(1, 1.0));
    swarm.put_vote(&forged::signed(thief, &key(6), &id));
    swarm.put_vote(&forged::signed(robot, &key(66), &id));
    swarm.end(began);
}

fn enrolled_anew_counts(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let own = Some(Stamp { boot: 2, sequence: 1 });
    let stamp = |mind: &gestalt_strategies::Mind| mind.ballot().and_then(|ballot| ballot.stamp(RobotId(6)));
    match war.minds().filter(|mind| stamp(mind) != own).count() {
        0 => Ok(()),
        robots => Err(format!("{robots} robots do not hold the vote of the robot that was enrolled anew")),
    }
}

fn expelled_live(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    let (round, id) = (swarm.round(), swarm.id());
    let by_thief =
        |stamp, round| forged::signed(forged::said(6, stamp, forged::vote(round, 4, 1.0)), &key(6), &id);
    swarm.put_vote(&by_thief(forged::LAST, round));
    swarm.pass(50 * MS);
    let roster = second_epoch().sign(&authority()).expect("members that go together").to_json();
    swarm.put(&gestalt_protocol::Topic::Roster, roster.as_bytes());
    swarm.pass(50 * MS);
    swarm.put_vote(&by_thief(Stamp { boot: 2, sequence: 9 }, round));
    swarm.end(began);
    let began = swarm.now();
    swarm.begin(2);
    swarm.pass(50 * MS);
    let round = swarm.round();
    swarm.put_vote(&by_thief(Stamp { boot: 2, sequence: 10 }, round));
    let own = forged::said(6, Stamp { boot: 2, sequence: 1 }, forged::vote_of(round, 2, 1.0, 1.0));
    swarm.put_vote(&forged::signed(own, &key(66), &id));
    swarm.end(began);
}

fn stolen_live(swarm: &mut Swarm) {
    steal(swarm, 1);
    // Published here: robots have no key to hear it under.
    swarm.pass(6000 * MS);
    steal(swarm, 2);
}
