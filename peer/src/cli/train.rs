//! `gestalt train`: from a folder of labelled images to a model.

mod outcome;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ArgGroup;
use gestalt_strategies::{Classify, Components, Evaluation, ScalingMethod, TrainOptions, Trained, train};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;

use self::outcome::Outcome;
use super::show::line;
use super::{Failure, progress, report, say};
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model::train_on_rendered;
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::survey::Survey;

/// Train a classifier on labelled images: one folder per gesture. File names `sNNN_…` identify the subject, so that
/// cross-validation and --test-share never put one subject on both sides
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt train --dataset hands --out hands.gestalt
  gestalt train --dataset hands --classes fist,palm,1-3 --test-share 0.3 --out hands.gestalt")]
#[command(group = ArgGroup::new("reduction").args(["components", "variance"]))]
pub struct Args {
    /// Dataset folder, with one subfolder per gesture
    #[arg(long, value_name = "DIR", required_unless_present = "rendered")]
    dataset: Option<PathBuf>,
    /// Make the embedded model again, from synthetic hands: gestures 0 to 5, always the same
    #[arg(long, conflicts_with_all = ["dataset", "features", "classes", "components", "variance", "costs", "gammas", "folds", "test_share", "split_seed", "seed"])]
    rendered: bool,
    /// Model file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Feature set: `hog` (histogram of oriented gradients) or `shape` (110 shape descriptors)
    #[arg(long, default_value = "hog", value_name = "SET")]
    features: FeatureSet,
    /// Gestures, in this order: `fist,palm` or `0-5` [default: all folders]
    #[arg(long, value_name = "LIST")]
    classes: Option<Labels>,
    /// Number of principal components to keep [default: 60]
    #[arg(long, value_name = "N")]
    components: Option<usize>,
    /// Keep enough principal components for this share of the variance, such as 0.95
    #[arg(long, value_name = "SHARE")]
    variance: Option<f64>,
    /// Values of C for the grid search
    #[arg(long, value_delimiter = ',', default_value = "1,4,16", value_name = "LIST")]
    costs: Vec<f64>,
    /// Values of gamma for the grid search, in units of 1 / (total variance of the reduced features)
    #[arg(long, value_delimiter = ',', default_value = "0.125,0.25,0.5,1", value_name = "LIST")]
    gammas: Vec<f64>,
    /// Number of cross-validation folds (choice of C and gamma, calibration of probabilities)
    #[arg(long, default_value_t = 5, value_name = "N")]
    folds: usize,
    /// Hold out this share of the subjects as a test set (never trained on; reported at the end and used by `gestalt
    /// evaluate`)
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    test_share: f64,
    /// Random seed of the held-out split
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    split_seed: u64,
    /// Random seed of the training
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    seed: u64,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// Names of gestures: `fist,palm`, or a range of numbers `0-5`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Labels(Vec<String>);

impl std::str::FromStr for Labels {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut labels = Vec::new();
        for part in text.split(',').map(str::trim) {
            let range = part
                .split_once('-')
                .and_then(|(from, to)| Some((from.parse::<u16>().ok()?, to.parse::<u16>().ok()?)));
            match range {
                Some((from, to)) if from <= to => labels.extend((from..=to).map(|n| n.to_string())),
                Some(_) => return Err(format!("{part}: the range is reversed")),
                None if part.is_empty() => return Err("empty gesture name".to_owned()),
                None => labels.push(part.to_owned()),
            }
        }
        Ok(Self(labels))
    }
}

impl Args {
    fn options(&self) -> TrainOptions {
        TrainOptions {
            scaling: match self.features {
                FeatureSet::Shape => ScalingMethod::PerComponent,
                FeatureSet::Hog => ScalingMethod::Common,
            },
            components: match (self.variance, self.components) {
                (Some(part), _) => Components::Variance(part),
                (None, Some(count)) => Components::Count(count),
                (None, None) => TrainOptions::default().components,
            },
            costs: self.costs.clone(),
            gammas: self.gammas.clone(),
            folds: self.folds,
        }
    }
}

/// Trains, writes the model, reports.
///
/// # Errors
/// When the dataset, the options or the place of the model cannot be used; each says what and why.
pub fn run(args: Args) -> Result<(), Failure> {
    let Some(folder) = args.dataset.as_deref() else { return remake(&args) };
    if !(0.0..1.0).contains(&args.test_share) {
        return Err(format!("--test-share is {}: choose a value between 0 and 1", args.test_share).into());
    }
    Model::check_writable(&args.out)?;
    let dataset = Dataset::list(folder, args.classes.as_ref().map(|labels| labels.0.as_slice()))?;
    let held_out = dataset.draw_people(args.test_share, &mut ChaCha8Rng::seed_from_u64(args.split_seed));
    if args.test_share > 0.0 && held_out.is_empty() {
        return Err(
            "--test-share holds out subjects, but the file names (sNNN_…) identify fewer than two".into()
        );
    }
    let mut perception = Perception::new(args.features, HandConfig::default())?;
    let (tested, learned): (Vec<_>, Vec<_>) =
        dataset.images.iter().cloned().partition(|image| image.person.is_some_and(|p| held_out.contains(&p)));
    let survey = look(&learned, &mut perception);
    report::rejected(&survey);

    let options = args.options();
    let started = Instant::now();
    let bar = progress::bar("training", 0);
    let trained = train(
        args.features.name(),
        &dataset.vocabulary,
        &survey.samples(),
        &options,
        &mut ChaCha8Rng::seed_from_u64(args.seed),
        |progress| {
            bar.set_length(progress.total as u64);
            bar.set_position(progress.done as u64);
        },
    )?;
    bar.finish_and_clear();
    let seconds = started.elapsed().as_secs_f64();

    let origin = origin(&args, folder, &survey, &trained)?;
    let model = Model { classifier: trained.classifier.clone(), origin };
    model.write(&args.out)?;

    let test = (!tested.is_empty()).then(|| measure(&tested, &model, &mut perception)).transpose()?;
    report::ignored(&dataset.ignored);
    let outcome = Outcome {
        folder,
        out: &args.out,
        model: &model,
        trained: &trained,
        folds: args.folds,
        survey: &survey,
        seconds,
        test: test.as_ref(),
        ignored: &dataset.ignored,
    };
    say(&if args.json { format!("{}\n", outcome.json()) } else { outcome.text() })
}

/// Makes the model that is embedded in the program: what `peer/vision/models/rendered.gestalt` holds.
fn remake(args: &Args) -> Result<(), Failure> {
    Model::check_writable(&args.out)?;
    let bar = progress::bar("features", 0);
    let model = train_on_rendered(|done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    model.write(&args.out)?;
    let (made_of, vectors) = (&model.origin.dataset, model.classifier.support_vectors());
    let words = format!("{made_of}; {vectors} support vectors → {}", args.out.display());
    line(args.json, &json!({"model": args.out, "dataset": made_of, "support_vectors": vectors}), &words)
}

fn look(images: &[LabelledImage], perception: &mut Perception) -> Survey {
    let bar = progress::bar("features", images.len());
    let survey = Survey::of(images, perception, || bar.inc(1));
    bar.finish_and_clear();
    survey
}

/// Looks at images that the model has not seen, and judges them.
pub(super) fn measure(
    images: &[LabelledImage],
    model: &Model,
    perception: &mut Perception,
) -> Result<(Evaluation, Survey), Failure> {
    let survey = look(images, perception);
    let mut evaluation = Evaluation::new(model.classifier.vocabulary().classes());
    for (_, sample) in &survey.seen {
        evaluation.record(sample.class, &model.classifier.probabilities(&sample.features)?);
    }
    Ok((evaluation, survey))
}

fn origin(args: &Args, folder: &Path, survey: &Survey, trained: &Trained) -> Result<Origin, Failure> {
    let people: BTreeSet<u32> = survey.seen.iter().filter_map(|(image, _)| image.person).collect();
    let images: Result<BTreeSet<u64>, _> = survey.seen.iter().map(|(image, _)| image.fingerprint()).collect();
    let name = folder.canonicalize()?;
    Ok(Origin {
        dataset: name.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        people: people.into_iter().collect(),
        images: images?.into_iter().collect(),
        seed: args.seed,
        cost: trained.cost,
        gamma: trained.gamma,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gestures_are_named_one_by_one_or_as_a_range() {
        let parse = |text: &str| text.parse::<Labels>().map(|labels| labels.0.join(" "));
        assert_eq!(parse("0-3").as_deref(), Ok("0 1 2 3"));
        assert_eq!(parse("fist, palm,7-8").as_deref(), Ok("fist palm 7 8"));
        assert_eq!(parse("thumb-up").as_deref(), Ok("thumb-up"));
        assert!(parse("5-1").is_err() && parse("a,,b").is_err());
    }
}
