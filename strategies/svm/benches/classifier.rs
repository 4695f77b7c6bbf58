//! What judging and training cost: `cargo bench -p gestalt-svm --bench classifier`.

use divan::{Bencher, black_box};
use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{Classifier, Components, LabelledFeatures, ScalingMethod, TrainOptions, train};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 10;

fn main() {
    divan::main();
}

/// As many samples as the people of one training set give, of as many features as `length`.
fn samples(length: usize) -> Vec<LabelledFeatures> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let centres: Vec<Vec<f32>> =
        (0..CLASSES).map(|_| (0..length).map(|_| rng.random_range(-1.0..1.0)).collect()).collect();
    (0..1000)
        .map(|i| {
            let class = i % CLASSES;
            let features = centres[class].iter().map(|c| c + rng.random_range(-4.0..4.0)).collect();
            LabelledFeatures::new(features, ClassId(class as u32), Some((i / CLASSES) as u32))
        })
        .collect()
}

fn fit(samples: &[LabelledFeatures]) -> Classifier {
    let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).expect("ten different labels");
    let options = TrainOptions {
        scaling: ScalingMethod::PerComponent,
        components: Components::Count(60),
        costs: vec![4.0],
        gammas: vec![0.5],
        folds: 5,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    train("bench", &vocabulary, samples, &options, &mut rng, |_| ()).expect("good samples").classifier
}

/// One frame: from raw features (110 of a shape, 1,764 of gradients) to ten probabilities.
#[divan::bench(args = [110, 1764])]
fn probabilities(bencher: Bencher, length: usize) {
    let samples = samples(length);
    let classifier = fit(&samples);
    bencher.bench_local(|| classifier.probabilities(black_box(&samples[0].features)));
}

/// One pair of parameters: five folds and the final machine, with their principal components.
#[divan::bench(args = [110, 1764], sample_count = 3)]
fn training(bencher: Bencher, length: usize) {
    let samples = samples(length);
    bencher.bench_local(|| fit(black_box(&samples)));
}
