//! How a robot of a Gestalt swarm decides and learns.
//!
//! Pure: no clock, no entropy, no socket, no file, no camera. Time and random generators are arguments, so the
//! same inputs give the same outputs on every machine, byte for byte. The entry type is [`Mind`]: a state machine
//! with one verb, `handle(now, input) -> outputs`, which a host (real Zenoh or an emulated network, both in
//! `gestalt-peer`) feeds and obeys.
//!
//! ```text
//! Observation ─► Classifier ─► opinion ─► Round (evidence) ─► my Vote ─► Ballot ─► fusion ─► Decision
//!                                                      votes of others ──┘                     │
//!                                                      decisions of others ─── the greatest wins ┘
//! ```

mod agreement;
pub mod ballot;
mod classifier;
mod classify;
mod coding;
mod evaluation;
mod evidence;
mod feature_space;
mod fnv;
pub mod forgetting;
pub mod fusion;
mod learner;
mod lessons;
pub mod mind;
mod observation;
mod reduction;
mod round;
mod scaling;
pub mod selection;
mod training;
pub mod training_set;
mod vocabulary;
mod voter;

pub use ballot::Ballot;
pub use classifier::{Classifier, MAX_MODEL, ModelError};
pub use classify::{Classify, ClassifyError};
pub use coding::{Precision, VectorError, decode_vector};
pub use evaluation::{CALIBRATION_BINS, Evaluation, Proportion};
pub use evidence::{Evidence, Look};
pub use feature_space::FeatureSpace;
pub use forgetting::{Forgetting, ForgettingRule};
pub use learner::{LearnError, Learner, LearnerOptions};
pub use lessons::{Candidates, Heard, LessonBook, Verdict};
pub use mind::{
    Change, Input, Instructed, LearningConfig, LearningConfigError, LearningError, LearningSetup, Memory,
    MemoryError, Mind, MindConfig, MindConfigError, Output, Refusal, Refusals, TrainingChange,
};
pub use observation::Observation;
pub use reduction::{Components, Pca, Ranking, Reduction};
pub use scaling::{Scaling, ScalingMethod};
pub use selection::{Selection, SelectionRule};
pub use training::{Folding, MIN_SAMPLES, Progress, Sample, TrainError, TrainOptions, Trained, train};
pub use training_set::{HeldSample, Part, Receipt, RestoreError, Seen, SeenError, SetChange, TrainingSet};
pub use vocabulary::{Vocabulary, VocabularyError};
pub use voter::Voter;
