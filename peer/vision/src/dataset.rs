//! A folder of labelled photographs: one folder per gesture, the images in it, who shows it in the file's name.
//!
//! ```text
//! DIR/fist/s012_0001.jpg      the gesture `fist`, shown by person 12
//! DIR/palm/anything.png       the gesture `palm`, by no one in particular
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::{Vocabulary, VocabularyError};
use rand::Rng;
use rand::seq::SliceRandom;
use thiserror::Error;

/// Most images that are listed.
const MAX_IMAGES: usize = 1_000_000;

/// A folder that is no dataset.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// It cannot be read.
    #[error("cannot read the dataset folder {}: {source}", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It has no folder with images in it.
    #[error("{} holds no images: put them into one folder per gesture, as .jpg, .jpeg or .png", .0.display())]
    Empty(PathBuf),
    /// A gesture was asked for that has no folder.
    #[error("{} has no images of the gesture '{label}': it has {}", path.display(), found.join(", "))]
    Missing {
        /// The dataset.
        path: PathBuf,
        /// The gesture asked for.
        label: String,
        /// The gestures it has.
        found: Vec<String>,
    },
    /// Its folders make no vocabulary.
    #[error("the folders of {} make no vocabulary: {source}", path.display())]
    Vocabulary {
        /// The dataset.
        path: PathBuf,
        /// Why.
        source: VocabularyError,
    },
    /// More images than are ever needed.
    #[error("{} holds more than {MAX_IMAGES} images", .0.display())]
    TooLarge(PathBuf),
}

/// A photograph and what is known of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelledImage {
    /// Where it is.
    pub path: PathBuf,
    /// The gesture it shows.
    pub class: ClassId,
    /// Who shows it: NNN of a file name `sNNN_…`.
    pub person: Option<u32>,
}

impl LabelledImage {
    /// Tells image files apart by content, wherever they lie: the length and the CRC-32 of the bytes.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn fingerprint(&self) -> io::Result<u64> {
        // Opening a pipe would wait for its writer.
        if !fs::metadata(&self.path)?.is_file() {
            return Err(io::Error::other("it is not a regular file"));
        }
        let mut file = File::open(&self.path)?;
        let (mut hash, mut length) = (crc32fast::Hasher::new(), 0_u64);
        let mut chunk = vec![0; 64 * 1024];
        loop {
            match file.read(&mut chunk)? {
                0 => return Ok(length << 32 | u64::from(hash.finalize())),
                read => {
                    hash.update(&chunk[..read]);
                    length += read as u64;
                }
            }
        }
    }
}

/// The images of a dataset folder, listed but not yet read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dataset {
    /// The gestures: names of the folders, by number where all are numbers, else by alphabet.
    pub vocabulary: Vocabulary,
    /// The images, by gesture, then by file name.
    pub images: Vec<LabelledImage>,
    /// Folders with images that were not asked for.
    pub ignored: Vec<String>,
}

impl Dataset {
    /// Lists the images of `folder`: of all its gestures, or of those in `labels`, in that order.
    ///
    /// # Errors
    /// See [`DatasetError`].
    pub fn list(folder: &Path, labels: Option<&[String]>) -> Result<Self, DatasetError> {
        let mut found = folders_with_images(folder)?;
        if found.is_empty() {
            return Err(DatasetError::Empty(folder.to_owned()));
        }
        let labels = match labels {
            Some(labels) => labels.to_vec(),
            None => in_order(found.keys().cloned().collect()),
        };
        let vocabulary = Vocabulary::new(labels.iter().cloned())
            .map_err(|source| DatasetError::Vocabulary { path: folder.to_owned(), source })?;
        let names = in_order(found.keys().cloned().collect());
        let mut images = Vec::new();
        for (class, label) in (0_u8..).zip(&labels) {
            let paths = found.remove(label).ok_or_else(|| DatasetError::Missing {
                path: folder.to_owned(),
                label: label.clone(),
                found: names.clone(),
            })?;
            images.extend(paths.into_iter().map(|path| LabelledImage {
                class: ClassId(class),
                person: person(&path),
                path,
            }));
        }
        Ok(Self { vocabulary, images, ignored: in_order(found.into_keys().collect()) })
    }

    /// Lists the images of those gestures of `vocabulary` that `folder` has, under the vocabulary's class ids.
    ///
    /// # Errors
    /// [`DatasetError::Empty`] when it has none of them; else see [`DatasetError`].
    pub fn list_known(folder: &Path, vocabulary: &Vocabulary) -> Result<Self, DatasetError> {
        let mut found = folders_with_images(folder)?;
        let mut images = Vec::new();
        for (class, label) in (0_u8..).zip(vocabulary.labels()) {
            let paths = found.remove(label).unwrap_or_default().into_iter();
            let labelled =
                paths.map(|path| LabelledImage { class: ClassId(class), person: person(&path), path });
            images.extend(labelled);
        }
        if images.is_empty() {
            return Err(DatasetError::Empty(folder.to_owned()));
        }
        let ignored = in_order(found.into_keys().collect());
        Ok(Self { vocabulary: vocabulary.clone(), images, ignored })
    }

    /// The people who show something.
    #[must_use]
    pub fn people(&self) -> BTreeSet<u32> {
        self.images.iter().filter_map(|image| image.person).collect()
    }

    /// Draws `share` of the people, rounded, at least one of them and never all. Share in `0.0..1.0`; with 0, or
    /// fewer than two people, none.
    #[must_use]
    pub fn draw_people(&self, share: f64, rng: &mut impl Rng) -> BTreeSet<u32> {
        let mut people: Vec<u32> = self.people().into_iter().collect();
        if share <= 0.0 || people.len() < 2 {
            return BTreeSet::new();
        }
        people.shuffle(rng);
        let drawn = ((people.len() as f64 * share).round() as usize).clamp(1, people.len() - 1);
        people[..drawn].iter().copied().collect()
    }
}

/// The images of each sub-folder that has any, by file name.
fn folders_with_images(folder: &Path) -> Result<BTreeMap<String, Vec<PathBuf>>, DatasetError> {
    let entries = |path: &Path| -> Result<Vec<PathBuf>, DatasetError> {
        let failed = |source| DatasetError::Io { path: path.to_owned(), source };
        let entries = fs::read_dir(path).map_err(failed)?;
        entries.take(MAX_IMAGES + 1).map(|entry| entry.map(|entry| entry.path()).map_err(failed)).collect()
    };
    let mut found = BTreeMap::new();
    let mut count = 0;
    for path in entries(folder)? {
        let Some(label) = path.file_name().and_then(|name| name.to_str()).map(str::to_owned) else {
            continue;
        };
        if !path.is_dir() {
            continue;
        }
        let mut images = entries(&path)?;
        images.retain(|path| is_image(path));
        images.sort();
        count += images.len();
        if count > MAX_IMAGES {
            return Err(DatasetError::TooLarge(folder.to_owned()));
        }
        if !images.is_empty() {
            found.insert(label, images);
        }
    }
    Ok(found)
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["jpg", "jpeg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// NNN of a file name `sNNN_…`.
fn person(path: &Path) -> Option<u32> {
    let (prefix, _) = path.file_name()?.to_str()?.split_once('_')?;
    let digits = prefix.strip_prefix('s')?;
    digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?
}

/// By number where all labels are numbers (10 after 9), else by alphabet.
fn in_order(mut labels: Vec<String>) -> Vec<String> {
    if labels.iter().all(|label| label.parse::<u32>().is_ok()) {
        labels.sort_by_key(|label| (label.parse::<u32>().ok(), label.clone()));
    } else {
        labels.sort();
    }
    labels
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    fn dataset(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    fn strings(labels: &[&str]) -> Vec<String> {
        labels.iter().map(|label| (*label).to_owned()).collect()
    }

    #[test]
    fn folders_are_gestures_and_prefixes_are_people() {
        let folder = dataset(&[
            "10/s003_a.jpg",
            "9/s12_b.PNG",
            "9/sx_c.jpeg",
            "9/s_.jpg",
            "9/notes.txt",
            "README",
            "empty/x",
        ]);
        let dataset = Dataset::list(folder.path(), None).unwrap();
        assert_eq!(dataset.vocabulary.labels(), ["9", "10"]);
        let seen: Vec<_> = dataset
            .images
            .iter()
            .map(|image| (image.class.0, image.person, image.path.file_name().unwrap().to_str().unwrap()))
            .collect();
        assert_eq!(
            seen,
            [
                (0, Some(12), "s12_b.PNG"),
                (0, None, "s_.jpg"),
                (0, None, "sx_c.jpeg"),
                (1, Some(3), "s003_a.jpg")
            ]
        );
    }

    #[test]
    fn chosen_gestures_keep_the_order_they_were_chosen_in() {
        let folder = dataset(&["a/1.jpg", "b/1.jpg", "c/1.jpg"]);
        let chosen = Dataset::list(folder.path(), Some(&strings(&["c", "a"]))).unwrap();
        assert_eq!(chosen.vocabulary.labels(), ["c", "a"]);
        assert_eq!(chosen.ignored, ["b"]);
        let missing = Dataset::list(folder.path(), Some(&strings(&["a", "d"]))).unwrap_err();
        assert!(missing.to_string().contains("'d': it has a, b, c"), "{missing}");
    }

    #[test]
    fn a_folder_without_images_is_no_dataset() {
        for files in [&["a.jpg"][..], &["a/notes.txt"], &[]] {
            let folder = dataset(files);
            assert!(matches!(Dataset::list(folder.path(), None), Err(DatasetError::Empty(_))), "{files:?}");
        }
        let missing = Dataset::list(Path::new("/nowhere"), None);
        assert!(matches!(missing, Err(DatasetError::Io { .. })));
        let one = dataset(&["a/1.jpg"]);
        assert!(matches!(Dataset::list(one.path(), None), Err(DatasetError::Vocabulary { .. })));
    }

    #[test]
    fn a_model_sees_the_gestures_it_knows() {
        let folder = dataset(&["1/x.jpg", "background/x.jpg"]);
        let vocabulary = Vocabulary::new(["0", "1"]).unwrap();
        let known = Dataset::list_known(folder.path(), &vocabulary).unwrap();
        assert_eq!((known.images.len(), known.images[0].class), (1, ClassId(1)));
        assert_eq!(known.ignored, ["background"]);
        let stranger = Vocabulary::new(["x", "y"]).unwrap();
        assert!(matches!(Dataset::list_known(folder.path(), &stranger), Err(DatasetError::Empty(_))));
    }

    #[test]
    fn a_copy_of_an_image_has_its_fingerprint() {
        let folder = dataset(&["a/1.jpg", "b/2.jpg", "b/3.jpg"]);
        fs::write(folder.path().join("a/1.jpg"), "hand").unwrap();
        fs::write(folder.path().join("b/2.jpg"), "hand").unwrap();
        fs::write(folder.path().join("b/3.jpg"), "hane").unwrap();
        let images = Dataset::list(folder.path(), None).unwrap().images;
        let prints: Vec<u64> = images.iter().map(|image| image.fingerprint().unwrap()).collect();
        assert!(prints[0] == prints[1] && prints[1] != prints[2], "{prints:x?}");
    }

    #[test]
    fn a_share_of_the_people_is_drawn_by_the_seed() {
        let names: Vec<String> =
            (0..10).flat_map(|i| [format!("a/s{i}_1.jpg"), format!("b/s{i}_1.jpg")]).collect();
        let folder = dataset(&names.iter().map(String::as_str).collect::<Vec<_>>());
        let dataset = Dataset::list(folder.path(), None).unwrap();
        let draw = |share, seed| dataset.draw_people(share, &mut ChaCha8Rng::seed_from_u64(seed));
        assert_eq!(draw(0.3, 1).len(), 3);
        assert_eq!(draw(0.3, 1), draw(0.3, 1));
        assert!((2..9).any(|seed| draw(0.3, seed) != draw(0.3, 1)));
        assert_eq!((draw(0.0, 1).len(), draw(0.001, 1).len(), draw(0.999, 1).len()), (0, 1, 9));
    }
}
