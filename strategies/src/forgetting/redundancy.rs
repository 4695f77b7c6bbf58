//! What another sample says as well.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use rand::Rng;

use super::contract::Forgetting;
use crate::geometry::Neighbours;
use crate::sample::{HeldSample, HeldSamples, draw, take_out};

/// Of the class K with the most samples (ties at random), personal, shared and external alike,
/// arg min over x of min over x' ≠ x in K of ‖x − x'‖. The two of the closest pair tie: one of them goes at random.
/// Of equally close pairs it is the one with the smaller keys.
///
/// From the source research. Cost: a pass over K per sample that comes, one to find the closest pair, and one per sample whose nearest
/// neighbour has gone once it may be of the closest pair; and all pairs of K when it is first asked for one of K, before which it keeps nothing. Plainly:
/// all pairs of K each time.
///
/// Forgetting after k-center greedy (Sener & Savarese 2018) comes to the same pair: the sample without which the
/// others cover K best is the one that has another nearest.
#[derive(Clone, Debug, Default)]
pub struct Redundancy {
    /// Per class of which one was to go: every sample seeks, and is every other's neighbour.
    classes: BTreeMap<ClassId, Neighbours>,
}

impl Forgetting for Redundancy {
    fn inserted(&mut self, sample: &HeldSample) {
        if let Some(class) = self.classes.get_mut(&sample.class) {
            class.add(sample.key, &sample.vector);
        }
    }

    fn removed(&mut self, sample: &HeldSample) {
        take_out(&mut self.classes, sample.class, |class| {
            class.remove(sample.key);
            class.is_empty()
        });
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let class = samples.draw_largest_class(rng)?;
        let of_class = || {
            let mut all = Neighbours::of_each_other();
            let held = samples.with_keys(samples.class_keys(class));
            held.for_each(|sample| all.add(sample.key, &sample.vector));
            all
        };
        let pair = self.classes.entry(class).or_insert_with(of_class).closest()?;
        match pair.neighbour {
            Some(neighbour) => draw(&[pair.seeker, neighbour], rng),
            None => Some(pair.seeker),
        }
    }
}
