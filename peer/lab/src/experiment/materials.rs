//! What an experiment is made from, beside its file.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_vision::dataset::{LabelledImage, each_once, has_image_name};
use serde::{Deserialize, Serialize};

use super::error::ExperimentError;

/// So many entries of a folder are looked at; a dataset of as many pictures is refused when it is listed.
const MOST: usize = 1 << 20;

/// Where real hands come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Materials {
    /// Pictures that robots see; rendered hands when there are none.
    pub dataset: Option<PathBuf>,
    /// Pictures that a model is trained on to start from; rendered hands, seen from the front, when there are none.
    pub start: Option<PathBuf>,
}

/// What was in the folders: a CRC-32 of the names and bytes of all pictures of gestures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contents {
    /// Of the pictures that robots see.
    dataset: Option<u32>,
    /// Of those that a model is trained on to start from.
    start: Option<u32>,
}

impl Materials {
    /// That what robots see was not taught to the model that they start from.
    ///
    /// # Errors
    /// [`ExperimentError::Dataset`] where both are one folder, or one is not there; [`ExperimentError::Setting`] where pictures of one are copies of pictures
    /// of the other; [`ExperimentError::Read`].
    pub fn check(&self) -> Result<(), ExperimentError> {
        let folders: Vec<PathBuf> = [&self.dataset, &self.start].into_iter().flatten().cloned().collect();
        each_once(&folders)?;
        let [seen, taught] = &folders[..] else { return Ok(()) };
        let known: BTreeSet<u64> = pictures(taught)?.into_iter().map(|(_, content)| content).collect();
        let common = pictures(seen)?.iter().filter(|(_, content)| known.contains(content)).count();
        if common == 0 {
            return Ok(());
        }
        Err(ExperimentError::Setting(format!(
            "{common} pictures of {} are in {} too, byte for byte, and robots would be judged by what they start from: take them out of one of the two",
            seen.display(),
            taught.display()
        )))
    }

    /// What is in the folders now.
    ///
    /// # Errors
    /// [`ExperimentError::Read`].
    pub fn contents(&self) -> Result<Contents, ExperimentError> {
        let of = |folder: &Option<PathBuf>| folder.as_deref().map(checksum).transpose();
        Ok(Contents { dataset: of(&self.dataset)?, start: of(&self.start)? })
    }
}

/// Of the names and bytes of all pictures of a dataset's folders.
fn checksum(folder: &Path) -> Result<u32, ExperimentError> {
    let mut all = crc32fast::Hasher::new();
    for (path, content) in pictures(folder)? {
        // No file name has a zero in it.
        all.update(path.strip_prefix(folder).unwrap_or(&path).as_os_str().as_encoded_bytes());
        all.update(&[0]);
        all.update(&content.to_le_bytes());
    }
    Ok(all.finalize())
}

/// All pictures of a dataset's folders, whether or not their gestures are shown, and what tells their bytes from others.
fn pictures(folder: &Path) -> Result<Vec<(PathBuf, u64)>, ExperimentError> {
    let mut all = Vec::new();
    let gestures = entries(folder)?.into_iter().filter(|path| path.is_dir());
    for gesture in gestures {
        for path in entries(&gesture)?.into_iter().filter(|path| has_image_name(path)) {
            let image = LabelledImage { path, class: ClassId(0), person: None };
            let content = image.fingerprint();
            let content =
                content.map_err(|source| ExperimentError::Read { path: image.path.clone(), source })?;
            all.push((image.path, content));
        }
    }
    Ok(all)
}

/// What is in a folder, by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, ExperimentError> {
    let failed = |source| ExperimentError::Read { path: folder.to_owned(), source };
    let entries = fs::read_dir(folder).map_err(failed)?.take(MOST);
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| entry.map(|entry| entry.path()).map_err(failed)).collect::<Result<_, _>>()?;
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_judged_on_what_it_starts_from() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (folder.path().join("one"), folder.path().join("other"));
        fs::create_dir(&one).unwrap();
        fs::create_dir(&other).unwrap();
        let of = |dataset: Option<PathBuf>, start: Option<PathBuf>| Materials { dataset, start }.check();
        assert!(of(Some(one.clone()), Some(one.join("../one"))).is_err());
        assert!(of(Some(one.clone()), Some(other.clone())).is_ok());
        let write = |set: &Path, name: &str, bytes: &str| {
            fs::create_dir_all(set.join("1")).unwrap();
            fs::write(set.join("1").join(name), bytes).unwrap();
        };
        write(&one, "a.png", "a hand");
        write(&other, "b.png", "another");
        assert!(of(Some(one.clone()), Some(other.clone())).is_ok());
        write(&other, "c.png", "a hand");
        let refused = of(Some(one.clone()), Some(other)).unwrap_err().to_string();
        assert!(refused.contains("1 pictures"), "{refused}");
        assert!(of(Some(one.clone()), None).is_ok() && of(None, Some(one)).is_ok() && of(None, None).is_ok());
    }

    #[test]
    fn contents_change_with_the_bytes_and_the_names_of_pictures_and_not_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (folder.path().join("one"), folder.path().join("other"));
        let write = |set: &Path, name: &str, bytes: &str| {
            fs::create_dir_all(set.join(name).parent().unwrap()).unwrap();
            fs::write(set.join(name), bytes).unwrap();
        };
        for set in [&one, &other] {
            write(set, "1/a.png", "a hand");
            write(set, "2/a.png", "another");
        }
        let of = |set: &Path| Materials { dataset: None, start: Some(set.to_owned()) }.contents().unwrap();
        let before = of(&one);
        assert_eq!(before, of(&other));
        write(&other, "2/a.png", "changed");
        assert_ne!(before, of(&other));
        write(&other, "2/a.png", "another");
        write(&other, "2/b.png", "another");
        assert_ne!(before, of(&other));
        fs::remove_file(other.join("2/a.png")).unwrap();
        assert_ne!(before, of(&other), "the name tells who shows it");
        assert_eq!(Materials::default().contents().unwrap(), Contents::default());
    }
}
