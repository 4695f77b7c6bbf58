//! What learned eyes were made with: no test of them, whatever classifier judges what they see.

use std::path::PathBuf;

use gestalt_protocol::ClassId;

use super::super::Failure;
use gestalt_vision::dataset::{LabelledImage, joined};
use gestalt_vision::model;
use gestalt_vision::model_file::Origin;
use gestalt_vision::perception::FeatureSet;

/// How the eyes of a feature set came to be; `None` of features that nothing was trained for.
pub(in crate::cli) struct Eyes(Option<Origin>);

impl Eyes {
    pub fn of(features: FeatureSet) -> Result<Self, Failure> {
        Ok(Self(match features {
            FeatureSet::Embedding => Some(model::hands()?.origin),
            FeatureSet::Shape | FeatureSet::Hog => None,
        }))
    }

    /// Those of these images that they were not made with, nor with the people in them.
    ///
    /// # Errors
    /// When none of them is left.
    pub fn unseen(
        &self,
        folders: &[PathBuf],
        images: Vec<LabelledImage>,
    ) -> Result<Vec<LabelledImage>, Failure> {
        let Some(origin) = &self.0 else { return Ok(images) };
        let any = !images.is_empty();
        let kept = origin.unseen(images);
        if any && kept.is_empty() {
            return Err(format!(
                "the learned eyes were made with the pictures in {}, or with the people in them, so nothing is left to measure on: take \
                 other pictures, train with --features shape or hog, or use evaluate --include-training to measure training accuracy",
                joined(folders)
            )
            .into());
        }
        Ok(kept)
    }

    /// Those of these pictures without a gesture that they were not made with.
    pub fn unseen_none(&self, none: &[PathBuf]) -> Vec<PathBuf> {
        let Some(origin) = &self.0 else { return none.to_vec() };
        let nobodys = |path: &PathBuf| LabelledImage { path: path.clone(), class: ClassId(0), person: None };
        let unseen = origin.unseen(none.iter().map(nobodys).collect());
        unseen.into_iter().map(|image| image.path).collect()
    }

    /// How many of these images they were made with, or with the people in them.
    pub fn count_known(&self, images: Vec<LabelledImage>) -> usize {
        let all = images.len();
        self.0.as_ref().map_or(0, |origin| all - origin.unseen(images).len())
    }
}

#[cfg(test)]
pub(in crate::cli) mod tests {
    use std::path::Path;

    use super::*;

    /// Files of two people, and eyes that were made with the first of them.
    pub fn images(folder: &Path) -> (Vec<LabelledImage>, Eyes) {
        let image = |(name, person): (&str, u32)| {
            let path = folder.join(name);
            std::fs::write(&path, name).unwrap();
            LabelledImage { path, class: ClassId(0), person: Some(person) }
        };
        let images: Vec<LabelledImage> =
            [("s001_0.jpg", 1), ("s001_1.jpg", 1), ("s002_0.jpg", 2)].map(image).into();
        let origin = Origin { images: vec![images[0].fingerprint().unwrap()], ..Origin::default() };
        (images, Eyes(Some(origin)))
    }

    #[test]
    fn what_the_eyes_were_made_with_is_left_out_and_so_is_who_is_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let (images, eyes) = images(folder.path());
        let folders = [folder.path().to_owned()];
        assert_eq!(eyes.unseen(&folders, images.clone()).unwrap(), images[2..]);
        let error = eyes.unseen(&folders, images[..2].to_vec()).err().unwrap().to_string();
        assert!(error.contains("learned eyes") && error.contains("--features shape"), "{error}");
        assert_eq!(Eyes(None).unseen(&folders, images.clone()).unwrap(), images);
        assert_eq!((eyes.count_known(images.clone()), Eyes(None).count_known(images.clone())), (2, 0));
        // Of pictures without a gesture each counts for itself.
        let none: Vec<PathBuf> = images.into_iter().map(|image| image.path).collect();
        assert_eq!((eyes.unseen_none(&none), Eyes(None).unseen_none(&none)), (none[1..].to_vec(), none));
    }

    #[test]
    fn learned_eyes_alone_were_made_with_anything() {
        let made_with = |features| Eyes::of(features).unwrap().0.map_or(0, |origin| origin.images.len());
        assert!(made_with(FeatureSet::Embedding) > 1000);
        assert_eq!([FeatureSet::Shape, FeatureSet::Hog].map(made_with), [0, 0]);
    }
}
