//! Learning on the spot from what was learned elsewhere: of other people, before other cameras.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{Classifier, Components, FeatureSpace, Learner, LearnerOptions, ScalingMethod};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const CLASSES: usize = 5;
const FEATURES: usize = 10;
/// Of the classes, the last is not taught.
const UNTAUGHT: usize = 1;
const SEEDS: u64 = 10;

/// About a standard normal variable: the sum of twelve uniform ones.
fn normal(rng: &mut impl Rng) -> f32 {
    (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum()
}

/// Where each gesture lies.
struct World(Vec<Vec<f32>>);

impl World {
    fn new(rng: &mut impl Rng) -> Self {
        let class = |_| (0..FEATURES).map(|_| normal(rng)).collect();
        Self((0..CLASSES + UNTAUGHT).map(class).collect())
    }

    /// The same gestures of other people, before another camera.
    fn elsewhere(&self, far: f32, rng: &mut impl Rng) -> Self {
        let class = |class: &Vec<f32>| class.iter().map(|x| x + far * normal(rng)).collect();
        Self(self.0.iter().map(class).collect())
    }

    /// Views of a showing.
    fn show(&self, class: usize, views: usize, rng: &mut impl Rng) -> Vec<Vec<f32>> {
        let shown: Vec<f32> = self.0[class].iter().map(|x| x + 0.5 * normal(rng)).collect();
        (0..views).map(|_| shown.iter().map(|x| x + 0.3 * normal(rng)).collect()).collect()
    }
}

fn learner(space: &Arc<FeatureSpace>) -> Learner {
    let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).unwrap();
    Learner::new(space.clone(), vocabulary, LearnerOptions::default()).unwrap()
}

/// Shows each class so often, in turn.
fn show(learner: &mut Learner, world: &World, showings: usize, views: usize, rng: &mut impl Rng) {
    for showing in 0..showings * CLASSES {
        let seen = world.show(showing % CLASSES, views, rng);
        teach(learner, showing, showing % CLASSES, &seen);
    }
}

/// Takes in what was seen of a showing.
fn teach(learner: &mut Learner, showing: usize, class: usize, seen: &[Vec<f32>]) {
    for (view, raw) in seen.iter().enumerate() {
        let (key, vector) = ((showing * seen.len() + view) as u64, learner.space().project(raw).unwrap());
        learner.insert_shown(key, ClassId(class as u32), &vector, showing as u64).unwrap();
    }
}

fn best(p: &[f64]) -> usize {
    (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap()
}

/// Which part of single views of further showings is judged rightly; and how often one of the untaught gesture looks less known than one of a taught one.
fn judged(classifier: &Classifier, world: &World, rng: &mut impl Rng) -> [f64; 2] {
    let (mut right, mut known, mut unknown) = (0, Vec::new(), Vec::new());
    for n in 0..300 {
        let class = n % (CLASSES + UNTAUGHT);
        let view = world.show(class, 1, rng).remove(0);
        let judgement = classifier.judge(&view).unwrap();
        right += usize::from(best(&judgement.probabilities) == class);
        if class < CLASSES { &mut known } else { &mut unknown }.push(judgement.unknown.unwrap());
    }
    let wins = unknown.iter().flat_map(|u| known.iter().map(move |k| u.total_cmp(k)));
    let wins: f64 = wins.map(|order| f64::midpoint(order as i8 as f64, 1.0)).sum();
    [right as f64 / known.len() as f64, wins / (known.len() * unknown.len()) as f64]
}

/// A space, and what a classifier knows that was taught in this world.
fn learned(there: &World, rng: &mut ChaCha8Rng) -> (Arc<FeatureSpace>, Arc<Classifier>) {
    let rows: Vec<Vec<f32>> = (0..60).flat_map(|n| there.show(n % (CLASSES + UNTAUGHT), 2, rng)).collect();
    let rows = rows.iter().map(Vec::as_slice);
    let kept = Components::Count(FEATURES);
    let space = Arc::new(FeatureSpace::fit("toy-1", rows, ScalingMethod::PerComponent, kept, rng));
    let mut teacher = learner(&space);
    show(&mut teacher, there, 100, 1, rng);
    let start = teacher.learn().unwrap();
    (space, start)
}

/// The means over seeds of what is judged by who starts from what was learned elsewhere and learns nothing, from that and learns, and from nothing.
fn compared(far: f32, showings: usize) -> [[f64; 2]; 3] {
    let mut sums = [[0.0; 2]; 3];
    for seed in 0..SEEDS {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let there = World::new(rng);
        let here = there.elsewhere(far, rng);
        let (space, start) = learned(&there, rng);
        let (mut begun, mut fresh) = (learner(&space), learner(&space));
        begun.build_on(&start).unwrap();
        let mut same = rng.clone();
        show(&mut begun, &here, showings, 12, rng);
        show(&mut fresh, &here, showings, 12, &mut same);
        let all = [start, begun.learn().unwrap(), fresh.learn().unwrap()];
        for (sum, classifier) in sums.iter_mut().zip(all) {
            let judged = judged(&classifier, &here, &mut rng.clone());
            sum.iter_mut().zip(judged).for_each(|(sum, x)| *sum += x / SEEDS as f64);
        }
    }
    sums
}

#[test]
fn what_was_learned_elsewhere_helps_and_does_not_hold_back() {
    for far in [0.0, 0.4, 0.8, 1.5] {
        for showings in [1, 3, 8] {
            let [start, begun, fresh] = compared(far, showings);
            let figures = format!("{far} away, {showings} showings: {start:.3?}, {begun:.3?}, {fresh:.3?}");
            println!("{figures}");
            assert!(begun[0] > f64::max(start[0], fresh[0]) - 0.01, "{figures}");
            assert!(begun[1] > f64::max(start[1], fresh[1]) - 0.03, "{figures}");
        }
    }
}

#[test]
fn a_gesture_that_is_not_shown_here_is_not_lost() {
    let (mut before, mut after) = ([0.0; 2], [0.0; 2]);
    for seed in 0..2 * SEEDS {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let there = World::new(rng);
        let here = there.elsewhere(0.6, rng);
        let (space, start) = learned(&there, rng);
        let mut begun = learner(&space);
        begun.build_on(&start).unwrap();
        let shown = CLASSES - 2;
        for showing in 0..8 * shown {
            teach(&mut begun, showing, showing % shown, &here.show(showing % shown, 8, rng));
            begun.learn().unwrap();
        }
        let learned = begun.learn().unwrap();
        for n in 0..100 {
            let class = n % CLASSES;
            let view = here.show(class, 1, rng).remove(0);
            for (sums, classifier) in [(&mut before, &start), (&mut after, &learned)] {
                let right = best(&classifier.probabilities(&view).unwrap()) == class;
                let (of, all) = if class < shown { (0, 1200.0) } else { (1, 800.0) };
                sums[of] += f64::from(u8::from(right)) / all;
            }
        }
    }
    println!("shown, and not: {before:.3?}, {after:.3?}");
    assert!(after[0] > before[0] && after[1] > before[1] - 0.03, "{before:.3?}, {after:.3?}");
}

#[test]
fn whoever_learns_with_each_showing_is_no_worse_for_it_and_who_forgets_all_is_where_it_began() {
    let (mut with_each, mut at_once) = (0.0, 0.0);
    for seed in 0..SEEDS {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let there = World::new(rng);
        let here = there.elsewhere(1.0, rng);
        let (space, start) = learned(&there, rng);
        let (mut begun, mut late) = (learner(&space), learner(&space));
        for learner in [&mut begun, &mut late] {
            learner.build_on(&start).unwrap();
        }
        let began = begun.learn().unwrap();
        for showing in 0..4 * CLASSES {
            let seen = here.show(showing % CLASSES, 6, rng);
            for learner in [&mut begun, &mut late] {
                teach(learner, showing, showing % CLASSES, &seen);
            }
            begun.learn().unwrap();
        }
        for (sum, learner) in [(&mut with_each, &mut begun), (&mut at_once, &mut late)] {
            let [right, _] = judged(&learner.learn().unwrap(), &here, &mut rng.clone());
            *sum += right / SEEDS as f64;
        }
        (0..24 * CLASSES as u64).for_each(|key| assert!(begun.remove(key)));
        assert!(begun.is_empty());
        let after = begun.learn().unwrap();
        let alike = |view: &Vec<f32>| {
            let [one, other] = [&began, &after].map(|known| known.probabilities(view).unwrap());
            one.iter().zip(&other).all(|(one, other)| (one - other).abs() < 0.02)
        };
        assert!((0..CLASSES).all(|class| there.show(class, 4, rng).iter().all(alike)), "seed {seed}");
    }
    assert!(with_each > at_once - 0.01, "{with_each} and {at_once}");
}
