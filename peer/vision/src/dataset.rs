//! A folder of labelled photographs: one folder per gesture, the images in it, who shows it in the file's name.
//!
//! ```text
//! DIR/fist/s012_0001.jpg      the gesture `fist`, shown by person 12
//! DIR/palm/anything.png       the gesture `palm`, by no one in particular
//! DIR/none/office.jpg         no gesture: for counting false alarms
//! ```

mod folders;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::{Vocabulary, VocabularyError};
use rand::Rng;
use rand::seq::SliceRandom;
use thiserror::Error;

use folders::{Folders, MAX_IMAGES, in_order};

pub use folders::{Ignored, NONE, Naming, has_image_name};

/// A folder that is no dataset.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// It cannot be read.
    #[error("cannot read the dataset folder {}: {source}: check the path; it has one subfolder per gesture", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It has no folder with images of a gesture in it.
    #[error("{} has no subfolders with images: put them into one folder per gesture, as .jpg, .jpeg or .png (convert others)", .0.display())]
    Empty(PathBuf),
    /// It has images, and none of a gesture that counts.
    #[error("{} has no images of {wanted}: its folders are {}", folder.display(), found.join(", "))]
    Others {
        /// The folder.
        folder: PathBuf,
        /// Its folders with images.
        found: Vec<String>,
        /// What was looked for, in words.
        wanted: String,
    },
    /// Named more than once: it would be learned from and measured on at the same time.
    #[error("{} is given twice: name each dataset once", .0.display())]
    Twice(PathBuf),
    /// A gesture was asked for that has no folder.
    #[error("{} has no images of the gesture '{label}': it has {}", joined(folders), found.join(", "))]
    Missing {
        /// The datasets.
        folders: Vec<PathBuf>,
        /// The gesture asked for.
        label: String,
        /// The gestures they have.
        found: Vec<String>,
    },
    /// [`NONE`] was asked for.
    #[error("'{NONE}' holds pictures without a gesture, which nobody learns: leave it out of the gestures")]
    NoGesture,
    /// The folders make no vocabulary.
    #[error(
        "the folders of {} make no vocabulary: {source}: one subfolder for each gesture, named after it",
        joined(folders)
    )]
    Vocabulary {
        /// The datasets.
        folders: Vec<PathBuf>,
        /// Why.
        source: VocabularyError,
    },
    /// More images than are ever needed.
    #[error("{} holds more than {MAX_IMAGES} images", .0.display())]
    TooLarge(PathBuf),
}

/// Why nothing of a folder counts.
fn nothing_in(folder: &Path, ignored: &[Ignored], labels: &[String], naming: Naming) -> DatasetError {
    if ignored.is_empty() {
        return DatasetError::Empty(folder.to_owned());
    }
    let gestures = match labels {
        [] => "a gesture".to_owned(),
        labels => format!("any of the gestures {}", labels.join(", ")),
    };
    let counts = match naming {
        Naming::Names => "",
        Naming::Counts => " (folders named by counts of fingers: 3, or 3_anything)",
    };
    DatasetError::Others {
        folder: folder.to_owned(),
        found: ignored.iter().map(|folder| folder.label.clone()).collect(),
        wanted: gestures + counts,
    }
}

/// Some folders, in words.
#[must_use]
pub fn joined(folders: &[PathBuf]) -> String {
    folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// A photograph and what is known of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelledImage {
    /// Where it is.
    pub path: PathBuf,
    /// The gesture it shows.
    pub class: ClassId,
    /// Who shows it: NNN of a file name `sNNN_…`. Where several datasets are listed together, the people of all of them are
    /// numbered through, so that those of different datasets never share a number.
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
    /// The gestures, by number where all are numbers, else by alphabet; or in the order they were asked for.
    pub vocabulary: Vocabulary,
    /// The images, by gesture, then by folder and file name.
    pub images: Vec<LabelledImage>,
    /// Images without a gesture: those in the folder [`NONE`].
    pub none: Vec<PathBuf>,
    /// Folders with images that were not asked for, or show no gesture.
    pub ignored: Vec<Ignored>,
}

impl Dataset {
    /// Lists the images of `folder`: of all its gestures, or of those in `labels`, in that order.
    ///
    /// # Errors
    /// See [`DatasetError`].
    pub fn list(folder: &Path, labels: Option<&[String]>) -> Result<Self, DatasetError> {
        Ok(Self::list_several(&[folder.to_owned()], Naming::Names, labels)?.remove(0))
    }

    /// Lists the images of several folders under one vocabulary: of all the gestures that any of them has, or of those in
    /// `labels`, in that order. One dataset for each folder; of a folder that has none of the gestures, one without images.
    ///
    /// # Errors
    /// See [`DatasetError`]; [`DatasetError::Empty`] also of a folder with no images at all.
    pub fn list_several(
        folders: &[PathBuf],
        naming: Naming,
        labels: Option<&[String]>,
    ) -> Result<Vec<Self>, DatasetError> {
        each_once(folders)?;
        let read = |folder: &PathBuf| -> Result<Folders, DatasetError> {
            match Folders::read(folder, naming)? {
                found if found.gestures.is_empty() && found.none.is_empty() => {
                    Err(nothing_in(folder, &found.left(), &[], naming))
                }
                found => Ok(found),
            }
        };
        let sets: Vec<Folders> = folders.iter().map(read).collect::<Result<_, _>>()?;
        let found: BTreeSet<String> = sets.iter().flat_map(|set| set.gestures.keys().cloned()).collect();
        let found = in_order(found.into_iter().collect());
        if found.is_empty() {
            return Err(DatasetError::Others {
                folder: folders.first().cloned().unwrap_or_default(),
                found: vec![NONE.to_owned()],
                wanted: "a gesture".to_owned(),
            });
        }
        let labels = labels.map_or_else(|| found.clone(), <[String]>::to_vec);
        if labels.iter().any(|label| label == NONE) {
            return Err(DatasetError::NoGesture);
        }
        if let Some(label) = labels.iter().find(|label| !found.contains(label)) {
            return Err(DatasetError::Missing { folders: folders.to_vec(), label: label.clone(), found });
        }
        let vocabulary = Vocabulary::new(labels)
            .map_err(|source| DatasetError::Vocabulary { folders: folders.to_vec(), source })?;
        let mut sets: Vec<Self> = sets.into_iter().map(|set| Self::of(set, &vocabulary)).collect();
        if sets.len() > 1 {
            number_people_through(&mut sets);
        }
        Ok(sets)
    }

    /// Lists the images of those gestures of `vocabulary` that `folder` has, under the vocabulary's class ids.
    ///
    /// # Errors
    /// [`DatasetError::Others`] when it has none of them and no images without a gesture either, unless its folders are
    /// counts of fingers: they are all ignored then. Else see [`DatasetError`].
    pub fn list_known(folder: &Path, naming: Naming, vocabulary: &Vocabulary) -> Result<Self, DatasetError> {
        let dataset = Self::of(Folders::read(folder, naming)?, vocabulary);
        let nothing = dataset.images.is_empty() && dataset.none.is_empty();
        if nothing && (naming == Naming::Names || dataset.ignored.is_empty()) {
            return Err(nothing_in(folder, &dataset.ignored, vocabulary.labels(), naming));
        }
        Ok(dataset)
    }

    fn of(mut found: Folders, vocabulary: &Vocabulary) -> Self {
        let mut images = Vec::new();
        for (class, label) in (0_u32..).zip(vocabulary.labels()) {
            let paths = found.gestures.remove(label).unwrap_or_default().into_iter();
            images.extend(paths.map(|path| LabelledImage {
                class: ClassId(class),
                person: person(&path),
                path,
            }));
        }
        let none = std::mem::take(&mut found.none);
        Self { vocabulary: vocabulary.clone(), images, none, ignored: found.left() }
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

/// Two names of one folder are one dataset.
fn each_once(folders: &[PathBuf]) -> Result<(), DatasetError> {
    let mut seen = BTreeSet::new();
    for folder in folders {
        let place =
            fs::canonicalize(folder).map_err(|source| DatasetError::Io { path: folder.clone(), source })?;
        if !seen.insert(place) {
            return Err(DatasetError::Twice(folder.clone()));
        }
    }
    Ok(())
}

/// Gives the people of all datasets numbers of their own.
fn number_people_through(sets: &mut [Dataset]) {
    let people = sets.iter().enumerate().flat_map(|(set, dataset)| {
        dataset.people().into_iter().map(move |person| (set, person)).collect::<Vec<_>>()
    });
    let numbers: BTreeMap<(usize, u32), u32> = people.zip(0..).collect();
    for (set, dataset) in sets.iter_mut().enumerate() {
        for image in &mut dataset.images {
            image.person = image.person.and_then(|person| numbers.get(&(set, person)).copied());
        }
    }
}

/// NNN of a file name `sNNN_…`.
fn person(path: &Path) -> Option<u32> {
    let (prefix, _) = path.file_name()?.to_str()?.split_once('_')?;
    let digits = prefix.strip_prefix('s')?;
    digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?
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
    fn a_folder_of_other_gestures_is_not_called_empty() {
        let folder = dataset(&["fist/1.png", "palm/2.png"]);
        let of = |error: DatasetError| error.to_string();
        let others = of(Dataset::list_known(
            folder.path(),
            Naming::Names,
            &Vocabulary::new(["0", "1"].map(str::to_owned).to_vec()).unwrap(),
        )
        .unwrap_err());
        assert!(others.contains("the gestures 0, 1: its folders are fist, palm"), "{others}");
        let counts =
            of(Dataset::list_several(&[folder.path().to_owned()], Naming::Counts, None).unwrap_err());
        assert!(counts.contains("counts of fingers") && counts.contains("fist, palm"), "{counts}");
        let nothing = dataset(&["none/1.png"]);
        let nothing = of(Dataset::list(nothing.path(), None).unwrap_err());
        assert!(nothing.ends_with("its folders are none"), "{nothing}");
        let empty = of(Dataset::list(tempfile::tempdir().unwrap().path(), None).unwrap_err());
        assert!(empty.contains("no subfolders with images"), "{empty}");
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
        assert_eq!(chosen.ignored, [Ignored { label: "b".to_owned(), images: 1 }]);
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
        let known = Dataset::list_known(folder.path(), Naming::Names, &vocabulary).unwrap();
        assert_eq!((known.images.len(), known.images[0].class), (1, ClassId(1)));
        assert_eq!(said(&known), ["background (1 images)"]);
        let stranger = Vocabulary::new(["x", "y"]).unwrap();
        let unknown = Dataset::list_known(folder.path(), Naming::Names, &stranger);
        assert!(matches!(unknown, Err(DatasetError::Others { .. })));
        // A count that the model does not know is said, and no error.
        let unknown = Dataset::list_known(folder.path(), Naming::Counts, &stranger).unwrap();
        assert!(unknown.images.is_empty());
        assert_eq!(said(&unknown), ["1 (1 images)", "background (1 images)"]);
    }

    fn said(dataset: &Dataset) -> Vec<String> {
        dataset.ignored.iter().map(Ignored::to_string).collect()
    }

    #[test]
    fn folders_can_be_counts_of_fingers() {
        let folder = dataset(&[
            "3/a.jpg",
            "3_thumb/b.jpg",
            "3_thumb/boxes.csv",
            "0/c.jpg",
            "call/d.jpg",
            "none/e.jpg",
            "LICENCE.txt",
        ]);
        let folders = [folder.path().to_owned()];
        let counts = Dataset::list_several(&folders, Naming::Counts, None).unwrap().remove(0);
        assert_eq!(counts.vocabulary.labels(), ["0", "3"]);
        assert_eq!(counts.images.iter().map(|image| image.class.0).collect::<Vec<_>>(), [0, 1, 1]);
        assert_eq!((said(&counts), counts.none.len()), (vec!["call (1 images)".to_owned()], 1));
    }

    #[test]
    fn pictures_without_a_gesture_are_nobodys_class() {
        let folder = dataset(&["a/1.jpg", "b/1.jpg", "none/1.jpg", "none/2.jpg"]);
        let all = Dataset::list(folder.path(), None).unwrap();
        assert_eq!(
            (all.vocabulary.labels(), all.images.len(), all.none.len()),
            (&strings(&["a", "b"])[..], 2, 2)
        );
        let asked = Dataset::list(folder.path(), Some(&strings(&["a", "none"])));
        assert!(matches!(asked, Err(DatasetError::NoGesture)));
    }

    #[test]
    fn several_datasets_have_one_vocabulary_and_no_person_in_common() {
        let sets = [
            dataset(&["1/s001_a.jpg", "2/s007_a.jpg", "2/x.jpg"]),
            dataset(&["2/s001_a.jpg", "3/s002_a.jpg"]),
        ];
        let negatives = dataset(&["none/x.jpg"]);
        let folders: Vec<PathBuf> =
            sets.iter().chain([&negatives]).map(|folder| folder.path().to_owned()).collect();
        let listed = Dataset::list_several(&folders, Naming::Names, None).unwrap();
        assert!(listed.iter().all(|set| set.vocabulary.labels() == ["1", "2", "3"]));
        let shown = |set: &Dataset| set.images.iter().map(|i| (i.class.0, i.person)).collect::<Vec<_>>();
        assert_eq!(shown(&listed[0]), [(0, Some(0)), (1, Some(1)), (1, None)]);
        assert_eq!(shown(&listed[1]), [(1, Some(2)), (2, Some(3))]);
        assert_eq!((listed[2].images.len(), listed[2].none.len()), (0, 1));

        let chosen = Dataset::list_several(&folders, Naming::Names, Some(&strings(&["3", "1"]))).unwrap();
        assert_eq!((shown(&chosen[0]), shown(&chosen[1])), (vec![(1, Some(0))], vec![(0, Some(1))]));
        let missing =
            Dataset::list_several(&folders, Naming::Names, Some(&strings(&["1", "9"]))).unwrap_err();
        assert!(missing.to_string().contains("'9': it has 1, 2, 3"), "{missing}");
        let twice = [folders[0].clone(), folders[0].join("../").join(folders[0].file_name().unwrap())];
        let twice = Dataset::list_several(&twice, Naming::Names, None);
        assert!(matches!(twice, Err(DatasetError::Twice(_))));
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
