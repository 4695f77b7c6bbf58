//! A vocabulary that grows, on real photographs: who knows 0 to 5 is taught further gestures one by one, with few showings each. The data are not part of
//! the project: `GESTALT_DATA`, or `../shared/data` seen from the workspace; skipped where there are none.
//!
//! `cargo test -p gestalt-vision --test growing` prints the figures, of as many seeds as `GESTALT_SEEDS` says.

#![cfg(feature = "opencv")]

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Classify, FeatureSpace, Head, Learner, LearnerOptions, Vocabulary};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{HandConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{EmulatedView, read_image};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![[Works, Data] new_gestures_are_learned_from_few_showings])
}

/// The gestures that are known.
const KNOWN: usize = 6;
/// Pictures that are used of a gesture of a data set.
const PICTURES: usize = 40;
/// Robots around the hand, whose views of one picture are one showing.
const ROBOTS: usize = 3;
/// Pictures of each gesture of each other data set that were shown before, and of the data set at hand.
const BEFORE: usize = 8;
const HERE: usize = 3;

/// Each picture of a gesture of a data set as each robot sees it, in the space of learned eyes: by label.
type Set = BTreeMap<String, Vec<Vec<Vec<f32>>>>;

/// The picture as it is, and as robots around it see it.
fn look(name: &str, height_m: f64, model: &RobotModel) -> Set {
    let (folder, space) = (gestalt_trials::data().join(name), model.classifier.space());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let places: Vec<(CameraModel, Pose)> = (1..ROBOTS)
        .map(|_| {
            let camera = CameraModel::laptop().specimen(&mut rng);
            let (bearing_deg, elevation_deg) = (rng.random_range(-35.0..35.0), rng.random_range(-20.0..20.0));
            (camera, Pose { bearing_deg, elevation_deg, distance_m: rng.random_range(0.5..1.2) })
        })
        .collect();
    let mut images: BTreeMap<String, Vec<LabelledImage>> = BTreeMap::new();
    let dataset = Dataset::list(&folder, None).unwrap();
    for image in dataset.images {
        let label = image.path.parent().unwrap().file_name().unwrap().to_string_lossy().into_owned();
        images.entry(label).or_default().push(image);
    }
    let mut set = Set::new();
    for (label, mut images) in images {
        images.shuffle(&mut rng);
        for (n, image) in images.iter().take(PICTURES).enumerate() {
            let picture = read_image(&image.path).unwrap();
            let seen = |frame| {
                let mut eyes = Perception::new(model.features, HandConfig::default()).unwrap();
                Some(space.project(&eyes.observe(&frame).ok()?.features).unwrap())
            };
            let views = places.iter().filter_map(|(camera, pose)| {
                let mut view = EmulatedView::new(camera.clone(), *pose, height_m, n as u64).unwrap();
                seen(view.view(&picture).unwrap())
            });
            let views: Vec<Vec<f32>> = seen(picture.clone()).into_iter().chain(views).collect();
            if !views.is_empty() {
                set.entry(label.clone()).or_default().push(views);
            }
        }
    }
    set
}

/// Recall of the new gestures, and of the known ones before and after, in percent.
#[derive(Clone, Copy, Default)]
struct Outcome {
    new: f64,
    before: f64,
    after: f64,
}

/// How a view is judged: by the machines alone, the head alone, or the classifier, which takes both.
const JUDGES: [&str; 3] = ["machines", "head", "both"];

fn judge(classifier: &Classifier, judge: usize, x: &[f32]) -> usize {
    let mut p = match judge {
        0 => classifier.machines().probabilities(x),
        1 => classifier.head().unwrap().probabilities(x),
        _ => classifier.probabilities_in_space(x).unwrap(),
    };
    // Which of the gestures that it was taught.
    p.iter_mut().zip(classifier.learned()).for_each(|(p, learned)| *p *= f64::from(u8::from(*learned > 0)));
    (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap()
}

/// Teaches the new gestures of a set to who was shown the known ones in all sets.
fn grow(sets: &BTreeMap<&str, Set>, at: &str, new: &[&str], shows: usize, seed: u64) -> [Outcome; 3] {
    let space: Arc<FeatureSpace> = RobotModel::hands().unwrap().classifier.space().clone();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let labels: Vec<String> =
        (0..KNOWN).map(|n| n.to_string()).chain(new.iter().map(|label| (*label).to_owned())).collect();
    let vocabulary = Vocabulary::new(labels.iter().cloned()).unwrap();
    let mut learner = Learner::new(space, vocabulary, LearnerOptions::default()).unwrap();
    let (mut key, mut showing) = (0, 0);
    let mut show = |learner: &mut Learner, class: usize, views: &[Vec<f32>]| {
        for view in views {
            learner.insert_shown(key, ClassId(class as u32), view, showing).unwrap();
            key += 1;
        }
        showing += 1;
    };
    for set in sets.iter().filter(|(name, _)| **name != at).map(|(_, set)| set) {
        for (class, label) in labels.iter().enumerate().take(KNOWN) {
            let pictures = set.get(label).map_or([].as_slice(), Vec::as_slice);
            for views in pictures.sample(&mut rng, BEFORE.min(pictures.len())) {
                show(&mut learner, class, &views[..1]);
            }
        }
    }
    let (mut taught, mut tests) = (Vec::new(), Vec::new());
    for (class, label) in labels.iter().enumerate() {
        let mut pictures: Vec<_> = sets[at].get(label).into_iter().flatten().collect();
        pictures.shuffle(&mut rng);
        let count = if class < KNOWN { HERE } else { shows };
        let rest = pictures.split_off(count.min(pictures.len() / 2));
        taught.push(pictures);
        tests.push(rest);
    }
    let recall = |classifier: &Classifier, by: usize, classes: std::ops::Range<usize>| {
        let views = classes.flat_map(|class| tests[class].iter().copied().flatten().map(move |x| (class, x)));
        let right: Vec<bool> = views.map(|(class, x)| judge(classifier, by, x) == class).collect();
        100.0 * right.iter().filter(|right| **right).count() as f64 / right.len() as f64
    };
    let mut outcomes = [Outcome::default(); 3];
    for (class, pictures) in taught.iter().enumerate().take(KNOWN) {
        pictures.iter().for_each(|views| show(&mut learner, class, views));
    }
    let before = learner.learn().unwrap();
    for (class, pictures) in taught.iter().enumerate().skip(KNOWN) {
        pictures.iter().for_each(|views| show(&mut learner, class, views));
        // One by one, as an instructor does.
        learner.learn().unwrap();
    }
    let after = learner.learn().unwrap();
    for (by, outcome) in outcomes.iter_mut().enumerate() {
        outcome.before = recall(&before, by, 0..KNOWN);
        outcome.after = recall(&after, by, 0..KNOWN);
        outcome.new = recall(&after, by, KNOWN..labels.len());
    }
    outcomes
}

/// The two-sided 95 % quantiles of Student's t, from one degree of freedom on: what is known of two seeds is not what is known of many.
const STUDENT: [f64; 19] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093,
];

/// The mean over seeds and half its 95 % interval; of more than twenty seeds hardly wider than it is, of one seed none.
fn mean(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let quantile = STUDENT[values.len().saturating_sub(2).min(STUDENT.len() - 1)];
    (mean, quantile * (variance / n).sqrt())
}

/// What comes of each, in their order, by a thread each.
fn side_by_side<T: Send, R: Send>(of: impl IntoIterator<Item = T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let work = &work;
    std::thread::scope(|scope| {
        let threads: Vec<_> = of.into_iter().map(|of| scope.spawn(move || work(of))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

fn new_gestures_are_learned_from_few_showings() {
    let model = RobotModel::hands().unwrap();
    let heights = [
        ("asl-digits", 0.25),
        ("asl_letters", 0.35),
        ("lowres64_cn", 0.3),
        ("phone_home", 0.35),
        ("subhi_hands", 0.5),
    ];
    let looked = side_by_side(heights, |(name, height)| (name, look(name, height, &model)));
    let sets: BTreeMap<&str, Set> = looked.into_iter().collect();
    let seeds = std::env::var("GESTALT_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(4_u64);
    let grown: [(&str, &[&str]); 3] = [
        ("asl-digits", &["6", "7", "8", "9"]),
        ("asl_letters", &["call", "ok"]),
        ("lowres64_cn", &["call", "hook9", "pinch7", "ring_O"]),
    ];
    eprintln!("of the views in which a hand is found; 95 % intervals by seed, Student's t");
    eprintln!("set | showings each | by | recall of the new | of the known | change of the known");
    for (at, new) in grown {
        for shows in [1, 3, 5] {
            let all = side_by_side(0..seeds, |seed| grow(&sets, at, new, shows, seed));
            let of = |by: usize, value: &dyn Fn(&Outcome) -> f64| mean(all.iter().map(|run| value(&run[by])));
            for (by, name) in JUDGES.iter().enumerate() {
                let (recall, known) = (of(by, &|o| o.new), of(by, &|o| o.after));
                let change = of(by, &|o| o.after - o.before);
                eprintln!(
                    "{at:<12} | {shows} | {name:<8} | {:.1} ± {:.1} | {:.1} ± {:.1} | {:+.1} ± {:.1}",
                    recall.0, recall.1, known.0, known.1, change.0, change.1
                );
            }
            let [machines, _, both] = [0, 1, 2].map(|by| of(by, &|o| o.new).0);
            assert!(
                both > machines + 2.0,
                "{at}, {shows} showings: {both:.1} %, the machines alone {machines:.1} %"
            );
            if (at, shows) == ("asl-digits", 5) {
                let change = of(2, &|o| o.after - o.before).0;
                assert!(both >= 90.0 && change >= -1.0, "{both:.1} %, known gestures {change:+.1}");
            }
        }
    }
}
