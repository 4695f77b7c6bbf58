//! Who is an instructor.

use std::time::Duration;

use gestalt_protocol::{Answer, ClassId, Gesture, Instruction, Outcome, RobotId, Topic};

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, learned_alike, unmoved};
use crate::swarm::world::instructor;
use crate::swarm::{Plan, Swarm};

/// Why anybody may teach.
const NO_KEYS: &str = "instructors have no keys yet: whoever reaches a session speaks as any of them";

pub const ALL: &[Attack] = &[
    Attack {
        number: "A17 · 27",
        what: "says in ada's name that the gesture was another",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::None("none of it is refused"),
        gap: Some(NO_KEYS),
        play: |seed| beside(&Plan::sealed(), seed, in_her_name, learned_alike),
    },
    Attack {
        number: "A17",
        what: "answers ada in a robot's name before any robot does",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "the true answer is given",
        counted: Counted::None("none of it is refused"),
        gap: Some("answers are not signed: who hears one keeps silent"),
        play: |seed| beside(&Plan::sealed(), seed, answered_first, is_answered),
    },
    Attack {
        number: "27",
        what: "asks for a round 1,000 times a second for 5 s",
        tier: Tier::T5,
        setting: Setting::Sealed,
        expected: "at most two rounds a second, and each ends decided as in peace",
        counted: Counted::None("a request while a round is open, or has just begun, is a copy of the first"),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, opens, few_rounds),
    },
    Attack {
        number: "27",
        what: "replays an instructor's request to open a round",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::None("none of it is refused"),
        gap: Some("requests to open carry neither a signature nor a number of their own"),
        play: |seed| beside(&Plan::sealed(), seed, open_replayed, unmoved),
    },
    Attack {
        number: "27",
        what: "16 more instructors speak of every round, before ada and after her",
        tier: Tier::T5,
        setting: Setting::Sealed,
        expected: "ada, who was heard of first, is heard, and has the last word",
        counted: Counted::None("the last in of those who were heard of later gives way"),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, seventeen, ada_has_the_last_word),
    },
    Attack {
        number: "27",
        what: "an instructor overrules another",
        tier: Tier::T5,
        setting: Setting::Sealed,
        expected: "by role",
        counted: Counted::None("none of it is refused"),
        gap: Some("instructors have no roles: of words that exclude each other the latest counts alone"),
        play: |seed| beside(&Plan::sealed(), seed, overruled, learned_alike),
    },
];

fn say(swarm: &mut Swarm, by: &str, instruction: &Instruction) {
    let bytes = serde_json::to_vec(instruction).expect("a word is JSON");
    swarm.put(&Topic::Feedback(instructor(by)), &bytes);
}

fn was(round: gestalt_protocol::RoundId, class: u8) -> Instruction {
    Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
}

fn in_her_name(swarm: &mut Swarm) {
    let round = swarm.show(1);
    swarm.teach(round, 1);
    say(swarm, "ada", &was(round, 4));
    swarm.pass(Duration::from_secs(3));
}

fn answered_first(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.now().as_nanos() as u64;
    let to = was(round, 1);
    let answer =
        Answer { robot: RobotId(9), at, to, outcome: Outcome::UnknownRound, class: None, samples: 0 };
    let bytes = serde_json::to_vec(&answer).expect("an answer is JSON");
    swarm.put(&Topic::Answer(instructor("ada")), &bytes);
    swarm.teach(round, 1);
}

fn is_answered(_: &Swarm, war: &Swarm) -> Result<(), String> {
    if war.answered(Outcome::Learned) { Ok(()) } else { Err("no robot answers".to_owned()) }
}

fn opens(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    for n in 0..5000_u32 {
        swarm.pass(Duration::from_millis(1));
        if n % 5 == 0 {
            // Each arrives at one robot, so that all are asked 200 times a second.
            let bytes = br#"{"say":"open"}"#;
            (1..=5).for_each(|robot| swarm.put_to(robot, &Topic::Feedback(instructor("eve")), bytes));
        }
    }
    swarm.end(began);
}

fn few_rounds(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let rounds = war.round().counter - peace.round().counter;
    if rounds > 11 {
        return Err(format!("{rounds} rounds in 5 s"));
    }
    let wrong = war.announced().iter().filter(|(.., decision)| decision.class != Some(ClassId(1)));
    match (wrong.count(), war.shown()[0].held == peace.shown()[0].held) {
        (0, true) => Ok(()),
        (wrong, _) => Err(format!("{wrong} wrong decisions, held {:?}", war.shown()[0].held)),
    }
}

fn open_replayed(swarm: &mut Swarm) {
    let round = swarm.show(1);
    swarm.say("ada", &Instruction::Open);
    swarm.teach(round, 1);
    swarm.pass(Duration::from_secs(10));
    let opened = swarm.air().iter().find(|parcel| parcel.bytes == br#"{"say":"open"}"#).cloned();
    if let Some(parcel) = opened {
        swarm.replay(&parcel);
    }
    swarm.pass(Duration::from_secs(3));
}

fn seventeen(swarm: &mut Swarm) {
    for class in [1, 2] {
        let round = swarm.show(class);
        let others = |swarm: &mut Swarm| {
            for n in 0..16 {
                say(swarm, &format!("eve{n}"), &was(round, 4));
            }
        };
        if class == 2 {
            others(swarm);
        }
        swarm.teach(round, class);
        if class == 1 {
            others(swarm);
            swarm.pass(Duration::from_secs(1));
            // Of those who contradict each other the latest counts.
            swarm.teach(round, class);
        }
        swarm.pass(Duration::from_secs(3));
    }
}

fn ada_has_the_last_word(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let classes = |mind: &gestalt_strategies::Mind| -> Vec<usize> {
        let of = |class| mind.training_set().map_or(0, |set| set.class_count(ClassId(class)));
        (0..6).map(of).collect()
    };
    match war.minds().map(classes).find(|counts| *counts != [0, 10, 10, 0, 0, 0]) {
        None => Ok(()),
        Some(counts) => Err(format!("samples by class: {counts:?}")),
    }
}

fn overruled(swarm: &mut Swarm) {
    let round = swarm.show(1);
    swarm.teach(round, 1);
    say(swarm, "eve", &was(round, 4));
    swarm.pass(Duration::from_secs(3));
}
