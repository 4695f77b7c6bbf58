//! The course that the networks take: each is taught with what those before it get wrong.

use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use gestalt_vision::model_file::Model;
use gestalt_vision::network::{Counter, FeatureMap};

use crate::networks::encode;
use crate::photos::Photos;
use crate::pools::pools;
use crate::robots::Weights;
use crate::scenery::{self, Scenery};
use crate::{counting, frames, mining, model, sheets, train};

/// How to take it.
#[derive(Clone, Copy)]
pub struct Course {
    /// Share of the usual steps and pictures.
    pub effort: f32,
    pub seed: u64,
    pub began: Instant,
}

/// What comes of it.
pub struct Taught {
    /// Weights as they are shipped: of finder, refiner and counter.
    pub weights: [Vec<u8>; 3],
    pub model: Model,
}

impl Course {
    fn tell(&self, what: &str) {
        println!("[{:.0} s] {what}", self.began.elapsed().as_secs_f32());
    }

    fn some(&self, n: usize) -> usize {
        ((n as f32 * self.effort) as usize).max(64)
    }

    /// The hands and rooms it is taken with.
    fn scenery(&self, photos: Photos) -> Scenery {
        for (set, all) in photos.by_set() {
            self.tell(&format!("{set}: {} hands", all.len()));
        }
        let nothing: usize = photos.empty.iter().map(|(_, pictures)| pictures.len()).sum();
        self.tell(&format!("{} faces, {nothing} pictures without hands", photos.faces.len()));
        let scenery = Scenery::new(photos, scenery::drawn_hands(self.some(14_000), self.seed));
        self.tell("hands drawn");
        scenery
    }

    /// Draws sheets of what the networks would be shown.
    pub fn show(&self, photos: Photos, out: &Path) -> Result<(), Box<dyn Error>> {
        let scenery = self.scenery(photos);
        let frames = frames::frames(&scenery, self.seed + 1, 60);
        let crops = frames::crops(&scenery, self.seed + 2, 100);
        sheets::all(out, &scenery, &frames, &crops)
    }

    pub fn take(&self, photos: Photos) -> Result<Taught, Box<dyn Error>> {
        let Self { seed, .. } = *self;
        let images = photos.fingerprints()?;
        let scenery = self.scenery(photos);
        let mut frames = frames::frames(&scenery, seed + 1, self.some(16_000));
        let mut crops = frames::crops(&scenery, seed + 2, self.some(24_000));
        self.tell(&format!("{} frames and {} crops made", frames.len(), crops.len()));
        // Of finder and refiner, each time.
        let steps = self.some(5000);
        let (finder, refiner) = rayon::join(
            || train::finder(&frames, None, steps, 4e-3, seed + 3),
            || train::refiner(&crops, None, steps, 4e-3, seed + 4),
        );
        self.tell("finder and refiner trained");
        let mut mined = mining::mine(&scenery, &Weights::of(&finder, &refiner), seed + 5, self.some(7000));
        self.tell(&format!(
            "close looks at {} hands and {} others; something was taken for a hand in {} frames",
            mined.hands.len(),
            mined.others.len(),
            mined.frames.len(),
        ));
        // About half of it is new, the rest a reminder.
        frames.truncate(self.some(8000));
        crops.truncate(self.some(10_000));
        frames.extend(std::mem::take(&mut mined.frames));
        crops.extend(mined.crops());
        let (finder, refiner) = rayon::join(
            || train::finder(&frames, Some(finder), steps, 2e-3, seed + 6),
            || train::refiner(&crops, Some(refiner), steps, 2.5e-3, seed + 7),
        );
        self.tell("finder and refiner trained again");
        drop((frames, crops));
        let pools = pools(&scenery, &Weights::of(&finder, &refiner), seed + 8, self.some(8000));
        for (share, pool) in &pools {
            self.tell(&format!("{} hands at {share:.2}", pool.len()));
        }
        let mut counter = rayon::scope(|_| train::counter(&pools, self.some(12_000), 4e-3, seed + 9));
        self.tell("counter trained");
        let weights =
            [finder.weights(), refiner.weights(), counter.weights()].map(|weights| encode(&weights));
        let embed = |inputs: &[&[f32]]| train::embed(&mut counter, inputs);
        let model = model::learn(embed, &pools, &name(&weights), images, self.some(2400), seed + 10)?;
        self.tell("classifier trained");
        Ok(Taught { weights, model })
    }

    /// Only the classifier: with networks that are as they are, of pictures that they may never have seen. `seen`: fingerprints of those that
    /// they were made with.
    pub fn classify(
        &self,
        photos: Photos,
        weights: [Vec<u8>; 3],
        seen: Vec<u64>,
    ) -> Result<Taught, Box<dyn Error>> {
        let Self { seed, .. } = *self;
        let images = of_both(seen, photos.fingerprints()?);
        let scenery = self.scenery(photos);
        let mut counter = Counter::decode(&weights[2])?;
        let robots = Weights::new(weights[0].clone(), weights[1].clone());
        let pools = pools(&scenery, &robots, seed + 8, self.some(8000));
        let embed = |inputs: &[&[f32]]| {
            let mut map = FeatureMap::new(2, counting::SIDE, counting::SIDE);
            let each = inputs.iter().map(|input| {
                map.values_mut().copy_from_slice(input);
                counter.run(&map).embedding.to_vec()
            });
            each.collect()
        };
        let model = model::learn(embed, &pools, &name(&weights), images, self.some(2400), seed + 10)?;
        self.tell("classifier trained");
        Ok(Taught { weights, model })
    }
}

/// The fingerprints of the networks' pictures and of the classifier's, ascending, each once.
fn of_both(networks: Vec<u64>, classifier: Vec<u64>) -> Vec<u64> {
    let all: BTreeSet<u64> = networks.into_iter().chain(classifier).collect();
    all.into_iter().collect()
}

/// The name of the feature space of these weights.
pub fn name(weights: &[Vec<u8>; 3]) -> String {
    let [finder, refiner, counter] = weights;
    gestalt_vision::perception::embedding_name(gestalt_vision::network::checksum([finder, refiner, counter]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_classifier_made_anew_forgets_no_picture_of_its_networks() {
        assert_eq!(of_both(vec![2, 7, 9], vec![1, 7]), [1, 2, 7, 9]);
    }
}
