//! The contract of a selection rule.

use std::fmt::Debug;

use gestalt_rounds::Classify;
use rand::Rng;

use crate::sample::{HeldSample, HeldSamples};

/// Says which personal sample to share next.
///
/// A rule is told of every change of the set, so that it can keep distances up to date instead of computing them
/// anew at each choice; a rule that needs none of that only writes `select`. What it picks may depend on what is
/// held, on the classifier and on the generator handed in, and on nothing else.
///
/// ```
/// use gestalt_protocol::{ClassId, RobotId, RoundId};
/// use gestalt_strategies::sample::{SetPart, HeldSamples};
/// use gestalt_strategies::{Classify, ForgettingRule, Selection, TrainingSet};
/// use rand::{Rng, SeedableRng};
/// use rand_chacha::ChaCha8Rng;
///
/// /// The newest first: what is shown now is what the swarm talks about.
/// #[derive(Debug)]
/// struct Newest;
///
/// impl Selection for Newest {
///     fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
///         let class = samples.draw_personal_class(rng)?;
///         samples.part_keys(SetPart::Personal, class).last().copied()
///     }
/// }
///
/// let mut rng = ChaCha8Rng::seed_from_u64(1);
/// let mut set = TrainingSet::new(RobotId(1), 100, Box::new(Newest), ForgettingRule::default().build());
/// for counter in 1..=3 {
///     let round = RoundId { counter, opener: RobotId(1), life: 0 };
///     set.keep(ClassId(0), round, vec![counter as f32], &mut rng);
/// }
/// set.share(1, None, &|vector| vector.to_vec(), &mut rng);
/// let shared = set.common().next().expect("one sample was shared");
/// assert_eq!(shared.round.counter, 3);
/// ```
pub trait Selection: Debug + Send {
    /// A sample came in, in any part; it is not among the samples yet.
    fn inserted(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample went.
    fn removed(&mut self, sample: &HeldSample) {
        let _ = sample;
    }

    /// A sample has another class, or went from personal to shared, maybe with another vector. By default the old
    /// one goes and the new one comes.
    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        self.removed(before);
        self.inserted(after);
    }

    /// The key of the personal sample to share next, or `None` when there is none. Any other answer ends the
    /// sharing.
    fn select(
        &mut self,
        samples: &HeldSamples,
        classifier: Option<&dyn Classify>,
        rng: &mut dyn Rng,
    ) -> Option<u64>;
}
