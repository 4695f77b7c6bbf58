//! The contract of a forgetting rule.

use std::fmt::Debug;

use rand::Rng;

use crate::sample::{HeldSample, HeldSamples};

/// Says which sample goes when the set holds more than its capacity.
///
/// A rule is told of every change of the set, so that it can keep distances up to date instead of computing them
/// anew each time; a rule that needs none of that only writes `victim`. What it picks may depend on what it was
/// told of and on the generator handed in, and on nothing else. What it keeps of a class it drops with the last sample of
/// that: who takes part in a swarm can make up classes without end.
///
/// ```
/// use gestalt_protocol::{ClassId, RobotId, RoundId};
/// use gestalt_strategies::sample::HeldSamples;
/// use gestalt_strategies::{Forgetting, SelectionRule, TrainingSet};
/// use rand::{Rng, SeedableRng};
/// use rand_chacha::ChaCha8Rng;
///
/// /// The first impression counts: whatever comes when the set is full goes at once.
/// #[derive(Debug)]
/// struct FirstImpression;
///
/// impl Forgetting for FirstImpression {
///     fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
///         samples.iter().next_back().map(|newest| newest.key)
///     }
/// }
///
/// let mut rng = ChaCha8Rng::seed_from_u64(1);
/// let mut set = TrainingSet::new(RobotId(1), 2, SelectionRule::default().build(), Box::new(FirstImpression));
/// for counter in 1..=3 {
///     let round = RoundId { counter, opener: RobotId(1), life: 0 };
///     set.keep(ClassId(0), round, vec![counter as f32], &mut rng);
/// }
/// assert!(set.iter().map(|sample| sample.round.counter).eq([1, 2]));
/// ```
pub trait Forgetting: Debug + Send {
    /// A sample came in, in any part; it is not among the samples yet.
    fn inserted(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample went that is to count as never come: it was retracted, or its author had more than its share of a full set.
    fn removed(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample was forgotten: the [`victim`](Self::victim), or another in its place, where that one's author, or its class, has little. By default
    /// as if it was removed.
    fn forgotten(&mut self, sample: &HeldSample) {
        self.removed(sample);
    }

    /// A sample has another class, or went from personal to shared, maybe with another vector. By default the old
    /// one goes and the new one comes.
    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        self.removed(before);
        self.inserted(after);
    }

    /// The key of the sample to forget. Asked when the set, the newest sample included, holds more than its
    /// capacity. If the answer is no sample that is held, the oldest goes.
    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64>;
}
