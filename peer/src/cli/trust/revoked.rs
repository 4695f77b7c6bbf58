//! The keys that a swarm's members lost their trust with. The roster keeps the last one of each robot, and of clients none: these are all.

use std::collections::BTreeSet;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use gestalt_trust::PublicKey;

use super::super::Failure;

/// Beside the authority's key: nobody else asks who may come back.
const REVOKED_FILE: &str = "revoked.json";

/// Room for two hundred thousand keys.
const MAX_FILE: u64 = 16 << 20;

/// All keys that were taken off the roster.
pub(super) struct Revoked {
    file: PathBuf,
    keys: BTreeSet<PublicKey>,
}

impl Revoked {
    /// Those of that folder; none where nothing was ever taken off.
    ///
    /// # Errors
    /// A file that cannot be read, or holds no list of keys.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let file = folder.join(REVOKED_FILE);
        let mut text = Vec::new();
        let read = gestalt_file::open(&file).and_then(|open| open.take(MAX_FILE + 1).read_to_end(&mut text));
        let keys = match read {
            Ok(length) if length as u64 > MAX_FILE => Err("it is longer than any such list".to_owned()),
            Ok(_) => serde_json::from_slice(&text).map_err(|error| error.to_string()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(BTreeSet::new()),
            Err(error) => Err(error.to_string()),
        };
        let keys = keys.map_err(|cause| {
            format!(
                "cannot read {}, the keys that are believed no more: {cause}: restore it from a copy",
                file.display()
            )
        })?;
        Ok(Self { file, keys })
    }

    /// Takes a key's trust away for good.
    pub fn add(&mut self, key: PublicKey) {
        self.keys.insert(key);
    }

    #[must_use]
    pub fn contains(&self, key: &PublicKey) -> bool {
        self.keys.contains(key)
    }

    /// Writes them where they were read.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self) -> Result<(), Failure> {
        if self.keys.is_empty() {
            return Ok(());
        }
        let text = serde_json::to_string_pretty(&self.keys)? + "\n";
        gestalt_file::replace(&self.file, text.as_bytes())
            .map_err(|error| format!("cannot write {}: {error}", self.file.display()).into())
    }
}
