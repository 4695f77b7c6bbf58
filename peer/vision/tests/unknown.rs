//! What robots know that they do not know, on real photographs: learned eyes, whole data sets left out. The data are not part of the project:
//! `GESTALT_DATA`, or `../shared/data` seen from the workspace; skipped where there are none.
//!
//! `cargo test -p gestalt-vision --test unknown -- --nocapture` prints the figures.

#![cfg(feature = "opencv")]

use std::path::PathBuf;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classifier, Classify, FeatureSpace, Learner, LearnerOptions, Observation, Vocabulary,
};
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{HandConfig, Perception};
use gestalt_vision::source::{Scene, Source, Video, read_image};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works, Data] what_was_never_taught_is_told_from_what_was,
    ])
}

/// The gestures that are taught.
const TAUGHT: [&str; 6] = ["0", "1", "2", "3", "4", "5"];

/// Pictures that are used of a gesture of a data set.
const PICTURES: usize = 40;

/// Of a video of people who sign words, every so many frames are looked at.
const EVERY: usize = 4;

/// Pictures with what is seen in each; `None` where no hand is.
type Seen = Vec<Option<Observation>>;

/// A data set by gesture: its label, and what is seen.
struct Set {
    name: &'static str,
    gestures: Vec<(String, Seen)>,
}

impl Set {
    fn look(name: &'static str, perception: &mut Perception) -> Self {
        let folder = gestalt_trials::data().join(name);
        let mut labels: Vec<String> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap())
            .filter(|entry| entry.path().is_dir() && entry.file_name() != "background")
            .map(|entry| entry.file_name().into_string().unwrap())
            .collect();
        labels.sort();
        let mut images: Vec<Vec<LabelledImage>> = vec![Vec::new(); labels.len()];
        for image in Dataset::list(&folder, Some(&labels)).unwrap().images {
            images[image.class.index()].push(image);
        }
        let gestures = labels.into_iter().zip(images).map(|(label, mut images)| {
            images.shuffle(&mut ChaCha8Rng::seed_from_u64(1));
            images.truncate(PICTURES);
            (label, look_at(images.into_iter().map(|image| image.path), perception))
        });
        Self { name, gestures: gestures.collect() }
    }

    fn of_class(&self, class: usize) -> &[Option<Observation>] {
        let of_label = self.gestures.iter().find(|(label, _)| label == TAUGHT[class]);
        of_label.map_or(&[], |(_, seen)| seen)
    }

    /// Its other gestures.
    fn others(&self) -> impl Iterator<Item = &Option<Observation>> {
        let taught = |label: &String| TAUGHT.contains(&label.as_str());
        self.gestures.iter().filter(move |(label, _)| !taught(label)).flat_map(|(_, seen)| seen)
    }
}

fn look_at(paths: impl Iterator<Item = PathBuf>, perception: &mut Perception) -> Seen {
    paths.filter_map(|path| Some(perception.observe(&read_image(&path).ok()?).ok())).collect()
}

fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let folder = gestalt_trials::data().join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.to_string_lossy().ends_with(ending));
    paths.sort();
    paths
}

/// Frames of people who stand, sign a word with both hands, and stand.
fn signing(perception: &mut Perception) -> Seen {
    let mut seen = Seen::new();
    for path in files("video", ".mkv") {
        let mut video = Video::open(&path, false).unwrap();
        let period = video.period();
        for n in 0_u32.. {
            match video.next_frame(period * n, &Scene::default()) {
                Ok(frame) if (n as usize).is_multiple_of(EVERY) => {
                    seen.push(perception.observe(&frame.image).ok());
                }
                Ok(_) => (),
                Err(error) if error.is_the_end() => break,
                Err(error) => panic!("{}: {error}", path.display()),
            }
        }
    }
    seen
}

/// A classifier that was taught with pictures of these sets, up to so many of each gesture of each; without one of the gestures.
fn taught<'a>(
    sets: impl Iterator<Item = &'a Set>,
    space: &Arc<FeatureSpace>,
    each: usize,
    without: Option<usize>,
) -> Arc<Classifier> {
    let vocabulary = Vocabulary::new(TAUGHT).unwrap();
    let mut learner = Learner::new(space.clone(), vocabulary, LearnerOptions::default()).unwrap();
    let mut key = 0;
    for set in sets {
        for class in (0..TAUGHT.len()).filter(|class| Some(*class) != without) {
            for seen in set.of_class(class).iter().flatten().take(each) {
                let vector = space.project(&seen.features).unwrap();
                learner.insert(key, ClassId(class as u32), &vector).unwrap();
                key += 1;
            }
        }
    }
    learner.learn().unwrap()
}

/// How a view is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
enum By {
    /// As robots do.
    Robots,
    /// The same, without what the eyes say of seeing a hand.
    Features,
    /// By the probability of the likeliest gesture alone.
    Softmax,
}

/// How unknown a view is, in logarithms.
fn score(classifier: &Classifier, by: By, seen: &Observation) -> f64 {
    let judgement = match by {
        By::Robots => classifier.judge_seen(seen),
        By::Features | By::Softmax => classifier.judge(&seen.features),
    };
    let judgement = judgement.unwrap();
    let met = judgement.probabilities.iter().zip(classifier.learned()).filter(|(_, learned)| **learned > 0);
    let largest = met.map(|(p, _)| *p).fold(0.0, f64::max);
    let beside = if by == By::Softmax { 1.0 } else { judgement.unknown.unwrap() };
    (beside / largest).ln()
}

/// A classifier, and how it is asked.
struct Asked<'a>(&'a Classifier, By);

impl Asked<'_> {
    /// What part of these is said to show a gesture that was taught, with .9 and more.
    fn known<'a>(&self, seen: impl Iterator<Item = &'a Option<Observation>>) -> f64 {
        let is_known = |seen: &Observation| {
            let judgement = self.0.judge_seen(seen).unwrap();
            let met =
                judgement.probabilities.iter().zip(self.0.learned()).filter(|(_, learned)| **learned > 0);
            // What was never taught is one more gesture beside those of the list.
            let all = 1.0 + judgement.unknown.unwrap();
            f64::from(u8::from(met.map(|(p, _)| *p).any(|p| p >= 0.9 * all)))
        };
        mean(&seen.flatten().map(is_known).collect::<Vec<_>>())
    }

    /// How unknown what was taken for a hand is.
    fn hands<'a>(&self, seen: impl Iterator<Item = &'a Option<Observation>>) -> Vec<f64> {
        seen.flatten().map(|seen| score(self.0, self.1, seen)).collect()
    }

    /// How unknown pictures are: one in which no hand is found shows no gesture that is known.
    fn pictures<'a>(&self, seen: impl Iterator<Item = &'a Option<Observation>>) -> Vec<f64> {
        let unknown = |seen: &Option<Observation>| {
            seen.as_ref().map_or(f64::INFINITY, |seen| score(self.0, self.1, seen))
        };
        seen.map(unknown).collect()
    }
}

/// How often an unknown one scores higher than a known one, with the half of its 95 % interval (Hanley & McNeil 1982).
fn auroc(known: &[f64], unknown: &[f64]) -> (f64, f64) {
    let wins: f64 = unknown
        .iter()
        .flat_map(|u| {
            known.iter().map(move |k| {
                if u > k {
                    1.0
                } else if u < k {
                    0.0
                } else {
                    0.5
                }
            })
        })
        .sum();
    let (n, m) = (known.len() as f64, unknown.len() as f64);
    let a = wins / (n * m);
    let (q, r) = (a / (2.0 - a), 2.0 * a * a / (1.0 + a));
    let variance = (a * (1.0 - a) + (m - 1.0) * (q - a * a) + (n - 1.0) * (r - a * a)) / (n * m);
    (a, 1.96 * variance.max(0.0).sqrt())
}

/// How well each kind of unknown is told from the gestures that were taught, all of a set that was not: other gestures of that set, one of 0 to 5 that was
/// not taught, things taken for hands, pictures without a hand, and those of people who sign.
#[derive(Default)]
struct Told {
    others: Vec<f64>,
    one_of_six: Vec<f64>,
    /// Of the five that were taught meanwhile, of the one that was not, of what is taken for hands and of people who sign, the part that is said to be known
    /// with .9 and more.
    known: [Vec<f64>; 4],
    things: Vec<f64>,
    nothing: Vec<f64>,
    signing: Vec<f64>,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn what_was_never_taught_is_told_from_what_was() {
    let model = RobotModel::hands().unwrap();
    let space = model.classifier.space().clone();
    assert!(space.is_of_learned_eyes(), "{}", space.feature_set());
    let mut perception = Perception::new(model.features, HandConfig::default()).unwrap();
    let names = ["asl-digits", "asl_letters", "lowres64_cn", "phone_home", "subhi_hands"];
    let sets: Vec<Set> = names.iter().map(|name| Set::look(name, &mut perception)).collect();
    let nothing = look_at(files("negatives/none", "").into_iter(), &mut perception);
    let signing = signing(&mut perception);
    for (what, seen) in [("without a hand", &nothing), ("of people who sign", &signing)] {
        let taken = seen.iter().flatten().count();
        eprintln!("of {} pictures {what} {taken} are taken for a hand", seen.len());
    }
    eprintln!(
        "pictures a gesture and set | left out | judged by | other gestures | one of six | known meanwhile: taught, untaught, taken for hands, signing | taken for hands | pictures without a hand | people who sign"
    );
    for each in [2, 10, PICTURES] {
        for by in [By::Robots, By::Features, By::Softmax] {
            let mut told = Told::default();
            for left_out in &sets {
                let rest = || sets.iter().filter(|set| set.name != left_out.name);
                let known = |without: Option<usize>| {
                    let classes = (0..TAUGHT.len()).filter(move |class| Some(*class) != without);
                    classes.flat_map(|class| left_out.of_class(class))
                };
                let classifier = taught(rest(), &space, each, None);
                let asked = Asked(&classifier, by);
                let (of_known, all_known) = (asked.hands(known(None)), asked.pictures(known(None)));
                let others = auroc(&of_known, &asked.hands(left_out.others()));
                let things = auroc(&of_known, &asked.hands(nothing.iter()));
                let empty = auroc(&all_known, &asked.pictures(nothing.iter()));
                let signs = auroc(&all_known, &asked.pictures(signing.iter()));
                // In the sets that show a gesture too seldom nothing is to be seen.
                let classes =
                    (0..TAUGHT.len()).filter(|class| left_out.of_class(*class).iter().flatten().count() > 5);
                let (mut one_of_six, mut meanwhile) = (vec![], [const { vec![] }; 4]);
                for class in classes {
                    let classifier = taught(rest(), &space, each, Some(class));
                    let asked = Asked(&classifier, by);
                    let of_class = asked.hands(left_out.of_class(class).iter());
                    one_of_six.push(auroc(&asked.hands(known(Some(class))), &of_class).0);
                    meanwhile[0].push(asked.known(known(Some(class))));
                    meanwhile[1].push(asked.known(left_out.of_class(class).iter()));
                    meanwhile[2].push(asked.known(nothing.iter()));
                    meanwhile[3].push(asked.known(signing.iter()));
                }
                let meanwhile = meanwhile.map(|known| mean(&known));
                let shown = |(a, half): (f64, f64)| format!("{a:.3} ± {half:.3}");
                eprintln!(
                    "{each:>3} | {:<12} | {by:?} | {} | {:.3} | {meanwhile:.3?} | {} | {} | {}",
                    left_out.name,
                    shown(others),
                    mean(&one_of_six),
                    shown(things),
                    shown(empty),
                    shown(signs)
                );
                told.others.push(others.0);
                told.one_of_six.push(mean(&one_of_six));
                told.known.iter_mut().zip(meanwhile).for_each(|(known, of_set)| known.push(of_set));
                told.things.push(things.0);
                told.nothing.push(empty.0);
                told.signing.push(signs.0);
            }
            let Told { others, one_of_six, known, things, nothing, signing } = &told;
            let means = [others, one_of_six, things, nothing, signing].map(|told| mean(told));
            let known = known.each_ref().map(|known| mean(known));
            eprintln!("{each:>3} | mean         | {by:?} | {means:.3?}, known {known:.3?}");
            if each == PICTURES && by == By::Robots {
                let least = [0.65, 0.90, 0.80, 0.92, 0.87];
                assert!(means.iter().zip(least).all(|(mean, least)| *mean >= least), "{means:?}");
                assert!(known[0] >= 0.5 && known[1] <= 0.03, "{known:?}");
            }
        }
    }
}
