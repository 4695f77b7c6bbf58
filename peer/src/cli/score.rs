//! How good a model is on each of some datasets: as a table, and as JSON.

use std::path::{Path, PathBuf};

use gestalt_strategies::{Evaluation, Proportion};
use serde_json::{Value, json};

use super::report;
use gestalt_vision::survey::{FalseAlarms, Survey};

/// What a model makes of one dataset.
pub(super) struct Score {
    folder: PathBuf,
    /// Images of a gesture that could be read.
    images: usize,
    /// Of all of them: one in which no hand was found is not judged right.
    accuracy: Option<Proportion>,
    without_hand: usize,
    calibration_error: Option<f64>,
    alarms: FalseAlarms,
}

impl Score {
    pub fn new(folder: &Path, evaluation: &Evaluation, survey: &Survey, alarms: FalseAlarms) -> Self {
        Self {
            folder: folder.to_owned(),
            images: survey.readable(),
            accuracy: report::of_all(evaluation, survey),
            without_hand: survey.without_hand.len(),
            calibration_error: evaluation.calibration_error(),
            alarms,
        }
    }

    /// No picture could be looked at: nothing is known.
    pub fn is_empty(&self) -> bool {
        self.images == 0 && self.alarms.images == 0
    }

    /// The part of the images in which no hand was found.
    fn missed(&self) -> Option<f64> {
        (self.images > 0).then(|| self.without_hand as f64 / self.images as f64)
    }

    /// The part of the images without a gesture in which a hand was reported.
    fn false_alarms(&self) -> Option<Proportion> {
        Proportion::wilson(self.alarms.alarms, self.alarms.images)
    }

    fn name(&self) -> String {
        self.folder.display().to_string()
    }

    fn json(&self) -> Value {
        json!({
            "dataset": self.name(),
            "images": self.images,
            "accuracy_of_all": self.accuracy.map(report::proportion_json),
            "without_hand": self.without_hand,
            "share_without_hand": self.missed(),
            "calibration_error": self.calibration_error,
            "images_without_gesture": self.alarms.images,
            "unreadable_without_gesture": self.alarms.unreadable.len(),
            "false_alarms": self.false_alarms().map(report::proportion_json),
        })
    }
}

/// Means over the datasets, each counting alike, and the dataset with the least accuracy; `None` of fewer than two.
struct Summary<'a> {
    accuracy: f64,
    missed: f64,
    calibration_error: Option<f64>,
    worst: (&'a Score, f64),
}

impl<'a> Summary<'a> {
    fn of(scores: &'a [Score]) -> Option<Self> {
        let judged = scores.iter().filter_map(|score| Some((score, score.accuracy?.value)));
        let judged: Vec<(&Score, f64)> = judged.collect();
        let worst = *judged.iter().min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let mean =
            |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        (judged.len() > 1).then_some(Self {
            accuracy: mean(judged.iter().map(|(_, accuracy)| *accuracy).collect())?,
            missed: mean(judged.iter().filter_map(|(score, _)| score.missed()).collect())?,
            calibration_error: mean(judged.iter().filter_map(|(score, _)| score.calibration_error).collect()),
            worst,
        })
    }
}

/// A row for each dataset; below them the means and the worst.
pub(super) fn table(scores: &[Score]) -> String {
    let names = scores.iter().map(|score| score.name().chars().count());
    let wide = names.max().unwrap_or_default().max("dataset".len());
    let row = |name: &str, images: &str, accuracy: &str, missed: &str, calibration: &str, alarms: &str| {
        let cells =
            format!("  {name:<wide$} {images:>7}  {accuracy:<28} {missed:>7}  {calibration:<17}  {alarms}");
        cells.trim_end().to_owned() + "\n"
    };
    let percent =
        |share: Option<f64>| share.map_or("–".to_owned(), |share| format!("{:.1} %", 100.0 * share));
    let decimals = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
    let mut text =
        row("dataset", "images", "accuracy of all", "no hand", "calibration error", "false alarms");
    for score in scores {
        let accuracy = match score.accuracy {
            Some(_) => report::proportion(score.accuracy),
            None => "–".to_owned(),
        };
        let alarms = match score.alarms.images {
            0 => String::new(),
            images => format!("{} of {images} images", percent(score.false_alarms().map(|p| p.value))),
        };
        let (missed, calibration) = (percent(score.missed()), decimals(score.calibration_error));
        text += &row(&score.name(), &score.images.to_string(), &accuracy, &missed, &calibration, &alarms);
    }
    if let Some(summary) = Summary::of(scores) {
        let (worst, least) = summary.worst;
        let (mean, missed) = (format!("{:.3}", summary.accuracy), percent(Some(summary.missed)));
        text += &row("mean", "", &mean, &missed, &decimals(summary.calibration_error), "");
        text += &row("worst", "", &format!("{least:.3} ({})", worst.name()), "", "", "");
    }
    text
}

/// The same as a JSON object.
pub(super) fn json(scores: &[Score]) -> Value {
    let summary = Summary::of(scores);
    json!({
        "sets": scores.iter().map(Score::json).collect::<Vec<_>>(),
        "mean": summary.as_ref().map(|summary| json!({
            "accuracy_of_all": summary.accuracy,
            "share_without_hand": summary.missed,
            "calibration_error": summary.calibration_error,
        })),
        "worst": summary.as_ref().map(|summary| json!({
            "dataset": summary.worst.0.name(),
            "accuracy_of_all": summary.worst.1,
        })),
    })
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::ClassId;
    use gestalt_strategies::LabelledFeatures;
    use gestalt_vision::dataset::LabelledImage;
    use gestalt_vision::survey::Rejected;

    use super::*;

    /// So many images judged right, wrong and not at all.
    fn score(name: &str, right: usize, wrong: usize, missed: usize, alarms: (u64, u64)) -> Score {
        let (mut evaluation, mut survey) = (Evaluation::new(2), Survey::default());
        let image = LabelledImage { path: "x.jpg".into(), class: ClassId(0), person: None };
        for k in 0..right + wrong {
            evaluation.record(ClassId(0), if k < right { &[1.0, 0.0] } else { &[0.0, 1.0] });
            let sample = LabelledFeatures::new(vec![], ClassId(0), None);
            survey.seen.push((image.clone(), sample));
        }
        for _ in 0..missed {
            survey.without_hand.push(Rejected { image: image.clone(), cause: String::new() });
        }
        let (alarms, images) = alarms;
        Score::new(
            Path::new(name),
            &evaluation,
            &survey,
            FalseAlarms { alarms, images, unreadable: Vec::new() },
        )
    }

    #[test]
    fn an_image_without_a_hand_is_not_judged_right_and_one_without_a_gesture_not_judged_at_all() {
        let scores =
            [score("near", 6, 2, 2, (0, 0)), score("far", 1, 0, 3, (0, 0)), score("empty", 0, 0, 0, (1, 4))];
        let json = json(&scores);
        let (near, empty) = (&json["sets"][0], &json["sets"][2]);
        assert_eq!(
            (&near["accuracy_of_all"]["value"], &near["share_without_hand"]),
            (&json!(0.6), &json!(0.2))
        );
        assert_eq!((&near["images"], &near["calibration_error"]), (&json!(10), &json!(0.25)));
        assert_eq!((&near["false_alarms"], &empty["accuracy_of_all"]), (&Value::Null, &Value::Null));
        assert_eq!((&empty["images"], &empty["false_alarms"]["value"]), (&json!(0), &json!(0.25)));
        let mean = json["mean"]["accuracy_of_all"].as_f64().unwrap();
        assert!((mean - 0.425).abs() < 1e-12, "{mean}");
        assert_eq!(json["worst"], json!({"dataset": "far", "accuracy_of_all": 0.25}));

        let table = table(&scores);
        let line = |start: &str| table.lines().find(|line| line.trim_start().starts_with(start)).unwrap();
        assert!(
            line("near").contains("0.600 (95 % 0.313 to 0.832)") && line("near").contains("20.0 %"),
            "{table}"
        );
        assert!(line("empty").ends_with("25.0 % of 4 images"), "{table}");
        assert!(line("mean").contains("0.425") && line("worst").contains("0.250 (far)"), "{table}");
    }

    #[test]
    fn one_dataset_has_no_mean() {
        let json = json(&[score("near", 1, 1, 0, (0, 0))]);
        assert_eq!((&json["mean"], &json["worst"]), (&Value::Null, &Value::Null));
    }
}
