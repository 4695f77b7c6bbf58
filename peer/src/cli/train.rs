//! `gestalt train`: from folders of labelled images to a model.

mod eyes;
mod leave_one_out;
mod mirror;
mod outcome;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ArgGroup;
use gestalt_strategies::{
    Classifier, Classify, Components, Evaluation, LabelledFeatures, ScalingMethod, TrainOptions, Trained,
    Vocabulary, train,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};

pub(super) use self::eyes::Eyes;
#[cfg(test)]
pub(super) use self::eyes::tests::images as eyes_and_images;
use self::outcome::Outcome;
use super::show::line;
use super::{Failure, progress, report, say, score};
use gestalt_vision::dataset::{Dataset, LabelledImage, Naming, leave_out_copies};
use gestalt_vision::model::train_on_rendered;
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::survey::{Survey, lessons};

/// Train a classifier on labelled images: one folder per gesture. File names `sNNN_…` identify the subject, so that
/// cross-validation and --test-share never put one subject on both sides. A folder `none` holds images without a gesture:
/// they are not learned
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt train --dataset hands --out hands.gestalt
  gestalt train --dataset office --dataset garden --counts --leave-one-out")]
#[command(group = ArgGroup::new("reduction").args(["components", "variance"]))]
pub struct Args {
    /// Dataset folder, with one subfolder per gesture; several are learned as one, and their subjects kept apart
    #[arg(long, value_name = "DIR", required_unless_present = "rendered")]
    dataset: Vec<PathBuf>,
    /// Make the embedded model again, from synthetic hands: gestures 0 to 5, always the same
    #[arg(long, conflicts_with_all = ["dataset", "features", "classes", "components", "variance", "costs", "gammas", "folds", "test_share", "split_seed", "seed", "counts", "leave_one_out", "augment", "no_mirror"])]
    rendered: bool,
    /// Model file to write
    #[arg(long, value_name = "FILE", required_unless_present = "leave_one_out")]
    out: Option<PathBuf>,
    /// Measure how well training carries over: for each dataset, train on the others and score on it, but for the images that
    /// learned eyes were made with
    #[arg(long)]
    leave_one_out: bool,
    /// Folders are counts of fingers: the number that their name begins with, so that `3_thumb_index_middle` is 3. Folders
    /// that begin with no number are left out
    #[arg(long)]
    counts: bool,
    /// Learn so many variations of each image beside it: mirrored or not, rolled by up to 30°, half to twice as bright. 0: none.
    /// None is mirrored when the mirror image of one gesture is another, such as left and right; the program says so
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=50))]
    augment: u8,
    /// Mirror no variation
    #[arg(long)]
    no_mirror: bool,
    /// Feature set: `embedding` (24 values of learned eyes, which know bare hands; carries over best to other people and
    /// cameras), `shape` (110 shape descriptors; gloves too) or `hog` (histogram of oriented gradients; for the same camera)
    #[arg(long, default_value = "embedding", value_name = "SET")]
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
    /// evaluate`). Those that learned eyes were made with are not tested on
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
    fn naming(&self) -> Naming {
        naming(self.counts)
    }

    fn options(&self) -> TrainOptions {
        TrainOptions {
            scaling: match self.features {
                FeatureSet::Shape => ScalingMethod::PerComponent,
                FeatureSet::Hog | FeatureSet::Embedding => ScalingMethod::Common,
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

/// What `--counts` means.
pub(super) fn naming(counts: bool) -> Naming {
    if counts { Naming::Counts } else { Naming::Names }
}

/// Trains, writes the model, reports.
///
/// # Errors
/// When a dataset, the options or the place of the model cannot be used; each says what and why.
pub fn run(args: &Args) -> Result<(), Failure> {
    if args.rendered {
        return remake(args);
    }
    if !(0.0..1.0).contains(&args.test_share) {
        return Err(format!("--test-share is {}: choose a value between 0 and 1", args.test_share).into());
    }
    if let Some(out) = &args.out {
        Model::check_writable(out)?;
    }
    let labels = args.classes.as_ref().map(|labels| labels.0.as_slice());
    let mut sets = Dataset::list_several(&args.dataset, args.naming(), labels)?;
    let copies = leave_out_copies(&mut sets);
    if copies > 0 {
        eprintln!(
            "note: left out {copies} copies of other pictures: one is not learned from and measured on"
        );
    }
    for (folder, set) in args.dataset.iter().zip(&sets) {
        report::ignored(folder, &set.ignored);
    }
    let mut perception = Perception::new(args.features, HandConfig::default())?;
    let compared =
        args.leave_one_out.then(|| leave_one_out::compare(args, &sets, &mut perception)).transpose()?;
    let (mut text, mut object) = (String::new(), json!({}));
    if let Some(out) = &args.out {
        (text, object) = learn(args, &sets, out, &mut perception)?;
    }
    if let Some(scores) = compared {
        text = format!("each dataset by a model of the others:\n{}{text}", score::table(&scores));
        object["leave_one_out"] = score::json(&scores);
    }
    say(&if args.json { format!("{object}\n") } else { text })
}

/// Trains on all datasets but the people held out, writes the model, and measures it on those.
fn learn(
    args: &Args,
    sets: &[Dataset],
    out: &Path,
    perception: &mut Perception,
) -> Result<(String, Value), Failure> {
    let images: Vec<LabelledImage> = sets.iter().flat_map(|set| set.images.iter().cloned()).collect();
    let vocabulary = &sets.first().ok_or("no dataset")?.vocabulary;
    let all = Dataset { vocabulary: vocabulary.clone(), images, none: Vec::new(), ignored: Vec::new() };
    let held_out = all.draw_people(args.test_share, &mut ChaCha8Rng::seed_from_u64(args.split_seed));
    if args.test_share > 0.0 && held_out.is_empty() {
        return Err(
            "--test-share holds out subjects, but the file names (sNNN_…) identify fewer than two: name the files s001_a.jpg, s002_a.jpg, \
             one number per person, as `gestalt capture --person N` does; or leave --test-share out: cross-validation by image is all there is then, and it knows the subjects"
                .into(),
        );
    }
    let (tested, learned): (Vec<_>, Vec<_>) =
        all.images.into_iter().partition(|image| image.person.is_some_and(|p| held_out.contains(&p)));
    let held_out = tested.len();
    let eyes = Eyes::of(args.features)?;
    let tested = eyes.unseen(&args.dataset, tested)?;
    let mut survey = look(&learned, perception);
    report::rejected(&survey);
    if args.features == FeatureSet::Embedding && survey.seen.len() < survey.without_hand.len() {
        return Err(format!(
            "learned eyes find a hand in only {} of {} images: they know bare hands; for gloves and drawn hands use --features shape",
            survey.seen.len(),
            survey.readable()
        )
        .into());
    }

    let mirror = mirror::are_mirrored(args, vocabulary, &[&survey], perception);
    mirror::vary(args, mirror, std::slice::from_mut(&mut survey), perception);

    let started = Instant::now();
    let trained = fit(args, vocabulary, &lessons(&[&survey]))?;
    let seconds = started.elapsed().as_secs_f64();

    let origin = origin(args, &survey, &trained)?;
    let model = Model { classifier: trained.classifier.clone(), origin };
    model.write(out)?;

    let test = (!tested.is_empty()).then(|| measure(&tested, &model.classifier, perception)).transpose()?;
    let outcome = Outcome {
        folders: &args.dataset,
        out,
        model: &model,
        trained: &trained,
        folds: args.folds,
        survey: &survey,
        seconds,
        test: test.as_ref(),
        left_out: held_out - tested.len(),
        known: eyes.count_known(survey.seen.iter().map(|(image, _)| image.clone()).collect()),
        ignored: sets.iter().flat_map(|set| &set.ignored).map(|ignored| ignored.label.as_str()).collect(),
    };
    Ok((outcome.text(), outcome.json()))
}

/// Trains, and shows how far it has come.
///
/// C and γ are searched among the images themselves: among the variations as well it takes ten times as long, and what is
/// found serves people who were held out no better.
fn fit(args: &Args, vocabulary: &Vocabulary, lessons: &[LabelledFeatures]) -> Result<Trained, Failure> {
    let learn = |samples: &[LabelledFeatures], options: &TrainOptions| {
        let bar = progress::bar("training", 0);
        let rng = &mut ChaCha8Rng::seed_from_u64(args.seed);
        let trained = train(args.features.name(), vocabulary, samples, options, rng, |progress| {
            bar.set_length(progress.total as u64);
            bar.set_position(progress.done as u64);
        });
        bar.finish_and_clear();
        trained
    };
    let images: Vec<LabelledFeatures> =
        lessons.iter().map(|lesson| LabelledFeatures { variations: Vec::new(), ..lesson.clone() }).collect();
    let found = learn(&images, &args.options())?;
    if lessons.iter().all(|lesson| lesson.variations.is_empty()) {
        return Ok(found);
    }
    let options = TrainOptions { costs: vec![found.cost], gammas: vec![found.gamma], ..args.options() };
    Ok(learn(lessons, &options)?)
}

/// Makes the model that is embedded in the program: what `peer/vision/models/rendered.gestalt` holds.
fn remake(args: &Args) -> Result<(), Failure> {
    let out = args.out.as_deref().ok_or("--out is missing")?;
    Model::check_writable(out)?;
    let bar = progress::bar("features", 0);
    let model = train_on_rendered(|done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    model.write(out)?;
    let (made_of, vectors) = (&model.origin.dataset, model.classifier.support_vectors());
    let words = format!("{made_of}; {vectors} support vectors → {}", out.display());
    line(args.json, &json!({"model": out, "dataset": made_of, "support_vectors": vectors}), &words)
}

/// Looks at images.
fn look(images: &[LabelledImage], perception: &mut Perception) -> Survey {
    let bar = progress::bar("features", images.len());
    let survey = Survey::of(images, perception, || bar.inc(1));
    bar.finish_and_clear();
    survey
}

/// Looks at images that the model has not seen, and judges them.
pub(super) fn measure(
    images: &[LabelledImage],
    classifier: &Classifier,
    perception: &mut Perception,
) -> Result<(Evaluation, Survey), Failure> {
    let survey = look(images, perception);
    let mut evaluation = Evaluation::new(classifier.vocabulary().classes());
    judge(&survey, classifier, &mut evaluation)?;
    Ok((evaluation, survey))
}

/// Judges what a survey has seen, without the variations.
fn judge(survey: &Survey, classifier: &Classifier, evaluation: &mut Evaluation) -> Result<(), Failure> {
    for (_, sample) in &survey.seen {
        evaluation.record(sample.class, &classifier.probabilities(&sample.features)?);
    }
    Ok(())
}

fn origin(args: &Args, survey: &Survey, trained: &Trained) -> Result<Origin, Failure> {
    let people: BTreeSet<u32> = survey.seen.iter().filter_map(|(image, _)| image.person).collect();
    let without_hand = survey.without_hand.iter().map(|rejected| &rejected.image);
    let shown = survey.seen.iter().map(|(image, _)| image).chain(without_hand);
    let images: BTreeSet<u64> = shown.map(LabelledImage::fingerprint).collect::<Result<_, _>>()?;
    let mut names = Vec::new();
    for folder in &args.dataset {
        let name = folder.canonicalize()?;
        names.push(name.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()));
    }
    Ok(Origin {
        dataset: names.join(", "),
        people: people.into_iter().collect(),
        images: images.into_iter().collect(),
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
