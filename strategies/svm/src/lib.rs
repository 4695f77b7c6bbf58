//! How a robot of a Gestalt swarm tells gestures apart: support vector machines in a small feature space.
//!
//! Pure: no clock, no entropy, no socket, no file. Random generators are arguments. The entry types are [`Learner`], which
//! brings machines up to date as samples come and go, and the [`Classifier`] it makes.
//!
//! ```text
//! raw features ─► Scaling ─► Reduction ─► coordinates ─► Machine: a decision per pair ─► Calibration ─► P(k)
//!                 └────── FeatureSpace ──────┘     │                                          ▲
//!                                                  └──► Head for few showings: odds of pairs ─┘   (all of this: Classifier)
//! ```
//!
//! With the feature `offline`, `train` makes a classifier of many samples at once: it searches for C and γ by
//! cross-validation, with linfa's solver, which nothing else compiles.

mod calibration;
mod classifier;
mod coupling;
mod evaluation;
mod familiarity;
mod feature_space;
mod head;
mod labelled;
mod learner;
mod machine;
mod model_codec;
mod no_hand;
mod panel;
mod reduction;
mod scaling;
mod scatter;
mod sigmoid;
#[cfg(feature = "offline")]
mod training;
mod vector;

pub use classifier::{Classifier, Machines};
pub use evaluation::{CALIBRATION_BINS, Evaluation, Proportion};
pub use feature_space::FeatureSpace;
pub use head::{Discriminant, DiscriminantSums, Head, Shown, Teach};
pub use labelled::LabelledFeatures;
pub use learner::{LearnError, Learner, LearnerOptions, SharedKernel};
pub use model_codec::{MAX_MODEL, ModelError};
pub use panel::Certified;
pub use reduction::{Components, Pca, Ranking, Reduction};
pub use scaling::{Scaling, ScalingMethod};
#[cfg(feature = "offline")]
pub use training::{Folding, MIN_SAMPLES, TrainError, TrainOptions, TrainProgress, Trained, train};
