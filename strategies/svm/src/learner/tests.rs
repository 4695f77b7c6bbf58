//! What holds inside a learner; how it is used is tested from outside.

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::reduction::Components;
use crate::scaling::ScalingMethod;
use crate::sigmoid::Sigmoid;

const CLASSES: usize = 4;
const WIDTH: usize = 5;

pub(super) fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A vector of a class, overlapping with the other classes.
pub(super) fn vector(class: usize, rng: &mut impl Rng) -> Vec<f32> {
    let mut vector: Vec<f32> = (0..WIDTH).map(|_| rng.random_range(-1.5..1.5)).collect();
    vector[class % WIDTH] += 1.0;
    vector
}

fn learner() -> Learner {
    let mut rng = generator(1);
    let rows: Vec<Vec<f32>> = (0..200).map(|i| vector(i % CLASSES, &mut rng)).collect();
    let rows = rows.iter().map(Vec::as_slice);
    let keep = Components::Count(WIDTH);
    let space = FeatureSpace::fit("toy-1", rows, ScalingMethod::Common, keep, &mut rng);
    let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).unwrap();
    Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap()
}

fn taught(count: usize, rng: &mut impl Rng) -> Learner {
    let mut learner = learner();
    for key in 0..count {
        let class = key % CLASSES;
        learner.insert(key as u64, ClassId(class as u32), &vector(class, rng)).unwrap();
    }
    learner.learn().unwrap();
    learner
}

fn decisions(machine: &Machine, x: &[f32]) -> Vec<f64> {
    let mut decisions = Vec::new();
    machine.decide(x, &mut decisions);
    decisions
}

#[test]
fn its_machines_decide_as_those_of_the_offline_trainer() {
    let mut rng = generator(2);
    let learner = taught(160, &mut rng);
    let members: Vec<Vec<&[f32]>> = (0..CLASSES)
        .map(|class| learner.samples.of(class).iter().map(|sample| &*sample.vector).collect())
        .collect();
    let offline = Machine::fit(&members, WIDTH, 10.0, f64::from(learner.gamma)).unwrap();
    let online = learner.machine(&learner.present());
    for i in 0..400 {
        let x = vector(i % CLASSES, &mut rng);
        for (a, b) in decisions(&online, &x).into_iter().zip(decisions(&offline, &x)) {
            // The tolerance, which is the same, leaves this much open.
            assert!((a - b).abs() < 1e-2, "{a} for {b}");
        }
    }
}

#[test]
fn pairs_of_other_classes_are_not_touched() {
    let mut rng = generator(3);
    let mut learner = taught(120, &mut rng);
    let probes: Vec<Vec<f32>> = (0..50).map(|i| vector(i % CLASSES, &mut rng)).collect();
    let judge = |learner: &Learner| -> Vec<Vec<f64>> {
        let machine = learner.machine(&learner.present());
        probes.iter().map(|x| decisions(&machine, x)).collect()
    };
    let before = judge(&learner);
    let sigmoids =
        |learner: &Learner| -> Vec<Sigmoid> { learner.pairs.iter().map(|pair| pair.sigmoid).collect() };
    let sigmoids_before = sigmoids(&learner);
    for key in 0..10 {
        assert!(learner.remove(key * CLASSES as u64 + 3));
        learner.insert(1000 + key, ClassId(3), &vector(3, &mut rng)).unwrap();
    }
    learner.learn().unwrap();
    let after = judge(&learner);
    for (pair, (i, j)) in pairs(CLASSES).enumerate() {
        let same = before.iter().zip(&after).all(|(a, b)| a[pair].to_bits() == b[pair].to_bits());
        assert_eq!(same, i != 3 && j != 3, "machine of {i} and {j}");
        let same = sigmoids_before[pair] == sigmoids(&learner)[pair];
        assert_eq!(same, i != 3 && j != 3, "sigmoid of {i} and {j}");
    }
}

#[test]
fn stale_pairs_take_turns() {
    let mut rng = generator(4);
    let mut learner = taught(400, &mut rng);
    assert!(learner.pairs.iter().all(|pair| pair.changes == 0), "calibrated at first");
    let mut most = 0;
    for round in 0..40_u64 {
        for class in 0..CLASSES as u64 {
            learner.remove(round * 4 + class);
            learner
                .insert(1000 + round * 4 + class, ClassId(class as u32), &vector(class as usize, &mut rng))
                .unwrap();
        }
        learner.learn().unwrap();
        most = most.max(learner.pairs.iter().filter(|pair| pair.changes == 0).count());
        for pair in &learner.pairs {
            assert!(pair.staleness(&learner.samples) <= 0.2, "{round}");
        }
    }
    assert_eq!(most, 1, "of six pairs, in one call");
}

fn named(label: &str) -> ClassId {
    ClassId::named(&"ana".parse().unwrap(), label)
}

/// A view of a gesture that is not on the list.
fn new_view(rng: &mut impl Rng) -> Vec<f32> {
    let mut view = vector(4, rng);
    view[4] += 2.0;
    view
}

#[test]
fn a_gesture_that_is_met_while_it_learns_is_told_apart_as_one_of_the_list() {
    let mut rng = generator(5);
    let mut learner = taught(80, &mut rng);
    let before = learner.learn().unwrap();
    let probes: Vec<Vec<f32>> = (0..60).map(|_| new_view(&mut rng)).collect();
    for key in 0..20 {
        learner.insert(1000 + key, named("circle"), &new_view(&mut rng)).unwrap();
    }
    let grown = learner.learn().unwrap();
    assert_eq!(grown.vocabulary().classes(), CLASSES + 1);
    assert_eq!(grown.vocabulary().class_at(CLASSES), Some(named("circle")));
    // How likely each view is the new gesture.
    let judged = |classifier: &Classifier| -> Vec<f64> {
        let p = |probe: &Vec<f32>| classifier.probabilities_in_space(probe).unwrap();
        probes
            .iter()
            .map(p)
            .inspect(|p| assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-9))
            .map(|p| p[CLASSES])
            .collect()
    };
    let p = judged(&grown);
    let mean = p.iter().sum::<f64>() / 60.0;
    assert!(mean > 0.6, "{mean}");

    // As one that had met it from the beginning, whatever came between.
    let mut other = self::learner();
    let mut rng = generator(5);
    let first: Vec<Vec<f32>> = (0..80).map(|key| vector(key % CLASSES, &mut rng)).collect();
    (0..60).for_each(|_| drop(new_view(&mut rng)));
    for key in 0..20 {
        other.insert(1000 + key, named("circle"), &new_view(&mut rng)).unwrap();
    }
    for (key, vector) in first.iter().enumerate() {
        other.insert(key as u64, ClassId((key % CLASSES) as u32), vector).unwrap();
    }
    let q = judged(&other.learn().unwrap());
    let apart = p.iter().zip(&q).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
    assert!(apart < 0.05, "{apart}");

    // Shown no more, it leaves no trace, and its place is another's.
    (0..20).for_each(|key| assert!(learner.remove(1000 + key)));
    let without = learner.learn().unwrap();
    assert_eq!(without.vocabulary(), before.vocabulary());
    for key in 0..3 {
        learner.insert(2000 + key, named("fist"), &new_view(&mut rng)).unwrap();
    }
    assert_eq!(learner.pairs.len(), pairs(CLASSES + 1).count());
    assert_eq!(learner.learn().unwrap().vocabulary().named(), [named("fist")]);
}

#[test]
fn there_is_room_for_so_many_gestures_and_no_more() {
    let mut rng = generator(6);
    let mut learner = learner();
    for n in 0..60_u64 {
        learner.insert(n, named(&n.to_string()), &vector(0, &mut rng)).unwrap();
    }
    let full = learner.insert(60, named("60"), &vector(0, &mut rng));
    assert_eq!(full, Err(LearnError::Class(named("60"))));
    assert_eq!(learner.len(), 60);
    assert!(learner.remove(7));
    learner.insert(60, named("60"), &vector(0, &mut rng)).unwrap();
    let unlisted = learner.insert(61, ClassId(4), &vector(0, &mut rng));
    assert_eq!(unlisted, Err(LearnError::Class(ClassId(4))));
}

#[test]
fn one_that_slims_down_after_each_round_learns_the_same() {
    let mut rng = generator(9);
    let (mut slim, mut full) = (learner(), learner());
    let mut most_held = 0;
    // Some come together, as where a robot begins anew.
    slim.make_room((0..60).map(|key| ClassId(key % CLASSES as u32)));
    for round in 0..12_u64 {
        for n in 0..if round == 0 { 60 } else { 7 } {
            let key = 100 * round + n;
            let vector = vector(key as usize, &mut rng);
            for learner in [&mut slim, &mut full] {
                learner.insert(key, ClassId((key % CLASSES as u64) as u32), &vector).unwrap();
                learner.remove(100 * (round % 3) + 3 * n);
                learner.relabel(100 * (round % 2) + n, ClassId(1)).unwrap();
            }
        }
        let learned = [&mut slim, &mut full].map(|learner| learner.learn().unwrap());
        assert_eq!(learned[0].encode(), learned[1].encode(), "round {round}");
        let x = vector(1, &mut rng);
        assert_eq!(learned[0].probabilities_in_space(&x), learned[1].probabilities_in_space(&x));
        slim.slim_down();
        assert_eq!(slim.samples.rows_held(), 0);
        most_held = most_held.max(full.samples.rows_held());
    }
    assert!(most_held > 0);
}
