//! `gestalt evaluate`: how good a model is on photographs it has not seen.

use std::collections::BTreeSet;
use std::path::PathBuf;

use gestalt_strategies::Classify;
use serde_json::json;

use super::train::measure;
use super::{Failure, report, say};
use gestalt_draw::confusion;
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};

/// Evaluate a model on labelled images. Images and subjects it was trained on are left out
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt evaluate --dataset hands --model hands.gestalt
  gestalt evaluate --dataset others --model hands.gestalt --plot confusion.png")]
pub struct Args {
    /// Dataset folder, with one subfolder per gesture
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Model file written by `gestalt train`
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
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
/// When the model or the dataset cannot be used, or nothing unseen is left to measure on.
pub fn run(args: Args) -> Result<(), Failure> {
    if let Some(path) = &args.plot {
        gestalt_draw::check(path)?;
    }
    let model = Model::read(&args.model)?;
    let vocabulary = model.classifier.vocabulary();
    // A set that this program does not know is named by the error; one of another length by the check.
    let set: FeatureSet = model.classifier.space().feature_set().parse()?;
    model.check_features(set.name(), set.length())?;
    let mut perception = Perception::new(set, HandConfig::default())?;

    let dataset = Dataset::list_known(&args.dataset, vocabulary)?;
    let all = dataset.images.len();
    let images = if args.include_training { dataset.images } else { unseen(dataset.images, &model.origin) };
    let left_out = all - images.len();
    if images.is_empty() {
        return Err(format!(
            "the model was trained on all subjects in {}: hold some out (gestalt train --test-share 0.3), or use \
             --include-training to measure its training accuracy",
            args.dataset.display()
        )
        .into());
    }
    let people: BTreeSet<u32> = images.iter().filter_map(|image| image.person).collect();
    let (evaluation, survey) = measure(&images, &model, &mut perception)?;
    report::rejected(&survey);
    report::ignored(&dataset.ignored);
    if let Some(path) = &args.plot {
        confusion::draw(&evaluation, vocabulary, path)?;
    }
    if args.json {
        let mut report = report::json(&evaluation, &survey, vocabulary);
        report["model"] = json!(args.model.display().to_string());
        report["dataset"] = json!(args.dataset.display().to_string());
        report["people"] = json!(people.len());
        report["left_out_as_trained_on"] = json!(left_out);
        report["includes_training"] = json!(args.include_training);
        say(&format!("{report}\n"))
    } else {
        let mut text =
            format!("{} images of {} subjects, {}\n", images.len(), people.len(), args.dataset.display());
        if left_out > 0 {
            text += &format!("  left out          {left_out} images of training subjects\n");
        }
        if args.include_training {
            text += "  warning           training images may be included\n";
        }
        say(&(text + &report::text(&evaluation, &survey, vocabulary)))
    }
}

/// The images that the model has not been trained on. Where one of them is in the dataset, the numbers of people
/// mean the same as in training, and everyone it was trained on is left out whole.
fn unseen(images: Vec<LabelledImage>, origin: &Origin) -> Vec<LabelledImage> {
    let known_image = |image: &LabelledImage| {
        // A file that cannot be read is reported when it is looked at.
        image.fingerprint().is_ok_and(|print| origin.images.binary_search(&print).is_ok())
    };
    let known: Vec<bool> = images.iter().map(known_image).collect();
    let same_people = known.contains(&true);
    let known_person = |image: &LabelledImage| {
        same_people && image.person.is_some_and(|person| origin.people.contains(&person))
    };
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
        let origin = |prints: Vec<u64>| Origin { people: vec![1], images: prints, ..Origin::default() };
        let seen = origin(vec![images[0].fingerprint().unwrap()]);
        assert_eq!(names(unseen(images.clone(), &seen)), ["s002_a.jpg", "x.jpg"]);
        // Trained on another dataset, whose person 1 is somebody else.
        assert_eq!(unseen(images.clone(), &origin(vec![7])), images);
    }
}
