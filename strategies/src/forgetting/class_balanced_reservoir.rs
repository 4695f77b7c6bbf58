//! An even sample of each class, with the classes as even as the stream allows.

use std::collections::BTreeMap;

use gestalt_protocol::ClassId;
use rand::{Rng, RngExt};

use super::contract::Forgetting;
use crate::sample::{HeldSample, HeldSamples, draw, take_out};

/// Class-balancing reservoir sampling (Chrysakis & Moens, "Online continual learning from imbalanced data", ICML
/// 2020). A class that is or once was the largest of a full set is *full*. The newest sample, of class c,
/// - if c is not full, takes the place of any sample of the largest class (ties at random);
/// - if c is full, stays with probability m / n in place of any other of c, and else goes itself: m samples of c are
///   held, n have come.
///
/// Small classes are kept whole, and full ones are even samples of what came of them. How many came of each class is
/// counted from what the set is told: after a restart, from what is held; of a class of which no sample is left, anew. Cost: a step per class.
#[derive(Clone, Debug, Default)]
pub struct ClassBalancedReservoir {
    classes: BTreeMap<ClassId, Stream>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Stream {
    came: u64,
    held: usize,
    full: bool,
}

impl Forgetting for ClassBalancedReservoir {
    fn inserted(&mut self, sample: &HeldSample) {
        let Stream { came, held, .. } = self.classes.entry(sample.class).or_default();
        *came += 1;
        *held += 1;
    }

    fn removed(&mut self, sample: &HeldSample) {
        if let Some(Stream { came, .. }) = self.classes.get_mut(&sample.class) {
            *came = came.saturating_sub(1);
        }
        self.forgotten(sample);
    }

    fn forgotten(&mut self, sample: &HeldSample) {
        take_out(&mut self.classes, sample.class, |Stream { held, .. }| {
            *held = held.saturating_sub(1);
            *held == 0
        });
    }

    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        // The other way round a class of one sample would be forgotten.
        self.inserted(after);
        self.removed(before);
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let newest = samples.iter().next_back()?;
        let held = |class| samples.class_count(class) - usize::from(class == newest.class);
        let most = samples.classes().map(held).max()?;
        let largest: Vec<ClassId> = samples.classes().filter(|class| held(*class) == most).collect();
        for class in &largest {
            self.classes.entry(*class).or_default().full = true;
        }

        let Stream { came, full, .. } = self.classes.get(&newest.class).copied().unwrap_or_default();
        let kin = held(newest.class);
        if !full || kin == 0 {
            let class = draw(&largest, rng)?;
            draw(samples.class_keys(class), rng)
        } else if rng.random_range(0..came.max(1)) < kin as u64 {
            // The newest has the greatest key, so it is the last of its class.
            draw(&samples.class_keys(newest.class)[..kin], rng)
        } else {
            Some(newest.key)
        }
    }
}
