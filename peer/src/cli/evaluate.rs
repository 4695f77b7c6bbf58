//! `gestalt evaluate`: how good a model is on photographs it has not seen.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gestalt_strategies::{Classify, Evaluation};
use serde_json::json;

use super::score::{self, Score};
use super::train::{measure, naming};
use super::{Failure, report, say};
use crate::config::ModelSection;
use gestalt_draw::confusion;
use gestalt_vision::dataset::{Dataset, LabelledImage, joined};
use gestalt_vision::model;
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::survey::{FalseAlarms, Survey};

/// Evaluate a model on labelled images. Images and subjects it was trained on are left out. A folder `none` holds images
/// without a gesture: of them is told in how many a hand is reported
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt evaluate --dataset hands --model hands.gestalt --plot confusion.png
  gestalt evaluate --dataset office --dataset garden --counts")]
pub struct Args {
    /// Dataset folder, with one subfolder per gesture; several are scored one by one and together
    #[arg(long, value_name = "DIR", required = true)]
    dataset: Vec<PathBuf>,
    /// Model file written by `gestalt train`, `hands` (bare hands before any camera) or `rendered` (synthetic hands)
    #[arg(long, value_name = "FILE|hands|rendered", default_value = "hands")]
    model: ModelSection,
    /// Folders are counts of fingers: the number that their name begins with, so that `3_thumb_index_middle` is 3. Folders
    /// that begin with no number are left out
    #[arg(long)]
    counts: bool,
    /// Plot the confusion matrix (SVG or PNG, by the file extension)
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    plot: Option<PathBuf>,
    /// Include the training images too (training accuracy, not generalisation)
    #[arg(long)]
    include_training: bool,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// Measures and reports.
///
/// # Errors
/// When the model or a dataset cannot be used, or nothing unseen is left to measure on.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(path) = &args.plot {
        gestalt_draw::check(path)?;
    }
    let (model, name) = read_model(&args.model)?;
    let vocabulary = model.classifier.vocabulary();
    // A set that this program does not know is named by the error; one of another length by the check.
    let set: FeatureSet = model.classifier.space().feature_set().parse()?;
    model.check_features(set.name(), set.length())?;
    let mut perception = Perception::new(set, HandConfig::default())?;

    let (mut images, mut left_out, mut people, mut ignored) = (0, 0, 0, false);
    let (mut evaluation, mut survey) = (Evaluation::new(vocabulary.classes()), Survey::default());
    let mut scores = Vec::new();
    for folder in &args.dataset {
        let dataset = Dataset::list_known(folder, naming(args.counts), vocabulary)?;
        report::ignored(folder, &dataset.ignored);
        ignored |= !dataset.ignored.is_empty();
        let all = dataset.images.len();
        let kept = if args.include_training { dataset.images } else { unseen(dataset.images, &model.origin) };
        if kept.is_empty() && all > 0 {
            return Err(trained_on(folder).into());
        }
        images += kept.len();
        left_out += all - kept.len();
        people += kept.iter().filter_map(|image| image.person).collect::<BTreeSet<u32>>().len();
        let (of_set, seen) = measure(&kept, &model.classifier, &mut perception)?;
        let alarms = FalseAlarms::count(&dataset.none, &mut perception);
        report::unreadable(&alarms);
        scores.push(Score::new(folder, &of_set, &seen, alarms));
        evaluation.append(&of_set);
        survey.append(seen);
    }
    if images == 0 && left_out == 0 && ignored {
        eprintln!(
            "note: no picture shows a gesture that the model knows, which are {}: false alarms alone are counted; --model names another",
            vocabulary.labels().join(", ")
        );
    }
    report::rejected(&survey);
    if let Some(path) = &args.plot {
        confusion::draw(&evaluation, vocabulary, path)?;
    }
    let datasets = joined(&args.dataset);
    if args.json {
        let mut report = report::json(&evaluation, &survey, vocabulary);
        report["model"] = json!(name);
        report["dataset"] = json!(datasets);
        report["by_dataset"] = score::json(&scores);
        report["people"] = json!(people);
        report["left_out_as_trained_on"] = json!(left_out);
        report["includes_training"] = json!(args.include_training);
        say(&format!("{report}\n"))
    } else {
        let mut text = format!("{images} images of {people} subjects, {datasets}\n");
        if left_out > 0 {
            text += &format!("  left out          {left_out} images of training subjects\n");
        }
        if args.include_training {
            text += "  warning           training images may be included\n";
        }
        text += &format!("\n{}", score::table(&scores));
        if images > 0 {
            text += &format!("\n{}", report::text(&evaluation, &survey, vocabulary));
        }
        say(&text)
    }
}

/// The model, and its name.
fn read_model(section: &ModelSection) -> Result<(Model, String), Failure> {
    match section {
        ModelSection::None => Err("an evaluation needs a model: give --model FILE".into()),
        ModelSection::Hands => Ok((model::hands()?, "hands".to_owned())),
        ModelSection::Rendered => Ok((model::rendered()?, "rendered".to_owned())),
        ModelSection::File(path) => Ok((Model::read(path)?, path.display().to_string())),
    }
}

fn trained_on(folder: &Path) -> String {
    format!(
        "the model was trained on all subjects in {}: hold some out (gestalt train --test-share 0.3), or use \
         --include-training to measure its training accuracy",
        folder.display()
    )
}

/// The images that the model has not been trained on. Of everyone who shows one of those, all images are left out.
fn unseen(images: Vec<LabelledImage>, origin: &Origin) -> Vec<LabelledImage> {
    let known_image = |image: &LabelledImage| {
        // A file that cannot be read is reported when it is looked at.
        image.fingerprint().is_ok_and(|print| origin.images.binary_search(&print).is_ok())
    };
    let known: Vec<bool> = images.iter().map(known_image).collect();
    let seen = images.iter().zip(&known).filter(|(_, known)| **known);
    let people: BTreeSet<u32> = seen.filter_map(|(image, _)| image.person).collect();
    let known_person = |image: &LabelledImage| image.person.is_some_and(|person| people.contains(&person));
    let kept = images.into_iter().zip(known).filter(|(image, known)| !known && !known_person(image));
    kept.map(|(image, _)| image).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn people_trained_on_are_left_out_where_the_numbers_mean_the_same() {
        let folder = tempfile::tempdir().unwrap();
        for file in ["0/s001_a.jpg", "0/s001_b.jpg", "0/s002_a.jpg", "1/x.jpg"] {
            fs::create_dir_all(folder.path().join(file).parent().unwrap()).unwrap();
            fs::write(folder.path().join(file), file).unwrap();
        }
        let images = Dataset::list(folder.path(), None).unwrap().images;
        let names = |images: Vec<LabelledImage>| -> Vec<String> {
            images.iter().map(|i| i.path.file_name().unwrap().to_str().unwrap().to_owned()).collect()
        };
        // Trained on s001_a of this very dataset: the other picture of person 1 is no test either.
        let origin = |prints: Vec<u64>| Origin { people: vec![2], images: prints, ..Origin::default() };
        // Trained with another dataset, whose people are numbered through with these.
        let seen = origin(vec![images[0].fingerprint().unwrap()]);
        assert_eq!(names(unseen(images.clone(), &seen)), ["s002_a.jpg", "x.jpg"]);
        // Trained on another dataset, whose person 1 is somebody else.
        assert_eq!(unseen(images.clone(), &origin(vec![7])), images);
    }
}
