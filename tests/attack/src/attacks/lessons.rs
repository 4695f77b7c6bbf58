//! Lessons that no instructor gave.

use std::collections::BTreeSet;
use std::time::Duration;

use gestalt_protocol::{
    ClassId, Envelope, Gesture, Instruction, Lesson, Message, Outcome, RobotId, RoundId, Word,
};

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, learned_alike, unmoved};
use crate::forged;
use crate::swarm::{Plan, Swarm};

pub const ALL: &[Attack] = &[
    Attack {
        number: "A9",
        what: "an enrolled robot tells 1,024 lessons on rounds of the last counters there are",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_lesson_far_ahead"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| last_rounds(swarm, 6), unmoved),
    },
    Attack {
        number: "A9",
        what: "an enrolled robot tells 4,096 lessons on made-up rounds of the newest count",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_lesson_unproven"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| near_rounds(swarm, 6), learned_alike),
    },
    Attack {
        number: "A9",
        what: "an enrolled robot vouches for 1,100 such lessons of somebody without a key",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "the next true word is learned by all",
        counted: Counted::None("a round that nobody lived through gives way to one that somebody did"),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, vouched_rounds, next_word_counts),
    },
    Attack {
        number: "A9",
        what: "an enrolled robot vouches for somebody who takes back what every robot's next 64 rounds showed",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "the next gestures are seen, decided and learned by all",
        counted: Counted::None("a round that was spoken of before it was shown is not over for that"),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, rounds_to_come, next_word_counts),
    },
    Attack {
        number: "A9",
        what: "tells 4,096 lessons on made-up rounds",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| near_rounds(swarm, 50), learned_alike),
    },
    Attack {
        number: "A10 · 3",
        what: "an enrolled robot takes back in ada's name what she taught, under the last count there is",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_lesson_unproven"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| taken_back(swarm, 6, u64::MAX), unmoved),
    },
    Attack {
        number: "A10 · 3",
        what: "an enrolled robot takes it back under the highest count that is taken, and in 16 made-up names",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_lesson_unproven"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| taken_back(swarm, 6, 1 << 32), unmoved),
    },
    Attack {
        number: "A10 · 3",
        what: "takes back in ada's name what she taught, and she says no more",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, taken_back_for_good, learned_alike),
    },
];

fn tell(swarm: &mut Swarm, from: u32, lessons: Vec<Lesson>) {
    for part in lessons.chunks(1024) {
        swarm.whisper(from, &forged::lessons(part.to_vec()));
    }
}

fn show_and_teach(swarm: &mut Swarm, class: u32) -> RoundId {
    let round = swarm.show(class);
    swarm.teach(round, class);
    round
}

fn last_rounds(swarm: &mut Swarm, from: u32) {
    show_and_teach(swarm, 1);
    let of = |n| {
        let round = RoundId { counter: u32::MAX - n, opener: RobotId(1), life: 0 };
        forged::lesson(round, "eve", 1, Word::Was(ClassId(4)))
    };
    tell(swarm, from, (0..1024).map(of).collect());
    show_and_teach(swarm, 2);
}

fn near_rounds(swarm: &mut Swarm, from: u32) {
    let first = show_and_teach(swarm, 1);
    let of = |n: u32| {
        let round = RoundId { counter: first.counter, opener: RobotId(u32::MAX), life: n };
        forged::lesson(round, "eve", 1, Word::Was(ClassId(4)))
    };
    tell(swarm, from, (0..4096).map(of).collect());
    swarm.pass(Duration::from_secs(5));
    show_and_teach(swarm, 2);
}

fn vouched_rounds(swarm: &mut Swarm) {
    let first = show_and_teach(swarm, 1);
    if swarm.at_war() {
        let of = |n: u32| {
            let round = RoundId { counter: first.counter, opener: RobotId(u32::MAX), life: n };
            let was = Instruction::Was { round, class: Gesture::Class(ClassId(4)) };
            let said = forged::vouched(6, &swarm.id(), "guest", n.into(), &was);
            forged::lesson_of(said, round, "guest", n.into(), Word::Was(ClassId(4)))
        };
        for lessons in (0..1100).map(of).collect::<Vec<_>>().chunks(256) {
            swarm.whisper(6, &forged::lessons(lessons.to_vec()));
        }
    }
    swarm.pass(Duration::from_secs(5));
    show_and_teach(swarm, 2);
}

fn rounds_to_come(swarm: &mut Swarm) {
    let first = show_and_teach(swarm, 1);
    swarm.pass(Duration::from_secs(5));
    let own = swarm.air().iter().filter_map(|parcel| Envelope::decode(&parcel.bytes).ok());
    let shared = own.filter_map(|envelope| match envelope.message {
        Message::Samples(samples) => samples.first(),
        _ => None,
    });
    // A robot opens its rounds, and shares its samples, in the same life.
    let lives: BTreeSet<(RobotId, u32)> = shared.map(|id| (id.author, id.life)).collect();
    assert!(lives.len() > 1, "robots share what they saw");
    if swarm.at_war() {
        let (id, mut count) = (swarm.id(), 0);
        let mut of = |(opener, life), n: u32| {
            let round = RoundId { counter: first.counter + n, opener, life };
            count += 1;
            let said = forged::vouched(6, &id, "guest", count, &Instruction::Retract { round });
            forged::lesson_of(said, round, "guest", count, Word::Retracted)
        };
        let mut lessons = Vec::new();
        for life in lives {
            lessons.extend((1..=64).map(|n| of(life, n)));
        }
        for part in lessons.chunks(256) {
            swarm.whisper(6, &forged::lessons(part.to_vec()));
        }
    }
    swarm.pass(Duration::from_secs(5));
    show_and_teach(swarm, 2);
    show_and_teach(swarm, 3);
}

/// The last word of all was learned: what was seen in the last round is labelled by it everywhere.
fn next_word_counts(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let of_last = |swarm: &Swarm| -> Vec<Vec<u32>> {
        let round = swarm.round();
        let of = |mind: &gestalt_strategies::Mind| -> Vec<u32> {
            let set = mind.training_set().into_iter().flat_map(|set| set.iter());
            set.filter(|sample| sample.round == round).map(|sample| sample.class.0).collect()
        };
        swarm.minds().map(of).collect()
    };
    if !war.answered(Outcome::Learned) {
        return Err("nothing was answered as learned".to_owned());
    }
    match of_last(war) == of_last(peace) {
        true => Ok(()),
        false => Err(format!("of the last round {:?}, in peace {:?}", of_last(war), of_last(peace))),
    }
}

fn retractions(round: RoundId, count: u64) -> Vec<Lesson> {
    let names = std::iter::once("ada".to_owned()).chain((0..16).map(|n| format!("eve{n}")));
    let of = |name: String| {
        let count = if name == "ada" { count } else { count.min(9) };
        forged::lesson(round, &name, count, Word::Retracted)
    };
    names.map(of).collect()
}

fn taken_back(swarm: &mut Swarm, from: u32, count: u64) {
    let round = show_and_teach(swarm, 1);
    let lessons = match count {
        u64::MAX => vec![forged::lesson(round, "ada", count, Word::Retracted)],
        _ => retractions(round, count),
    };
    tell(swarm, from, lessons);
    swarm.pass(Duration::from_secs(5));
    swarm.teach(round, 5);
    swarm.pass(Duration::from_secs(5));
}

fn taken_back_for_good(swarm: &mut Swarm) {
    let round = show_and_teach(swarm, 1);
    tell(swarm, 50, vec![forged::lesson(round, "ada", 2, Word::Retracted)]);
    swarm.pass(Duration::from_secs(5));
}
