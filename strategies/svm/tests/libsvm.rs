//! Side by side with LIBSVM on the same problem; skipped where it is not installed.

mod side_by_side;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{Evaluation, LabelledFeatures, TrainOptions, train};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 5;

/// Classes on a circle in 6 features: each person shifts them all, so that people never
/// seen are harder than more of the same.
fn samples(people: std::ops::Range<u32>, rng: &mut impl Rng) -> Vec<LabelledFeatures> {
    let mut normal = || (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum::<f32>();
    let mut samples = Vec::new();
    for person in people {
        let shift: Vec<f32> = (0..6).map(|_| 0.3 * normal()).collect();
        for class in 0..CLASSES {
            let angle = class as f32 / CLASSES as f32 * std::f32::consts::TAU;
            for _ in 0..3 {
                let mut features: Vec<f32> = shift.iter().map(|shift| shift + 0.4 * normal()).collect();
                features[0] += angle.cos();
                features[1] += angle.sin();
                samples.push(LabelledFeatures::new(features, ClassId(class as u32), Some(person)));
            }
        }
    }
    samples
}

#[test]
fn it_judges_as_well_as_libsvm_and_promises_no_more_than_it_keeps() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (learned, unseen) = (samples(0..60, &mut rng), samples(60..300, &mut rng));
    let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).unwrap();
    // One pair of parameters, so that both solve the same problem.
    let options = TrainOptions { costs: vec![4.0], gammas: vec![1.0], ..TrainOptions::default() };
    let trained = train("toy-1", &vocabulary, &learned, &options, &mut rng, |_| ()).unwrap();
    let mut ours = Evaluation::new(CLASSES);
    for sample in &unseen {
        ours.record(sample.class, &trained.classifier.probabilities(&sample.features).unwrap());
    }
    let Some(theirs) = side_by_side::libsvm(&trained.classifier, (4.0, 1.0), &learned, &unseen, "circle")
    else {
        return;
    };
    side_by_side::print("ours", &ours);
    side_by_side::print("LIBSVM", &theirs);
    let accuracy = |e: &Evaluation| e.accuracy().unwrap().value;
    assert!((0.6..0.95).contains(&accuracy(&ours)), "the classes should overlap");
    assert!((accuracy(&ours) - accuracy(&theirs)).abs() <= 0.01);
    assert!(ours.log_loss().unwrap() <= theirs.log_loss().unwrap() + 0.01);
    assert!(ours.calibration_error().unwrap() <= 0.05);
}
