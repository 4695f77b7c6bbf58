//! What eyes say of seeing a hand at all, in what a classifier makes of the view.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Judgement, Observation, Vocabulary};
use gestalt_svm::{Classifier, Components, FeatureSpace, Learner, LearnerOptions, ScalingMethod};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 4;

/// A view of a gesture: noise about a corner of its own.
fn view(class: usize, rng: &mut impl Rng) -> Vec<f32> {
    let noise = |x| if x == class { 3.0 } else { 0.0 } + rng.random_range(-0.5_f32..0.5);
    (0..CLASSES).map(noise).collect()
}

/// Who was taught the first so many of four gestures, by features of that name.
fn taught(feature_set: &str, met: usize) -> Arc<Classifier> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows: Vec<Vec<f32>> = (0..80).map(|n| view(n % CLASSES, &mut rng)).collect();
    let (scaling, keep) = (ScalingMethod::PerComponent, Components::Count(CLASSES));
    let space = FeatureSpace::fit(feature_set, rows.iter().map(Vec::as_slice), scaling, keep, &mut rng);
    let vocabulary = Vocabulary::new((0..CLASSES).map(|class| class.to_string())).unwrap();
    let mut learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap();
    for (n, row) in rows.iter().enumerate().filter(|(n, _)| n % CLASSES < met) {
        let vector = learner.space().project(row).unwrap();
        learner.insert(n as u64, ClassId((n % CLASSES) as u32), &vector).unwrap();
    }
    learner.learn().unwrap()
}

fn seen(classifier: &Classifier, quality: f32) -> Judgement {
    let features = view(0, &mut ChaCha8Rng::seed_from_u64(2));
    classifier.judge_seen(&Observation { features, quality }).unwrap()
}

#[test]
fn what_hardly_looks_like_a_hand_is_unknown_to_learned_eyes_whichever_gesture_it_resembles() {
    for met in [2, 4] {
        let classifier = taught("embedding-1-00000000", met);
        let judgements: Vec<Judgement> =
            [1.0, 0.8, 0.6, 0.4, 0.2].iter().map(|quality| seen(&classifier, *quality)).collect();
        let unknown: Vec<f64> = judgements.iter().map(|judgement| judgement.unknown.unwrap()).collect();
        assert!(unknown.is_sorted_by(|a, b| a < b), "{met} met: {unknown:?}");
        for Judgement { probabilities, unknown, .. } in &judgements {
            assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{probabilities:?}");
            // A gesture of the list that was never taught is as likely as one beside it, to the bit.
            assert!(probabilities[met..].iter().all(|p| Some(*p) == *unknown), "{probabilities:?}");
        }
        let sure = &judgements[0];
        assert!(sure.probabilities[0] > sure.unknown.unwrap(), "{sure:?}");
        let hardly = &judgements[4];
        assert!(hardly.probabilities.iter().all(|p| *p <= hardly.unknown.unwrap()), "{hardly:?}");
        // Which gesture is likeliest of those it was taught is another question.
        let ratio = |judgement: &Judgement| judgement.probabilities[0] / judgement.probabilities[1];
        assert!((ratio(sure) / ratio(hardly) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_hand_for_certain_is_judged_by_its_features_alone_and_so_is_all_that_other_eyes_see() {
    let features = view(0, &mut ChaCha8Rng::seed_from_u64(2));
    let learned = taught("embedding-1-00000000", 4);
    assert_eq!(seen(&learned, 1.0), learned.judge(&features).unwrap());
    let by_shape = taught("shape-2", 4);
    assert_eq!(seen(&by_shape, 0.2), by_shape.judge(&features).unwrap());
}
