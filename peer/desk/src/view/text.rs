//! Texts from the network, made short.

use gestalt_protocol::ClassId;
use gestalt_strategies::Vocabulary;

/// The longest text that is shown of what others say, in characters.
const MAX_TEXT: usize = 400;

/// The beginning of a text, with a sign where more follows.
#[must_use]
pub fn clipped(text: &str) -> String {
    match text.char_indices().nth(MAX_TEXT) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A gesture in words: its label, or `class 3` where there is no name for it.
pub(super) fn gesture(class: ClassId, vocabulary: Option<&Vocabulary>) -> String {
    let label = vocabulary.and_then(|vocabulary| vocabulary.label(class));
    label.map_or_else(|| format!("class {class}"), str::to_owned)
}

/// A number that others said, or zero where it is none.
pub(super) fn finite(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}
