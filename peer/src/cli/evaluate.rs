//! `gestalt evaluate`: how good a model is on photographs it has not seen.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gestalt_strategies::{Classify, Evaluation, Vocabulary};
use serde_json::json;
use thiserror::Error;

use super::score::{self, Score};
use super::train::{Eyes, measure, naming};
use super::{Failure, report, say};
use crate::config::ModelSection;
use gestalt_draw::confusion;
use gestalt_vision::dataset::{
    Dataset, DatasetError, LabelledImage, Naming, each_once, joined, leave_out_copies,
};
use gestalt_vision::model;
use gestalt_vision::model_file::Model;
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::survey::{FalseAlarms, Survey};

/// Evaluate a model on labelled images. Images and subjects it was trained on are left out, and where learned eyes look, those that the eyes
/// were made with. A folder `none` holds images
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

/// Nothing was measured.
#[derive(Debug, Error)]
#[error(
    "nothing in {} can be scored: no picture that can be read and was not left out shows one of the model's gestures ({}), and none is without a gesture: \
     name a folder after each gesture, or give another --model",
    joined(folders),
    labels.join(", ")
)]
struct NothingScored {
    folders: Vec<PathBuf>,
    labels: Vec<String>,
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

    let (sets, copies) = list(&args.dataset, naming(args.counts), vocabulary)?;
    if copies > 0 {
        eprintln!("note: left out {copies} copies of other pictures: each is scored once");
    }

    let eyes = Eyes::of(set)?;
    let (mut images, mut left_out, mut by_eyes, mut people, mut ignored) = (0, 0, 0, 0, false);
    let mut none_by_eyes = 0;
    let (mut evaluation, mut survey) = (Evaluation::new(vocabulary.classes()), Survey::default());
    let mut scores = Vec::new();
    for (folder, mut dataset) in args.dataset.iter().zip(sets) {
        report::ignored(folder, &dataset.ignored);
        ignored |= !dataset.ignored.is_empty();
        let kept = if args.include_training {
            dataset.images
        } else {
            let none = eyes.unseen_none(&dataset.none);
            none_by_eyes += dataset.none.len() - none.len();
            dataset.none = none;
            let unseen = unseen(&model, &eyes, folder, dataset.images)?;
            left_out += unseen.left_out;
            by_eyes += unseen.by_eyes;
            unseen.images
        };
        images += kept.len();
        people += kept.iter().filter_map(|image| image.person).collect::<BTreeSet<u32>>().len();
        let (of_set, seen) = measure(&kept, &model.classifier, &mut perception)?;
        let alarms = FalseAlarms::count(&dataset.none, &mut perception);
        report::unreadable(&alarms);
        scores.push(Score::new(folder, &of_set, &seen, alarms));
        evaluation.append(&of_set);
        survey.append(seen);
    }
    if scores.iter().all(Score::is_empty) {
        let labels = vocabulary.labels().to_vec();
        return Err(NothingScored { folders: args.dataset.clone(), labels }.into());
    }
    if images == 0 && left_out + by_eyes == 0 && ignored {
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
        report["left_out_as_trained_on"] = json!(left_out + by_eyes);
        report["without_gesture_left_out_as_trained_on"] = json!(none_by_eyes);
        report["copies_left_out"] = json!(copies);
        report["includes_training"] = json!(args.include_training);
        say(&format!("{report}\n"))
    } else {
        let mut text = format!("{images} images of {people} subjects, {datasets}\n");
        if left_out > 0 {
            text += &format!("  left out          {left_out} images of training subjects\n");
        }
        if by_eyes > 0 {
            text += &format!("  left out          {by_eyes} images that the learned eyes were made with\n");
        }
        if none_by_eyes > 0 {
            text += &format!(
                "  left out          {none_by_eyes} images without a gesture that the learned eyes were made with\n"
            );
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

/// The images of each folder, each picture once, and how many copies are left out.
fn list(
    folders: &[PathBuf],
    naming: Naming,
    vocabulary: &Vocabulary,
) -> Result<(Vec<Dataset>, usize), DatasetError> {
    each_once(folders)?;
    let known = |folder: &PathBuf| Dataset::list_known(folder, naming, vocabulary);
    let mut sets: Vec<Dataset> = folders.iter().map(known).collect::<Result<_, _>>()?;
    let copies = leave_out_copies(&mut sets);
    Ok((sets, copies))
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

/// What is left to measure on, and how much is left out as the classifier's and as its eyes' training.
struct Unseen {
    images: Vec<LabelledImage>,
    left_out: usize,
    by_eyes: usize,
}

fn unseen(model: &Model, eyes: &Eyes, folder: &Path, images: Vec<LabelledImage>) -> Result<Unseen, Failure> {
    let all = images.len();
    let images = model.origin.unseen(images);
    let left_out = all - images.len();
    if images.is_empty() && all > 0 {
        return Err(trained_on(folder).into());
    }
    let images = eyes.unseen(&[folder.to_owned()], images)?;
    Ok(Unseen { left_out, by_eyes: all - left_out - images.len(), images })
}

fn trained_on(folder: &Path) -> String {
    format!(
        "the model was trained on all subjects in {}: hold some out (gestalt train --test-share 0.3), or use \
         --include-training to measure its training accuracy",
        folder.display()
    )
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::train::eyes_and_images;
    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn written(folder: &Path, files: &[(&str, &str)]) {
        for (file, content) in files {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
    }

    #[test]
    fn each_picture_is_scored_once_whatever_it_is_called_and_wherever_it_lies() {
        let [one, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        written(one.path(), &[("3/a.jpg", "a hand"), ("3/b.jpg", "another")]);
        written(other.path(), &[("3/c.jpg", "a hand"), ("2/d.jpg", "a third")]);
        let vocabulary = Vocabulary::new(["2", "3"]).unwrap();
        let [one, other] = [&one, &other].map(|folder| folder.path().to_owned());
        let (sets, copies) = list(&[one.clone(), other], Naming::Names, &vocabulary).unwrap();
        assert_eq!((sets.iter().map(|set| set.images.len()).collect::<Vec<_>>(), copies), (vec![2, 1], 1));
        let again = list(&[one.clone(), one.join("3/..")], Naming::Names, &vocabulary);
        assert!(matches!(again, Err(DatasetError::Twice(_))));
    }

    #[test]
    fn nothing_to_score_is_no_success() {
        let folder = tempfile::tempdir().unwrap();
        written(
            folder.path(),
            &[("7/a.jpg", "of a gesture that the model does not know"), ("call/b.jpg", "")],
        );
        let dataset = folder.path().to_str().unwrap();
        let line = ["evaluate", "--counts", "--model", "rendered", "--dataset", dataset];
        let error = run(&Line::try_parse_from(line).unwrap().args).unwrap_err().to_string();
        assert!(error.contains(dataset) && error.contains("can be scored"), "{error}");
    }

    #[test]
    fn what_the_eyes_of_a_model_were_made_with_is_left_out_though_the_model_never_saw_it() {
        let folder = tempfile::tempdir().unwrap();
        let (images, eyes) = eyes_and_images(folder.path());
        let mut model = model::hands().unwrap();
        model.origin = gestalt_vision::model_file::Origin::default();
        let kept = unseen(&model, &eyes, folder.path(), images.clone()).unwrap();
        assert_eq!((kept.images, kept.left_out, kept.by_eyes), (images[2..].to_vec(), 0, 2));
        // Of what the model saw too it is said as ever.
        model.origin.images = vec![images[2].fingerprint().unwrap()];
        let error = unseen(&model, &eyes, folder.path(), images[2..].to_vec()).err().unwrap().to_string();
        assert!(error.contains("--include-training"), "{error}");
    }
}
