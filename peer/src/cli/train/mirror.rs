//! The variations that are learned beside each picture, and whether they may be mirrored: the mirror image of "left" is "right".

use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classify, Evaluation, LabelledFeatures, MIN_SAMPLES, TrainOptions, Vocabulary, train,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::super::progress;
use super::Args;
use gestalt_vision::perception::Perception;
use gestalt_vision::survey::{Survey, lessons};

/// So many images of each gesture are mirrored to see what they are taken for.
const TRIED: usize = 40;
/// Of fewer nothing can be said.
const FEWEST: u64 = 4;
/// With these the images themselves are told apart, whatever the features; γ as in `--gammas`.
const COST: f64 = 4.0;
const GAMMA: f64 = 0.5;

/// Whether mirrored variations of these are learned too: unless the arguments say otherwise, or the mirror image of one gesture is another.
pub(super) fn are_mirrored(
    args: &Args,
    vocabulary: &Vocabulary,
    surveys: &[&Survey],
    perception: &mut Perception,
) -> bool {
    if args.augment == 0 || args.no_mirror {
        return false;
    }
    let twins = twins(args, vocabulary, surveys, perception);
    if let Some([one, other]) = twins.map(|twins| twins.map(|class| &vocabulary.labels()[class.index()])) {
        eprintln!(
            "note: nothing is mirrored in training: mirrored images of \"{one}\" are taken for \"{other}\", and the other way round"
        );
    }
    twins.is_none()
}

/// Looks at so many variations of each image as the arguments say.
pub(super) fn vary(args: &Args, mirror: bool, surveys: &mut [Survey], perception: &mut Perception) {
    if args.augment == 0 {
        return;
    }
    let bar = progress::bar("variations", surveys.iter().map(|survey| survey.seen.len()).sum());
    for survey in surveys {
        survey.vary(perception, (usize::from(args.augment), mirror), args.seed, || bar.inc(1));
    }
    bar.finish_and_clear();
}

/// Two gestures that are each other's mirror images to a classifier of the images alone; it is trained without a search, as it
/// only has to tell the images that it knows. `None` also where nothing can be trained: the training itself says why.
fn twins(
    args: &Args,
    vocabulary: &Vocabulary,
    surveys: &[&Survey],
    perception: &mut Perception,
) -> Option<[ClassId; 2]> {
    let mut samples = lessons(surveys);
    // Where several folders are compared, some gestures may be there once or not at all.
    let mut counts = vec![0; vocabulary.classes()];
    samples.iter().for_each(|sample| counts[sample.class.index()] += 1);
    let classes = (0..).map(ClassId).take(counts.len());
    let known: Vec<ClassId> = classes.filter(|class| counts[class.index()] >= MIN_SAMPLES).collect();
    let among_known =
        |class| (0..).map(ClassId).zip(&known).find(|(_, it)| **it == class).map(|(among, _)| among);
    samples = samples
        .into_iter()
        .filter_map(|sample| Some(LabelledFeatures { class: among_known(sample.class)?, ..sample }))
        .collect();
    let labels =
        Vocabulary::new(known.iter().map(|class| vocabulary.labels()[class.index()].clone())).ok()?;
    let options = TrainOptions { costs: vec![COST], gammas: vec![GAMMA], ..args.options() };
    let rng = &mut ChaCha8Rng::seed_from_u64(args.seed);
    let classifier = train(args.features.name(), &labels, &samples, &options, rng, |_| ()).ok()?.classifier;
    let mut evaluation = Evaluation::new(known.len());
    for survey in surveys {
        for (class, features) in survey.mirrored(perception, TRIED) {
            if let Some(class) = among_known(class) {
                evaluation.record(class, &classifier.probabilities(&features).ok()?);
            }
        }
    }
    mirror_images(evaluation.confusion()).map(|twins| twins.map(|class| known[class]))
}

/// Two gestures of which each one's mirror images are taken for the other one oftener than for itself; of several, those that
/// are confused most. `confusion`: a row for each gesture, how often its mirror images are taken for each.
fn mirror_images(confusion: &[Vec<u64>]) -> Option<[usize; 2]> {
    let pairs = (0..confusion.len()).flat_map(|a| (0..a).map(move |b| [b, a]));
    let are_twins = |&[a, b]: &[usize; 2]| {
        let is_other = |one: usize, other: usize| confusion[one][other] > confusion[one][one];
        is_other(a, b) && is_other(b, a) && confusion[a][b].min(confusion[b][a]) >= FEWEST
    };
    pairs.filter(are_twins).max_by_key(|&[a, b]| confusion[a][b] + confusion[b][a])
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use gestalt_vision::dataset::Dataset;
    use gestalt_vision::perception::HandConfig;

    use super::super::super::vocabulary;
    use super::super::look;
    use super::*;

    #[derive(Parser)]
    struct Draw {
        #[command(flatten)]
        args: vocabulary::Args,
    }

    #[derive(Parser)]
    struct Train {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn only_gestures_that_are_taken_for_each_other_are_mirror_images() {
        let of = |rows: &[[u64; 3]]| mirror_images(&rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>());
        assert_eq!(of(&[[9, 0, 0], [0, 2, 7], [1, 5, 3]]), Some([1, 2]));
        // One way alone: what the eyes do not know is taken for something.
        assert_eq!(of(&[[0, 0, 9], [0, 0, 9], [0, 0, 9]]), None);
        // Too few to tell.
        assert_eq!(of(&[[0, 3, 0], [3, 0, 0], [0, 0, 9]]), None);
        assert_eq!(of(&[[0, 4, 5], [4, 0, 0], [5, 0, 0]]), Some([0, 2]));
    }

    #[test]
    fn left_and_right_are_not_mirrored_and_what_has_no_side_is() {
        let folder = tempfile::tempdir().unwrap();
        let drawn = folder.path().to_str().unwrap();
        vocabulary::run(
            &Draw::try_parse_from(["draw", "spatial", "--pictures", drawn, "--people", "16"]).unwrap().args,
        )
        .unwrap();
        for (features, classes, expected) in [
            ("hog", "down,group,left,pair,right,up", Some(["left", "right"])),
            ("shape", "left,right", Some(["left", "right"])),
            ("hog", "down,group,pair,up", None),
        ] {
            let words = ["train", "--dataset", drawn, "--out", "x", "--augment", "2"];
            let words = words.into_iter().chain(["--features", features, "--classes", classes]);
            let args = Train::try_parse_from(words).unwrap().args;
            let labels = args.classes.as_ref().map(|labels| labels.0.as_slice());
            let set = Dataset::list_several(&args.dataset, args.naming(), labels).unwrap().remove(0);
            let mut perception = Perception::new(args.features, HandConfig::default()).unwrap();
            let mut survey = look(&set.images, &mut perception);
            let found = twins(&args, &set.vocabulary, &[&survey], &mut perception);
            let found = found.map(|twins| twins.map(|class| set.vocabulary.labels()[class.index()].as_str()));
            assert_eq!(found, expected, "{features}: {classes}");

            let mut varied = |mirror| {
                survey.vary(&mut perception, (2, mirror), args.seed, || ());
                survey.samples()
            };
            let (with, without) = (varied(true), varied(false));
            assert!(with != without);
            for no_mirror in [true, false] {
                let args = Args { no_mirror, ..args.clone() };
                let mirrors = are_mirrored(&args, &set.vocabulary, &[&survey], &mut perception);
                assert_eq!(mirrors, !no_mirror && expected.is_none());
                vary(&args, mirrors, std::slice::from_mut(&mut survey), &mut perception);
                assert!(survey.samples() == if mirrors { with.clone() } else { without.clone() });
            }
        }
    }
}
