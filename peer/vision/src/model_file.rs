//! A trained classifier on disk.
//!
//! ```text
//! magic "GESTALT\n" │ version u16 │ length of the body u64 │ CRC-32 of the body u32 │ body (postcard)
//! ```
//! Numbers are little-endian.

use std::collections::BTreeSet;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_strategies::{Classifier, MAX_MODEL, ModelError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::dataset::LabelledImage;

const MAGIC: &[u8; 8] = b"GESTALT\n";
/// The layout of the file; another layout gets another number.
const VERSION: u16 = 1;
const HEADER: usize = 8 + 2 + 8 + 4;
/// Longest body that is read: a classifier, and the record of its training.
const MAX_BODY: u64 = 2 * MAX_MODEL as u64;

fn remedy(action: &str) -> &'static str {
    match action {
        "write" => "its folder must be there, with room, and yours to write to",
        _ => "check the path; `gestalt train --out FILE` writes one",
    }
}

/// A file that is not a usable model.
#[derive(Debug, Error)]
pub enum ModelFileError {
    /// It cannot be read or written.
    #[error("cannot {action} the model {}: {source}: {}", path.display(), remedy(action))]
    Io {
        /// `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Something else altogether.
    #[error("{} is not a model file: `gestalt train` writes one", .0.display())]
    NotAModel(PathBuf),
    /// Written by another version of the program.
    #[error("the model {} has file version {found}, this program reads version {VERSION}: train it again", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u16,
    },
    /// Its end is missing.
    #[error("the model {} is truncated ({found} of {expected} bytes): copy it again, or train it again", path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
        /// Bytes of the body that are there.
        found: u64,
        /// Bytes of the body that its header promises.
        expected: u64,
    },
    /// Its contents are not those that were written.
    #[error("the model {} is corrupted (checksum mismatch): copy it again, or train it again", .0.display())]
    Damaged(PathBuf),
    /// Checksum right, contents wrong: written by another program.
    #[error("the model {} cannot be used: {source}", path.display())]
    Contents {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ModelError,
    },
    /// Larger than any model.
    #[error("the model {} declares {size} bytes; at most {MAX_BODY} are allowed", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Bytes it claims.
        size: u64,
    },
    /// Trained on other features than those that are computed here.
    #[error(
        "the model expects {expected} features of the '{model}' set, but perception gives {found} of '{perception}': train a model for '{perception}'"
    )]
    FeatureSet {
        /// The model's feature set.
        model: String,
        /// How many features the model takes.
        expected: usize,
        /// Perception's feature set.
        perception: String,
        /// How many features perception gives.
        found: usize,
    },
}

/// How a model came to be: what must be known to measure it honestly, and to make it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Name of the dataset's folder, or of several; of synthetic hands, what was rendered.
    pub dataset: String,
    /// The people it has seen in training, by the numbers of that dataset; of several datasets, numbered through.
    pub people: Vec<u32>,
    /// The [fingerprints](crate::dataset::LabelledImage::fingerprint) of the images it was shown in training, ascending, also
    /// of those in which no hand was found.
    pub images: Vec<u64>,
    /// The seed of the training.
    pub seed: u64,
    /// The chosen C.
    pub cost: f64,
    /// The chosen γ, in units of 1 / (total variance of the reduced samples).
    pub gamma: f64,
}

impl Origin {
    /// Those of these images that it was not shown. Of everyone who shows one of those that it was, all images are left out.
    #[must_use]
    pub fn unseen(&self, images: Vec<LabelledImage>) -> Vec<LabelledImage> {
        let known_image = |image: &LabelledImage| {
            // A file that cannot be read is reported when it is looked at.
            image.fingerprint().is_ok_and(|print| self.images.binary_search(&print).is_ok())
        };
        let known: Vec<bool> = images.iter().map(known_image).collect();
        let seen = images.iter().zip(&known).filter(|(_, known)| **known);
        let people: BTreeSet<u32> = seen.filter_map(|(image, _)| image.person).collect();
        let known_person =
            |image: &LabelledImage| image.person.is_some_and(|person| people.contains(&person));
        let kept = images.into_iter().zip(known).filter(|(image, known)| !known && !known_person(image));
        kept.map(|(image, _)| image).collect()
    }
}

/// A classifier and its origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What judges.
    pub classifier: Classifier,
    /// How it came to be.
    pub origin: Origin,
}

#[derive(Serialize, Deserialize)]
struct Body {
    origin: Origin,
    classifier: Vec<u8>,
}

impl Model {
    /// Reads a model. Any file gives a model or an error.
    ///
    /// # Errors
    /// See [`ModelFileError`].
    pub fn read(path: &Path) -> Result<Self, ModelFileError> {
        let failed = |source| ModelFileError::Io { action: "read", path: path.to_owned(), source };
        let mut bytes = Vec::new();
        let file = gestalt_file::open(path).map_err(failed)?;
        file.take(HEADER as u64 + MAX_BODY + 1).read_to_end(&mut bytes).map_err(failed)?;
        Self::decode(&bytes, path)
    }

    /// Reads a model from the bytes of its file; `path` is named in errors.
    ///
    /// # Errors
    /// See [`ModelFileError`].
    pub fn decode(bytes: &[u8], path: &Path) -> Result<Self, ModelFileError> {
        let Some((header, body)) = bytes.split_at_checked(HEADER) else {
            return Err(ModelFileError::NotAModel(path.to_owned()));
        };
        let (magic, rest) = header.split_at(8);
        let (version, rest) = rest.split_at(2);
        let (length, checksum) = rest.split_at(8);
        if magic != MAGIC {
            return Err(ModelFileError::NotAModel(path.to_owned()));
        }
        let version = little_endian(version) as u16;
        if version != VERSION {
            return Err(ModelFileError::Version { path: path.to_owned(), found: version });
        }
        let expected = little_endian(length);
        if expected > MAX_BODY {
            return Err(ModelFileError::TooLarge { path: path.to_owned(), size: expected });
        }
        let found = body.len() as u64;
        if found < expected {
            return Err(ModelFileError::CutShort { path: path.to_owned(), found, expected });
        }
        if found > expected || u64::from(crc32fast::hash(body)) != little_endian(checksum) {
            return Err(ModelFileError::Damaged(path.to_owned()));
        }
        let contents = |source| ModelFileError::Contents { path: path.to_owned(), source };
        let body: Body = postcard::from_bytes(body).map_err(|_| contents(ModelError::Malformed))?;
        let classifier = Classifier::decode(&body.classifier).map_err(contents)?;
        Ok(Self { classifier, origin: body.origin })
    }

    /// Writes the model: to a temporary file beside `path`, which then takes its name, so that no reader ever
    /// sees half a model and an older one survives a failure. A link stays, and what it leads to is replaced.
    ///
    /// # Errors
    /// [`ModelFileError::Io`]; nothing has changed then.
    pub fn write(&self, path: &Path) -> Result<(), ModelFileError> {
        let body = Body { origin: self.origin.clone(), classifier: self.classifier.encode() };
        let body =
            postcard::to_stdvec(&body).expect("postcard writes every value of known length into a vector");
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(crc32fast::hash(&body).to_le_bytes());
        bytes.extend(body);

        gestalt_file::write(path, &bytes).map_err(unwritable(path))
    }

    /// Finds out whether [`Self::write`] can succeed, before the work of training is done.
    ///
    /// # Errors
    /// [`ModelFileError::Io`] when the folder does not exist or may not be written.
    pub fn check_writable(path: &Path) -> Result<(), ModelFileError> {
        gestalt_file::check(path).map_err(unwritable(path))
    }

    /// Checks that the model takes what perception gives.
    ///
    /// # Errors
    /// [`ModelFileError::FeatureSet`].
    pub fn check_features(&self, name: &str, length: usize) -> Result<(), ModelFileError> {
        if self.classifier.space().feature_set() == name && self.classifier.space().features() == length {
            return Ok(());
        }
        Err(ModelFileError::FeatureSet {
            model: self.classifier.space().feature_set().to_owned(),
            expected: self.classifier.space().features(),
            perception: name.to_owned(),
            found: length,
        })
    }
}

fn unwritable(path: &Path) -> impl Fn(io::Error) -> ModelFileError {
    |source| ModelFileError::Io { action: "write", path: path.to_owned(), source }
}

fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use gestalt_protocol::ClassId;
    use gestalt_strategies::{LabelledFeatures, TrainOptions, Vocabulary, train};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::dataset::Dataset;

    fn model() -> Model {
        let sample = |i: u8| {
            LabelledFeatures::new(vec![f32::from(i % 2), f32::from(i) / 10.0], ClassId((i % 2).into()), None)
        };
        let samples: Vec<LabelledFeatures> = (0..10).map(sample).collect();
        let vocabulary = Vocabulary::new(["fist", "palm"]).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let trained =
            train("toy-1", &vocabulary, &samples, &TrainOptions::default(), &mut rng, |_| ()).unwrap();
        let origin = Origin { dataset: "toys".to_owned(), people: vec![3, 5], seed: 1, ..Origin::default() };
        Model { classifier: trained.classifier, origin }
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hands.model");
        let model = model();
        Model::check_writable(&path).unwrap();
        model.write(&path).unwrap();
        model.write(&path).unwrap();
        assert_eq!(Model::read(&path).unwrap(), model);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn a_model_that_is_not_whole_is_refused_by_its_reason() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hands.model");
        model().write(&path).unwrap();
        let whole = fs::read(&path).unwrap();
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            Model::read(&path).unwrap_err()
        };

        for length in [0, 5, HEADER - 1] {
            assert!(matches!(read(&whole[..length]), ModelFileError::NotAModel(_)), "{length}");
        }
        for length in [HEADER, whole.len() / 2, whole.len() - 1] {
            assert!(matches!(read(&whole[..length]), ModelFileError::CutShort { .. }), "{length}");
        }
        let changed = |index: usize, value: u8| {
            let mut bytes = whole.clone();
            bytes[index] = value;
            bytes
        };
        assert!(matches!(read(&changed(0, b'X')), ModelFileError::NotAModel(_)));
        assert!(matches!(read(&changed(8, 9)), ModelFileError::Version { found: 9, .. }));
        assert!(matches!(read(&changed(17, 1)), ModelFileError::TooLarge { .. }));
        for index in [18, HEADER, whole.len() / 2, whole.len() - 1] {
            let damaged = changed(index, whole[index] ^ 1);
            assert!(matches!(read(&damaged), ModelFileError::Damaged(_)), "byte {index}");
        }
        assert!(matches!(read(&[&whole[..], &[0]].concat()), ModelFileError::Damaged(_)));
    }

    #[test]
    fn what_cannot_be_read_or_written_says_so() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(Model::read(folder.path()), Err(ModelFileError::Io { action: "read", .. })));
        let nowhere = folder.path().join("missing/hands.model");
        assert!(matches!(Model::read(&nowhere), Err(ModelFileError::Io { .. })));
        for path in [nowhere.as_path(), folder.path()] {
            assert!(matches!(Model::check_writable(path), Err(ModelFileError::Io { action: "write", .. })));
            assert!(matches!(model().write(path), Err(ModelFileError::Io { action: "write", .. })));
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_a_link_leads_to_is_replaced_whole() {
        use std::os::unix::fs::{MetadataExt, symlink};

        let folder = tempfile::tempdir().unwrap();
        let [old, kept, link, lost] = ["old", "kept", "link", "lost"].map(|name| folder.path().join(name));
        fs::write(&old, "old").unwrap();
        // Who reads the old one meanwhile reads on in it.
        fs::hard_link(&old, &kept).unwrap();
        symlink("old", &link).unwrap();
        Model::check_writable(&link).unwrap();
        model().write(&link).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(Model::read(&old).unwrap(), model());
        assert_eq!(fs::read(&kept).unwrap(), b"old");
        assert_ne!(fs::metadata(&old).unwrap().ino(), fs::metadata(&kept).unwrap().ino());
        symlink("missing/hands.model", &lost).unwrap();
        assert!(matches!(Model::check_writable(&lost), Err(ModelFileError::Io { action: "write", .. })));
        assert!(model().write(&lost).is_err());
        fs::create_dir(folder.path().join("missing")).unwrap();
        Model::check_writable(&lost).unwrap();
        model().write(&lost).unwrap();
        assert_eq!(Model::read(&lost).unwrap(), model());
    }

    #[test]
    fn a_model_of_other_features_is_refused() {
        let model = model();
        assert!(model.check_features("toy-1", 2).is_ok());
        let error = model.check_features("hog-1", 1764).unwrap_err().to_string();
        assert!(error.contains("'toy-1'") && error.contains("1764 of 'hog-1'"), "{error}");
    }

    #[test]
    fn people_trained_on_are_left_out_where_the_numbers_mean_the_same() {
        let folder = tempfile::tempdir().unwrap();
        for file in ["0/s001_a.jpg", "0/s001_b.jpg", "0/s002_a.jpg", "1/x.jpg"] {
            fs::create_dir_all(folder.path().join(file).parent().unwrap()).unwrap();
            fs::write(folder.path().join(file), file).unwrap();
        }
        let images = Dataset::list(folder.path(), None).unwrap().images;
        let names = |images: Vec<LabelledImage>| -> Vec<String> {
            images.iter().map(|i| i.path.file_name().unwrap().to_str().unwrap().to_owned()).collect()
        };
        // Trained on s001_a of this very dataset: the other picture of person 1 is no test either.
        let origin = |prints: Vec<u64>| Origin { people: vec![2], images: prints, ..Origin::default() };
        // Trained with another dataset, whose people are numbered through with these.
        let seen = origin(vec![images[0].fingerprint().unwrap()]);
        assert_eq!(names(seen.unseen(images.clone())), ["s002_a.jpg", "x.jpg"]);
        // Trained on another dataset, whose person 1 is somebody else.
        assert_eq!(origin(vec![7]).unseen(images.clone()), images);
    }
}
