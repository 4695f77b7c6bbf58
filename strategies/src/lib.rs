//! The mind of a robot of a Gestalt swarm: it decides with the others and learns from what it is told.
//!
//! Pure: no clock, no entropy, no socket, no file, no camera. Time and random generators are arguments, so on one machine
//! the same inputs give the same outputs, byte for byte. The entry type is [`Mind`]: a state machine with one verb,
//! `handle(now, input) -> outputs`, which a host (real Zenoh or an emulated network) feeds and obeys.
//!
//! ```text
//! Observation ─► Rounds (gestalt-rounds): votes, ballot, fusion, agreement ─► Decision
//!      │            ▲ votes and decisions of others
//!      │            └─ Classifier (gestalt-svm) ◄─ Train
//!      └─► Learning: looks ─ labelled by instructors ─► TrainingSet ─ selection ─► samples for others
//!                                                            └─ forgetting ─► what is not worth its place
//! ```
//!
//! Who wants decisions and no learning takes `gestalt-rounds` alone; who wants classifiers, `gestalt-svm`. What a host
//! needs of both is re-exported here.

mod asking;
mod believe;
mod candidates;
pub mod forgetting;
pub mod geometry;
mod groups;
mod learning;
mod lessons;
pub mod mind;
mod names;
pub mod sample;
mod scrutiny;
pub mod selection;
mod shares;
mod training_set;
mod vector_codec;

pub use asking::{Occasion, QuestionBudget, QuestionsConfig, QuestionsConfigError, worth_asking};
pub use believe::{Believe, Standing};
pub use candidates::Candidates;
pub use forgetting::{Forgetting, ForgettingRule};
pub use gestalt_rounds::{
    Ballot, Classify, ClassifyError, Doubt, Evidence, Fuse, JudgedFrame, Judgement, Life, Observation,
    Quorum, Refusal, Refusals, Sign, Vocabulary, VocabularyError, Voter, follows, fusion, is_refuted,
    outcome,
};
pub use gestalt_svm::{
    CALIBRATION_BINS, Certified, Classifier, Components, Discriminant, Evaluation, FeatureSpace, Head,
    LabelledFeatures, LearnError, Learner, LearnerOptions, MAX_MODEL, Machines, ModelError, Pca, Proportion,
    Ranking, Reduction, Scaling, ScalingMethod, SharedKernel, Shown, Teach,
};
#[cfg(feature = "offline")]
pub use gestalt_svm::{Folding, MIN_SAMPLES, TrainError, TrainOptions, TrainProgress, Trained, train};
pub use learning::{
    LearningConfig, LearningConfigError, LearningError, LearningSetup, MemoryError, OwnRules, RecordChange,
    RobotMemory, Shelf, ToTrain, TrainingChange, Untrained,
};
pub use lessons::{LessonBook, LessonReceipt, Verdict};
pub use mind::{Input, Instructed, Mind, MindConfig, MindConfigError, Output};
pub use names::{NameBook, NamingReceipt};
pub use sample::{HeldSample, HeldSamples, SeenError, SeenSamples, SetPart};
pub use scrutiny::PoisonDefence;
pub use selection::{Selection, SelectionRule};
pub use training_set::{RestoreError, SampleReceipt, SetChange, TrainingSet};
pub use vector_codec::{Precision, VectorError, decode_vector};
