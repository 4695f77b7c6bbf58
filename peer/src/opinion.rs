//! What one robot takes a hand for.

use std::time::Duration;

use gestalt_protocol::{ClassId, Opinion};
use gestalt_strategies::Classify;

/// The likeliest class and its probability; `None` of no classes.
#[must_use]
pub fn likeliest(probabilities: &[f64]) -> Option<(ClassId, f64)> {
    let by_class = (0..).map(ClassId).zip(probabilities.iter().copied());
    by_class.max_by(|(_, a), (_, b)| a.total_cmp(b))
}

/// What a classifier takes a hand for that was seen at that time of its robot; `None` when it cannot judge it.
pub(crate) fn opinion(classifier: &dyn Classify, features: &[f32], at: Duration) -> Option<Opinion> {
    let (class, probability) = likeliest(&classifier.probabilities(features).ok()?)?;
    let gesture = classifier.vocabulary().label(class)?.to_owned();
    let at_ms = u64::try_from(at.as_millis()).unwrap_or(u64::MAX);
    Some(Opinion { gesture, probability: probability as f32, at_ms })
}
