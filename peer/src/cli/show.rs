//! Decisions and robots in words, and results as lines on stdout.

use std::fmt::Write as _;

use gestalt_protocol::{ClassId, Decision, FusionRule, RobotId};
use serde_json::Value;

use super::Failure;

/// Prints one result on a line of its own: as a JSON object, or in words.
pub(super) fn line(as_json: bool, object: &Value, words: &str) -> Result<(), Failure> {
    super::say(&if as_json { format!("{object}\n") } else { format!("{words}\n") })
}

/// A decision with its certificate in short: `round 3@1: three .998 (8 robots in 812 ms, log pool: 1→3 2→2 …)`.
pub(super) fn decision(decision: &Decision, label: Option<&str>) -> String {
    let Decision { round, class, confidence, certificate, .. } = decision;
    let what = match (class, label) {
        (Some(_), Some(label)) => label.to_owned(),
        (Some(class), None) => format!("class {class}"),
        (None, _) => "no decision".to_owned(),
    };
    let rule = match &certificate.rule {
        FusionRule::Majority => "majority",
        FusionRule::MeanProbability => "mean of probabilities",
        FusionRule::LogPool => "log pool",
        FusionRule::ConfidenceWeighted => "confidence-weighted pool",
        FusionRule::Other(name) => name.as_str(),
    };
    let mut words = format!(
        "round {round}: {what} {confidence:.3} ({} robots in {} ms, {rule}:",
        certificate.votes.len(),
        certificate.elapsed_ms
    );
    // The first votes show how it came about; a large swarm's would fill the screen.
    const SHOWN: usize = 12;
    for vote in certificate.votes.iter().take(SHOWN) {
        let ClassId(class) = vote.class;
        // Writing to a string cannot fail.
        let _ = write!(words, " {}→{class}", vote.robot);
    }
    if certificate.votes.len() > SHOWN {
        words.push_str(" …");
    }
    words.push(')');
    words
}

/// `1 2 3`, or `nobody`.
pub(super) fn robots<'a>(robots: impl IntoIterator<Item = &'a RobotId>) -> String {
    let ids: Vec<String> = robots.into_iter().map(ToString::to_string).collect();
    if ids.is_empty() { "nobody".to_owned() } else { ids.join(" ") }
}
