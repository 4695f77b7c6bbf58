//! What all robots that learn have in common.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classifier, Components, FeatureSpace, LearnError, Learner, LearnerOptions, ScalingMethod, SharedKernel,
    Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::observer::Observer;

/// What all learning robots of a swarm have in common. It is shared between them, and between runs.
#[derive(Clone, Debug)]
pub struct School {
    space: Arc<FeatureSpace>,
    vocabulary: Vocabulary,
    start: Option<Arc<Classifier>>,
    options: LearnerOptions,
    kernel: Arc<SharedKernel>,
}

impl School {
    /// Robots that learn in that space, from that classifier on or from nothing.
    ///
    /// # Errors
    /// A space, a classifier or options that no [`Learner`] works with.
    pub fn new(
        space: Arc<FeatureSpace>,
        vocabulary: Vocabulary,
        start: Option<Arc<Classifier>>,
        options: LearnerOptions,
    ) -> Result<Self, LearnError> {
        let plain = Learner::new(space.clone(), vocabulary.clone(), options.clone())?;
        let school = Self { space, vocabulary, start, options, kernel: Arc::new(plain.shared_kernel()) };
        school.learner()?;
        Ok(school)
    }

    /// The school of robots that see class scores: their space is that of the scores, and they start from nothing.
    pub(super) fn of_scores(
        observer: &mut dyn Observer,
        vocabulary: Vocabulary,
        options: LearnerOptions,
    ) -> Result<Self, LearnError> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let classes = vocabulary.classes();
        let mut rows = Vec::new();
        for n in 0..30 * classes {
            observer.show(ClassId((n % classes) as u32), &mut rng);
            rows.extend(observer.frame(&mut rng).map(|observation| observation.features));
        }
        let rows = rows.iter().map(Vec::as_slice);
        let keep = Components::Count(classes);
        let space = FeatureSpace::fit("scores", rows, ScalingMethod::PerComponent, keep, &mut rng);
        Self::new(Arc::new(space), vocabulary, None, options)
    }

    /// The space all learn in.
    #[must_use]
    pub fn space(&self) -> &Arc<FeatureSpace> {
        &self.space
    }

    /// The gestures there are to be learned.
    #[must_use]
    pub fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    /// What robots start from; nothing where there is none.
    #[must_use]
    pub fn start(&self) -> Option<&Arc<Classifier>> {
        self.start.as_ref()
    }

    /// The same for a run: what its robots work out together they share with no other run's.
    pub(super) fn begun(&self) -> Self {
        Self { kernel: Arc::new(self.kernel.emptied()), ..self.clone() }
    }

    /// The kernel of what robots of one run hold alike.
    pub(super) fn kernel(&self) -> &SharedKernel {
        &self.kernel
    }

    /// The machine of a robot that starts.
    pub(super) fn learner(&self) -> Result<Learner, LearnError> {
        let learner = Learner::new(self.space.clone(), self.vocabulary.clone(), self.options.clone())?;
        let mut learner = learner.sharing(self.kernel.clone());
        if let Some(start) = &self.start {
            learner.build_on(start)?;
        }
        Ok(learner)
    }
}
