//! The learner as its users see it: samples come and go, classifiers come out.

mod side_by_side;

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{
    Classifier, Components, Evaluation, FeatureSpace, Head, LabelledFeatures, LearnError, Learner,
    LearnerOptions, ScalingMethod,
};
use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 4;
const FEATURES: usize = 6;

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// About a standard normal variable: the sum of twelve uniform ones.
fn normal(rng: &mut impl Rng) -> f32 {
    (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum()
}

/// Raw features of a class: on a circle, overlapping with its neighbours.
fn features(class: usize, rng: &mut impl Rng) -> Vec<f32> {
    let angle = class as f32 / CLASSES as f32 * std::f32::consts::TAU;
    let mut features: Vec<f32> = (0..FEATURES).map(|_| 0.6 * normal(rng)).collect();
    features[0] += angle.cos();
    features[1] += angle.sin();
    features
}

fn space() -> Arc<FeatureSpace> {
    let mut rng = generator(1);
    let rows: Vec<Vec<f32>> = (0..200).map(|i| features(i % CLASSES, &mut rng)).collect();
    let rows = rows.iter().map(Vec::as_slice);
    Arc::new(FeatureSpace::fit(
        "toy-1",
        rows,
        ScalingMethod::PerComponent,
        Components::Count(FEATURES),
        &mut rng,
    ))
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new((0..CLASSES).map(|k| k.to_string())).unwrap()
}

fn learner(space: &Arc<FeatureSpace>) -> Learner {
    Learner::new(space.clone(), vocabulary(), LearnerOptions::default()).unwrap()
}

/// Vectors in the space, of classes in turn.
fn samples(space: &FeatureSpace, count: usize, rng: &mut impl Rng) -> Vec<(ClassId, Vec<f32>)> {
    let sample =
        |i: usize| (ClassId((i % CLASSES) as u32), space.project(&features(i % CLASSES, rng)).unwrap());
    (0..count).map(sample).collect()
}

fn judge(classifier: &Classifier, vector: &[f32]) -> Vec<f64> {
    classifier.probabilities_in_space(vector).unwrap()
}

fn taught(space: &Arc<FeatureSpace>, samples: &[(ClassId, Vec<f32>)]) -> Learner {
    let mut learner = learner(space);
    for (key, (class, vector)) in samples.iter().enumerate() {
        learner.insert(key as u64, *class, vector).unwrap();
    }
    learner
}

#[test]
fn gestures_never_met_are_as_likely_as_unknown_and_less_so_the_more_is_known() {
    let space = space();
    let samples = samples(&space, 80, &mut generator(2));
    let mut learner = learner(&space);
    let x = &samples[0].1;
    let raw = features(0, &mut generator(3));
    let mut by_classes = vec![learner.learn().unwrap()];
    for class in 0..CLASSES as u32 {
        for (key, (_, vector)) in samples.iter().enumerate().filter(|(_, (of, _))| of.0 == class) {
            learner.insert(key as u64, ClassId(class), vector).unwrap();
        }
        by_classes.push(learner.learn().unwrap());
    }
    assert_eq!(judge(&by_classes[0], x), [0.25; 4], "nothing met");
    assert_eq!(by_classes[0].unknown(&raw), None);
    let one = judge(&by_classes[1], x);
    assert!(
        one[0] <= 0.25 && one[1..] == [one[1]; 3],
        "what other gestures look like it cannot know: {one:?}"
    );
    let two = judge(&by_classes[2], x);
    assert!(two[0] > one[0] && two[0] > 2.0 * two[2] && two[2] == two[3], "{one:?} {two:?}");
    assert!(two[3] < one[3], "{one:?} {two:?}");
    let all = judge(&by_classes[4], x);
    assert!(best(&all) == 0, "{all:?}");
    for (met, classifier) in by_classes.iter().enumerate() {
        let p = judge(classifier, x);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        if (1..CLASSES).contains(&met) {
            let unmet = classifier.probabilities(&raw).unwrap()[CLASSES - 1];
            assert_eq!(classifier.unknown(&raw), Some(unmet), "{met} met");
        }
        let read = Classifier::decode(&classifier.encode()).unwrap();
        assert_eq!(read, **classifier, "on disk");
    }
    // Far from all it has met it is likelier unknown than any of them.
    let far: Vec<f32> = raw.iter().map(|x| 40.0 - 9.0 * x).collect();
    let (known, unknown) = (by_classes[4].probabilities(&far).unwrap(), by_classes[4].unknown(&far).unwrap());
    assert!(known.iter().all(|p| *p < unknown), "{known:?} {unknown}");
}

#[test]
fn the_layout_before_is_read_and_says_the_same_of_what_was_taught() {
    let space = space();
    let samples = samples(&space, 80, &mut generator(2));
    let now = taught(&space, &samples).learn().unwrap();
    let mut before = now.encode();
    // Without the weights of other gestures, and that there are some.
    before.truncate(before.len() - 33);
    before[0] = 5;
    let read = Classifier::decode(&before).unwrap();
    let raw = features(0, &mut generator(3));
    assert_eq!(read.judge(&raw).unwrap(), now.judge(&raw).unwrap(), "all are taught");
    assert_eq!(Classifier::decode(&read.encode()).unwrap(), read, "written as it is now");
}

#[test]
fn samples_of_one_showing_tell_no_more_than_one_of_what_is_unknown() {
    let space = space();
    let samples = samples(&space, 16, &mut generator(2));
    let of = |copies: u64, showings: &dyn Fn(u64) -> u64| {
        let mut learner = learner(&space);
        for key in 0..copies * samples.len() as u64 {
            let (class, vector) = &samples[key as usize % samples.len()];
            learner.insert_shown(key, *class, vector, showings(key)).unwrap();
        }
        learner.learn().unwrap().unknown(&features(0, &mut generator(3))).unwrap()
    };
    let once = of(1, &|key| key);
    let repeated = of(5, &|key| key % samples.len() as u64);
    assert!((once - repeated).abs() < 1e-6, "{once} {repeated}");
    let shown_anew = of(5, &|key| key);
    assert!((once - shown_anew).abs() > 1e-4, "what is shown anew counts anew: {shown_anew} {once}");
}

/// A learner that was shown the first classes often, and the others so many times; two samples a showing.
fn grown(space: &Arc<FeatureSpace>, often: usize, seldom: u64, seed: u64) -> Arc<Classifier> {
    let (mut rng, mut learner, mut key) = (generator(seed), learner(space), 0);
    for class in 0..CLASSES {
        for _ in 0..if class < CLASSES - 1 { often as u64 } else { seldom } {
            let showing = key;
            for _ in 0..2 {
                let vector = space.project(&features(class, &mut rng)).unwrap();
                learner.insert_shown(key, ClassId(class as u32), &vector, showing).unwrap();
                key += 1;
            }
        }
    }
    learner.learn().unwrap()
}

#[test]
fn a_young_class_is_answered_for_by_the_head_for_few() {
    let space = space();
    let (mut by_machines, mut by_both, mut old) = (0, 0, [0; 2]);
    for seed in 0..20 {
        let classifier = grown(&space, 40, 2, 30 + seed);
        let (machines, head) = (classifier.machines(), classifier.head().unwrap());
        for (class, x) in samples(&space, 200, &mut generator(60 + seed)) {
            let p = judge(&classifier, &x);
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-9 && p.iter().all(|p| (0.0..=1.0).contains(p)));
            let right = |p: &[f64]| usize::from(best(p) == class.index());
            if class.index() == CLASSES - 1 {
                by_machines += right(&machines.probabilities(&x));
                by_both += right(&p);
                let by_head = head.probabilities(&x);
                assert!(by_head[CLASSES - 1] > 0.9 || p[CLASSES - 1] <= 0.95, "{by_head:?} {p:?}");
            } else {
                old[0] += right(&machines.probabilities(&x));
                old[1] += right(&p);
            }
        }
    }
    // Of 1,000 views of the class that was shown twice, and 3,000 of the others.
    assert!(by_both > by_machines + 200, "{by_both} of 1000, machines {by_machines}");
    assert!(old[1] + 450 > old[0], "{old:?} of 3000");
}

#[test]
fn the_head_for_few_knows_no_order_and_no_past() {
    let space = space();
    let pool = samples(&space, 120, &mut generator(14));
    let mut rng = generator(15);
    let learned = |order: &[usize], rng: &mut ChaCha8Rng| {
        let mut learner = learner(&space);
        for at in order {
            let (class, vector) = &pool[*at];
            // What came and went, and what was called otherwise first.
            learner
                .insert(1000 + rng.random_range(0..9_u64), ClassId(1), &pool[rng.random_range(0..120)].1)
                .unwrap();
            learner
                .insert_shown(*at as u64, ClassId(rng.random_range(0..4)), vector, *at as u64 / 2)
                .unwrap();
            learner.relabel(*at as u64, *class).unwrap();
        }
        for key in 1000..1009 {
            learner.remove(key);
        }
        learner.learn().unwrap()
    };
    let mut order: Vec<usize> = (0..pool.len()).collect();
    let first = learned(&order, &mut rng);
    for _ in 0..3 {
        order.shuffle(&mut rng);
        let other = learned(&order, &mut rng);
        for (_, x) in &pool {
            assert_eq!(first.head().unwrap().logs(x), other.head().unwrap().logs(x), "to the last bit");
        }
    }
}

#[test]
fn damaged_bytes_of_a_classifier_with_a_head_give_an_error_or_finite_answers() {
    let space = space();
    let bytes = grown(&space, 12, 3, 70).encode();
    assert_eq!(Classifier::decode(&bytes).unwrap().encode(), bytes);
    for length in 0..bytes.len() {
        assert!(Classifier::decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
    let mut rng = generator(71);
    for _ in 0..3000 {
        let mut damaged = bytes.clone();
        for _ in 0..rng.random_range(1..4_u64) {
            let at = rng.random_range(0..damaged.len());
            damaged[at] = rng.random();
        }
        if let Ok(classifier) = Classifier::decode(&damaged) {
            let far = vec![f32::MAX; classifier.space().features()];
            let p = classifier.probabilities(&far).unwrap();
            assert!(p.iter().all(|p| p.is_finite()), "{p:?}");
        }
    }
}

#[test]
fn what_cannot_be_learned_from_is_refused_and_changes_nothing() {
    let space = space();
    let samples = samples(&space, 40, &mut generator(3));
    let mut learner = taught(&space, &samples);
    let before = learner.learn().unwrap();
    let good = &samples[0].1;
    let with = |value: f32| {
        let mut vector = good.clone();
        vector[3] = value;
        vector
    };
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        assert_eq!(learner.insert(0, ClassId(1), &with(value)), Err(LearnError::Range(3)));
    }
    assert_eq!(
        learner.insert(0, ClassId(1), &good[1..]),
        Err(LearnError::Length { found: FEATURES - 1, expected: FEATURES })
    );
    assert_eq!(learner.insert(0, ClassId(4), good), Err(LearnError::Class(ClassId(4))));
    assert_eq!(learner.relabel(0, ClassId(4)), Err(LearnError::Class(ClassId(4))));
    assert_eq!(learner.relabel(99, ClassId(1)), Ok(false));
    assert!(!learner.remove(99));
    assert_eq!(learner.len(), 40);
    assert!(Arc::ptr_eq(&before, &learner.learn().unwrap()), "nothing to learn");
}

fn best(p: &[f64]) -> usize {
    (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap()
}

/// Of so many new vectors, how many two classifiers judge differently.
fn differences(a: &Classifier, b: &Classifier, count: usize, rng: &mut impl Rng) -> usize {
    let probes = samples(a.space(), count, rng);
    probes.iter().filter(|(_, x)| best(&judge(a, x)) != best(&judge(b, x))).count()
}

#[test]
fn what_came_and_went_leaves_no_trace() {
    let space = space();
    let exact = LearnerOptions { staleness: 0.0, ..LearnerOptions::default() };
    let new = || Learner::new(space.clone(), vocabulary(), exact.clone()).unwrap();
    let mut different = 0;
    for seed in 0..20 {
        let mut rng = generator(100 + seed);
        let pool = samples(&space, 300, &mut rng);
        let mut warm = new();
        let mut held: Vec<(u64, ClassId, usize)> = Vec::new();
        for (step, (class, vector)) in pool.iter().enumerate() {
            let at = rng.random_range(0..held.len().max(1) as u64) as usize;
            match rng.random_range(0..6_u64) {
                0 if at < held.len() => assert!(warm.remove(held.swap_remove(at).0)),
                1 if at < held.len() => {
                    held[at].1 = ClassId(rng.random_range(0..CLASSES as u64) as u32);
                    assert!(warm.relabel(held[at].0, held[at].1).unwrap());
                }
                2 if at < held.len() => {
                    held[at] = (held[at].0, *class, step);
                    warm.insert(held[at].0, *class, vector).unwrap();
                }
                _ => {
                    held.push((step as u64, *class, step));
                    warm.insert(step as u64, *class, vector).unwrap();
                }
            }
            if rng.random_bool(0.1) {
                warm.learn().unwrap();
            }
        }
        let mut cold = new();
        for (key, class, index) in &held {
            cold.insert(*key, *class, &pool[*index].1).unwrap();
        }
        assert_eq!(warm.len(), held.len());
        different += differences(&warm.learn().unwrap(), &cold.learn().unwrap(), 1000, &mut rng);
    }
    assert!(different <= 20, "{different} of 20,000 judged differently");
}

#[test]
fn a_sigmoid_that_is_kept_hardly_changes_an_answer() {
    let space = space();
    let mut rng = generator(7);
    let pool = samples(&space, 1400, &mut rng);
    let mut warm = taught(&space, &pool[..1000]);
    warm.learn().unwrap();
    let mut different = 0;
    for round in 0..20 {
        for i in round * 12..(round + 1) * 12 {
            assert!(warm.remove(i as u64));
            warm.insert(1000 + i as u64, pool[1000 + i].0, &pool[1000 + i].1).unwrap();
        }
        let now = warm.learn().unwrap();
        let mut cold = learner(&space);
        for (i, (class, vector)) in pool.iter().enumerate().skip((round + 1) * 12).take(1000) {
            cold.insert(i as u64, *class, vector).unwrap();
        }
        different += differences(&now, &cold.learn().unwrap(), 1000, &mut rng);
    }
    assert!(different <= 20, "{different} of 20,000 judged differently");
}

#[test]
fn the_same_operations_give_the_same_bytes() {
    let space = space();
    let pool = samples(&space, 200, &mut generator(8));
    let run = |last: usize| {
        let mut learner = taught(&space, &pool[..120]);
        learner.learn().unwrap();
        for (i, (class, vector)) in pool.iter().enumerate().take(last).skip(120) {
            learner.remove(i as u64 - 100);
            learner.insert(i as u64, *class, vector).unwrap();
            learner.relabel(i as u64 - 50, ClassId(2)).unwrap();
            learner.learn().unwrap();
        }
        learner.learn().unwrap().encode()
    };
    assert_eq!(run(150), run(150));
    assert_ne!(run(150), run(151));
    assert_eq!(*Classifier::decode(&run(150)).unwrap().encode(), *run(150));
}

#[test]
fn what_a_learner_looks_up_in_a_shared_kernel_makes_no_difference() {
    let space = space();
    let kernel = Arc::new(learner(&space).shared_kernel());
    let mut rng = generator(17);
    let held: Vec<(ClassId, Arc<[f32]>)> =
        samples(&space, 120, &mut rng).into_iter().map(|(class, vector)| (class, vector.into())).collect();
    let mut known = generator(18);
    for seed in 0..3 {
        let (mut alone, mut sharing) = (learner(&space), learner(&space).sharing(kernel.clone()));
        let mut rng = generator(20 + seed);
        for step in 0..300 {
            let key = rng.random_range(0..120_u64);
            let (class, vector) = &held[key as usize];
            match rng.random_range(0..8) {
                0 => assert_eq!(alone.remove(key), sharing.remove(key)),
                1 => {
                    let class = ClassId((class.0 + 1) % CLASSES as u32);
                    assert_eq!(alone.relabel(key, class), sharing.relabel(key, class));
                }
                _ => {
                    // Some are known from the first learner on, some only later, some to nobody.
                    if key % 3 > 0 && known.random_bool(0.5) {
                        kernel.hold(vector);
                    }
                    alone.insert_shown(key, *class, vector, key / 4).unwrap();
                    sharing.insert_held(key, *class, vector.clone(), key / 4).unwrap();
                }
            }
            if step % 60 == 59 {
                let (alone, sharing) = (alone.learn().unwrap(), sharing.learn().unwrap());
                assert_eq!(alone.encode(), sharing.encode());
                assert_eq!(judge(&alone, vector), judge(&sharing, vector));
            }
        }
    }
    let options = LearnerOptions { gamma: 2.0, ..LearnerOptions::default() };
    let other = || Learner::new(space.clone(), vocabulary(), options.clone()).unwrap();
    let (mut alone, mut sharing) = (other(), other().sharing(kernel));
    for (key, (class, vector)) in (0..).zip(&held) {
        alone.insert(key, *class, vector).unwrap();
        sharing.insert_held(key, *class, vector.clone(), key).unwrap();
    }
    assert_eq!(alone.learn().unwrap().encode(), sharing.learn().unwrap().encode(), "of another γ");
}

#[test]
fn a_key_names_one_sample() {
    let space = space();
    let pool = samples(&space, 80, &mut generator(9));
    let mut learner = taught(&space, &pool[..60]);
    let before = learner.learn().unwrap();
    for (key, (class, vector)) in pool[..60].iter().enumerate() {
        learner.insert(key as u64, *class, vector).unwrap();
    }
    assert!(Arc::ptr_eq(&before, &learner.learn().unwrap()), "nothing new");
    learner.insert(5, pool[70].0, &pool[70].1).unwrap();
    assert_eq!(learner.len(), 60);
    assert_ne!(*before, *learner.learn().unwrap());
    learner.relabel(5, pool[5].0).unwrap();
    learner.insert(5, pool[5].0, &pool[5].1).unwrap();
    let after = learner.learn().unwrap();
    assert_eq!(after.learned(), before.learned());
    for key in 0..60 {
        assert!(learner.remove(key));
    }
    assert!(learner.is_empty());
    assert_eq!(judge(&learner.learn().unwrap(), &pool[0].1), [0.25; CLASSES]);
}

#[test]
fn it_goes_on_from_what_a_classifier_knows() {
    let space = space();
    let mut rng = generator(10);
    let pool = samples(&space, 400, &mut rng);
    let offline = taught(&space, &pool[..300]).learn().unwrap();
    let mut learner = learner(&space);
    learner.build_on(&offline).unwrap();
    assert!(learner.is_empty(), "support vectors are not inserted samples");
    let first = learner.learn().unwrap();
    assert_eq!(first.learned().iter().sum::<u32>() as usize, offline.support_vectors());
    let accuracy = |classifier: &Classifier, rng: &mut ChaCha8Rng| {
        let probes = samples(&space, 4000, rng);
        probes.iter().filter(|(class, x)| best(&judge(classifier, x)) == class.index()).count() as f64
            / 4000.0
    };
    let (theirs, ours) = (accuracy(&offline, &mut generator(11)), accuracy(&first, &mut generator(11)));
    assert!((theirs - ours).abs() < 0.02, "{ours} built on {theirs}");

    learner.build_on(&offline).unwrap();
    assert_eq!(learner.learn().unwrap().learned(), first.learned(), "twice is once");
    for (key, (class, vector)) in pool[300..].iter().enumerate() {
        learner.insert(key as u64, *class, vector).unwrap();
    }
    assert_eq!(learner.len(), 100);
    for key in 0..100 {
        assert!(learner.remove(key));
    }
    assert_eq!(learner.learn().unwrap().learned(), first.learned(), "never removed");

    let mut rng = generator(12);
    let rows: Vec<Vec<f32>> = (0..50).map(|i| features(i % CLASSES, &mut rng)).collect();
    let rows = rows.iter().map(Vec::as_slice);
    let keep = Components::Count(FEATURES);
    let other = FeatureSpace::fit("toy-1", rows, ScalingMethod::PerComponent, keep, &mut rng);
    let mut elsewhere = Learner::new(Arc::new(other), vocabulary(), LearnerOptions::default()).unwrap();
    assert_eq!(elsewhere.build_on(&offline), Err(LearnError::Space));
    let words = Vocabulary::new(["a", "b", "c", "d"]).unwrap();
    let mut others = Learner::new(space.clone(), words, LearnerOptions::default()).unwrap();
    assert_eq!(others.build_on(&offline), Err(LearnError::Vocabulary));
}

#[test]
fn options_out_of_range_are_refused() {
    let good = LearnerOptions::default();
    let bad = [
        LearnerOptions { cost: 0.0, ..good.clone() },
        LearnerOptions { cost: f64::NAN, ..good.clone() },
        LearnerOptions { gamma: f64::INFINITY, ..good.clone() },
        LearnerOptions { folds: 1, ..good.clone() },
        LearnerOptions { staleness: 0.5, ..good.clone() },
    ];
    for options in bad {
        let error = Learner::new(space(), vocabulary(), options).unwrap_err();
        assert!(matches!(error, LearnError::Option(_)), "{error}");
    }
    let rows = [vec![1.0; FEATURES], vec![1.0; FEATURES]];
    let rows = rows.iter().map(Vec::as_slice);
    let keep = Components::Count(FEATURES);
    let flat = FeatureSpace::fit("toy-1", rows, ScalingMethod::PerComponent, keep, &mut generator(1));
    assert_eq!(Learner::new(Arc::new(flat), vocabulary(), good).unwrap_err(), LearnError::NoVariance);
}

/// Six classes in 40 features, by the noise about their centres.
fn wide_samples(noise: f32, count: usize, seed: u64) -> Vec<LabelledFeatures> {
    let mut centres = generator(20);
    let centres: Vec<Vec<f32>> = (0..6).map(|_| (0..40).map(|_| normal(&mut centres)).collect()).collect();
    let mut rng = generator(seed);
    let sample = |i: usize| {
        let features = centres[i % 6].iter().map(|c| c + noise * normal(&mut rng)).collect();
        LabelledFeatures::new(features, ClassId((i % 6) as u32), None)
    };
    (0..count).map(sample).collect()
}

#[test]
fn it_judges_as_well_as_libsvm() {
    for (noise, expected) in [(1.0, 0.99..=1.0), (2.2, 0.85..=0.95)] {
        let (fitted, learned) = (wide_samples(noise, 1000, 1), wide_samples(noise, 1000, 2));
        let unseen = wide_samples(noise, 6000, 3);
        let rows = fitted.iter().map(|sample| sample.features.as_slice());
        let keep = Components::Count(40);
        let space = FeatureSpace::fit("wide-1", rows, ScalingMethod::PerComponent, keep, &mut generator(4));
        let vocabulary = Vocabulary::new((0..6).map(|k| k.to_string())).unwrap();
        let mut learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap();
        for (key, sample) in learned.iter().enumerate() {
            let vector = learner.space().project(&sample.features).unwrap();
            learner.insert(key as u64, sample.class, &vector).unwrap();
        }
        let classifier = learner.learn().unwrap();
        let mut ours = Evaluation::new(6);
        for sample in &unseen {
            ours.record(sample.class, &classifier.probabilities(&sample.features).unwrap());
        }
        let accuracy = |e: &Evaluation| e.accuracy().unwrap().value;
        assert!(expected.contains(&accuracy(&ours)), "{}", accuracy(&ours));
        let name = format!("learner-{noise}");
        let Some(theirs) = side_by_side::libsvm(&classifier, (10.0, 1.0), &learned, &unseen, &name) else {
            return;
        };
        side_by_side::print("ours", &ours);
        side_by_side::print("LIBSVM", &theirs);
        assert!(accuracy(&ours) >= accuracy(&theirs) - 0.005);
        let error = |e: &Evaluation| e.calibration_error().unwrap();
        assert!(error(&ours) <= error(&theirs) + 0.02, "{} and {}", error(&ours), error(&theirs));
    }
}
