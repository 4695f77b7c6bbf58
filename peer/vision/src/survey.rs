//! Looks at all images of a dataset, and counts what cannot be used instead of stopping at it.

use gestalt_strategies::LabelledFeatures;

use crate::dataset::LabelledImage;
use crate::perception::Perception;
use crate::source::read_image;

/// What perception saw in some images.
#[derive(Debug, Default)]
pub struct Survey {
    /// The images that show a hand, each with its features, gesture and person.
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
                        let (class, group) = (image.class, image.person);
                        let sample = LabelledFeatures { features: observation.features, class, group };
                        survey.seen.push((image.clone(), sample));
                    }
                    Err(error) => survey.without_hand.push(rejected(error.to_string())),
                },
                Err(error) => survey.unreadable.push(rejected(error.to_string())),
            }
            step();
        }
        survey
    }

    /// The labelled feature vectors.
    #[must_use]
    pub fn samples(&self) -> Vec<LabelledFeatures> {
        self.seen.iter().map(|(_, sample)| sample.clone()).collect()
    }
}
