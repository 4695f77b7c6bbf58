//! What robots know that they do not know, on real photographs: learned eyes, whole data sets left out. The data are not part of the project:
//! `GESTALT_DATA`, or `../shared/data` seen from the workspace; skipped where there are none.
//!
//! `cargo test -p gestalt-vision --test unknown` prints the figures.

#![cfg(feature = "opencv")]

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Classify, FeatureSpace, Learner, LearnerOptions, Vocabulary};
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{HandConfig, Perception};
use gestalt_vision::source::read_image;
use gestalt_vision::survey::Survey;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works, Data] gestures_never_taught_are_told_from_those_that_were,
    ])
}

/// The gestures that are taught.
const TAUGHT: [&str; 6] = ["0", "1", "2", "3", "4", "5"];

/// Pictures that are used of a gesture of a data set.
const PICTURES: usize = 40;

/// What a picture is, by two feature sets.
type TwoViews = (Vec<f32>, Vec<f32>);

/// A data set by gesture: its label, and each hand found, in the space of learned eyes, with its raw features.
struct Set {
    name: &'static str,
    gestures: Vec<(String, Vec<TwoViews>)>,
}

impl Set {
    fn look(name: &'static str, space: &FeatureSpace, perception: &mut Perception) -> Self {
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
            let samples = Survey::of(&images, perception, || ()).samples();
            let hand = |features: Vec<f32>| (space.project(&features).unwrap(), features);
            (label, samples.into_iter().map(|sample| hand(sample.features)).collect())
        });
        Self { name, gestures: gestures.collect() }
    }

    fn known(&self) -> impl Iterator<Item = (usize, &(Vec<f32>, Vec<f32>))> {
        let class = |label: &String| TAUGHT.iter().position(|taught| taught == label);
        self.gestures
            .iter()
            .filter_map(move |(label, seen)| Some((class(label)?, seen)))
            .flat_map(|(class, seen)| seen.iter().map(move |hand| (class, hand)))
    }

    fn unknown(&self) -> impl Iterator<Item = &(Vec<f32>, Vec<f32>)> {
        let taught = |label: &String| TAUGHT.contains(&label.as_str());
        self.gestures.iter().filter(move |(label, _)| !taught(label)).flat_map(|(_, seen)| seen)
    }
}

/// What is taken for a hand in pictures that show none.
fn no_hands(space: &FeatureSpace, perception: &mut Perception) -> Vec<(Vec<f32>, Vec<f32>)> {
    let folder = gestalt_trials::data().join("negatives/none");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let seen = paths.iter().filter_map(|path| perception.observe(&read_image(path).ok()?).ok());
    seen.map(|seen| (space.project(&seen.features).unwrap(), seen.features)).collect()
}

/// A classifier that was taught with pictures of these sets, up to so many of each gesture of each.
fn taught<'a>(
    sets: impl Iterator<Item = &'a Set>,
    space: &Arc<FeatureSpace>,
    each: usize,
) -> Arc<Classifier> {
    let vocabulary = Vocabulary::new(TAUGHT).unwrap();
    let mut learner = Learner::new(space.clone(), vocabulary, LearnerOptions::default()).unwrap();
    let mut key = 0;
    for set in sets {
        let mut counts = [0; TAUGHT.len()];
        for (class, (vector, _)) in set.known() {
            counts[class] += 1;
            if counts[class] <= each {
                learner.insert(key, ClassId(class as u32), vector).unwrap();
                key += 1;
            }
        }
    }
    learner.learn().unwrap()
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

fn gestures_never_taught_are_told_from_those_that_were() {
    let model = RobotModel::hands().unwrap();
    let space = model.classifier.space().clone();
    let mut perception = Perception::new(model.features, HandConfig::default()).unwrap();
    let names = ["asl-digits", "asl_letters", "lowres64_cn", "phone_home", "subhi_hands"];
    let sets: Vec<Set> = names.iter().map(|name| Set::look(name, &space, &mut perception)).collect();
    let nothing = no_hands(&space, &mut perception);
    eprintln!(
        "pictures a gesture and set | left out | by likelihood ratio | by the largest softmax | things that are no hand"
    );
    let mut by_ratio = Vec::new();
    for each in [2, 10, PICTURES] {
        for left_out in &sets {
            if left_out.unknown().next().is_none() {
                continue;
            }
            let classifier = taught(sets.iter().filter(|set| set.name != left_out.name), &space, each);
            let largest = |features: &[f32]| {
                classifier.probabilities(features).unwrap().into_iter().fold(0.0, f64::max)
            };
            let ratio = |features: &[f32]| (classifier.unknown(features).unwrap() / largest(features)).ln();
            let score = |hands: &mut dyn Iterator<Item = &(Vec<f32>, Vec<f32>)>,
                         of: &dyn Fn(&[f32]) -> f64| {
                hands.map(|(_, features)| of(features)).collect::<Vec<f64>>()
            };
            let softmax = |features: &[f32]| -largest(features);
            let known = |of: &dyn Fn(&[f32]) -> f64| score(&mut left_out.known().map(|(_, hand)| hand), of);
            let unknown = |of: &dyn Fn(&[f32]) -> f64| score(&mut left_out.unknown(), of);
            let things = |of: &dyn Fn(&[f32]) -> f64| score(&mut nothing.iter(), of);
            let both = |of: &dyn Fn(&[f32]) -> f64| {
                (auroc(&known(of), &unknown(of)), auroc(&known(of), &things(of)))
            };
            let ((a, ea), (c, ec)) = both(&ratio);
            let ((b, eb), (d, ed)) = both(&softmax);
            eprintln!(
                "{each:>3} | {:<12} | {a:.3} ± {ea:.3} | {b:.3} ± {eb:.3} | {c:.3} ± {ec:.3}, softmax {d:.3} ± {ed:.3}",
                left_out.name
            );
            let taken = |of: Vec<f64>| {
                of.iter().filter(|ratio| **ratio > 0.0).count() as f64 / of.len().max(1) as f64
            };
            eprintln!(
                "    likelier unknown than any gesture: {:.3} of the known, {:.3} of the unknown, {:.3} of the things",
                taken(known(&ratio)),
                taken(unknown(&ratio)),
                taken(things(&ratio))
            );
            if each == PICTURES {
                by_ratio.push(a);
            }
        }
    }
    let mean = by_ratio.iter().sum::<f64>() / by_ratio.len() as f64;
    eprintln!("mean over the sets left out: {mean:.3}");
    assert!(mean >= 0.6, "{mean}");
}
