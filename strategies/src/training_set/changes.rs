//! What becomes of a set when something is done with it.

use gestalt_protocol::{ClassId, SampleId, SampleSeries};

use crate::sample::{HeldSample, SeenError};

/// What an operation changed, in order: the caller stores, trains and broadcasts from it.
#[derive(Clone, Debug, PartialEq)]
pub enum SetChange {
    /// The sample with this key came in. It may be among those removed later in the same list.
    Added(u64),
    /// This sample went.
    Removed(HeldSample),
    /// The sample with this key has another class than this one, which it had before.
    Relabelled(u64, ClassId),
    /// The sample with this key went from personal to shared under this name; its vector is now what travels.
    Shared(u64, SampleId),
    /// What was seen of this series is another set now, without a sample that came: it was forgotten for another series, or gaps in it count as seen.
    Seen(SampleSeries),
}

/// What became of a received sample.
#[derive(Clone, Debug, PartialEq)]
pub enum SampleReceipt {
    /// It was taken in.
    New(Vec<SetChange>),
    /// It was seen before, whether it is still held or not: nothing changed.
    Known,
    /// Its name cannot be remembered within the bounds: nothing changed.
    Refused(SeenError),
}
