//! What passes on samples and lessons: questions of strangers, lists without end, digests that look alike.

use std::time::Duration;

use gestalt_protocol::{
    Digest, Envelope, Have, Know, Message, RobotId, RoundId, SampleId, SharedSample, Topic,
};
use gestalt_strategies::SeenSamples;

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, unmoved};
use crate::forged;
use crate::swarm::{Plan, Swarm};

pub const ALL: &[Attack] = &[
    Attack {
        number: "A13",
        what: "gives robot 3, which starts again after it, 20,000 samples of 80 made-up authors with a gap after each",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "a robot that lost its memory is given all true samples within 30 s",
        counted: Counted::None("intervals of numbers are bounded, so that what is known fits in a message"),
        gap: None,
        play: |seed| beside(&small_open(), seed, gaps, all_is_given),
    },
    Attack {
        number: "A15",
        what: "an enrolled robot asks robot 1 1,000 times what is known",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "at most 128 messages at once and 16 more a second come upon it",
        counted: Counted::Some(&["refused_question_too_often"]),
        gap: None,
        play: |seed| {
            beside(
                &Plan::sealed().liars(1),
                seed,
                |swarm| asks(swarm, 6),
                |peace, war| no_flood(peace, war, 6),
            )
        },
    },
    Attack {
        number: "A15",
        what: "asks 1,000 times in the name of a robot that is no neighbour what is known",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "nothing",
        counted: Counted::All(&["refused_question_of_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::open(), seed, |swarm| asks(swarm, 50), unmoved),
    },
    Attack {
        number: "A15",
        what: "asks robot 1 1,000 times in the name of its neighbour, robot 2",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_forged"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| asks(swarm, 2), unmoved),
    },
    Attack {
        number: "A15",
        what: "asks robot 1 1,000 times in the name of its neighbour, robot 2",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "at most 128 messages at once and 16 more a second come upon robot 2",
        counted: Counted::Some(&["refused_question_too_often"]),
        gap: None,
        play: |seed| {
            beside(&Plan::open(), seed, |swarm| asks(swarm, 2), |peace, war| no_flood(peace, war, 2))
        },
    },
    Attack {
        number: "22",
        what: "says to robot 1 again what the others asked and gave it, ten times over",
        tier: Tier::T2,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_repeated"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, said_again, unmoved),
    },
    Attack {
        number: "A20 · 26",
        what: "gives robot 2 samples whose marks cancel under the key that it compared under last",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all know them within two repair periods a hop",
        counted: Counted::None("the key is drawn anew whenever something was learned"),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, look_alike, all_know_them),
    },
];

/// Robots that hold 60 samples, since forgetting many is most of the work, and sign nothing.
fn small_open() -> Plan {
    let mut plan = Plan::open();
    plan.learning.capacity = 60;
    plan
}

const STRANGE: RoundId = RoundId { counter: 1, opener: RobotId(60), life: 60 };

fn teach_some(swarm: &mut Swarm) {
    for class in 1..=2 {
        let round = swarm.show(class);
        swarm.teach(round, class);
    }
}

fn gaps(swarm: &mut Swarm) {
    teach_some(swarm);
    let of = |author: u32| {
        let id = move |n: u32| SampleId { author: RobotId(100 + author), life: 5, number: 1 + 1_000_000 * n };
        (0..250).map(move |n| forged::sample(id(n), n % 6, STRANGE, &[n as f32 / 30.0, 0.3]))
    };
    let all: Vec<SharedSample> = (0..80).flat_map(of).collect();
    for part in all.chunks(10_000) {
        swarm.whisper_to(3, 50, &forged::samples(part.to_vec()));
    }
    swarm.pass(Duration::from_secs(1));
    swarm.restart(3, false);
    swarm.restart(4, true);
    swarm.pass(Duration::from_secs(30));
}

/// Robot 4 holds every sample of the true robots that robot 1 holds.
fn all_is_given(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let (known, given) = (war.mind(1).training_set(), war.mind(4).training_set());
    let true_ones = known.into_iter().flat_map(|set| set.common()).filter_map(|sample| sample.id);
    let lacking =
        true_ones.filter(|id| id.author.0 <= 5 && given.is_none_or(|set| !set.seen().contains(*id)));
    match lacking.count() {
        0 => Ok(()),
        lacking => Err(format!("{lacking} samples were not given")),
    }
}

fn asks(swarm: &mut Swarm, name: u32) {
    teach_some(swarm);
    let digest = Digest { key: 1, samples: 2, lessons: 3 };
    let know =
        Know { samples: Vec::new(), lessons: Vec::new(), digest, answer: true, nothing_for: None, named: 0 };
    for _ in 0..1000 {
        swarm.whisper_to(1, name, &Message::Know(know.clone()));
    }
    swarm.pass(Duration::from_secs(10));
}

fn said_again(swarm: &mut Swarm) {
    teach_some(swarm);
    let key = swarm.key(&Topic::Repair(RobotId(1)));
    let heard: Vec<_> = swarm.air().iter().filter(|parcel| parcel.key == key).cloned().collect();
    for _ in 0..10 {
        heard.iter().for_each(|parcel| swarm.replay_to(1, parcel));
    }
    swarm.pass(Duration::from_secs(10));
}

fn no_flood(peace: &Swarm, war: &Swarm, upon: u32) -> Result<(), String> {
    let told = |swarm: &Swarm| {
        let key = swarm.key(&Topic::Repair(RobotId(upon)));
        swarm.air().iter().filter(|parcel| parcel.key == key).count()
    };
    let more = told(war).saturating_sub(told(peace));
    if more <= 128 + 160 { Ok(()) } else { Err(format!("{more} messages more than in peace")) }
}

/// The key that robot 2 told last.
fn key_of_second(swarm: &Swarm) -> u64 {
    let envelopes = swarm.air().iter().rev().filter_map(|parcel| Envelope::decode(&parcel.bytes).ok());
    let keys =
        envelopes.filter(|envelope| envelope.author == RobotId(2)).filter_map(|envelope| {
            match envelope.message {
                Message::Have(Have { knowledge: Some(digest), .. }) => Some(digest.key),
                _ => None,
            }
        });
    { keys }.next().unwrap_or_default()
}

/// Names whose marks under that key cancel: by elimination over GF(2), of 65 names at most.
fn cancelling(key: u64) -> Vec<SampleId> {
    let name = |n: u32| SampleId { author: RobotId(6), life: 5, number: 1 + 2 * n };
    let mark = |id: SampleId| {
        let mut seen = SeenSamples::default();
        // One name always finds room in an empty set.
        let _ = seen.insert(id);
        seen.digest(key)
    };
    // Reduced marks, each with the names that it is made of.
    let mut basis: Vec<(u64, u128)> = Vec::new();
    for n in 0..65 {
        let (mut value, mut names) = (mark(name(n)), 1_u128 << n);
        for (held, made_of) in &basis {
            if value ^ held < value {
                (value, names) = (value ^ held, names ^ made_of);
            }
        }
        if value == 0 {
            return (0..65).filter(|n| names >> n & 1 == 1).map(name).collect();
        }
        basis.push((value, names));
        basis.sort_unstable_by(|a, b| b.cmp(a));
    }
    Vec::new()
}

fn look_alike(swarm: &mut Swarm) {
    teach_some(swarm);
    swarm.pass(Duration::from_secs(10));
    let names = cancelling(key_of_second(swarm));
    assert!(names.len() > 1, "65 marks of 64 bits depend on each other");
    let samples =
        names.iter().map(|id| forged::sample(*id, 1, STRANGE, &[id.number as f32 / 50.0, 0.3])).collect();
    swarm.whisper_to(2, 6, &forged::samples(samples));
    // Two idle periods of each hop on half the ring.
    swarm.pass(Duration::from_secs(32));
}

fn all_know_them(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let seen = |mind: &gestalt_strategies::Mind| mind.training_set().map(|set| set.seen().digest(1));
    let of_second = seen(war.mind(2));
    match war.minds().filter(|mind| seen(mind) != of_second).count() {
        0 => Ok(()),
        robots => Err(format!("{robots} robots know something else than robot 2")),
    }
}
