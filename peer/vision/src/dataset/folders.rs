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

/// A folder with images that were not asked for, that show no gesture, or that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ignored {
    /// Its name; where folders are counts of fingers, the count.
    pub label: String,
    /// How many images it has that can be read.
    pub images: usize,
    /// How many files it has of other formats, and folders in it.
    pub others: usize,
}

impl fmt::Display for Ignored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.others {
            0 => write!(f, "{} ({} images)", self.label, self.images),
            others => write!(
                f,
                "{others} of {}: no .jpg, .jpeg or .png (convert pictures, and move them out of folders in it)",
                self.label
            ),
        }
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
        for (name, Inside { images, others }) in folders_with_images(folder)? {
            let label = name.to_string_lossy().into_owned();
            if others > 0 {
                found.ignored.push(Ignored { label: label.clone(), images: 0, others });
            }
            if images.is_empty() {
                continue;
            }
            match name.to_str().and_then(|name| naming.gesture(name)) {
                _ if name == NONE => found.none = images,
                Some(label) => found.gestures.entry(label.to_owned()).or_default().extend(images),
                None => found.ignored.push(Ignored { images: images.len(), label, others: 0 }),
            }
        }
        Ok(found)
    }

    /// What nobody took, as ignored.
    pub fn left(self) -> Vec<Ignored> {
        let Self { mut gestures, mut ignored, .. } = self;
        let left: Vec<Ignored> = in_order(gestures.keys().cloned().collect())
            .into_iter()
            .map(|label| {
                let images = gestures.remove(&label).map_or(0, |images| images.len());
                Ignored { images, label, others: 0 }
            })
            .collect();
        ignored.splice(0..0, left);
        ignored
    }
}

/// What a sub-folder has in it.
struct Inside {
    /// Its images, by file name.
    images: Vec<PathBuf>,
    /// How many pictures of other formats it has; where it has no images, also how many folders.
    others: usize,
}

/// The sub-folders that have images, or pictures that cannot be read.
fn folders_with_images(folder: &Path) -> Result<BTreeMap<OsString, Inside>, DatasetError> {
    let entries = |path: &Path| -> Result<Vec<PathBuf>, DatasetError> {
        let failed = |source| DatasetError::Io { path: path.to_owned(), source };
        let entries = fs::read_dir(path).map_err(failed)?;
        entries.take(MAX_IMAGES + 1).map(|entry| entry.map(|entry| entry.path()).map_err(failed)).collect()
    };
    let mut found = BTreeMap::new();
    let mut count = 0;
    for path in entries(folder)? {
        let is_hidden = |name: &OsString| name.as_encoded_bytes().starts_with(b".");
        let Some(label) =
            path.file_name().map(OsStr::to_owned).filter(|name| path.is_dir() && !is_hidden(name))
        else {
            continue;
        };
        let (mut images, others): (Vec<PathBuf>, Vec<PathBuf>) =
            entries(&path)?.into_iter().partition(|path| has_image_name(path));
        images.sort();
        let is_lost = |path: &&PathBuf| is_picture(path) || images.is_empty() && path.is_dir();
        let others = others.iter().filter(is_lost).count();
        count += images.len();
        if count > MAX_IMAGES {
            return Err(DatasetError::TooLarge(folder.to_owned()));
        }
        if !images.is_empty() || others > 0 {
            found.insert(label, Inside { images, others });
        }
    }
    Ok(found)
}

/// Whether a file is named as the images are that can be read.
#[must_use]
pub fn has_image_name(path: &Path) -> bool {
    has_extension(path, &["jpg", "jpeg", "png"])
}

/// Whether a file is named as a picture is that cannot be read.
fn is_picture(path: &Path) -> bool {
    has_extension(path, &["avif", "bmp", "gif", "heic", "jfif", "jp2", "pgm", "ppm", "tif", "tiff", "webp"])
}

fn has_extension(path: &Path, known: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    known.iter().any(|known| extension.eq_ignore_ascii_case(known))
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
    fn pictures_that_cannot_be_read_are_named_with_their_folder() {
        let dataset = tempfile::tempdir().unwrap();
        for (folder, files) in [
            ("one", &["a.jpg", "b.PNG", "notes.csv"][..]),
            ("two", &["a.jpg", "b.webp", "c.bmp"]),
            ("three", &["a.heic"]),
            ("four", &["alice/a.jpg", "bob/a.jpg"]),
            ("docs", &["README.md"]),
        ] {
            for file in files {
                let path = dataset.path().join(folder).join(file);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, "").unwrap();
            }
        }
        let folders = Folders::read(dataset.path(), Naming::Names).unwrap();
        assert_eq!(folders.gestures.keys().collect::<Vec<_>>(), ["one", "two"]);
        let ignored: Vec<(&str, usize)> =
            folders.ignored.iter().map(|it| (it.label.as_str(), it.others)).collect();
        assert_eq!(ignored, [("four", 2), ("three", 1), ("two", 2)]);
        let said = folders.ignored[2].to_string();
        assert!(said.starts_with("2 of two: no .jpg"), "{said}");
    }

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
