//! Real photographs of people never seen in training. The data are not part of the project: `GESTALT_DATA`, or
//! `../shared/data` seen from the workspace; skipped where there are none.
//!
//! `cargo test -p gestalt-vision --test real_hands` prints the figures.

#![cfg(feature = "opencv")]

#[path = "../../../strategies/svm/tests/side_by_side/mod.rs"]
mod side_by_side;

use std::path::{Path, PathBuf};

use gestalt_strategies::{
    Classify, Evaluation, LabelledFeatures, ScalingMethod, TrainOptions, Vocabulary, train,
};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::dataset::{Dataset, LabelledImage, Naming};
use gestalt_vision::eyes::{Eyes, MINIMUM};
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{FeatureSet, HandConfig, LayerConfig, NoObservation, Perception};
use gestalt_vision::source::read_image;
use gestalt_vision::survey::{FalseAlarms, Survey};
use opencv::core::{self, CV_16SC3, Mat, Scalar, Vec3b, Vector, no_array};
use opencv::imgcodecs::{IMREAD_COLOR, IMWRITE_JPEG_QUALITY, imdecode, imencode};
use opencv::imgproc;
use opencv::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works, Data] a_cast_a_dim_light_noise_and_compression_cost_the_shape_little,
        [Works, Data] a_cast_a_dim_light_noise_and_compression_cost_the_gradients_little,
        [Works, Data] gradients_tell_ten_signs_of_people_never_seen,
        [Works, Data] shape_tells_six_signs_of_people_never_seen,
        [Works, Data] fingers_before_another_camera_are_told_better_than_by_the_reference,
        [Works, Data] learned_eyes_take_in_every_picture,
        [Works, Data] learned_eyes_count_fingers_before_a_camera_that_had_no_part_in_making_them,
        [Works, Data] faults_of_a_camera_cost_learned_eyes_little,
        [Works, Data] learned_eyes_seldom_see_a_hand_where_none_is,
        [Works, Data] a_hand_beside_a_thing_that_was_taken_for_one_is_seen,
    ])
}

fn data(folder: &str) -> PathBuf {
    gestalt_trials::data().join(folder)
}

fn options(set: FeatureSet) -> TrainOptions {
    let scaling = match set {
        FeatureSet::Shape => ScalingMethod::PerComponent,
        FeatureSet::Hog | FeatureSet::Embedding => ScalingMethod::Common,
    };
    TrainOptions { scaling, costs: vec![4.0], gammas: vec![0.25, 0.5], ..TrainOptions::default() }
}

/// Accuracy over all images, those without a hand counting as wrong, and calibration error: means over two splits
/// with 30 % of the people held out.
fn on_people_never_seen(set: FeatureSet, labels: std::ops::RangeInclusive<u8>) -> (f64, f64) {
    const SPLITS: u64 = 2;
    let labels: Vec<String> = labels.map(|label| label.to_string()).collect();
    let what = format!("{}-{}", set.name(), labels.len());
    let dataset = Dataset::list(&data("asl-digits"), Some(&labels)).unwrap();
    let mut perception = Perception::new(set, HandConfig::default()).unwrap();
    let survey = Survey::of(&dataset.images, &mut perception, || ());
    assert!(survey.unreadable.is_empty(), "{:?}", survey.unreadable);
    let (mut accuracy, mut error) = (0.0, 0.0);
    for seed in 0..SPLITS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let held_out = dataset.draw_people(0.3, &mut rng);
        let is_held_out = |person: Option<u32>| person.is_some_and(|person| held_out.contains(&person));
        let (unseen, learned): (Vec<LabelledFeatures>, Vec<LabelledFeatures>) =
            survey.samples().into_iter().partition(|sample| is_held_out(sample.group));
        let trained =
            train(set.name(), &dataset.vocabulary, &learned, &options(set), &mut rng, |_| ()).unwrap();
        let mut ours = Evaluation::new(labels.len());
        for sample in &unseen {
            ours.record(sample.class, &trained.classifier.probabilities(&sample.features).unwrap());
        }
        eprintln!("{what}, split {seed}, {} images:", unseen.len());
        side_by_side::print("ours", &ours);
        let parameters = (trained.cost, trained.gamma);
        if let Some(theirs) = side_by_side::libsvm(&trained.classifier, parameters, &learned, &unseen, &what)
        {
            side_by_side::print("LIBSVM", &theirs);
        }
        let missed = survey.without_hand.iter().filter(|rejected| is_held_out(rejected.image.person)).count();
        let seen = unseen.len() as f64;
        accuracy += ours.accuracy().unwrap().value * seen / (seen + missed as f64) / SPLITS as f64;
        error += ours.calibration_error().unwrap() / SPLITS as f64;
    }
    eprintln!("{what}: {accuracy:.4} of all images, calibration error {error:.3}");
    (accuracy, error)
}

fn shape_tells_six_signs_of_people_never_seen() {
    let (accuracy, error) = on_people_never_seen(FeatureSet::Shape, 0..=5);
    assert!(accuracy >= 0.985 && error <= 0.05, "{accuracy} {error}");
}

fn gradients_tell_ten_signs_of_people_never_seen() {
    let (accuracy, error) = on_people_never_seen(FeatureSet::Hog, 0..=9);
    assert!(accuracy >= 0.965 && error <= 0.05, "{accuracy} {error}");
}

fn fingers_before_another_camera_are_told_better_than_by_the_reference() {
    let (signs, webcam) = (data("asl-digits"), data("webcam-fingers"));
    let vocabulary = Vocabulary::new(["1", "2", "3", "4", "5"]).unwrap();
    let set = FeatureSet::Shape;
    let mut perception = Perception::new(set, HandConfig::default()).unwrap();
    let mut look = |folder: &Path| {
        let dataset = Dataset::list_known(folder, Naming::Names, &vocabulary).unwrap();
        Survey::of(&dataset.images, &mut perception, || ())
    };
    let (learned, unseen) = (look(&signs).samples(), look(&webcam));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let trained = train(set.name(), &vocabulary, &learned, &options(set), &mut rng, |_| ()).unwrap();
    let mut evaluation = Evaluation::new(5);
    for (_, sample) in &unseen.seen {
        evaluation.record(sample.class, &trained.classifier.probabilities(&sample.features).unwrap());
    }
    side_by_side::print("webcam", &evaluation);
    let seen = evaluation.count() as f64;
    let accuracy = evaluation.accuracy().unwrap().value * seen / (seen + unseen.without_hand.len() as f64);
    // Measured: 0.780. scikit-learn with 30 shape features, untuned: 0.654.
    assert!(accuracy >= 0.76, "{accuracy} of all images");

    // The same frames before the wall known empty.
    let wall = data("webcam-fingers/background");
    let mut walls: Vec<PathBuf> =
        std::fs::read_dir(wall).unwrap().map(|entry| entry.unwrap().path()).collect();
    walls.sort();
    let wall = walls.iter().find_map(|path| read_image(path).ok()).unwrap();
    let mut eyes = Perception::new(set, HandConfig::default()).unwrap();
    let mut evaluation = Evaluation::new(5);
    let images = Dataset::list_known(&webcam, Naming::Names, &vocabulary).unwrap().images;
    for image in &images {
        if let Ok(seen) = eyes.observe_before(&read_image(&image.path).unwrap(), Some(&wall)) {
            evaluation.record(image.class, &trained.classifier.probabilities(&seen.features).unwrap());
        }
    }
    side_by_side::print("webcam, wall known", &evaluation);
    let known = evaluation.accuracy().unwrap().value * evaluation.count() as f64 / images.len() as f64;
    assert!(known >= accuracy - 0.01, "{known} of all images with the wall known, {accuracy} without");
}

fn learned_eyes_take_in_every_picture() {
    let mut eyes = Eyes::shipped().unwrap();
    let set = FeatureSet::Embedding;
    let mut perception =
        Perception::for_camera(set, HandConfig::default(), LayerConfig::ALL, &CameraModel::laptop()).unwrap();
    for folder in ["asl-digits", "webcam-fingers"] {
        let images = Dataset::list(&data(folder), None).unwrap().images;
        let (mut seen, mut again, mut all) = (0, 0, 0);
        for image in images.iter().step_by(30) {
            let picture = read_image(&image.path).unwrap();
            all += 1;
            match eyes.look(&picture, None) {
                Ok(look) => {
                    seen += 1;
                    assert!((MINIMUM..=1.0).contains(&look.confidence), "{look:?}");
                    assert!(look.embedding.iter().all(|value| value.is_finite()), "{look:?}");
                    assert!(!look.outline().unwrap().is_empty());
                    again += u32::from(eyes.look(&picture, Some(look.place)).is_ok());
                }
                Err(error) => assert!(matches!(error, NoObservation::NoHand(_)), "{error}"),
            }
            if let Ok(observation) = perception.observe(&picture) {
                assert_eq!(observation.features.len(), set.length());
                let (region, mask) = (perception.region(), perception.mask());
                assert!(
                    region.x + region.width <= picture.cols() && region.y + region.height <= picture.rows()
                );
                assert!(mask.cols().max(mask.rows()) == 194 && perception.crop().cols() == 48);
            }
        }
        eprintln!("{folder}: a hand in {seen} of {all} pictures, and still in {again}");
    }
}

/// The webcam's fingers: no picture of it had a part in making the weights or their model.
fn webcam() -> Vec<(LabelledImage, Mat)> {
    let vocabulary = RobotModel::hands().unwrap().classifier.vocabulary().clone();
    let images = Dataset::list_known(&data("webcam-fingers"), Naming::Names, &vocabulary).unwrap().images;
    images.into_iter().map(|image| (image.clone(), read_image(&image.path).unwrap())).collect()
}

/// What the shipped model makes of pictures, each by itself: an evaluation of those with a hand found, and the share of all
/// that is right.
fn shipped(pictures: &[(LabelledImage, Mat)], fault: Fault) -> (Evaluation, f64) {
    core::set_rng_seed(1).unwrap();
    let model = RobotModel::hands().unwrap();
    let mut perception = Perception::new(model.features, HandConfig::default()).unwrap();
    let mut evaluation = Evaluation::new(6);
    for (image, picture) in pictures {
        match perception.observe(&fault.apply(picture)) {
            Ok(seen) => {
                evaluation.record(image.class, &model.classifier.probabilities(&seen.features).unwrap());
            }
            Err(error) => assert!(matches!(error, NoObservation::NoHand(_)), "{error}"),
        }
    }
    let right = evaluation.accuracy().map_or(0.0, |a| a.value) * evaluation.count() as f64;
    (evaluation, right / pictures.len() as f64)
}

fn learned_eyes_count_fingers_before_a_camera_that_had_no_part_in_making_them() {
    let pictures = webcam();
    let (evaluation, right) = shipped(&pictures, Fault::None);
    let error = evaluation.calibration_error().unwrap();
    eprintln!(
        "webcam, learned eyes: {right:.3} of all, {} without a hand, calibration error {error:.3}",
        pictures.len() as u64 - evaluation.count()
    );
    assert!(right >= 0.91 && error <= 0.08, "{right} {error}");
}

fn faults_of_a_camera_cost_learned_eyes_little() {
    let pictures: Vec<_> = webcam().into_iter().step_by(2).collect();
    let (_, clean) = shipped(&pictures, Fault::None);
    for fault in Fault::ALL {
        let cost = 100.0 * (clean - shipped(&pictures, fault).1);
        eprintln!("  {fault:?}: costs learned eyes {cost:.1} points");
        assert!(cost <= 3.0, "{fault:?}: {cost:.1} points");
    }
}

/// Of these pictures none had a part in making the weights, of the others in the folder some had.
fn learned_eyes_seldom_see_a_hand_where_none_is() {
    let model = RobotModel::hands().unwrap();
    let dataset =
        Dataset::list_known(&data("negatives"), Naming::Names, model.classifier.vocabulary()).unwrap();
    let unknown = |path: &PathBuf| !path.file_name().unwrap().to_string_lossy().starts_with("misc_");
    let pictures: Vec<PathBuf> = dataset.none.into_iter().filter(unknown).collect();
    let mut perception = Perception::new(model.features, HandConfig::default()).unwrap();
    let FalseAlarms { alarms, images, unreadable } = FalseAlarms::count(&pictures, &mut perception);
    assert!(unreadable.is_empty(), "{unreadable:?}");
    eprintln!("a hand in {alarms} of {images} pictures without one");
    assert!(images > 30 && alarms as f64 <= 0.1 * images as f64, "{alarms} of {images}");
}

/// A banana is taken for a hand; then a hand is shown beside it.
fn a_hand_beside_a_thing_that_was_taken_for_one_is_seen() {
    let thing = read_image(&data("negatives/none/misc_banana_0.jpg")).unwrap();
    let hand = read_image(&data("asl-digits/5/s003_IMG_1153.jpg")).unwrap();
    let (mut large, mut both) = (Mat::default(), thing.clone());
    imgproc::resize(&hand, &mut large, core::Size::new(300, 300), 0.0, 0.0, imgproc::INTER_LINEAR).unwrap();
    let beside = core::Rect::new(20, 320, 300, 300);
    large.copy_to(&mut Mat::roi_mut(&mut both, beside).unwrap()).unwrap();
    let (camera, layer) = (CameraModel::laptop(), LayerConfig::ALL);
    let mut eyes =
        Perception::for_camera(FeatureSet::Embedding, HandConfig::default(), layer, &camera).unwrap();
    for _ in 0..20 {
        eyes.observe(&thing).unwrap();
    }
    let mut sees_the_hand = || {
        let quality = eyes.observe(&both).unwrap().quality;
        let region = eyes.region();
        quality > 0.9 && beside.contains((region.tl() + region.br()) / 2)
    };
    let after = (0..100).position(|_| sees_the_hand()).unwrap();
    eprintln!("the hand is seen in frame {after}");
    assert!(after < 12 && (0..30).all(|_| sees_the_hand()), "{after}");
}

/// What a camera may do to a picture.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// Each channel (blue, green, red) times a factor, saturating.
    Gain(f64, f64, f64),
    /// Compressed to that quality.
    Jpeg(i32),
    /// Gaussian noise of that standard deviation.
    Noise(f64),
    /// Dim, tinted, and noisy at once.
    Dusk,
}

impl Fault {
    const ALL: [Self; 14] = [
        Self::Gain(1.3, 1.0, 1.0),
        Self::Gain(0.7, 1.0, 1.0),
        Self::Gain(1.0, 1.3, 1.0),
        Self::Gain(1.0, 0.7, 1.0),
        Self::Gain(1.0, 1.0, 1.3),
        Self::Gain(1.0, 1.0, 0.7),
        Self::Gain(0.5, 0.5, 0.5),
        Self::Gain(0.707, 0.707, 0.707),
        Self::Gain(1.414, 1.414, 1.414),
        Self::Gain(2.0, 2.0, 2.0),
        Self::Jpeg(40),
        Self::Noise(8.0),
        Self::Dusk,
        Self::None,
    ];

    fn apply(self, image: &Mat) -> Mat {
        match self {
            Self::None => image.clone(),
            Self::Gain(blue, green, red) => {
                let mut out = image.clone();
                for pixel in out.data_typed_mut::<Vec3b>().unwrap() {
                    for (value, gain) in pixel.iter_mut().zip([blue, green, red]) {
                        *value = (f64::from(*value) * gain).round() as u8;
                    }
                }
                out
            }
            Self::Jpeg(quality) => {
                let mut bytes = Vector::new();
                let options = Vector::from_slice(&[IMWRITE_JPEG_QUALITY, quality]);
                imencode(".jpg", image, &mut bytes, &options).unwrap();
                imdecode(&bytes, IMREAD_COLOR).unwrap()
            }
            Self::Noise(sigma) => {
                let size = image.size().unwrap();
                let mut noise = Mat::new_size_with_default(size, CV_16SC3, Scalar::all(0.0)).unwrap();
                core::randn(&mut noise, &Scalar::all(0.0), &Scalar::all(sigma)).unwrap();
                let mut out = Mat::default();
                core::add(image, &noise, &mut out, &no_array(), core::CV_8U).unwrap();
                out
            }
            Self::Dusk => Self::Noise(5.0).apply(&Self::Gain(0.75, 0.6, 0.5).apply(image)),
        }
    }
}

/// What each fault costs a classifier that was trained on clean pictures, in points of accuracy on people never seen,
/// pictures without a hand found counting as wrong: means over three splits.
fn cost_of_faults(set: FeatureSet) -> Vec<(Fault, f64)> {
    const SPLITS: u64 = 3;
    let dataset = Dataset::list(&data("asl-digits"), None).unwrap();
    let images: Vec<(&LabelledImage, Mat)> =
        dataset.images.iter().map(|image| (image, read_image(&image.path).unwrap())).collect();
    let mut perception = Perception::new(set, HandConfig::default()).unwrap();
    let mut look = |fault: Fault, whom: &dyn Fn(Option<u32>) -> bool| -> Vec<Option<LabelledFeatures>> {
        core::set_rng_seed(1).unwrap();
        let mut sample = |(image, picture): &(&LabelledImage, Mat)| {
            let features = perception.observe(&fault.apply(picture)).ok()?.features;
            Some(LabelledFeatures::new(features, image.class, image.person))
        };
        images.iter().map(|image| whom(image.0.person).then(|| sample(image))?).collect()
    };
    let clean = look(Fault::None, &|_| true);
    let splits: Vec<_> = (0..SPLITS)
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let held_out = dataset.draw_people(0.3, &mut rng);
            let unseen = move |person: Option<u32>| person.is_some_and(|p| held_out.contains(&p));
            let learned: Vec<LabelledFeatures> =
                clean.iter().flatten().filter(|s| !unseen(s.group)).cloned().collect();
            let trained =
                train(set.name(), &dataset.vocabulary, &learned, &options(set), &mut rng, |_| ()).unwrap();
            (unseen, trained.classifier)
        })
        .collect();
    let mut accuracy = |fault: Fault| {
        let anywhere = |person| splits.iter().any(|(unseen, _)| unseen(person));
        let samples = if matches!(fault, Fault::None) { clean.clone() } else { look(fault, &anywhere) };
        let mut right = 0.0;
        for (unseen, classifier) in &splits {
            let tested: Vec<_> =
                images.iter().zip(&samples).filter(|((image, _), _)| unseen(image.person)).collect();
            let named = tested.iter().filter(|((image, _), sample)| {
                let p = sample.as_ref().map(|s| classifier.probabilities(&s.features).unwrap());
                let best = p.and_then(|p| (0..p.len()).max_by(|&a, &b| p[a].total_cmp(&p[b])));
                best == Some(image.class.index())
            });
            right += 100.0 * named.count() as f64 / tested.len() as f64 / SPLITS as f64;
        }
        let tested = images.iter().zip(&samples).filter(|((image, _), _)| anywhere(image.person));
        (right, tested.filter(|(_, sample)| sample.is_none()).count())
    };
    let (reference, lost) = accuracy(Fault::None);
    eprintln!("{}: {reference:.2} % of clean pictures, no hand in {lost}", set.name());
    let cost = |fault: Fault| {
        let (right, lost) = accuracy(fault);
        eprintln!("  {fault:?}: costs {:.2} points, no hand in {lost}", reference - right);
        (fault, reference - right)
    };
    Fault::ALL.into_iter().map(cost).collect()
}

fn a_cast_a_dim_light_noise_and_compression_cost_the_shape_little() {
    for (fault, cost) in cost_of_faults(FeatureSet::Shape) {
        // Twice the light makes wall and highlights of the skin the same 255 in all channels: what is left of their border
        // is the shade around it.
        let most = if matches!(fault, Fault::Gain(2.0, 2.0, 2.0)) { 9.0 } else { 3.0 };
        assert!(cost <= most, "{fault:?}: {cost:.2} points");
    }
}

fn a_cast_a_dim_light_noise_and_compression_cost_the_gradients_little() {
    for (fault, cost) in cost_of_faults(FeatureSet::Hog) {
        assert!(cost <= 3.0, "{fault:?}: {cost:.2} points");
    }
}
