//! Samples that teach something else than what was shown.

use std::time::Duration;

use gestalt_protocol::{
    Batches, ClassId, Gesture, HeldBatch, Instruction, Message, RobotId, RoundId, SampleId, SharedSample,
    Topic,
};
use gestalt_strategies::{Mind, SetPart};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, learned_alike, unmoved};
use crate::forged;
use crate::swarm::{Plan, Swarm};

pub const ALL: &[Attack] = &[
    Attack {
        number: "A11 · 18",
        what: "gives 1,000 samples that lie as far apart as can be said",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| far_out(swarm, 50), unmoved),
    },
    Attack {
        number: "A11 · 18",
        what: "an enrolled robot gives 1,000 samples that lie as far apart as can be said",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_sample_with_bad_vector"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| far_out(swarm, 6), unmoved),
    },
    Attack {
        number: "A11 · 18",
        what: "gives 600 samples of 20 made-up authors, far apart but possible, to robots that hold 60",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "a quarter of a set at most is theirs; no own sample goes",
        counted: Counted::None(
            "what is above the share of an author, or of all strangers, is the first to be forgotten",
        ),
        gap: None,
        play: |seed| beside(&small_open(), seed, by_strangers, a_quarter_at_most),
    },
    Attack {
        number: "18",
        what: "an enrolled robot gives 600 samples with gaps in their numbers to robots that hold 60",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "15 of them are held at most, its share where five robots vote; no own sample goes",
        counted: Counted::None("what is above the share of an author is the first to be forgotten"),
        gap: None,
        play: |seed| beside(&small(1), seed, by_a_member, its_share_at_most),
    },
    Attack {
        number: "A11 · 18",
        what: "gives samples of made-up authors",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&small(0), seed, by_strangers, learned_alike),
    },
    Attack {
        number: "A12",
        what: "gives robot 2 4,200 samples of as many made-up authors",
        tier: Tier::T0,
        setting: Setting::Open,
        expected: "the samples of true robots are taken from then on as ever",
        counted: Counted::Some(&["refused_sample_number"]),
        gap: None,
        play: |seed| beside(&small_open(), seed, many_authors, last_round_is_shared),
    },
    Attack {
        number: "A14 · 4",
        what: "gives samples under the names that robot 3 will use next",
        tier: Tier::T0,
        setting: Setting::Sealed,
        expected: "nothing; the others still get the true ones",
        counted: Counted::All(&["refused_repair_stranger"]),
        gap: None,
        play: |seed| beside(&Plan::sealed(), seed, |swarm| next_numbers(swarm, 50), true_vectors),
    },
    Attack {
        number: "4",
        what: "an enrolled robot gives samples under the names that robot 3 will use next",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing; the others still get the true ones",
        counted: Counted::All(&["refused_repair_unsigned"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1), seed, |swarm| next_numbers(swarm, 6), true_vectors),
    },
    Attack {
        number: "4",
        what: "an enrolled robot relabels what it passes on, of a round that was taught",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing is trained on under a false label",
        counted: Counted::All(&["refused_repair_forged"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| passed_on(swarm, &other_label), learned_alike)
        },
    },
    Attack {
        number: "4",
        what: "an enrolled robot passes on other vectors than the author shared, before the true ones come",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing; the others still get the true ones",
        counted: Counted::All(&["refused_repair_forged"]),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| passed_on(swarm, &other_vector), true_vectors)
        },
    },
    Attack {
        number: "15",
        what: "an enrolled robot shares samples with flipped labels of a round that was taught",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "none is trained on as what it says",
        counted: Counted::None("what an instructor said of the round decides"),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| flipped(swarm, Feedback::Full), none_flipped)
        },
    },
    Attack {
        number: "15",
        what: "an enrolled robot shares flipped labels of a round of which it was said that the decision was wrong",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "none is trained on",
        counted: Counted::None("while several gestures are possible samples of others wait aside"),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| flipped(swarm, Feedback::Partial), none_flipped)
        },
    },
    Attack {
        number: "15",
        what: "an enrolled robot shares flipped labels of a round of which nothing was said",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "none is trained on",
        counted: Counted::None("none of it is refused"),
        gap: Some("without a lesson on its round a sample is taken for what its author says"),
        play: |seed| {
            beside(&Plan::sealed().liars(1), seed, |swarm| flipped(swarm, Feedback::None), none_flipped)
        },
    },
];

/// Robots that hold 60 samples.
fn small(liars: u32) -> Plan {
    let mut plan = Plan::sealed().liars(liars);
    plan.learning.capacity = 60;
    plan
}

/// The same, of whom nobody signs.
fn small_open() -> Plan {
    let mut plan = Plan::open();
    plan.learning.capacity = 60;
    plan
}

fn show_and_teach(swarm: &mut Swarm, class: u32) -> RoundId {
    let round = swarm.show(class);
    swarm.teach(round, class);
    round
}

/// By seven made-up authors, or by one that is enrolled.
fn far_out(swarm: &mut Swarm, from: u32) {
    let round = show_and_teach(swarm, 1);
    let sample = |n: u32| {
        let id = SampleId {
            author: RobotId(if from == 50 { from + n % 7 } else { from }),
            life: 5,
            number: 1 + n,
        };
        forged::sample(id, n % 6, round, &[1e30, -1e30, 11.0 + n as f32])
    };
    swarm.whisper(from, &forged::samples((0..1000).map(sample).collect()));
    show_and_teach(swarm, 2);
}

/// Samples that could be true, somewhere in space.
fn possible(n: u32, author: u32, round: RoundId, rng: &mut ChaCha8Rng) -> SharedSample {
    let id = SampleId { author: RobotId(author), life: 5, number: 1 + 3 * n };
    let at: Vec<f32> = (0..4).map(|_| rng.random_range(-9.0..9.0)).collect();
    forged::sample(id, rng.random_range(0..6), round, &at)
}

fn flood(swarm: &mut Swarm, from: u32, author: impl Fn(u32) -> u32) {
    for class in 0..4 {
        show_and_teach(swarm, class);
    }
    let strange = RoundId { counter: 3, opener: RobotId(60), life: 60 };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let samples = (0..600).map(|n| possible(n, author(n), strange, &mut rng)).collect();
    swarm.whisper(from, &forged::samples(samples));
    show_and_teach(swarm, 4);
    swarm.pass(Duration::from_secs(5));
}

fn by_strangers(swarm: &mut Swarm) {
    flood(swarm, 50, |n| 50 + n % 20);
}

fn by_a_member(swarm: &mut Swarm) {
    flood(swarm, 6, |_| 6);
}

fn shares(peace: &Swarm, war: &Swarm, most: usize, theirs: fn(RobotId) -> bool) -> Result<(), String> {
    let own = |mind: &Mind| {
        let set = mind.training_set();
        set.map_or(0, |set| set.total(SetPart::Personal) + set.total(SetPart::Shared))
    };
    for (before, after) in peace.minds().zip(war.minds()) {
        let authors = after.training_set().into_iter().flat_map(|set| set.authors());
        let held: usize = authors.filter(|(author, _)| theirs(*author)).map(|(_, held)| held).sum();
        if held > most || own(after) < own(before) {
            return Err(format!(
                "robot {}: {held} of theirs, {} own of {}",
                after.me(),
                own(after),
                own(before)
            ));
        }
    }
    Ok(())
}

fn a_quarter_at_most(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    shares(peace, war, 15, |author| author.0 >= 50)
}

fn its_share_at_most(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    shares(peace, war, 15, |author| author.0 == 6)
}

fn many_authors(swarm: &mut Swarm) {
    show_and_teach(swarm, 1);
    let round = RoundId { counter: 3, opener: RobotId(60), life: 60 };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let samples: Vec<_> = (0..4200).map(|n| possible(0, 1000 + n, round, &mut rng)).collect();
    for part in samples.chunks(1000) {
        swarm.whisper_to(2, 50, &forged::samples(part.to_vec()));
    }
    show_and_teach(swarm, 2);
    swarm.pass(Duration::from_secs(10));
}

/// Every robot holds as many samples of the last round as in peace.
fn last_round_is_shared(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let of_last = |swarm: &Swarm| -> Vec<usize> {
        let round = swarm.round();
        let of = |mind: &Mind| {
            let set = mind.training_set().into_iter().flat_map(|set| set.iter());
            set.filter(|sample| sample.round == round).count()
        };
        swarm.minds().map(of).collect()
    };
    match of_last(war) == of_last(peace) {
        true => Ok(()),
        false => Err(format!("of the last round {:?}, in peace {:?}", of_last(war), of_last(peace))),
    }
}

/// What robot 3 shared, as it was said.
fn of_third(swarm: &Swarm) -> Vec<HeldBatch> {
    let key = swarm.key(&Topic::Sample(RobotId(3)));
    let said = swarm.air().iter().filter(|parcel| parcel.key == key);
    let envelopes = said.filter_map(|parcel| gestalt_protocol::Envelope::decode(&parcel.bytes).ok());
    let batches = envelopes.filter_map(|envelope| match envelope.message {
        Message::Samples(samples) => Some(HeldBatch {
            robot: envelope.author,
            stamp: envelope.stamp,
            samples,
            signature: envelope.signature,
        }),
        _ => None,
    });
    batches.collect()
}

fn next_numbers(swarm: &mut Swarm, from: u32) {
    let round = show_and_teach(swarm, 1);
    let last = of_third(swarm).last().and_then(|batch| Some(batch.samples.samples.last()?.id));
    if let Some(last) = last {
        let next = (1..=10).map(|n| SampleId { number: last.number + n, ..last });
        let samples = next.map(|id| forged::sample(id, 4, round, &[1.0, -1.0])).collect();
        swarm.whisper(from, &forged::samples(samples));
    }
    show_and_teach(swarm, 2);
    swarm.pass(Duration::from_secs(10));
}

/// Every robot holds of robot 3's samples what robot 3 holds of them.
fn true_vectors(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let own = war.mind(3).training_set().ok_or("robot 3 learns nothing")?;
    for sample in own.common().filter(|sample| sample.part == SetPart::Shared) {
        let Some(id) = sample.id else { continue };
        for mind in war.minds() {
            let held = mind.training_set().and_then(|set| set.find(id));
            if held.is_none_or(|held| held.vector != sample.vector || held.class != sample.class) {
                return Err(format!("robot {} holds another sample {id}, or none", mind.me()));
            }
        }
    }
    Ok(())
}

/// Robot 1 is cut off while robot 3 shares; what it lacks it hears of the liar first.
fn passed_on(swarm: &mut Swarm, change: &dyn Fn(&mut SharedSample)) {
    let began = swarm.now();
    swarm.begin(1);
    let round = swarm.end(began);
    swarm.cut([1]);
    swarm.teach(round, 1);
    let mut batches = of_third(swarm);
    batches.iter_mut().flat_map(|batch| &mut batch.samples.samples).for_each(change);
    swarm.whisper_to(1, 6, &Message::Batches(Batches { batches }));
    swarm.cut([]);
    swarm.pass(Duration::from_secs(15));
}

fn other_label(sample: &mut SharedSample) {
    sample.class = ClassId(4);
}

fn other_vector(sample: &mut SharedSample) {
    *sample = forged::sample(sample.id, sample.class.0, sample.round, &[0.5, -0.5]);
}

/// What is said of a round.
enum Feedback {
    Full,
    Partial,
    None,
}

fn flipped(swarm: &mut Swarm, feedback: Feedback) {
    let round = swarm.show(1);
    match feedback {
        Feedback::Full => {
            swarm.teach(round, 1);
        }
        Feedback::Partial => {
            swarm.say("ada", &Instruction::Wrong { round, of: Gesture::Class(ClassId(2)) });
        }
        Feedback::None => {}
    }
    let id = |number| SampleId { author: RobotId(6), life: 5, number };
    let samples =
        (1..=10).map(|number| forged::sample(id(number), 4, round, &[number as f32 / 5.0, 0.3])).collect();
    swarm.whisper(6, &forged::samples(samples));
    swarm.pass(Duration::from_secs(5));
}

fn none_flipped(_: &Swarm, war: &Swarm) -> Result<(), String> {
    let flipped = |mind: &Mind| mind.training_set().map_or(0, |set| set.class_count(ClassId(4)));
    match war.minds().map(flipped).sum::<usize>() {
        0 => Ok(()),
        samples => Err(format!("{samples} samples of 5 robots are trained on under the liar's label")),
    }
}
