//! One hand, two cameras: what the heterogeneity layer buys, and what each of its stages does.
//!
//! `GESTALT_LONG=1 cargo test -p gestalt-vision --test cameras -- --nocapture` measures over 20 seeds and prints the
//! tables; without it, one.

#![cfg(feature = "opencv")]

use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Classify, LabelledFeatures, TrainOptions, Vocabulary, train};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::perception::{FeatureSet, HandConfig, LayerConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::rendered::{LabelledFrame, TrainingFrames};
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};
use opencv::core::Mat;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const GLOVE: Glove = Glove::Cyan;

fn long() -> bool {
    std::env::var_os("GESTALT_LONG").is_some()
}

fn seeds() -> u64 {
    if long() { 20 } else { 1 }
}

fn eyes(layer: LayerConfig, camera: &CameraModel) -> Perception {
    Perception::for_camera(FeatureSet::Shape, HandConfig::default(), layer, camera).unwrap()
}

/// Frames of that camera: with the same seed, the same people in the same poses, whatever the camera.
fn frames(camera: CameraModel, seed: u64, count: usize) -> Vec<LabelledFrame> {
    TrainingFrames::new(vec![camera], GLOVE, 60.0, seed).take(count).map(Result::unwrap).collect()
}

/// What perception makes of each frame; `None` where it finds no hand.
fn samples(
    frames: &[LabelledFrame],
    layer: LayerConfig,
    camera: &CameraModel,
) -> Vec<Option<LabelledFeatures>> {
    let mut eyes = eyes(layer, camera);
    let sample = |frame: &LabelledFrame| {
        let observation = eyes.observe(&frame.image).ok()?;
        let class = ClassId(frame.class.into());
        Some(LabelledFeatures::new(observation.features, class, Some(frame.group)))
    };
    frames.iter().map(sample).collect()
}

fn learn(samples: &[Option<LabelledFeatures>], seed: u64) -> Option<Classifier> {
    let vocabulary = Vocabulary::new(["0", "1", "2", "3", "4", "5"]).unwrap();
    let options = TrainOptions { costs: vec![8.0], gammas: vec![1.0], ..TrainOptions::default() };
    let samples: Vec<LabelledFeatures> = samples.iter().flatten().cloned().collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let trained = train(FeatureSet::Shape.name(), &vocabulary, &samples, &options, &mut rng, |_| ());
    trained.ok().map(|trained| trained.classifier)
}

/// The share of frames whose gesture is named, in per cent; one without a hand found is not.
fn named(classifier: &Classifier, samples: &[Option<LabelledFeatures>]) -> f64 {
    let right = |sample: &&LabelledFeatures| {
        let p = classifier.probabilities(&sample.features).unwrap();
        let best = (0..p.len()).max_by(|&a, &b| p[a].total_cmp(&p[b]));
        best == Some(sample.class.index())
    };
    100.0 * samples.iter().flatten().filter(right).count() as f64 / samples.len() as f64
}

/// Mean and half the width of its 95 % interval (Student's t).
fn interval(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let t = if values.len() == 20 { 2.093 } else { 12.71 };
    (mean, t * (variance / n).sqrt())
}

/// What a classifier learns from, and what it is tested on, per seed and camera.
const LEARNED: usize = 480;
const TESTED: usize = 240;

/// The settings of the layer that are compared. The stage of time concerns evidence over many frames, not one.
const SETTINGS: [(&str, LayerConfig); 5] = [
    ("all on", LayerConfig::ALL),
    ("no geometry", LayerConfig { geometry: false, ..LayerConfig::ALL }),
    ("no colour", LayerConfig { colour: false, ..LayerConfig::ALL }),
    ("no resolution", LayerConfig { resolution: false, ..LayerConfig::ALL }),
    ("all off", LayerConfig::NONE),
];

/// All of them, or the first and the last.
fn settings() -> Vec<(&'static str, LayerConfig)> {
    if long() { SETTINGS.to_vec() } else { vec![SETTINGS[0], SETTINGS[4]] }
}

/// Accuracy in per cent on views of the Parrot, and of the Foot-bot, of a classifier that has only seen a Parrot's:
/// per setting of the layer, per seed.
fn transfer() -> Vec<(&'static str, Vec<[f64; 2]>)> {
    let (parrot, footbot) = (CameraModel::parrot(), CameraModel::footbot());
    let mut table: Vec<(&str, Vec<[f64; 2]>)> =
        settings().into_iter().map(|(name, _)| (name, Vec::new())).collect();
    for seed in 0..seeds() {
        let learned = frames(parrot.clone(), 2 * seed, LEARNED);
        let here = frames(parrot.clone(), 2 * seed + 1, TESTED);
        let there = frames(footbot.clone(), 2 * seed + 1, TESTED);
        for ((_, rows), (_, layer)) in table.iter_mut().zip(settings()) {
            let classifier = learn(&samples(&learned, layer, &parrot), seed);
            let accuracy = |frames, camera| {
                classifier.as_ref().map_or(0.0, |c| named(c, &samples(frames, layer, camera)))
            };
            rows.push([accuracy(&here, &parrot), accuracy(&there, &footbot)]);
        }
    }
    for (name, rows) in &table {
        let column = |f: fn(&[f64; 2]) -> f64| interval(&rows.iter().map(f).collect::<Vec<_>>());
        let (here, there, loss) = (column(|r| r[0]), column(|r| r[1]), column(|r| r[0] - r[1]));
        eprintln!(
            "{name:14} Parrot {:5.1} ± {:3.1}   Foot-bot {:5.1} ± {:3.1}   loss {:5.1} ± {:3.1}",
            here.0, here.1, there.0, there.1, loss.0, loss.1
        );
    }
    table
}

#[test]
fn what_a_parrot_taught_a_footbot_reads() {
    let table = transfer();
    let loss = |row: usize| interval(&table[row].1.iter().map(|r| r[0] - r[1]).collect::<Vec<_>>()).0;
    let (on, off) = (loss(0), loss(table.len() - 1));
    assert!(on <= 3.0, "{on} points lost with the layer");
    assert!(off >= on + 20.0, "{off} points lost without it");
}

/// The features of scenes seen by both cameras, each divided by its standard deviation over views of many people.
/// Ratio of the mean distance between cameras to that between neighbouring gestures.
fn ratio(layer: LayerConfig, scenes: u64) -> (f64, usize) {
    let cameras = [CameraModel::parrot(), CameraModel::footbot()];
    let pose = Pose { bearing_deg: 15.0, elevation_deg: -10.0, distance_m: 0.9 };
    let spread = {
        let seen = samples(&frames(cameras[0].clone(), 77, 300), layer, &cameras[0]);
        let seen: Vec<&LabelledFeatures> = seen.iter().flatten().collect();
        let n = seen.len() as f64;
        let feature = |i: usize| seen.iter().map(move |s| f64::from(s.features[i]));
        let deviation = |i: usize| {
            let mean = feature(i).sum::<f64>() / n;
            (feature(i).map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
        };
        (0..FeatureSet::Shape.length()).map(deviation).collect::<Vec<f64>>()
    };
    let distance = |a: &[f32], b: &[f32]| {
        let scaled = a.iter().zip(b).zip(&spread).map(|((a, b), s)| f64::from(a - b) / s.max(1e-6));
        scaled.map(|d| d * d).sum::<f64>().sqrt()
    };
    let (mut between_cameras, mut between_gestures) = (Vec::new(), Vec::new());
    let mut missed = 0;
    for seed in 0..scenes {
        let views = cameras.clone().map(|camera| {
            let mut eyes = eyes(layer, &camera);
            let mut source = RenderedSource::new(camera, pose, GLOVE, seed).unwrap();
            (0..=5)
                .map(|count| {
                    let scene = Scene { gesture: Some(count), seed };
                    let frame = source.next_frame(Duration::ZERO, &scene).unwrap();
                    eyes.observe(&frame.image).ok().map(|seen| seen.features)
                })
                .collect::<Vec<_>>()
        });
        for pair in views[0].iter().zip(&views[1]) {
            match pair {
                (Some(a), Some(b)) => between_cameras.push(distance(a, b)),
                _ => missed += 1,
            }
        }
        for view in &views {
            for pair in view.windows(2) {
                if let [Some(a), Some(b)] = pair {
                    between_gestures.push(distance(a, b));
                }
            }
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    (mean(&between_cameras) / mean(&between_gestures), missed)
}

#[test]
fn two_cameras_differ_less_than_two_neighbouring_gestures() {
    let scenes = 10 * seeds();
    for (name, layer) in settings() {
        let (ratio, missed) = ratio(layer, scenes);
        eprintln!(
            "{name:14} between cameras / between gestures {ratio:.3}   ({missed} of {} missed)",
            6 * scenes
        );
        if layer == LayerConfig::ALL {
            assert!(ratio <= 0.5, "{ratio}");
        }
    }
}

/// Scenes seen by both cameras, from many poses: the frame, the same room empty, and what is shown.
fn scenes_with_their_rooms(count: u64) -> Vec<(CameraModel, Mat, Mat, u8)> {
    let cameras = [CameraModel::parrot(), CameraModel::footbot()];
    let take = |seed: u64| {
        let camera = cameras[(seed % 2) as usize].clone();
        let (gesture, turn) = ((seed / 2 % 6) as u8, (seed * 37 % 101) as f64 - 50.0);
        let pose = Pose { bearing_deg: turn, elevation_deg: -10.0, distance_m: 0.9 };
        let mut source = RenderedSource::new(camera.clone(), pose, GLOVE, 900 + seed).unwrap();
        let mut frame = |gesture| source.next_frame(Duration::ZERO, &Scene { gesture, seed }).unwrap().image;
        let (empty, shown) = (frame(None), frame(Some(gesture)));
        (camera, shown, empty, gesture)
    };
    (0..count).map(take).collect()
}

#[test]
fn a_room_known_empty_does_no_harm() {
    let parrot = CameraModel::parrot();
    let classifier =
        learn(&samples(&frames(parrot.clone(), 5, LEARNED), LayerConfig::ALL, &parrot), 5).unwrap();
    let scenes = scenes_with_their_rooms(60 * seeds());
    let accuracy = |with_room: bool| {
        let sample = |(camera, frame, room, gesture): &(CameraModel, Mat, Mat, u8)| {
            let room = with_room.then_some(room);
            let features = eyes(LayerConfig::ALL, camera).observe_before(frame, room).ok()?.features;
            Some(LabelledFeatures::new(features, ClassId((*gesture).into()), None))
        };
        named(&classifier, &scenes.iter().map(sample).collect::<Vec<_>>())
    };
    let (without, with) = (accuracy(false), accuracy(true));
    eprintln!("{} scenes: {without:.1} % without the empty room, {with:.1} % with it", scenes.len());
    assert!(with >= without - 1.0, "{without} without, {with} with");
}
