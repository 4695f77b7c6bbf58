//! `gestalt train`: from a folder of photographs to a model.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ArgGroup;
use gestalt_strategies::{
    Classify, Components, Evaluation, Folding, Reduction, ScalingMethod, TrainOptions, Trained, train,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;

use super::{Failure, progress, report, say};
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::survey::Survey;

/// Trains a classifier on a folder of photographs: one folder per gesture, the images in it. File names `sNNN_…` tell
/// who shows the gesture; then cross-validation and --test-share keep people apart.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("reduction").args(["components", "variance"]))]
pub struct Args {
    /// The folder of photographs
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The model file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What to look at: `hog` (gradients of the hand's picture) or `shape` (110 measures of its outline)
    #[arg(long, default_value = "hog", value_name = "SET")]
    features: FeatureSet,
    /// The gestures to learn, in this order: `fist,palm` or `0-5`; all folders if not given
    #[arg(long, value_name = "LIST")]
    classes: Option<Labels>,
    /// How many principal components to keep [default: 60]
    #[arg(long, value_name = "N")]
    components: Option<usize>,
    /// Keep as many principal components as carry this part of the variance, such as 0.95
    #[arg(long, value_name = "PART")]
    variance: Option<f64>,
    /// The values of C to try
    #[arg(long, value_delimiter = ',', default_value = "1,4,16", value_name = "LIST")]
    costs: Vec<f64>,
    /// The values of gamma to try, in units of 1 / (total variance of the reduced features)
    #[arg(long, value_delimiter = ',', default_value = "0.125,0.25,0.5,1", value_name = "LIST")]
    gammas: Vec<f64>,
    /// Parts of the cross-validation that chooses C and gamma and calibrates the probabilities
    #[arg(long, default_value_t = 5, value_name = "N")]
    folds: usize,
    /// Hold out this share of the people: not trained on, but measured on at the end (and by `gestalt evaluate`)
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    test_share: f64,
    /// Which people are held out
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    split_seed: u64,
    /// For everything else that is left to chance
    #[arg(long, default_value_t = 1, value_name = "SEED")]
    seed: u64,
    /// Report as one JSON object on stdout
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
                Some(_) => return Err(format!("the range {part} runs backwards")),
                None if part.is_empty() => return Err("a gesture without a name".to_owned()),
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
/// When the dataset, the options or the place of the model are no good; each says what and why.
pub fn run(args: Args) -> Result<(), Failure> {
    if !(0.0..1.0).contains(&args.test_share) {
        return Err(format!("--test-share {} is not within 0 and 1", args.test_share).into());
    }
    Model::check_writable(&args.out)?;
    let dataset = Dataset::list(&args.dataset, args.classes.as_ref().map(|labels| labels.0.as_slice()))?;
    let held_out = dataset.draw_people(args.test_share, &mut ChaCha8Rng::seed_from_u64(args.split_seed));
    if args.test_share > 0.0 && held_out.is_empty() {
        return Err(
            "--test-share holds out people, but the file names tell of fewer than two (sNNN_…)".into()
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

    let origin = origin(&args, &survey, &trained)?;
    let model = Model { classifier: trained.classifier.clone(), origin };
    model.write(&args.out)?;

    let test = (!tested.is_empty()).then(|| measure(&tested, &model, &mut perception)).transpose()?;
    report::ignored(&dataset.ignored);
    if args.json {
        let summary = summary(&args, &model, &trained, &survey, seconds, test.as_ref(), &dataset.ignored);
        say(&format!("{summary}\n"))
    } else {
        say(&text(&args, &model, &trained, &survey, seconds, test.as_ref()))
    }
}

fn look(images: &[LabelledImage], perception: &mut Perception) -> Survey {
    let bar = progress::bar("looking", images.len());
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

fn origin(args: &Args, survey: &Survey, trained: &Trained) -> Result<Origin, Failure> {
    let people: BTreeSet<u32> = survey.seen.iter().filter_map(|(image, _)| image.person).collect();
    let images: Result<BTreeSet<u64>, _> = survey.seen.iter().map(|(image, _)| image.fingerprint()).collect();
    let name = args.dataset.canonicalize()?;
    Ok(Origin {
        dataset: name.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        people: people.into_iter().collect(),
        images: images?.into_iter().collect(),
        seed: args.seed,
        cost: trained.cost,
        gamma: trained.gamma,
    })
}

fn text(
    args: &Args,
    model: &Model,
    trained: &Trained,
    survey: &Survey,
    seconds: f64,
    test: Option<&(Evaluation, Survey)>,
) -> String {
    let classifier = &model.classifier;
    let people = model.origin.people.len();
    let folding = match trained.folding {
        Folding::ByGroup => "by person",
        Folding::BySample => "by image: the same people are on both sides",
    };
    let mut lines = vec![
        format!("{} images of {people} people, {}", survey.seen.len(), args.dataset.display()),
        format!("  gestures   {}", classifier.vocabulary().labels().join(" ")),
        format!(
            "  features   {} → {} principal components, {:.1} % of the variance",
            classifier.space().feature_set(),
            classifier.space().components(),
            100.0 * explained(classifier)
        ),
        format!(
            "  machine    C = {}, γ = {}, {} support vectors",
            trained.cost,
            trained.gamma,
            classifier.support_vectors()
        ),
        format!(
            "  held out   accuracy {:.3} in {}-fold cross-validation {folding}",
            trained.accuracy, args.folds
        ),
        format!("  trained in {seconds:.1} s → {}", args.out.display()),
    ];
    if let Some((evaluation, survey)) = test {
        lines.push(format!("\n{} images of people held out:", evaluation.count()));
        lines.push(report::text(evaluation, survey, classifier.vocabulary()));
    }
    lines.join("\n") + "\n"
}

fn summary(
    args: &Args,
    model: &Model,
    trained: &Trained,
    survey: &Survey,
    seconds: f64,
    test: Option<&(Evaluation, Survey)>,
    ignored: &[String],
) -> serde_json::Value {
    let classifier = &model.classifier;
    let path = |path: &Path| path.display().to_string();
    json!({
        "model": path(&args.out),
        "dataset": path(&args.dataset),
        "gestures": classifier.vocabulary().labels(),
        "ignored": ignored,
        "feature_set": classifier.space().feature_set(),
        "space": classifier.space().id().to_string(),
        "components": classifier.space().components(),
        "variance": explained(classifier),
        "cost": trained.cost,
        "gamma": trained.gamma,
        "support_vectors": classifier.support_vectors(),
        "images": survey.seen.len(),
        "without_hand": survey.without_hand.len(),
        "unreadable": survey.unreadable.len(),
        "people": model.origin.people.len(),
        "cross_validation": {
            "folds": args.folds,
            "by_person": trained.folding == Folding::ByGroup,
            "accuracy": trained.accuracy,
            "log_loss": trained.log_loss,
        },
        "seconds": seconds,
        "test": test.map(|(evaluation, survey)| report::json(evaluation, survey, classifier.vocabulary())),
    })
}

/// Part of the variance that the classifier's space keeps, `0.0..=1.0`.
fn explained(classifier: &gestalt_strategies::Classifier) -> f64 {
    match classifier.space().reduction() {
        Reduction::Pca(pca) => pca.explained(),
        Reduction::Selected { width, kept } => kept.len() as f64 / *width as f64,
    }
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
