//! Who is an instructor.

use std::time::Duration;

use gestalt_protocol::{Answer, ClassId, Gesture, Instruction, Outcome, RobotId, RoundId, Topic};

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, learned_alike, unmoved};
use crate::swarm::world::{STRANGER, instructor, key};
use crate::swarm::{Plan, Swarm};
use crate::trust::{Speaker, WordHeading, answer, word};

pub const ALL: &[Attack] = &[
    Attack {
        number: "A17 · 27",
        what: "says in ada's name that the gesture was another",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::Some(&[
            "refused_feedback_unsigned",
            "refused_word_unsigned",
            "refused_word_forged",
        ]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, in_her_name, learned_alike),
    },
    Attack {
        number: "A17",
        what: "answers ada in a robot's name before any robot does",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "the true answer is given",
        counted: Counted::All(&["refused_answer_unsigned", "refused_answer_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, answered_first, is_answered),
    },
    Attack {
        number: "A17",
        what: "the same, 1,000 times a second from before the word on, with made-up signatures",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "the true answer is given",
        counted: Counted::Some(&["refused_answer_forged", "refused_answer_too_fast"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, answered_all_along, is_answered),
    },
    Attack {
        number: "27",
        what: "asks for a round 1,000 times a second for 5 s",
        tier: Tier::T5,
        setting: Setting::Sealed,
        expected: "at most two rounds a second, and each ends decided as in peace",
        counted: Counted::Some(&["refused_word_too_fast"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, opens, few_rounds),
    },
    Attack {
        number: "27",
        what: "replays an instructor's request to open a round",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::Some(&["refused_word_repeated"]),
        gap: None,
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
        what: "an instructor who may teach overrules another, who spoke first",
        tier: Tier::T5,
        setting: Setting::Sealed,
        expected: "nothing: that takes the role",
        counted: Counted::Some(&["refused_word_not_allowed"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, overruled, learned_alike),
    },
];

/// In somebody's name: without a signature, and with that of a key that is nobody's.
fn say_as(swarm: &mut Swarm, by: &str, instruction: &Instruction) {
    let bytes = serde_json::to_vec(instruction).expect("a word is JSON");
    swarm.put(&Topic::Feedback(instructor(by)), &bytes);
    swarm.put(&Topic::Word(instructor(by)), &bytes);
    let mut forged = swarm.word(by, instruction);
    let heading = WordHeading { speaker: Speaker::Own(instructor(by)), count: u64::MAX };
    forged.attachment = Some(word::sign(&key(STRANGER), &swarm.id(), &instructor(by), &heading, &bytes));
    swarm.replay(&forged);
}

fn was(round: gestalt_protocol::RoundId, class: u32) -> Instruction {
    Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
}

fn in_her_name(swarm: &mut Swarm) {
    let round = swarm.show(1);
    swarm.teach(round, 1);
    say_as(swarm, "ada", &was(round, 4));
    swarm.pass(Duration::from_secs(3));
}

/// An answer to ada's word on that round, said then, which robot 1 never gave; and that signature under it.
fn false_answer(swarm: &mut Swarm, round: RoundId, at: Duration, signature: Option<&[u8]>) {
    let answer = Answer {
        robot: RobotId(1),
        at: at.as_nanos() as u64,
        to: was(round, 1),
        outcome: Outcome::UnknownRound,
        class: None,
        samples: 0,
        looks_like: None,
    };
    let bytes = serde_json::to_vec(&answer).expect("an answer is JSON");
    let own = || answer::sign(&key(STRANGER), &swarm.id(), RobotId(1), &instructor("ada"), &bytes);
    let attachment = signature.map_or_else(|| own().as_bytes().to_vec(), <[u8]>::to_vec);
    let attachment = Some(attachment).filter(|attachment| !attachment.is_empty());
    swarm.put_attached(&Topic::Answer(instructor("ada")), bytes, attachment);
}

fn answered_first(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.now();
    false_answer(swarm, round, at, Some(&[]));
    false_answer(swarm, round, at, None);
    swarm.teach(round, 1);
}

fn answered_all_along(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.now() + Duration::from_secs(1);
    for n in 0..1000_u32 {
        swarm.pass(Duration::from_millis(1));
        let signature = n.to_le_bytes().repeat(16);
        false_answer(swarm, round, at, Some(&signature));
    }
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
            // All are asked 200 times a second, by one who may.
            swarm.put_word("eve", &Instruction::Open);
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
                swarm.put_word(&format!("eve{n}"), &was(round, 4));
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
    swarm.put_word("eve", &was(round, 4));
    swarm.pass(Duration::from_secs(3));
}
