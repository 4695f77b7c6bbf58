//! A sample, the samples held, and those ever seen: what rules, training set and learning speak of.

mod batches;
mod by_class;
mod grow;
mod held;
mod in_order;
mod samples;
mod seen;

pub(crate) use batches::Batches;
pub(crate) use by_class::take_out;
pub use held::{HeldSample, SetPart};
pub use samples::{HeldSamples, draw};
pub use seen::{LAST_NUMBER, MAX_GAPS, MAX_INTERVALS_IN_ALL, MAX_LIVES, MAX_SERIES, SeenError, SeenSamples};
