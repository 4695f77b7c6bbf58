//! What makes an emulated robot learn: its teaching, the space it learns in, its memory and its machines.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, RobotId};
use gestalt_strategies::{
    Change, Classifier, Components, FeatureSpace, LearnError, Learner, LearnerOptions, LearningConfig,
    LearningSetup, Memory, Mind, MindConfig, OwnRules, ScalingMethod, TrainingChange, Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::observer::Observer;

/// How robots are taught, and how they learn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Teaching {
    /// What the instructor says of each gesture shown.
    pub feedback: Feedback,
    /// How long after a gesture is shown the instructor speaks.
    #[serde(with = "humantime_serde")]
    pub after: Duration,
    /// How every robot learns.
    pub robots: LearningConfig,
}

impl Default for Teaching {
    fn default() -> Self {
        Self {
            feedback: Feedback::default(),
            after: Duration::from_secs(5),
            robots: LearningConfig::default(),
        }
    }
}

/// What a scripted instructor says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// Which gesture it was.
    #[default]
    Full,
    /// Whether the decision was right; nothing where there is none.
    Partial,
    /// Nothing: robots stay with what they know.
    None,
}

/// What all learning robots of a swarm have in common. It is shared between them, and between runs.
#[derive(Clone, Debug)]
pub struct School {
    space: Arc<FeatureSpace>,
    vocabulary: Vocabulary,
    start: Option<Arc<Classifier>>,
    options: LearnerOptions,
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
        let school = Self { space, vocabulary, start, options };
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
            observer.show(ClassId((n % classes) as u8), &mut rng);
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

    fn learner(&self) -> Result<Learner, LearnError> {
        let mut learner = Learner::new(self.space.clone(), self.vocabulary.clone(), self.options.clone())?;
        if let Some(start) = &self.start {
            learner.build_on(start)?;
        }
        Ok(learner)
    }
}

/// One robot that learns: its disk outlives it.
#[derive(Debug, Default)]
pub(super) struct Pupil {
    disk: BTreeMap<Vec<u8>, Vec<u8>>,
    /// The revision on the disk.
    pub remembered: u64,
    learner: Option<Learner>,
    /// What the classifier has not followed yet.
    due: Vec<TrainingChange>,
    classifier: Option<Arc<Classifier>>,
}

impl Pupil {
    /// The mind of this robot, with what its disk holds.
    pub fn start(
        &mut self,
        (me, boot): (RobotId, u32),
        mind: MindConfig,
        school: &School,
        config: &LearningConfig,
        rng: ChaCha8Rng,
    ) -> Mind {
        let records = self.disk.iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
        let memory = Memory::read(records).expect("it holds what this robot's minds wrote");
        self.stop();
        self.classifier = school.start.clone();
        self.learner = Some(school.learner().expect("the school was tried when it was made"));
        let setup = LearningSetup {
            config: config.clone(),
            space: school.space.clone(),
            vocabulary: school.vocabulary.clone(),
            rng: Box::new(rng),
            memory: Some(memory),
            rules: OwnRules::default(),
        };
        Mind::new(me, boot, mind)
            .expect("the scenario was validated")
            .learning(setup)
            .expect("the scenario was validated, and the memory is this robot's own")
    }

    /// Loses what is on no disk.
    pub fn stop(&mut self) {
        (self.remembered, self.learner, self.classifier) = (0, None, None);
        self.due.clear();
    }

    pub fn remember(&mut self, revision: u64, changes: Vec<Change>) {
        for Change { key, value } in changes {
            match value {
                Some(value) => self.disk.insert(key, value),
                None => self.disk.remove(&key),
            };
        }
        self.remembered = revision;
    }

    pub fn train_later(&mut self, changes: Vec<TrainingChange>) {
        self.due.extend(changes);
    }

    /// The classifier, brought up to date, and whether that changed it.
    pub fn learn(&mut self) -> Option<Arc<Classifier>> {
        let learner = self.learner.as_mut().filter(|_| !self.due.is_empty())?;
        for change in self.due.drain(..) {
            change.apply_to(learner).expect("a mind trains on vectors of the school's space and classes");
        }
        self.classifier = Some(learner.learn().expect("a learner learns from any samples it took"));
        self.classifier.clone()
    }

    pub fn classifier(&self) -> Option<&Arc<Classifier>> {
        self.classifier.as_ref()
    }
}
