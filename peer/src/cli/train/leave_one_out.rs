//! How well training carries over to people, cameras and places that nobody trained on: whole datasets are left out.

use std::path::Path;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Evaluation, LabelledFeatures, MIN_SAMPLES, Vocabulary};

use super::super::score::Score;
use super::super::{Failure, report};
use super::{Args, fit, judge, look};
use gestalt_vision::dataset::Dataset;
use gestalt_vision::perception::Perception;
use gestalt_vision::survey::{FalseAlarms, Survey, lessons};

/// Scores each dataset by a model that is trained on the others. Gestures that the others do not show are left out.
pub(super) fn compare(
    args: &Args,
    sets: &[Dataset],
    perception: &mut Perception,
) -> Result<Vec<Score>, Failure> {
    if sets.iter().filter(|set| !set.images.is_empty()).count() < 2 {
        return Err("--leave-one-out trains on all datasets but one: give --dataset at least twice".into());
    }
    let surveys: Vec<Survey> =
        sets.iter().map(|set| look(&set.images, args.augment, args.seed, perception)).collect();
    surveys.iter().for_each(report::rejected);
    let mut scores = Vec::new();
    for (left, (folder, set)) in args.dataset.iter().zip(sets).enumerate() {
        let alarms = FalseAlarms::count(&set.none, perception);
        report::unreadable(&alarms);
        if set.images.is_empty() {
            // Nothing to judge; whether a hand is found does not depend on the model.
            scores.push(Score::new(folder, &Evaluation::new(1), &surveys[left], alarms));
            continue;
        }
        let others = surveys.iter().enumerate().filter(|(other, _)| *other != left);
        let lessons = lessons(&others.map(|(_, survey)| survey).collect::<Vec<_>>());
        let taught = Taught::by(&lessons, &set.vocabulary);
        let vocabulary = Vocabulary::new(taught.labels(&set.vocabulary))
            .map_err(|error| format!("nothing to train on without {}: {error}", folder.display()))?;
        let classifier = fit(args, &vocabulary, &taught.samples(&lessons))?.classifier;
        let (known, unknown) = taught.survey(&surveys[left]);
        say_unknown(folder, unknown);
        let mut evaluation = Evaluation::new(classifier.vocabulary().classes());
        judge(&known, &classifier, &mut evaluation)?;
        scores.push(Score::new(folder, &evaluation, &known, alarms));
    }
    Ok(scores)
}

fn say_unknown(folder: &Path, images: usize) {
    if images > 0 {
        eprintln!(
            "note: {}: left out {images} images of gestures that no other dataset shows",
            folder.display()
        );
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
        let (known, unknown) = taught.survey(&survey);
        assert_eq!(known.seen.iter().map(|(_, sample)| sample.class.0).collect::<Vec<_>>(), [1, 0]);
        assert_eq!((known.without_hand.len(), unknown), (1, 3));
    }
}
