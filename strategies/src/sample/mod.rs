//! A sample, the samples held, and those ever seen: what rules, training set and learning speak of.

mod batches;
mod samples;
mod seen;

pub(crate) use batches::Batches;
pub use samples::{HeldSample, HeldSamples, SetPart, draw};
pub use seen::{LAST_NUMBER, MAX_GAPS, MAX_INTERVALS_IN_ALL, MAX_LIVES, MAX_SERIES, SeenError, SeenSamples};
