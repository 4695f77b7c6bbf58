//! The file: an embedded database in which a change is written whole or not at all.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gestalt_protocol::RobotId;
use gestalt_strategies::{Change, Classifier, Memory, MemoryError};
use redb::{Database, DatabaseError, ReadableDatabase, ReadableTable, TableDefinition};
use thiserror::Error;

/// Facts about the file itself.
const ABOUT: TableDefinition<'_, &str, u64> = TableDefinition::new("about");
/// What the mind remembers, record by record.
const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
/// The classifier as it was last trained.
const CLASSIFIER: TableDefinition<'_, (), &[u8]> = TableDefinition::new("classifier");

/// The layout of the tables; another layout gets another number.
const SCHEMA: u64 = 1;

/// Why a memory cannot be opened, read or written. Nothing that was written before is lost.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The disk: no room, no right to write, no such folder.
    #[error("memory {path}: {cause}; make room, or give the robot another file")]
    Disk {
        /// Which file.
        path: PathBuf,
        /// What the database says.
        cause: Box<redb::Error>,
    },
    /// Another process has it open.
    #[error("memory {0} is in use by another process: give each robot a file of its own")]
    InUse(PathBuf),
    /// Written by another release.
    #[error(
        "memory {path} has schema {found}, this release reads {SCHEMA}: move the file away, or run the release that wrote it"
    )]
    Schema {
        /// Which file.
        path: PathBuf,
        /// The schema found.
        found: u64,
    },
    /// Another robot's.
    #[error("memory {path} is robot {found}'s, this is robot {expected}: give each robot a file of its own")]
    Robot {
        /// Which file.
        path: PathBuf,
        /// Whose it is.
        found: u64,
        /// Who opened it.
        expected: RobotId,
    },
    /// No memory at all, or a damaged one.
    #[error("memory {path}: {cause}")]
    Content {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        cause: MemoryError,
    },
}

impl StoreError {
    /// Whether the disk is at fault, and not what stands on it: a robot can do without for now.
    #[must_use]
    pub fn is_of_the_disk(&self) -> bool {
        matches!(self, Self::Disk { .. })
    }
}

/// An open memory.
#[derive(Debug)]
pub struct Store {
    database: Database,
    path: PathBuf,
    boot: u32,
}

impl Store {
    /// Opens a robot's memory, or makes a new one, and counts this start. The first start has number `first_boot`.
    ///
    /// # Errors
    /// See [`StoreError`].
    pub fn open(path: &Path, robot: RobotId, first_boot: u32) -> Result<Self, StoreError> {
        let disk = |cause: redb::Error| StoreError::Disk { path: path.to_owned(), cause: Box::new(cause) };
        let database = Database::create(path).map_err(|error| match error {
            DatabaseError::DatabaseAlreadyOpen => StoreError::InUse(path.to_owned()),
            other => disk(other.into()),
        })?;
        let mut store = Self { database, path: path.to_owned(), boot: first_boot };
        let before = store.about().map_err(disk)?;
        if let Some((schema, owner, last_boot)) = before {
            if schema != SCHEMA {
                return Err(StoreError::Schema { path: store.path, found: schema });
            }
            if owner != u64::from(robot.0) {
                return Err(StoreError::Robot { path: store.path, found: owner, expected: robot });
            }
            let next = u32::try_from(last_boot).unwrap_or(u32::MAX).saturating_add(1);
            store.boot = first_boot.max(next);
        }
        store.sign(robot).map_err(disk)?;
        Ok(store)
    }

    /// Opens it again after the disk failed: the database takes nothing more until then.
    ///
    /// # Errors
    /// See [`StoreError`].
    pub(super) fn reopen(path: &Path, boot: u32) -> Result<Self, StoreError> {
        let disk =
            |cause: DatabaseError| StoreError::Disk { path: path.to_owned(), cause: Box::new(cause.into()) };
        let database = Database::create(path).map_err(disk)?;
        Ok(Self { database, path: path.to_owned(), boot })
    }

    /// Schema, robot and number of the last start, of a file that was written before.
    fn about(&self) -> Result<Option<(u64, u64, u64)>, redb::Error> {
        let read = self.database.begin_read()?;
        let table = match read.open_table(ABOUT) {
            Ok(table) => table,
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let fact = |name| Ok::<_, redb::Error>(table.get(name)?.map(|value| value.value()));
        Ok(Some((fact("schema")?.unwrap_or(0), fact("robot")?.unwrap_or(0), fact("boot")?.unwrap_or(0))))
    }

    fn sign(&self, robot: RobotId) -> Result<(), redb::Error> {
        let write = self.database.begin_write()?;
        {
            let mut table = write.open_table(ABOUT)?;
            table.insert("schema", SCHEMA)?;
            table.insert("robot", u64::from(robot.0))?;
            table.insert("boot", u64::from(self.boot))?;
            write.open_table(RECORDS)?;
            write.open_table(CLASSIFIER)?;
        }
        write.commit()?;
        Ok(())
    }

    /// Which start of the robot this is: higher than at any before.
    #[must_use]
    pub fn boot(&self) -> u32 {
        self.boot
    }

    /// Where it stands.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the robot remembered up to its end.
    ///
    /// # Errors
    /// [`StoreError::Disk`] and [`StoreError::Content`].
    pub fn memory(&self) -> Result<Memory, StoreError> {
        let records = self.records().map_err(|cause| self.disk(cause))?;
        Memory::read(records.iter().map(|(key, value)| (key.as_slice(), value.as_slice())))
            .map_err(|cause| StoreError::Content { path: self.path.clone(), cause })
    }

    fn records(&self) -> Result<BTreeMap<Vec<u8>, Vec<u8>>, redb::Error> {
        let table = self.database.begin_read()?.open_table(RECORDS)?;
        let mut records = BTreeMap::new();
        for record in table.iter()? {
            let (key, value) = record?;
            records.insert(key.value().to_vec(), value.value().to_vec());
        }
        Ok(records)
    }

    /// The classifier as it was last trained. One that cannot be read is none: it is trained again.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn classifier(&self) -> Result<Option<Classifier>, StoreError> {
        let bytes = || {
            let table = self.database.begin_read()?.open_table(CLASSIFIER)?;
            Ok::<_, redb::Error>(table.get(())?.map(|value| value.value().to_vec()))
        };
        let bytes = bytes().map_err(|cause| self.disk(cause))?;
        Ok(bytes.and_then(|bytes| Classifier::decode(&bytes).ok()))
    }

    /// Writes changes, and a classifier if there is a new one: all of it or nothing, and when this returns it is on
    /// the disk.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn write(&self, changes: &[Change], classifier: Option<&Classifier>) -> Result<(), StoreError> {
        self.commit(changes, classifier).map_err(|cause| self.disk(cause))
    }

    fn commit(&self, changes: &[Change], classifier: Option<&Classifier>) -> Result<(), redb::Error> {
        let write = self.database.begin_write()?;
        {
            let mut table = write.open_table(RECORDS)?;
            for Change { key, value } in changes {
                match value {
                    Some(value) => table.insert(key.as_slice(), value.as_slice())?,
                    None => table.remove(key.as_slice())?,
                };
            }
            if let Some(classifier) = classifier {
                write.open_table(CLASSIFIER)?.insert((), classifier.encode().as_slice())?;
            }
        }
        write.commit()?;
        Ok(())
    }

    /// Makes every write fail from now on.
    #[cfg(test)]
    pub(super) fn spoil(&self) {
        let write = self.database.begin_write().unwrap();
        write.delete_table(RECORDS).unwrap();
        write.open_table(TableDefinition::<u64, u64>::new("records")).unwrap();
        write.commit().unwrap();
    }

    fn disk(&self, cause: redb::Error) -> StoreError {
        StoreError::Disk { path: self.path.clone(), cause: Box::new(cause) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(key: u8, value: Option<u8>) -> Change {
        Change { key: vec![key], value: value.map(|value| vec![value]) }
    }

    #[test]
    fn what_was_written_is_there_again_and_each_start_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.memory");
        for start in 1..4 {
            let store = Store::open(&path, RobotId(7), 1).unwrap();
            assert_eq!(store.boot(), start);
            let records = store.records().unwrap();
            assert_eq!(records.len(), start as usize - 1);
            store.write(&[change(start as u8, Some(9)), change(99, Some(1))], None).unwrap();
            store.write(&[change(99, None)], None).unwrap();
        }
    }

    #[test]
    fn a_boot_number_never_falls_below_the_clocks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.memory");
        assert_eq!(Store::open(&path, RobotId(7), 5).unwrap().boot(), 5);
        assert_eq!(Store::open(&path, RobotId(7), 1).unwrap().boot(), 6);
        assert_eq!(Store::open(&path, RobotId(7), 100).unwrap().boot(), 100);
    }

    #[test]
    fn a_file_in_use_of_another_robot_or_of_no_kind_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.memory");
        let store = Store::open(&path, RobotId(7), 1).unwrap();
        assert!(matches!(Store::open(&path, RobotId(7), 1), Err(StoreError::InUse(_))));
        drop(store);
        assert!(matches!(Store::open(&path, RobotId(8), 1), Err(StoreError::Robot { found: 7, .. })));
        let text = folder.path().join("text");
        std::fs::write(&text, "no database").unwrap();
        let error = Store::open(&text, RobotId(7), 1).unwrap_err();
        assert!(error.to_string().contains("text"), "{error}");
        let missing = folder.path().join("no/such/folder");
        assert!(Store::open(&missing, RobotId(7), 1).unwrap_err().is_of_the_disk());
    }

    #[test]
    fn records_that_are_no_memory_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("m"), RobotId(7), 1).unwrap();
        assert!(store.memory().unwrap().is_empty());
        store.write(&[change(200, Some(1))], None).unwrap();
        assert!(matches!(store.memory(), Err(StoreError::Content { .. })));
    }
}
