//! When a round begins and ends, and who is waited for.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{ClassId, Have, Message, Outcome, RobotId, RoundId, Stamp, Topic};
use gestalt_strategies::Mind;

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, decided_in_time, unmoved};
use crate::forged;
use crate::swarm::world::key;
use crate::swarm::{Plan, Swarm};

const MS: Duration = Duration::from_millis(1);

pub const ALL: &[Attack] = &[
    Attack {
        number: "A7",
        what: "begins another round every 100 ms",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_vote_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| round_after_round(swarm, 50, false), unmoved),
    },
    Attack {
        number: "A7",
        what: "begins another round every 100 ms",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "each gesture is decided, at most 1 s later",
        counted: Counted::Some(&["refused_round_too_soon"]),
        gap: None,
        play: |seed| {
            beside(&Plan::open(), seed, |swarm| round_after_round(swarm, 50, false), within_a_second)
        },
    },
    Attack {
        number: "A7",
        what: "an enrolled robot begins another round every 100 ms",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "each gesture is decided, at most 1 s later",
        counted: Counted::Some(&["refused_round_too_soon"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| round_after_round(swarm, 6, true), within_a_second)
        },
    },
    Attack {
        number: "A7",
        what: "an enrolled robot begins another round every 100 ms, and tells one robot of each",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "each gesture is decided, at most 1 s later",
        counted: Counted::Some(&["refused_round_too_soon"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, one_after_the_other, within_a_second),
    },
    Attack {
        number: "A7",
        what: "an enrolled robot says, ten times a second, that nothing was decided in the round that is open, or in the next",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "each gesture is decided, at most 1 s later",
        counted: Counted::Some(&["refused_round_too_soon"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, nothing_was_decided, within_a_second),
    },
    Attack {
        number: "A7",
        what: "an enrolled robot says of one newer round after the other that nothing was decided in it, before each gesture, and before the instructor says which it was",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "each gesture is decided, at most 1 s later, and samples have the class that was said of what they show",
        counted: Counted::Some(&["refused_round_too_soon"]),
        gap: None,
        play: |seed| {
            let judge = |peace: &Swarm, war: &Swarm| {
                within_a_second(peace, war).and_then(|()| names_apart(peace, war))
            };
            beside(&Plan::sealed().liars(1), seed, nothing_before_and_after, judge)
        },
    },
    Attack {
        number: "A7 · 7",
        what: "an enrolled robot begins another round under the count of one that was taught, and calls it by that one's name",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "no name stands for two gestures, and samples have the class that was said of what they show",
        counted: Counted::None("who says the name of a round that is over may be behind: it is not heard"),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, one_name_again, names_apart),
    },
    Attack {
        number: "A8",
        what: "votes and decides in rounds of the last counters there are",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "nothing",
        counted: Counted::All(&["refused_round_far_ahead"]),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, |swarm| last_counters(swarm, 50, false), unmoved),
    },
    Attack {
        number: "A8",
        what: "an enrolled robot votes in rounds of the last counters there are",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_round_far_ahead"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| last_counters(swarm, 6, true), unmoved),
    },
    Attack {
        number: "A8",
        what: "runs the counter up as far and as fast as is taken, 200 rounds each a million further",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "counters are not used up: the next gesture is decided as ever",
        counted: Counted::Some(&["refused_round_far_ahead"]),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, run_up, next_is_decided),
    },
    Attack {
        number: "A8 · A19",
        what: "says that it has 40 later rounds, up to the last counter",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "a word on the true round is learned; nothing is decided later",
        counted: Counted::None("what somebody says it has is a hint: it is asked for, and nothing comes"),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, has_later_rounds, decided_and_learned),
    },
    Attack {
        number: "A19",
        what: "opens the round that is open under 2,000 more names",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_vote_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, many_names, unmoved),
    },
    Attack {
        number: "A19",
        what: "opens the round that is open under 2,000 more names",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "it is decided, and a word on it is learned",
        counted: Counted::None("rounds that open at once merge; a thousand names are kept"),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, many_names, learned_anyway),
    },
    Attack {
        number: "A18 · 23",
        what: "shows 4,090 liveliness tokens of robots that do not exist",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "at most one round is lost; from the second on all is as ever",
        counted: Counted::Some(&["refused_alive_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, ghosts, all_but_the_first),
    },
    Attack {
        number: "A18 · 23",
        what: "shows tokens of other robots that do not exist before every round",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "rounds take at most 1.1 times as long",
        counted: Counted::Some(&["refused_alive_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, other_ghosts, all_but_the_first),
    },
];

/// Each gesture was announced, in whichever round, at most a second later than in peace.
fn within_a_second(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    for (before, after) in peace.shown().iter().zip(war.shown()) {
        let until = after.began + before.announced.unwrap_or_default() + 1000 * MS;
        let of_it = war.announced().iter().filter(|(at, ..)| (after.began..=until).contains(at));
        let classes: Vec<_> = of_it.map(|(.., decision)| decision.class).collect();
        if !classes.contains(&Some(ClassId(after.class))) {
            return Err(format!("shown {}, announced {classes:?}", after.class));
        }
    }
    Ok(())
}

fn say(swarm: &mut Swarm, robot: u32, signs: bool, sequence: u32, round: RoundId) {
    let said = forged::said(robot, Stamp { boot: 1, sequence }, forged::null_vote(round));
    let said = if signs { forged::signed(said, &key(robot), &swarm.id()) } else { said };
    swarm.put_vote(&said);
}

fn round_after_round(swarm: &mut Swarm, robot: u32, signs: bool) {
    for class in [1, 2] {
        let began = swarm.now();
        swarm.begin(class);
        for n in 0..25 {
            swarm.pass(100 * MS);
            let round = RoundId { counter: swarm.round().counter + 1, opener: RobotId(robot), life: 9 };
            say(swarm, robot, signs, 100 * class + n, round);
        }
        swarm.end(began);
        swarm.pass(6000 * MS);
    }
}

/// The same, each before one robot alone.
fn one_after_the_other(swarm: &mut Swarm) {
    for class in [1, 2] {
        let began = swarm.now();
        swarm.begin(class);
        for n in 0..25 {
            swarm.pass(100 * MS);
            let robot = swarm.liar();
            let round = RoundId { counter: swarm.round().counter + 1, opener: RobotId(robot), life: 9 };
            let stamp = Stamp { boot: 1, sequence: 100 * class + n };
            let said = forged::said(robot, stamp, forged::null_vote(round));
            let said = forged::signed(said, &key(robot), &swarm.id());
            swarm.put_to(1 + n % swarm.honest(), &Topic::Vote(said.author), &said.encode());
        }
        swarm.end(began);
        swarm.pass(6000 * MS);
    }
}

/// An enrolled robot, which was in that round alone, gives that nothing was decided in it.
fn came_to_nothing(swarm: &mut Swarm, sequence: u32, round: RoundId) {
    let liar = swarm.liar();
    let own = forged::said(liar, Stamp { boot: 1, sequence }, forged::null_vote(round));
    let own = forged::held(forged::signed(own, &key(liar), &swarm.id()));
    let mut decision = forged::decision(round, vec![own], liar);
    let certificate = &mut decision.certificate;
    (certificate.probabilities, certificate.elapsed_ms) = (Vec::new(), u32::MAX);
    decision.class = None;
    swarm.give(liar, Some(decision), Vec::new());
}

fn nothing_was_decided(swarm: &mut Swarm) {
    for class in [1, 2] {
        let began = swarm.now();
        swarm.begin(class);
        for n in 0..25 {
            swarm.pass(100 * MS);
            let counter = swarm.round().counter + n % 2;
            came_to_nothing(swarm, 100 * class + n, RoundId { counter, opener: RobotId(u32::MAX), life: 9 });
        }
        swarm.end(began);
        swarm.pass(6000 * MS);
    }
}

fn nothing_before_and_after(swarm: &mut Swarm) {
    let mut sequence = 0;
    let mut fire = |swarm: &mut Swarm, times: u32| {
        for _ in 0..times {
            swarm.pass(260 * MS);
            sequence += 1;
            let counter = swarm.mind(1).round().map_or(1, |round| round.counter + 1);
            came_to_nothing(swarm, sequence, RoundId { counter, opener: RobotId(u32::MAX), life: 9 });
        }
        // Until all have heard it.
        swarm.pass(20 * MS);
    };
    for class in [1, 2] {
        fire(swarm, 4);
        let round = swarm.show(class);
        fire(swarm, 40);
        swarm.teach(round, class);
        swarm.pass(6000 * MS);
    }
}

fn one_name_again(swarm: &mut Swarm) {
    let liar = swarm.liar();
    let first = swarm.show(1);
    swarm.teach(first, 1);
    swarm.pass(6000 * MS);
    let began = swarm.now();
    say(swarm, liar, true, 1, RoundId { opener: RobotId(u32::MAX), ..first });
    swarm.begin(2);
    swarm.pass(50 * MS);
    say(swarm, liar, true, 2, first);
    let second = swarm.end(began);
    swarm.teach(second, 2);
}

fn names_apart(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let mut gestures: BTreeMap<RoundId, BTreeSet<ClassId>> = BTreeMap::new();
    for (.., decision) in war.announced() {
        gestures.entry(decision.round).or_default().extend(decision.class);
    }
    if let Some((round, classes)) = gestures.iter().find(|(_, classes)| classes.len() > 1) {
        return Err(format!("{round:?} stands for {classes:?}"));
    }
    let samples = |swarm: &Swarm| -> Vec<[usize; 2]> {
        let of = |mind: &Mind, class| mind.training_set().map_or(0, |set| set.class_count(ClassId(class)));
        swarm.minds().map(|mind| [of(mind, 1), of(mind, 2)]).collect()
    };
    match (samples(war), samples(peace)) {
        (found, usual) if found == usual => Ok(()),
        (found, usual) => Err(format!("samples {found:?}, in peace {usual:?}")),
    }
}

fn last_counters(swarm: &mut Swarm, robot: u32, signs: bool) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    for n in 0..5 {
        let round = RoundId { counter: u32::MAX - n, opener: RobotId(robot), life: 9 };
        say(swarm, robot, signs, 1 + n, round);
        if !signs {
            let vote =
                |robot| forged::said(robot, Stamp { boot: 1, sequence: 1 }, forged::vote(round, 4, 1.0));
            let votes: Vec<_> = (50..60).map(|robot| forged::held(vote(robot))).collect();
            swarm.put_decision(&forged::decision(round, votes, 50));
        }
    }
    swarm.end(began);
}

fn run_up(swarm: &mut Swarm) {
    swarm.show(1);
    for n in 1..=200 {
        let round = RoundId { counter: n * 1_000_000, opener: RobotId(50), life: 9 };
        say(swarm, 50, false, n, round);
        swarm.pass(20 * MS);
    }
    swarm.pass(6000 * MS);
    swarm.show(2);
}

fn next_is_decided(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_in_time(peace, war)?;
    let counter = war.round().counter;
    if counter < u32::MAX / 2 { Ok(()) } else { Err(format!("the counter stands at {counter}")) }
}

fn has_later_rounds(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(100 * MS);
    let first = swarm.round().counter;
    for n in 1..=40 {
        let counter = if n == 40 { u32::MAX } else { first + n };
        let round = Some(RoundId { counter, opener: RobotId(50), life: 9 });
        let have =
            Have { round, decision: None, holders: 0, votes: Vec::new(), knowledge: None, answer: false };
        swarm.whisper(50, &Message::Have(have));
    }
    let round = swarm.end(began);
    swarm.teach(round, 1);
}

fn learned_anyway(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_in_time(peace, war)?;
    let samples = |swarm: &Swarm| -> Vec<usize> {
        swarm.minds().map(|mind| mind.training_set().map_or(0, |set| set.len())).collect()
    };
    match samples(war) == samples(peace) && war.answered(Outcome::Learned) {
        true => Ok(()),
        false => Err(format!("samples {:?}, in peace {:?}", samples(war), samples(peace))),
    }
}

fn decided_and_learned(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    learned_anyway(peace, war)?;
    crate::beside::learned_alike(peace, war)
}

fn many_names(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    let counter = swarm.round().counter;
    for n in 0..2000 {
        let round = RoundId { counter, opener: RobotId(50 + n), life: n };
        say(swarm, 50, false, 1 + n, round);
    }
    let round = swarm.end(began);
    swarm.teach(round, 1);
}

fn ghosts(swarm: &mut Swarm) {
    swarm.show_tokens(10_000..14_090);
    for class in [1, 2, 3] {
        swarm.show(class);
        swarm.pass(6000 * MS);
    }
}

fn other_ghosts(swarm: &mut Swarm) {
    for class in [1, 2, 3] {
        let first = 10_000 * class;
        swarm.show_tokens(first..first + 4090);
        swarm.show(class);
        swarm.pass(6000 * MS);
    }
}

fn all_but_the_first(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    for (n, (before, after)) in peace.shown().iter().zip(war.shown()).enumerate().skip(1) {
        let usual = before.announced.unwrap_or_default();
        if before.held != after.held || after.announced.is_none_or(|took| took > usual.mul_f64(1.1)) {
            return Err(format!("showing {n}: {after:?}, in peace {before:?}"));
        }
    }
    Ok(())
}
