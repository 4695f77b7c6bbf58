//! The outcome of a measurement, as text and as JSON.

use std::path::Path;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Evaluation, Proportion, Vocabulary};
use serde_json::json;

use gestalt_draw::confusion;
use gestalt_vision::dataset::Ignored;
use gestalt_vision::survey::{FalseAlarms, Rejected, Survey};

/// The accuracy over all images that can be read: one whose hand is not found is not judged right.
pub fn of_all(evaluation: &Evaluation, survey: &Survey) -> Option<Proportion> {
    let right = (0..).zip(evaluation.confusion()).map(|(class, row): (usize, _)| row[class]).sum();
    Proportion::wilson(right, evaluation.count() + survey.without_hand.len() as u64)
}

/// The measurement as text.
pub fn text(evaluation: &Evaluation, survey: &Survey, vocabulary: &Vocabulary) -> String {
    let mut text = format!("  accuracy          {}\n", proportion(evaluation.accuracy()));
    if !survey.without_hand.is_empty() {
        text += &format!(
            "  incl. no hand     {}   no hand found in {} images\n",
            proportion(of_all(evaluation, survey)),
            survey.without_hand.len()
        );
    }
    if let (Some(error), Some(loss)) = (evaluation.calibration_error(), evaluation.log_loss()) {
        text += &format!("  calibration error {error:.3}   log loss {loss:.3}\n");
    }
    text + "\n" + &confusion::table(evaluation, vocabulary)
}

/// The measurement as a JSON object.
pub fn json(evaluation: &Evaluation, survey: &Survey, vocabulary: &Vocabulary) -> serde_json::Value {
    let classes: Vec<_> = (0_u32..)
        .zip(vocabulary.labels())
        .map(|(class, label)| {
            json!({
                "gesture": label,
                "precision": evaluation.precision(ClassId(class)).map(|p| p.value),
                "recall": evaluation.recall(ClassId(class)).map(|p| p.value),
            })
        })
        .collect();
    json!({
        "images": evaluation.count(),
        "without_hand": survey.without_hand.len(),
        "unreadable": survey.unreadable.len(),
        "accuracy": evaluation.accuracy().map(proportion_json),
        "accuracy_of_all": of_all(evaluation, survey).map(proportion_json),
        "calibration_error": evaluation.calibration_error(),
        "log_loss": evaluation.log_loss(),
        "classes": classes,
        "confusion": evaluation.confusion(),
    })
}

/// Says on stderr which files could not be used.
pub fn rejected(survey: &Survey) {
    let tell = |what: &str, rejected: &[Rejected]| {
        let causes = rejected.iter().map(|Rejected { image, cause }| (image.path.as_path(), cause.as_str()));
        warn(what, &causes.collect::<Vec<_>>());
    };
    tell("could not be read", &survey.unreadable);
    tell("with no hand found", &survey.without_hand);
}

/// Says on stderr which images without a gesture could not be read.
pub fn unreadable(alarms: &FalseAlarms) {
    let causes = alarms.unreadable.iter().map(|(path, cause)| (path.as_path(), cause.as_str()));
    warn("without a gesture could not be read", &causes.collect::<Vec<_>>());
}

/// Names the first files with the cause, and counts them.
fn warn(what: &str, files: &[(&Path, &str)]) {
    for (path, cause) in files.iter().take(3) {
        eprintln!("warning: {}: {cause}", path.display());
    }
    if files.len() > 3 {
        eprintln!("warning: {} images in total {what}", files.len());
    }
}

/// Says on stderr which folders of a dataset were left out.
pub fn ignored(folder: &Path, left_out: &[Ignored]) {
    if !left_out.is_empty() {
        let folders: Vec<String> = left_out.iter().map(Ignored::to_string).collect();
        eprintln!("note: {}: ignored folders: {}", folder.display(), folders.join(", "));
    }
}

/// A proportion with its interval in words.
pub fn proportion(p: Option<Proportion>) -> String {
    p.map_or_else(|| "none".to_owned(), |p| format!("{:.3} (95 % {:.3} to {:.3})", p.value, p.low, p.high))
}

/// The same as a JSON object.
pub fn proportion_json(p: Proportion) -> serde_json::Value {
    json!({ "value": p.value, "low": p.low, "high": p.high })
}
