//! The folder of the weights: what a course leaves there, each file as a whole or not at all.

use std::io;
use std::path::{Path, PathBuf};

use gestalt_vision::model_file::{Model, ModelFileError};
use thiserror::Error;

use crate::course::{Taught, name};

/// The names of the weights' files, as the program embeds them.
const FILES: [&str; 3] = ["finder.net", "refiner.net", "counter.net"];

/// The name of the classifier's file.
const MODEL: &str = "hands.gestalt";

/// Why a folder is of no use; what is in it has stayed as it was.
#[derive(Debug, Error)]
pub enum FolderError {
    #[error("cannot read {}: {cause}: say with --out where the weights are, or train them", path.display())]
    Unreadable { path: PathBuf, cause: io::Error },
    #[error("cannot write {}: {cause}: its folder must be there, with room, and yours to write to", path.display())]
    Unwritable { path: PathBuf, cause: io::Error },
    #[error("{} was not made for the weights beside it: make it anew with --classifier-only", .0.display())]
    OtherWeights(PathBuf),
    #[error(transparent)]
    Model(#[from] ModelFileError),
}

/// Finds out whether all can be written, before the hour of work that it comes of.
pub fn check(folder: &Path) -> Result<(), FolderError> {
    FILES.into_iter().chain([MODEL]).try_for_each(|name| check_file(&folder.join(name)))
}

/// The same of one file, wherever it is.
pub fn check_file(path: &Path) -> Result<(), FolderError> {
    gestalt_file::check(path).map_err(unwritable(path))
}

/// Writes a file that does not go with others.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), FolderError> {
    gestalt_file::write(path, bytes).map_err(unwritable(path))
}

pub fn write(taught: &Taught, folder: &Path) -> Result<(), FolderError> {
    for (name, bytes) in FILES.iter().zip(&taught.weights) {
        write_file(&folder.join(name), bytes)?;
    }
    // It says which weights it is for, so that one before does not pass for theirs.
    taught.model.write(&folder.join(MODEL))?;
    Ok(())
}

/// The weights of finder, refiner and counter.
pub fn weights(folder: &Path) -> Result<[Vec<u8>; 3], FolderError> {
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read(&path).map_err(|cause| FolderError::Unreadable { path, cause })
    };
    let [finder, refiner, counter] = FILES;
    Ok([read(finder)?, read(refiner)?, read(counter)?])
}

pub fn read(folder: &Path) -> Result<Taught, FolderError> {
    let (weights, path) = (weights(folder)?, folder.join(MODEL));
    let model = Model::read(&path)?;
    if model.classifier.space().feature_set() != name(&weights) {
        return Err(FolderError::OtherWeights(path));
    }
    Ok(Taught { weights, model })
}

/// The fingerprints of the pictures that what lies there was made with, ascending, whichever weights its classifier is for; none where it has no classifier.
pub fn images(folder: &Path) -> Result<Vec<u64>, FolderError> {
    match Model::read(&folder.join(MODEL)) {
        Ok(model) => Ok(model.origin.images),
        Err(ModelFileError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            println!("no {MODEL} is there: what the weights were made with is taken for what is there now");
            Ok(Vec::new())
        }
        Err(error) => Err(error.into()),
    }
}

fn unwritable(path: &Path) -> impl Fn(io::Error) -> FolderError {
    |cause| FolderError::Unwritable { path: path.to_owned(), cause }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::ClassId;
    use gestalt_strategies::{LabelledFeatures, TrainOptions, Vocabulary, train};
    use gestalt_vision::model_file::Origin;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const WEIGHTS: [&str; 3] = ["of the finder", "of the refiner", "of the counter"];

    /// Those weights, and a classifier of features of that name.
    fn taught(features: &str) -> Taught {
        let sample = |i: u8| {
            LabelledFeatures::new(vec![f32::from(i % 2), f32::from(i) / 10.0], ClassId((i % 2).into()), None)
        };
        let samples: Vec<LabelledFeatures> = (0..10).map(sample).collect();
        let vocabulary = Vocabulary::new(["fist", "palm"]).unwrap();
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let trained = train(features, &vocabulary, &samples, &TrainOptions::default(), rng, |_| ()).unwrap();
        let origin = Origin { images: vec![3, 5], ..Origin::default() };
        let weights = WEIGHTS.map(Vec::from);
        Taught { weights, model: Model { classifier: trained.classifier, origin } }
    }

    #[test]
    fn what_is_written_is_read_and_what_cannot_be_is_found_out_before() {
        let folder = tempfile::tempdir().unwrap();
        check(folder.path()).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let taught = taught(&name(&WEIGHTS.map(Vec::from)));
        write(&taught, folder.path()).unwrap();
        let found = read(folder.path()).unwrap();
        assert_eq!((found.weights, found.model), (taught.weights, taught.model));
        let refused = check(&folder.path().join("missing")).unwrap_err().to_string();
        assert!(refused.contains("missing/finder.net") && refused.contains("room"), "{refused}");
    }

    #[test]
    fn a_classifier_of_other_weights_is_none_and_what_it_knows_was_seen_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        assert!(images(here).unwrap().is_empty());
        write(&taught(&name(&WEIGHTS.map(Vec::from))), here).unwrap();
        // A course that ends before its classifier is written.
        write_file(&here.join(FILES[2]), b"of another counter").unwrap();
        let refused = read(here).err().unwrap();
        assert!(matches!(refused, FolderError::OtherWeights(_)), "{refused}");
        assert!(refused.to_string().contains("--classifier-only"), "{refused}");
        assert_eq!(images(here).unwrap(), [3, 5]);
        write_file(&here.join(MODEL), b"no classifier").unwrap();
        assert!(images(here).is_err());
    }
}
