//! The classifier that is shipped with the weights: support vectors among the embeddings of the hands it was taught with, so
//! that what robots learn on the spot joins what they know already.

use std::error::Error;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Components, LabelledFeatures, ScalingMethod, TrainOptions, Vocabulary, train};
use gestalt_vision::model_file::{Model, Origin};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::counting::{self, Shown};
use crate::scenery::DRAWN;

/// Drawn hands are of so many parts of the cross-validation; each set of real ones is a part of its own.
const DRAWN_PARTS: u32 = 2;

/// Learns the counts from hands of these pools, varied as those that the counter was trained on. `images`: fingerprints of the
/// pictures they are of.
pub fn learn(
    embed: impl FnOnce(&[&[f32]]) -> Vec<Vec<f32>>,
    pools: &[(f32, Vec<Shown>)],
    feature_set: &str,
    images: Vec<u64>,
    samples: usize,
    seed: u64,
) -> Result<Model, Box<dyn Error>> {
    let hands = counting::batch(pools, samples, seed, 0);
    let counted: Vec<_> =
        hands.into_iter().filter(|(_, shown)| shown.hand && shown.count.is_some()).collect();
    let inputs: Vec<&[f32]> = counted.iter().map(|(variation, _)| variation.picture.as_slice()).collect();
    let embeddings = embed(&inputs);
    let samples: Vec<LabelledFeatures> = (0..)
        .zip(counted.iter().zip(embeddings))
        .map(|(i, ((_, shown), features))| LabelledFeatures::new(features, ClassId(shown.count.unwrap_or_default().into()), Some(if shown.origin == DRAWN { DRAWN + i % DRAWN_PARTS } else { shown.origin })))
        .collect();
    let vocabulary = Vocabulary::new(["0", "1", "2", "3", "4", "5"])?;
    let options = TrainOptions {
        scaling: ScalingMethod::Common,
        components: Components::Count(24),
        costs: vec![0.25, 1.0, 4.0],
        gammas: vec![0.125, 0.25, 0.5],
        folds: 5,
    };
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let trained = train(feature_set, &vocabulary, &samples, &options, rng, |_| ())?;
    println!(
        "classifier: {} samples, C {}, gamma {}, {:.3} of sets that it did not learn from, but the networks did, {} support vectors",
        samples.len(),
        trained.cost,
        trained.gamma,
        trained.accuracy,
        trained.classifier.support_vectors()
    );
    let origin = Origin {
        dataset: "drawn hands and sets of pictures: see the model card".to_owned(),
        people: Vec::new(),
        images,
        seed,
        cost: trained.cost,
        gamma: trained.gamma,
    };
    Ok(Model { classifier: trained.classifier, origin })
}
