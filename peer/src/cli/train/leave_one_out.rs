//! How well training carries over to people, cameras and places that nobody trained on: whole datasets are left out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Evaluation, LabelledFeatures, MIN_SAMPLES, Vocabulary};

use super::super::score::Score;
use super::super::{Failure, report};
use super::{Args, Eyes, fit, judge, look, mirror};
use gestalt_vision::dataset::{Dataset, LabelledImage};
use gestalt_vision::perception::Perception;
use gestalt_vision::survey::{FalseAlarms, Survey, lessons};

/// Scores each dataset by a model that is trained on the others. Gestures that the others do not show are left out, and so is what learned eyes
/// were made with.
pub(super) fn compare(
    args: &Args,
    sets: &[Dataset],
    perception: &mut Perception,
) -> Result<Vec<Score>, Failure> {
    if sets.iter().filter(|set| !set.images.is_empty()).count() < 2 {
        return Err("--leave-one-out trains on all datasets but one: give --dataset at least twice".into());
    }
    let eyes = Eyes::of(args.features)?;
    let unseen = |(folder, set): (&PathBuf, &Dataset)| {
        let images = eyes.unseen(std::slice::from_ref(folder), set.images.clone())?;
        say_left_out(folder, set.images.len() - images.len(), "that the learned eyes were made with");
        Ok(images)
    };
    let tested: Vec<Vec<LabelledImage>> =
        args.dataset.iter().zip(sets).map(unseen).collect::<Result<_, Failure>>()?;
    let mut surveys: Vec<Survey> = sets.iter().map(|set| look(&set.images, perception)).collect();
    surveys.iter().for_each(report::rejected);
    // What is left out has no say in whether the others are mirrored.
    let mirrored: Vec<bool> = (0..sets.len())
        .map(|left| mirror::are_mirrored(args, &sets[left].vocabulary, &but(&surveys, left), perception))
        .collect();
    let mut varied = None;
    let mut scores = Vec::new();
    for (left, (folder, set)) in args.dataset.iter().zip(sets).enumerate() {
        let none = eyes.unseen_none(&set.none);
        let which = "without a gesture that the learned eyes were made with";
        say_left_out(folder, set.none.len() - none.len(), which);
        let alarms = FalseAlarms::count(&none, perception);
        report::unreadable(&alarms);
        if set.images.is_empty() {
            // Nothing to judge; whether a hand is found does not depend on the model.
            scores.push(Score::new(folder, &Evaluation::new(1), &surveys[left], alarms));
            continue;
        }
        if varied != Some(mirrored[left]) {
            mirror::vary(args, mirrored[left], &mut surveys, perception);
            varied = Some(mirrored[left]);
        }
        let lessons = lessons(&but(&surveys, left));
        let taught = Taught::by(&lessons, &set.vocabulary);
        let vocabulary = Vocabulary::new(taught.labels(&set.vocabulary))
            .map_err(|error| format!("nothing to train on without {}: {error}", folder.display()))?;
        let classifier = fit(args, &vocabulary, &taught.samples(&lessons))?.classifier;
        let (known, unknown) = taught.survey(&only(&surveys[left], &tested[left]));
        say_left_out(folder, unknown, "of gestures that no other dataset shows");
        let mut evaluation = Evaluation::new(classifier.vocabulary().classes());
        judge(&known, &classifier, &mut evaluation)?;
        scores.push(Score::new(folder, &evaluation, &known, alarms));
    }
    Ok(scores)
}

/// All but that one.
fn but(surveys: &[Survey], left: usize) -> Vec<&Survey> {
    let others = surveys.iter().enumerate().filter(|(other, _)| *other != left);
    others.map(|(_, survey)| survey).collect()
}

fn say_left_out(folder: &Path, images: usize, which: &str) {
    if images > 0 {
        eprintln!("note: {}: left out {images} images {which}", folder.display());
    }
}

/// What was seen in these of the images.
fn only(survey: &Survey, images: &[LabelledImage]) -> Survey {
    let paths: BTreeSet<&Path> = images.iter().map(|image| image.path.as_path()).collect();
    let is_one = |image: &LabelledImage| paths.contains(image.path.as_path());
    Survey {
        seen: survey.seen.iter().filter(|(image, _)| is_one(image)).cloned().collect(),
        without_hand: survey.without_hand.iter().filter(|missed| is_one(&missed.image)).cloned().collect(),
        unreadable: survey.unreadable.iter().filter(|file| is_one(&file.image)).cloned().collect(),
    }
}

/// The gestures that there is enough of to learn, and the class that each has among these alone.
struct Taught(Vec<Option<ClassId>>);

impl Taught {
    fn by(samples: &[LabelledFeatures], vocabulary: &Vocabulary) -> Self {
        let mut counts = vec![0; vocabulary.classes()];
        samples.iter().for_each(|sample| counts[sample.class.index()] += 1);
        let mut classes = (0..).map(ClassId);
        Self(
            counts.into_iter().map(|count| if count < MIN_SAMPLES { None } else { classes.next() }).collect(),
        )
    }

    fn labels(&self, vocabulary: &Vocabulary) -> Vec<String> {
        let labels = vocabulary.labels().iter().zip(&self.0);
        labels.filter(|(_, class)| class.is_some()).map(|(label, _)| label.clone()).collect()
    }

    fn samples(&self, samples: &[LabelledFeatures]) -> Vec<LabelledFeatures> {
        let known = samples.iter().filter_map(|sample| Some((sample, self.0[sample.class.index()]?)));
        known.map(|(sample, class)| LabelledFeatures { class, ..sample.clone() }).collect()
    }

    /// What is to be judged, and how many images show other gestures.
    fn survey(&self, survey: &Survey) -> (Survey, usize) {
        let mut known = Survey::default();
        for (image, sample) in &survey.seen {
            if let Some(class) = self.0[sample.class.index()] {
                known.seen.push((image.clone(), LabelledFeatures { class, ..sample.clone() }));
            }
        }
        let missed = survey.without_hand.iter();
        known.without_hand =
            missed.filter(|missed| self.0[missed.image.class.index()].is_some()).cloned().collect();
        let unknown = survey.readable() - known.readable();
        (known, unknown)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_vision::dataset::LabelledImage;
    use gestalt_vision::survey::Rejected;

    use super::*;

    #[test]
    fn gestures_that_the_others_do_not_show_are_neither_learned_nor_judged() {
        let sample = |class| LabelledFeatures::new(vec![], ClassId(class), None);
        let image = |class| LabelledImage { path: "x.jpg".into(), class: ClassId(class), person: None };
        let vocabulary = Vocabulary::new(["0", "1", "2", "3"]).unwrap();
        // One sample of "2" is too few, of "0" there is none.
        let samples: Vec<_> = [1, 3, 1, 2, 3].map(sample).into();
        let taught = Taught::by(&samples, &vocabulary);
        assert_eq!(taught.labels(&vocabulary), ["1", "3"]);
        let classes: Vec<u32> = taught.samples(&samples).iter().map(|sample| sample.class.0).collect();
        assert_eq!(classes, [0, 1, 0, 1]);

        let rejected = |class| Rejected { image: image(class), cause: String::new() };
        let survey = Survey {
            seen: [0, 3, 1, 2].map(|class| (image(class), sample(class))).into(),
            without_hand: vec![rejected(3), rejected(0)],
            ..Survey::default()
        };
        let named = |path: &str, class| LabelledImage { path: path.into(), ..image(class) };
        let looked = Survey {
            seen: vec![(named("a.jpg", 1), sample(1)), (named("b.jpg", 3), sample(3))],
            without_hand: vec![Rejected { image: named("c.jpg", 1), cause: String::new() }],
            ..Survey::default()
        };
        let left = only(&looked, &[named("b.jpg", 3)]);
        assert_eq!((left.seen, left.without_hand.len()), (looked.seen[1..].to_vec(), 0));

        let (known, unknown) = taught.survey(&survey);
        assert_eq!(known.seen.iter().map(|(_, sample)| sample.class.0).collect::<Vec<_>>(), [1, 0]);
        assert_eq!((known.without_hand.len(), unknown), (1, 3));
    }
}
