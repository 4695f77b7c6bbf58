//! From many labelled feature vectors at once to a classifier: the offline trainer.

mod calibrating;
mod error;
mod folds;
mod one_vs_one;
mod options;
mod search;
mod train;

pub use error::{MIN_SAMPLES, TrainError};
pub use folds::Folding;
pub use options::TrainOptions;
pub use train::{TrainProgress, Trained, train};
