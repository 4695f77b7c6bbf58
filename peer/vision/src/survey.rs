//! Looks at all images of a dataset, and counts what cannot be used instead of stopping at it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::LabelledFeatures;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::dataset::LabelledImage;
use crate::perception::Perception;
use crate::source::read_image;
use crate::variation::{mirrored, varied};

/// What perception saw in some images.
#[derive(Debug, Default)]
pub struct Survey {
    /// The images that show a hand, each with its features, gesture and person, and what was seen in variations of it.
    pub seen: Vec<(LabelledImage, LabelledFeatures)>,
    /// Images without a hand, or whose hand was not found.
    pub without_hand: Vec<Rejected>,
    /// Files that are no image: damaged, cut short, too large.
    pub unreadable: Vec<Rejected>,
}

/// An image that gave no features.
#[derive(Clone, Debug)]
pub struct Rejected {
    /// Which one, and what it should show.
    pub image: LabelledImage,
    /// Why.
    pub cause: String,
}

impl Survey {
    /// Looks at each image; `step` is called after each.
    pub fn of(images: &[LabelledImage], perception: &mut Perception, mut step: impl FnMut()) -> Self {
        let mut survey = Self::default();
        for image in images {
            let rejected = |cause: String| Rejected { image: image.clone(), cause };
            match read_image(&image.path) {
                Ok(frame) => match perception.observe(&frame) {
                    Ok(observation) => {
                        let (features, class, group) = (observation.features, image.class, image.person);
                        let variations = Vec::new();
                        survey
                            .seen
                            .push((image.clone(), LabelledFeatures { features, class, group, variations }));
                    }
                    Err(error) => survey.without_hand.push(rejected(error.to_string())),
                },
                Err(error) => survey.unreadable.push(rejected(error.to_string())),
            }
            step();
        }
        survey
    }

    /// Looks at as many [variations](varied) of each image that shows a hand, drawn by the seed; those whose hand is not found
    /// any more are left out. `step` is called after each image.
    pub fn vary(
        &mut self,
        perception: &mut Perception,
        (copies, mirror): (usize, bool),
        seed: u64,
        mut step: impl FnMut(),
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for (image, sample) in &mut self.seen {
            if let Ok(frame) = read_image(&image.path) {
                let varied = (0..copies).filter_map(|_| varied(&frame, mirror, &mut rng).ok());
                let observed = varied.filter_map(|frame| perception.observe(&frame).ok());
                sample.variations = observed.map(|observation| observation.features).collect();
            }
            step();
        }
    }

    /// What the mirror images of at most so many images of each gesture show: the gesture, and the features of those whose hand
    /// is found. The images are taken evenly from all of its, so that all people have part.
    pub fn mirrored(&self, perception: &mut Perception, most: usize) -> Vec<(ClassId, Vec<f32>)> {
        let mut images: BTreeMap<ClassId, Vec<&Path>> = BTreeMap::new();
        for (image, sample) in &self.seen {
            images.entry(sample.class).or_default().push(&image.path);
        }
        let mut seen = Vec::new();
        for (class, paths) in images {
            for path in paths.iter().step_by(paths.len().div_ceil(most.max(1)).max(1)) {
                let mirror_image = read_image(path).ok().and_then(|frame| mirrored(&frame).ok());
                let observed = mirror_image.and_then(|frame| perception.observe(&frame).ok());
                seen.extend(observed.map(|observation| (class, observation.features)));
            }
        }
        seen
    }

    /// The labelled feature vectors of the images, each with those of its variations.
    #[must_use]
    pub fn samples(&self) -> Vec<LabelledFeatures> {
        self.seen.iter().map(|(_, sample)| sample.clone()).collect()
    }

    /// How many variations of images were seen.
    #[must_use]
    pub fn variations(&self) -> usize {
        self.seen.iter().map(|(_, sample)| sample.variations.len()).sum()
    }

    /// How many images could be read.
    #[must_use]
    pub fn readable(&self) -> usize {
        self.seen.len() + self.without_hand.len()
    }

    /// Takes in another survey.
    pub fn append(&mut self, mut other: Self) {
        self.seen.append(&mut other.seen);
        self.without_hand.append(&mut other.without_hand);
        self.unreadable.append(&mut other.unreadable);
    }
}

/// What is to be learned from some surveys. In cross-validation a person's samples stay together, and an image of nobody in
/// particular is a person of its own.
#[must_use]
pub fn lessons(surveys: &[&Survey]) -> Vec<LabelledFeatures> {
    let seen = || surveys.iter().flat_map(|survey| &survey.seen);
    let people = seen().filter_map(|(image, _)| image.person);
    let next = people.max().map_or(0, |last| last.saturating_add(1));
    let mut numbers: BTreeMap<&Path, u32> = BTreeMap::new();
    for (image, _) in seen() {
        let number = next.saturating_add(u32::try_from(numbers.len()).unwrap_or(u32::MAX));
        numbers.entry(&image.path).or_insert(number);
    }
    let lesson = |(image, sample): &(LabelledImage, LabelledFeatures)| {
        let group = image.person.or_else(|| numbers.get(image.path.as_path()).copied());
        LabelledFeatures { group, ..sample.clone() }
    };
    seen().map(lesson).collect()
}

/// How often a hand was reported where there is none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FalseAlarms {
    /// Images in which perception found a hand.
    pub alarms: u64,
    /// Images that could be read.
    pub images: u64,
    /// Files that are no image, each with the cause.
    pub unreadable: Vec<(PathBuf, String)>,
}

impl FalseAlarms {
    /// Looks at images without a gesture.
    pub fn count(images: &[PathBuf], perception: &mut Perception) -> Self {
        let mut found = Self::default();
        for path in images {
            match read_image(path) {
                Ok(frame) => {
                    found.alarms += u64::from(perception.observe(&frame).is_ok());
                    found.images += 1;
                }
                Err(error) => found.unreadable.push((path.clone(), error.to_string())),
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::Vector;
    use opencv::imgcodecs::imwrite;

    use super::*;
    use crate::camera_model::CameraModel;
    use crate::perception::{FeatureSet, HandConfig};
    use crate::pose::Pose;
    use crate::source::{Glove, RenderedSource, Scene, Source};

    /// Rendered hands that show so many fingers, and one empty scene, as files.
    fn pictures(folder: &Path, fingers: &[Option<u8>]) -> Vec<LabelledImage> {
        let mut source =
            RenderedSource::new(CameraModel::footbot(), Pose::FRONTAL, Glove::default(), 1).unwrap();
        let mut picture = |(k, &gesture): (usize, &Option<u8>)| {
            let frame = source.next_frame(std::time::Duration::ZERO, &Scene { gesture, seed: 1 }).unwrap();
            let path = folder.join(format!("{k}.png"));
            assert!(imwrite(&path, &frame.image, &Vector::new()).unwrap());
            LabelledImage { path, class: ClassId(gesture.unwrap_or_default().into()), person: None }
        };
        fingers.iter().enumerate().map(&mut picture).collect()
    }

    #[test]
    fn variations_are_learned_beside_their_picture_and_never_counted() {
        let folder = tempfile::tempdir().unwrap();
        let images = pictures(folder.path(), &[Some(2), None, Some(5)]);
        let mut perception = Perception::new(FeatureSet::Shape, HandConfig::default()).unwrap();
        let plain = Survey::of(&images, &mut perception, || ());
        let mut look = |seed| {
            let mut survey = Survey::of(&images, &mut perception, || ());
            survey.vary(&mut perception, (3, true), seed, || ());
            survey
        };
        let survey = look(1);
        assert_eq!((survey.seen.len(), survey.without_hand.len(), survey.readable()), (2, 1, 3));
        let features = |survey: &Survey| -> Vec<_> {
            survey.seen.iter().map(|(_, sample)| sample.features.clone()).collect()
        };
        assert_eq!(features(&survey), features(&plain));
        assert!(plain.variations() == 0 && survey.variations() > 3, "{} variations", survey.variations());
        assert_eq!(survey.seen, look(1).seen);
        assert_ne!(survey.seen, look(2).seen);

        let lessons = lessons(&[&survey]);
        let shown: Vec<_> = lessons.iter().map(|lesson| (lesson.class, lesson.group)).collect();
        assert_eq!(shown, [(ClassId(2), Some(0)), (ClassId(5), Some(1))]);
        assert!(
            lessons.iter().zip(&survey.seen).all(|(lesson, seen)| lesson.variations == seen.1.variations)
        );
    }

    #[test]
    fn a_hand_in_an_empty_scene_is_a_false_alarm() {
        let folder = tempfile::tempdir().unwrap();
        let shown = pictures(folder.path(), &[None, Some(4), None]);
        let mut paths: Vec<PathBuf> = shown.into_iter().map(|image| image.path).collect();
        let damaged = folder.path().join("damaged.png");
        std::fs::write(&damaged, "no image").unwrap();
        paths.insert(1, damaged.clone());
        paths.push(folder.path().join("missing.png"));
        let mut perception = Perception::new(FeatureSet::Shape, HandConfig::default()).unwrap();
        let FalseAlarms { alarms, images, unreadable } = FalseAlarms::count(&paths, &mut perception);
        assert_eq!((alarms, images), (1, 3));
        let unreadable: Vec<PathBuf> = unreadable.into_iter().map(|(path, _)| path).collect();
        assert_eq!(unreadable, [damaged, folder.path().join("missing.png")]);
    }
}
