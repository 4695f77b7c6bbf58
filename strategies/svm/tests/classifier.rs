//! The classifier as its users see it: learn, judge, store.

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, ClassifyError, Vocabulary};
use gestalt_svm::{
    Classifier, Components, Evaluation, Folding, LabelledFeatures, ModelError, TrainError, TrainOptions,
    Trained, train,
};
use proptest::prelude::*;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new(["fist", "palm", "point"]).unwrap()
}

/// About a standard normal variable: the sum of twelve uniform ones.
fn normal(rng: &mut impl Rng) -> f32 {
    (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum()
}

/// Three classes in five features; class 0 lies on both sides of the others, so no line parts it from them.
/// `spread` 0.3 keeps the classes apart, 1.0 makes them overlap.
fn samples(count: usize, spread: f32, rng: &mut impl Rng) -> Vec<LabelledFeatures> {
    (0..count)
        .map(|i| {
            let class = i % 3;
            let side = if rng.random_bool(0.5) { 2.0 } else { -2.0 };
            let centre = match class {
                0 => [side, side, 0.0, 5.0, 100.0],
                1 => [2.0, -2.0, 0.0, 5.0, 100.0],
                _ => [-2.0, 2.0, 0.0, 5.0, 100.0],
            };
            let features = centre.iter().map(|c| c + spread * normal(rng)).collect();
            LabelledFeatures::new(features, ClassId(class as u32), Some((i / 12) as u32))
        })
        .collect()
}

fn options() -> TrainOptions {
    TrainOptions { costs: vec![1.0, 10.0], gammas: vec![0.5, 2.0], ..TrainOptions::default() }
}

fn trained(samples: &[LabelledFeatures], seed: u64) -> Trained {
    train("shape-1", &vocabulary(), samples, &options(), &mut generator(seed), |_| ()).unwrap()
}

fn evaluate(classifier: &Classifier, samples: &[LabelledFeatures]) -> Evaluation {
    let mut evaluation = Evaluation::new(3);
    for sample in samples {
        evaluation.record(sample.class, &classifier.probabilities(&sample.features).unwrap());
    }
    evaluation
}

#[test]
fn it_learns_classes_that_no_line_parts() {
    let mut rng = generator(1);
    let trained = trained(&samples(240, 0.3, &mut rng), 1);
    assert_eq!(trained.folding, Folding::ByGroup);
    let unseen = evaluate(&trained.classifier, &samples(600, 0.3, &mut rng));
    assert!(unseen.accuracy().unwrap().value >= 0.99, "{:?}", unseen.accuracy());
}

#[test]
fn overlapping_classes_get_honest_probabilities() {
    let mut rng = generator(2);
    let trained = trained(&samples(360, 1.4, &mut rng), 2);
    let unseen = evaluate(&trained.classifier, &samples(3000, 1.4, &mut rng));
    let accuracy = unseen.accuracy().unwrap().value;
    assert!((0.7..0.95).contains(&accuracy), "the classes should overlap: {accuracy}");
    let error = unseen.calibration_error().unwrap();
    assert!(error <= 0.05, "calibration error {error}, accuracy {accuracy}");
    assert!((trained.accuracy - accuracy).abs() < 0.05, "{} promised, {accuracy} found", trained.accuracy);
}

#[test]
fn probabilities_are_a_distribution_however_far_off_the_features() {
    let classifier = trained(&samples(90, 0.5, &mut generator(3)), 3).classifier;
    for scale in [0.0, 1.0, 1e3, 1e20, f32::MAX] {
        let p = classifier.probabilities(&[scale, -scale, scale, 0.0, scale]).unwrap();
        assert_eq!(p.len(), 3);
        assert!(p.iter().all(|p| (0.0..=1.0).contains(p)), "{scale}: {p:?}");
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{scale}: {p:?}");
    }
}

#[test]
fn features_it_cannot_judge_are_refused() {
    let classifier = trained(&samples(90, 0.5, &mut generator(3)), 3).classifier;
    assert_eq!(classifier.probabilities(&[0.0; 4]), Err(ClassifyError::Length { found: 4, expected: 5 }));
    assert_eq!(classifier.probabilities(&[0.0, 0.0, f32::NAN, 0.0, 0.0]), Err(ClassifyError::NotFinite(2)));
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let samples = samples(120, 0.5, &mut generator(4));
    let first = trained(&samples, 7).classifier.encode();
    assert_eq!(first, trained(&samples, 7).classifier.encode());
    assert_ne!(first, trained(&samples[3..], 7).classifier.encode());
}

#[test]
fn samples_nothing_can_be_learned_from_are_refused() {
    let good = samples(60, 0.5, &mut generator(5));
    let error = |samples: &[LabelledFeatures]| {
        train("shape-1", &vocabulary(), samples, &options(), &mut generator(5), |_| ()).unwrap_err()
    };
    let mut bad = good.clone();
    bad[7].features[2] = f32::INFINITY;
    assert_eq!(error(&bad), TrainError::NotFinite { sample: 7, component: 2 });

    let mut bad = good.clone();
    bad[9].features.pop();
    assert_eq!(error(&bad), TrainError::Length { sample: 9, found: 4, expected: 5 });

    let mut bad = good.clone();
    bad[3].class = ClassId(3);
    assert_eq!(error(&bad), TrainError::Class { sample: 3, class: ClassId(3) });

    let one_class: Vec<LabelledFeatures> = good.iter().filter(|s| s.class == ClassId(1)).cloned().collect();
    assert_eq!(error(&one_class), TrainError::TooFew { label: "fist".to_owned(), found: 0 });
    assert_eq!(error(&[]), TrainError::TooFew { label: "fist".to_owned(), found: 0 });

    let mut bad = good;
    bad.iter_mut().for_each(|sample| sample.features = vec![1.0; 5]);
    assert_eq!(error(&bad), TrainError::NoVariance);
}

#[test]
fn options_out_of_range_are_refused() {
    let samples = samples(60, 0.5, &mut generator(5));
    let options = [
        TrainOptions { folds: 1, ..options() },
        TrainOptions { components: Components::Count(0), ..options() },
        TrainOptions { components: Components::Variance(1.0), ..options() },
        TrainOptions { components: Components::Variance(f64::NAN), ..options() },
        TrainOptions { costs: vec![0.0], ..options() },
        TrainOptions { gammas: vec![], ..options() },
    ];
    for options in options {
        let result = train("shape-1", &vocabulary(), &samples, &options, &mut generator(5), |_| ());
        assert!(matches!(result, Err(TrainError::Option(_))), "{options:?}");
    }
}

/// Sixty samples of one person, of which no two have anything in common, and near copies of each beside it.
fn samples_that_teach_nothing_of_each_other(rng: &mut ChaCha8Rng) -> Vec<LabelledFeatures> {
    let sample = |i: usize| {
        let features: Vec<f32> = (0..5).map(|_| normal(rng)).collect();
        let mut near = || features.iter().map(|x| x + 0.01 * normal(rng)).collect();
        let variations = vec![near(), near(), near()];
        LabelledFeatures { features, class: ClassId((i % 3) as u32), group: Some(7), variations }
    };
    (0..60).map(sample).collect()
}

#[test]
fn a_sample_is_not_judged_by_what_learned_a_variation_of_it() {
    let mut rng = generator(1);
    let lonely = samples_that_teach_nothing_of_each_other(&mut rng);
    let narrow = TrainOptions { costs: vec![10.0], gammas: vec![10.0], ..TrainOptions::default() };
    let learn = |samples: &[LabelledFeatures]| {
        train("shape-1", &vocabulary(), samples, &narrow, &mut generator(1), |_| ()).unwrap()
    };
    let trained = learn(&lonely);
    assert_eq!(trained.folding, Folding::BySample);
    assert!((0.15..0.55).contains(&trained.accuracy), "chance is a third: {}", trained.accuracy);

    // As if each variation were a picture of its own, it is told what it is to guess.
    let mut apart = lonely.clone();
    for sample in &lonely {
        let alone = |features: &Vec<f32>| LabelledFeatures {
            features: features.clone(),
            variations: Vec::new(),
            ..sample.clone()
        };
        apart.extend(sample.variations.iter().map(alone));
    }
    apart.iter_mut().for_each(|sample| sample.variations.clear());
    assert!(learn(&apart).accuracy > 0.9);
}

#[test]
fn variations_are_learned_and_never_scored() {
    let mut rng = generator(2);
    for people in [12, 240] {
        let mut taught = samples(240, 0.3, &mut rng);
        taught.iter_mut().enumerate().for_each(|(i, sample)| sample.group = Some((i / people) as u32));
        let plain = trained(&taught, 2);
        // Far from all samples, where nothing tells the classes apart.
        for sample in &mut taught {
            sample.variations = vec![(0..5).map(|k| 50.0 + k as f32 + normal(&mut rng)).collect(); 2];
        }
        let varied = trained(&taught, 2);
        assert_eq!(varied.folding, if people == 12 { Folding::ByGroup } else { Folding::BySample });
        assert!(varied.accuracy > 0.95, "{}", varied.accuracy);
        assert!(varied.classifier.support_vectors() > plain.classifier.support_vectors());
    }
}

#[test]
fn a_variation_of_another_length_is_refused() {
    let mut samples = samples(24, 0.3, &mut generator(3));
    samples[4].variations = vec![vec![0.0; 5], vec![0.0; 4]];
    let learn = |samples: &[LabelledFeatures]| {
        train("shape-1", &vocabulary(), samples, &options(), &mut generator(3), |_| ())
    };
    assert_eq!(learn(&samples), Err(TrainError::Length { sample: 4, found: 4, expected: 5 }));
    samples[4].variations[1] = vec![0.0, f32::NAN, 0.0, 0.0, 0.0];
    assert_eq!(learn(&samples), Err(TrainError::NotFinite { sample: 4, component: 1 }));
}

#[test]
fn two_samples_of_each_class_are_enough() {
    let mut rng = generator(6);
    let few: Vec<LabelledFeatures> = (0..6)
        .map(|i| {
            let mut features: Vec<f32> = (0..5).map(|_| 0.1 * normal(&mut rng)).collect();
            features[i % 3] += 1.0;
            LabelledFeatures::new(features, ClassId((i % 3) as u32), None)
        })
        .collect();
    let classifier = trained(&few, 6).classifier;
    assert_eq!(evaluate(&classifier, &few).accuracy().unwrap().value, 1.0);
}

#[test]
fn progress_ends_at_its_total() {
    let mut seen = Vec::new();
    let samples = samples(60, 0.5, &mut generator(5));
    train("s", &vocabulary(), &samples, &options(), &mut generator(5), |p| seen.push(p)).unwrap();
    assert!(seen.windows(2).all(|pair| pair[0].done < pair[1].done));
    assert!(seen.last().is_some_and(|last| last.done == last.total));
}

#[test]
fn what_is_stored_judges_the_same() {
    let samples = samples(90, 0.8, &mut generator(8));
    let classifier = trained(&samples, 8).classifier;
    let read = Classifier::decode(&classifier.encode()).unwrap();
    assert_eq!(read, classifier);
    assert_eq!(
        classifier.encode()[0],
        4,
        "without a head for few showings it is written as before there were any"
    );
    assert_eq!((read.space().feature_set(), read.space().features()), ("shape-1", 5));
    for sample in &samples {
        assert_eq!(read.probabilities(&sample.features), classifier.probabilities(&sample.features));
    }
}

#[test]
fn what_is_judged_at_once_is_what_each_question_gives() {
    let samples = samples(90, 0.8, &mut generator(8));
    let classifier = trained(&samples, 8).classifier;
    for sample in &samples {
        let judgement = classifier.judge(&sample.features).unwrap();
        assert_eq!(Ok(judgement.probabilities), classifier.probabilities(&sample.features));
        assert!(judgement.unknown.is_some() && judgement.view.is_some());
        assert_eq!(judgement.unknown, classifier.unknown(&sample.features));
        assert_eq!(judgement.view, classifier.view(&sample.features));
    }
    assert_eq!(classifier.judge(&[0.0; 4]), Err(ClassifyError::Length { found: 4, expected: 5 }));
}

#[test]
fn the_feature_space_has_a_name_of_its_own() {
    let some = samples(60, 0.5, &mut generator(9));
    let first = trained(&some, 9).classifier;
    let renamed = train("hog-1", &vocabulary(), &some, &options(), &mut generator(9), |_| ()).unwrap();
    assert_ne!(first.space().id(), renamed.classifier.space().id(), "another feature set");
    assert_ne!(
        first.space().id(),
        trained(&some[6..], 9).classifier.space().id(),
        "another scaling and basis"
    );
    assert_eq!(first.space().id(), Classifier::decode(&first.encode()).unwrap().space().id());
}

#[test]
fn bytes_of_another_layout_or_cut_short_are_refused() {
    let bytes = trained(&samples(60, 0.5, &mut generator(9)), 9).classifier.encode();
    let mut other = bytes.clone();
    other[0] = 200;
    assert_eq!(Classifier::decode(&other), Err(ModelError::Version(200)));
    for length in 0..bytes.len() {
        assert!(Classifier::decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    assert!(matches!(Classifier::decode(&longer), Err(ModelError::Inconsistent(_))));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_bytes_give_an_error_or_finite_answers(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)
    ) {
        static BYTES: std::sync::LazyLock<Vec<u8>> =
            std::sync::LazyLock::new(|| trained(&samples(60, 0.5, &mut generator(9)), 9).classifier.encode());
        let mut bytes = BYTES.clone();
        for (index, value) in changes {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        if let Ok(classifier) = Classifier::decode(&bytes) {
            let features = vec![f32::MAX; classifier.space().features()];
            let p = classifier.probabilities(&features).unwrap();
            prop_assert!(p.iter().all(|p| p.is_finite()), "{p:?}");
        }
    }

    #[test]
    fn random_bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = Classifier::decode(&bytes);
        if let Some(first) = bytes.first_mut() {
            *first = 1;
        }
        let _ = Classifier::decode(&bytes);
    }
}
