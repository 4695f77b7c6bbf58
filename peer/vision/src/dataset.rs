//! A folder of labelled photographs: one folder per gesture, the images in it, who shows it in the file's name.
//!
//! ```text
//! DIR/fist/s012_0001.jpg      the gesture `fist`, shown by person 12
//! DIR/palm/anything.png       the gesture `palm`, by no one in particular
//! DIR/none/office.jpg         no gesture: for counting false alarms
//! ```

mod copies;
mod folders;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::{Vocabulary, VocabularyError};
use rand::Rng;
use rand::seq::SliceRandom;
use thiserror::Error;

use folders::{Folders, MAX_IMAGES, in_order};

pub use copies::leave_out_copies;
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
        let mut file = gestalt_file::open(&self.path)?;
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

/// That no two of these are names of one folder.
///
/// # Errors
/// [`DatasetError::Twice`], and [`DatasetError::Io`] for what is not there.
pub fn each_once(folders: &[PathBuf]) -> Result<(), DatasetError> {
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
    // What follows may be in any encoding.
    let name = path.file_name()?.as_encoded_bytes();
    let digits = name.split(|byte| *byte == b'_').next()?.strip_prefix(b"s")?;
    let is_number = digits.len() + 1 < name.len() && digits.iter().all(u8::is_ascii_digit);
    is_number.then(|| std::str::from_utf8(digits).ok()?.parse().ok())?
}
