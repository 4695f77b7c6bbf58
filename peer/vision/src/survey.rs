//! Looks at all images of a dataset, and counts what cannot be used instead of stopping at it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gestalt_strategies::LabelledFeatures;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::dataset::LabelledImage;
use crate::perception::Perception;
use crate::source::read_image;
use crate::variation::varied;

/// What perception saw in some images.
#[derive(Debug, Default)]
pub struct Survey {
    /// The images that show a hand, each with its features, gesture and person.
    pub seen: Vec<(LabelledImage, LabelledFeatures)>,
    /// What it saw in variations of them.
    pub copies: Vec<(LabelledImage, LabelledFeatures)>,
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
    pub fn of(images: &[LabelledImage], perception: &mut Perception, step: impl FnMut()) -> Self {
        Self::with_copies(images, perception, 0, 0, step)
    }

    /// Looks at each image and, where it shows a hand, at as many [variations](varied) of it, drawn by the seed; those whose
    /// hand is not found any more are left out. `step` is called after each image.
    pub fn with_copies(
        images: &[LabelledImage],
        perception: &mut Perception,
        copies: usize,
        seed: u64,
        mut step: impl FnMut(),
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut survey = Self::default();
        for image in images {
            let rejected = |cause: String| Rejected { image: image.clone(), cause };
            let labelled = |features: Vec<f32>| {
                (image.clone(), LabelledFeatures { features, class: image.class, group: image.person })
            };
            match read_image(&image.path) {
                Ok(frame) => match perception.observe(&frame) {
                    Ok(observation) => {
                        survey.seen.push(labelled(observation.features));
                        let varied = (0..copies).filter_map(|_| varied(&frame, &mut rng).ok());
                        let observed = varied.filter_map(|frame| perception.observe(&frame).ok());
                        survey.copies.extend(observed.map(|observation| labelled(observation.features)));
                    }
                    Err(error) => survey.without_hand.push(rejected(error.to_string())),
                },
                Err(error) => survey.unreadable.push(rejected(error.to_string())),
            }
            step();
        }
        survey
    }

    /// The labelled feature vectors of the images themselves.
    #[must_use]
    pub fn samples(&self) -> Vec<LabelledFeatures> {
        self.seen.iter().map(|(_, sample)| sample.clone()).collect()
    }

    /// How many images could be read.
    #[must_use]
    pub fn readable(&self) -> usize {
        self.seen.len() + self.without_hand.len()
    }

    /// Takes in another survey.
    pub fn append(&mut self, mut other: Self) {
        self.seen.append(&mut other.seen);
        self.copies.append(&mut other.copies);
        self.without_hand.append(&mut other.without_hand);
        self.unreadable.append(&mut other.unreadable);
    }
}

/// What is to be learned from some surveys. In cross-validation a person's samples stay together, and so do an image of
/// nobody in particular and its variations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lessons {
    /// Of the images themselves.
    pub images: Vec<LabelledFeatures>,
    /// Of their variations.
    pub copies: Vec<LabelledFeatures>,
}

impl Lessons {
    /// Those of several surveys together.
    #[must_use]
    pub fn of(surveys: &[&Survey]) -> Self {
        let people = surveys.iter().flat_map(|survey| &survey.seen).filter_map(|(image, _)| image.person);
        let next = people.max().map_or(0, |last| last.saturating_add(1));
        let mut numbers: BTreeMap<&Path, u32> = BTreeMap::new();
        for (image, _) in surveys.iter().flat_map(|survey| &survey.seen) {
            let number = next.saturating_add(u32::try_from(numbers.len()).unwrap_or(u32::MAX));
            numbers.entry(&image.path).or_insert(number);
        }
        let lesson = |(image, sample): &(LabelledImage, LabelledFeatures)| {
            let group = image.person.or_else(|| numbers.get(image.path.as_path()).copied());
            LabelledFeatures { group, ..sample.clone() }
        };
        Self {
            images: surveys.iter().flat_map(|survey| &survey.seen).map(lesson).collect(),
            copies: surveys.iter().flat_map(|survey| &survey.copies).map(lesson).collect(),
        }
    }
}

/// How often a hand was reported where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FalseAlarms {
    /// Images in which perception found a hand.
    pub alarms: u64,
    /// Images that could be read.
    pub images: u64,
}

impl FalseAlarms {
    /// Looks at images without a gesture.
    pub fn count(images: &[PathBuf], perception: &mut Perception) -> Self {
        let frames = images.iter().filter_map(|path| read_image(path).ok());
        frames.fold(Self::default(), |Self { alarms, images }, frame| Self {
            alarms: alarms + u64::from(perception.observe(&frame).is_ok()),
            images: images + 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::ClassId;
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
        let mut look = |seed| Survey::with_copies(&images, &mut perception, 3, seed, || ());
        let survey = look(1);
        assert_eq!((survey.seen.len(), survey.without_hand.len(), survey.readable()), (2, 1, 3));
        assert_eq!(survey.samples(), plain.samples());
        assert!(plain.copies.is_empty() && survey.copies.len() > 3, "{} copies", survey.copies.len());
        assert_eq!(survey.copies, look(1).copies);
        assert_ne!(survey.copies, look(2).copies);

        let lessons = Lessons::of(&[&survey]);
        assert_eq!((lessons.images.len(), lessons.copies.len()), (2, survey.copies.len()));
        let all: Vec<_> = lessons.images.iter().chain(&lessons.copies).collect();
        let groups = |class| all.iter().filter(move |s| s.class == ClassId(class)).map(|s| s.group);
        assert!(groups(2).all(|group| group == Some(0)) && groups(5).all(|group| group == Some(1)));
    }

    #[test]
    fn a_hand_in_an_empty_scene_is_a_false_alarm() {
        let folder = tempfile::tempdir().unwrap();
        let shown = pictures(folder.path(), &[None, Some(4), None]);
        let mut paths: Vec<PathBuf> = shown.into_iter().map(|image| image.path).collect();
        paths.push(folder.path().join("missing.png"));
        let mut perception = Perception::new(FeatureSet::Shape, HandConfig::default()).unwrap();
        assert_eq!(FalseAlarms::count(&paths, &mut perception), FalseAlarms { alarms: 1, images: 3 });
    }
}
