//! What covers all that was seen with the fewest samples.

use gestalt_rounds::Classify;
use rand::Rng;

use super::contract::Selection;
use crate::geometry::{ExactSum, Neighbours, narrow};
use crate::sample::{HeldSample, HeldSamples, SetPart};

/// So many samples may come and go between two choices before the distances are dropped.
const IDLE: usize = 250;

/// arg max over all personal x of min over all shared and external x' of ‖x − x'‖, whatever their classes: the point
/// that the centres so far cover worst becomes the next. With no common knowledge at all the one nearest to the
/// centroid of the personal samples. Ties go to the oldest; there is nothing random.
///
/// The greedy k-center algorithm (Gonzalez 1985), within a factor of 2 of the best cover, as used to choose core sets
/// (Sener & Savarese, ICLR 2018), which do not look at classes. Within a class it would be
/// [`Novelty`](super::Novelty), and it is kept up to date in the same way, at the same cost, over all classes; but only from the first choice on, and not
/// where hundreds of samples came and went since the last: in a large swarm a robot seldom has anything to share.
#[derive(Clone, Debug, Default)]
pub struct KCenter(Option<Kept>);

/// What the choice follows from.
#[derive(Clone, Debug, Default)]
struct Kept {
    /// The personal samples seek, the common ones are their neighbours.
    distances: Neighbours,
    /// The sum of the personal ones.
    personal: ExactSum,
    /// How many samples came and went since the last choice.
    idle: usize,
}

impl Kept {
    fn of(samples: &HeldSamples) -> Self {
        let mut kept = Self::default();
        samples.iter().for_each(|sample| kept.inserted(sample));
        kept
    }

    fn inserted(&mut self, sample: &HeldSample) {
        self.idle += 1;
        match sample.part {
            SetPart::Personal => {
                self.distances.add_seeker(sample.key, &sample.vector);
                self.personal.add(&sample.vector);
            }
            SetPart::Shared | SetPart::External => self.distances.add_neighbour(sample.key, &sample.vector),
        }
    }

    fn removed(&mut self, sample: &HeldSample) {
        self.idle += 1;
        match sample.part {
            SetPart::Personal => {
                self.distances.remove_seeker(sample.key);
                self.personal.subtract(&sample.vector);
            }
            SetPart::Shared | SetPart::External => self.distances.remove_neighbour(sample.key),
        }
    }

    fn choose(&mut self) -> Option<u64> {
        self.idle = 0;
        if self.distances.has_neighbours() {
            self.distances.farthest().map(|pair| pair.seeker)
        } else {
            self.distances.seekers().nearest_to(&narrow(self.personal.mean()?))
        }
    }
}

impl KCenter {
    /// Keeps what is kept up to date, unless nobody has asked for so long.
    fn follow(&mut self, change: impl FnOnce(&mut Kept)) {
        if let Some(kept) = self.0.as_mut().filter(|kept| kept.idle < IDLE) {
            change(kept);
        } else {
            self.0 = None;
        }
    }
}

impl Selection for KCenter {
    fn inserted(&mut self, sample: &HeldSample) {
        self.follow(|kept| kept.inserted(sample));
    }

    fn removed(&mut self, sample: &HeldSample) {
        self.follow(|kept| kept.removed(sample));
    }

    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        // Another class makes no difference.
        if before.part != after.part {
            self.removed(before);
            self.inserted(after);
        }
    }

    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, _: &mut dyn Rng) -> Option<u64> {
        self.0.get_or_insert_with(|| Kept::of(samples)).choose()
    }
}
