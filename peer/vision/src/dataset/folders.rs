//! The folders of a dataset: which gesture each shows, and the images in it.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use super::DatasetError;

/// Most images that are listed.
pub(super) const MAX_IMAGES: usize = 1_000_000;

/// The folder of pictures without a gesture: nobody learns them, and whoever reports a hand in one is wrong.
pub const NONE: &str = "none";

/// Which gesture the images in a folder show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Naming {
    /// The one that the folder is named after.
    #[default]
    Names,
    /// The number of fingers that its name begins with: 3 in `3`, `03`, `3-three` and `3_thumb_index_middle`. Others show no
    /// gesture.
    Counts,
}

impl Naming {
    /// The gesture of a folder of that name; `None` when it shows none.
    fn gesture(self, folder: &str) -> Option<&str> {
        match self {
            Self::Names => Some(folder),
            Self::Counts => {
                let digits = folder.bytes().take_while(u8::is_ascii_digit).count();
                let (count, rest) = folder.split_at(digits);
                if count.is_empty() || rest.starts_with(char::is_alphanumeric) {
                    return None;
                }
                // A number, however it is written: all zeros are one.
                let zeros = count.bytes().take_while(|digit| *digit == b'0').count();
                Some(&count[zeros.min(digits - 1)..])
            }
        }
    }
}

/// A folder with images that were not asked for, or that show no gesture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ignored {
    /// Its name; where folders are counts of fingers, the count.
    pub label: String,
    /// How many images it has.
    pub images: usize,
}

impl fmt::Display for Ignored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} images)", self.label, self.images)
    }
}

/// The images of a dataset's folder.
#[derive(Debug, Default)]
pub(super) struct Folders {
    /// By the gesture they show, then by folder and file name.
    pub gestures: BTreeMap<String, Vec<PathBuf>>,
    /// Those without a gesture.
    pub none: Vec<PathBuf>,
    /// Folders whose names are no gestures.
    pub ignored: Vec<Ignored>,
}

impl Folders {
    pub fn read(folder: &Path, naming: Naming) -> Result<Self, DatasetError> {
        let mut found = Self::default();
        for (name, images) in folders_with_images(folder)? {
            match name.to_str().and_then(|name| naming.gesture(name)) {
                _ if name == NONE => found.none = images,
                Some(label) => found.gestures.entry(label.to_owned()).or_default().extend(images),
                None => {
                    let label = name.to_string_lossy().into_owned();
                    found.ignored.push(Ignored { images: images.len(), label });
                }
            }
        }
        Ok(found)
    }

    /// What nobody took, as ignored.
    pub fn left(self) -> Vec<Ignored> {
        let Self { mut gestures, mut ignored, .. } = self;
        let left: Vec<Ignored> = in_order(gestures.keys().cloned().collect())
            .into_iter()
            .map(|label| Ignored { images: gestures.remove(&label).map_or(0, |images| images.len()), label })
            .collect();
        ignored.splice(0..0, left);
        ignored
    }
}

/// The images of each sub-folder that has any, by file name.
fn folders_with_images(folder: &Path) -> Result<BTreeMap<OsString, Vec<PathBuf>>, DatasetError> {
    let entries = |path: &Path| -> Result<Vec<PathBuf>, DatasetError> {
        let failed = |source| DatasetError::Io { path: path.to_owned(), source };
        let entries = fs::read_dir(path).map_err(failed)?;
        entries.take(MAX_IMAGES + 1).map(|entry| entry.map(|entry| entry.path()).map_err(failed)).collect()
    };
    let mut found = BTreeMap::new();
    let mut count = 0;
    for path in entries(folder)? {
        let Some(label) = path.file_name().map(OsStr::to_owned).filter(|_| path.is_dir()) else {
            continue;
        };
        let mut images = entries(&path)?;
        images.retain(|path| has_image_name(path));
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

/// Whether a file is named as the images are that can be read.
#[must_use]
pub fn has_image_name(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["jpg", "jpeg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// By number where all labels are numbers (10 after 9), else by alphabet.
pub(super) fn in_order(mut labels: Vec<String>) -> Vec<String> {
    if labels.iter().all(|label| label.parse::<u32>().is_ok()) {
        labels.sort_by_key(|label| (label.parse::<u32>().ok(), label.clone()));
    } else {
        labels.sort();
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_of_fingers_is_what_a_name_begins_with() {
        let count = |name| Naming::Counts.gesture(name);
        assert_eq!(
            (count("3"), count("3_thumb_index_middle"), count("10_x")),
            (Some("3"), Some("3"), Some("10"))
        );
        let number = |name| count(name).map(str::to_owned);
        let written = ["03", "3-three", "3 fingers", "003.x"].map(number);
        assert_eq!(written, [(); 4].map(|()| Some("3".to_owned())));
        assert_eq!((count("0"), count("00_fist"), count("010")), (Some("0"), Some("0"), Some("10")));
        for name in ["call", "_3", "3a", "3é", "three_3", "pinch7", "", "-1"] {
            assert_eq!(count(name), None, "{name}");
        }
        assert_eq!(Naming::Names.gesture("3_together"), Some("3_together"));
    }
}
