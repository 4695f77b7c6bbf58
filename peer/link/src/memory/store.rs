//! The file: an embedded database in which a change is written whole or not at all.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use gestalt_protocol::RobotId;
use gestalt_strategies::{Classifier, RecordChange, RobotMemory};
use redb::{Builder, Database, ReadableDatabase, ReadableTable, StorageBackend, TableDefinition};

use super::bytes::Bytes;
use super::error::StoreError;
use super::place::{FileId, Place};
use crate::boot::step;
use crate::identity::fresh_nonce;
use crate::panics::said;

/// Facts about the file itself.
const ABOUT: TableDefinition<'_, &str, u64> = TableDefinition::new("about");
/// What the mind remembers, record by record.
const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
/// The classifier as it was last trained.
const CLASSIFIER: TableDefinition<'_, (), &[u8]> = TableDefinition::new("classifier");

/// The layout of the tables; another layout gets another number.
const SCHEMA: u64 = 1;

/// What every file of the database begins with.
const MAGIC: [u8; 9] = [b'r', b'e', b'd', b'b', 0x1A, 0x0A, 0xA9, 0x0D, 0x0A];

/// How much of the file is kept in memory while it is open, in bytes: it is read once, then only written.
const CACHE: usize = 4 << 20;

/// Records as they stand in the file.
pub(crate) type Records = BTreeMap<Vec<u8>, Vec<u8>>;

/// What the file says of itself.
struct About {
    schema: u64,
    robot: u64,
    boot: u64,
    mark: u64,
}

/// An open memory.
#[derive(Debug)]
pub(crate) struct Store {
    database: Database,
    place: Arc<dyn Place>,
    robot: RobotId,
    file: FileId,
    boot: u32,
    /// Differs at every start: tells this run's file from a copy put in its place.
    mark: u64,
}

impl Store {
    /// Opens a robot's memory, or makes a new one, and counts this start. The first start has number `first_boot`. Says
    /// whether it is new.
    #[cfg(test)]
    pub fn open(place: Arc<dyn Place>, robot: RobotId, first_boot: u32) -> Result<(Self, bool), StoreError> {
        let (mut store, new) = Self::look(place, robot)?;
        store.count(first_boot)?;
        Ok((store, new))
    }

    /// Opens a robot's memory, or makes a new one; says whether it is new. This start is not counted yet: a memory that is refused counts none, and one that
    /// cannot be written can be read.
    ///
    /// # Errors
    /// See [`StoreError`].
    pub fn look(place: Arc<dyn Place>, robot: RobotId) -> Result<(Self, bool), StoreError> {
        let there = place.is_there().map_err(|cause| StoreError::of_system(place.path(), &cause))?;
        if !there {
            Self::make(&place, robot)?;
        }
        let opened = place.open().map_err(|cause| StoreError::of_system(place.path(), &cause))?;
        Ok((Self::read(place, robot, opened)?, !there))
    }

    /// A copy of a robot's memory, in this process's memory; `None` where there is none. What is written to it is lost.
    ///
    /// # Errors
    /// See [`StoreError`].
    pub fn copy(place: Arc<dyn Place>, robot: RobotId) -> Result<Option<Self>, StoreError> {
        let of_reading = |cause| StoreError::of_reading(place.path(), &cause);
        if !place.is_there().map_err(of_reading)? {
            return Ok(None);
        }
        let opened = place.copy().map_err(of_reading)?;
        Self::read(place, robot, opened).map(Some)
    }

    /// Counts this start, so that the file is this run's. The first has number `first_boot`.
    ///
    /// # Errors
    /// Those of the disk, and [`StoreError::Damaged`].
    pub fn count(&mut self, first_boot: u32) -> Result<(), StoreError> {
        let next = if self.boot == 0 { first_boot } else { first_boot.max(self.boot.saturating_add(step())) };
        self.sign(next, fresh_nonce())
    }

    fn sign(&mut self, boot: u32, mark: u64) -> Result<(), StoreError> {
        guarded(self.place.path(), || {
            sign(&self.database, self.robot, boot, mark)?;
            self.commit(&[], None)
        })?;
        (self.boot, self.mark) = (boot, mark);
        Ok(())
    }

    /// Opens it again after it failed, or makes a new one where it was removed.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] for another file than before, and the others of [`StoreError`].
    pub fn reopen(place: Arc<dyn Place>, robot: RobotId, before: Run) -> Result<Self, StoreError> {
        let mut store = Self::look(place, robot)?.0;
        if store.mark == before.mark {
            return Ok(store);
        }
        // Begun in place of one that was removed, just now or before the disk was full: no start is counted in it yet.
        if store.boot != 0 || !store.records()?.is_empty() {
            return Err(StoreError::Replaced(store.place.path().to_owned()));
        }
        // By the mark of this run: it is this run's also where the disk fails in the midst of this.
        store.sign(before.boot, before.mark)?;
        Ok(store)
    }

    /// Makes a new file, signed.
    fn make(place: &Arc<dyn Place>, robot: RobotId) -> Result<(), StoreError> {
        let path = place.path();
        place.make(&|bytes| {
            let signed = || {
                let database = Builder::new().set_cache_size(CACHE).create_with_backend(bytes)?;
                sign(&database, robot, 0, fresh_nonce())?;
                Ok(database.close()?)
            };
            guarded(path, signed)
        })
    }

    /// Opens a file that is there, every byte of it checked, and owner and schema too.
    fn read(
        place: Arc<dyn Place>,
        robot: RobotId,
        (bytes, file): (Bytes, FileId),
    ) -> Result<Self, StoreError> {
        let path = place.path().to_owned();
        check_head(&path, &bytes)?;
        let (database, about) = guarded(&path, || {
            let database = Builder::new()
                .set_cache_size(CACHE)
                .set_check_integrity_on_open(true)
                .create_with_backend(bytes)?;
            let about = about(&database)?;
            Ok((database, about))
        })?;
        let About { schema, robot: owner, boot, mark } =
            about.ok_or_else(|| StoreError::Foreign(path.clone()))?;
        if schema != SCHEMA {
            return Err(StoreError::Schema { path, found: schema, expected: SCHEMA });
        }
        if owner != u64::from(robot.0) {
            return Err(StoreError::Robot { path, found: owner, expected: robot });
        }
        let boot =
            u32::try_from(boot).map_err(|_| StoreError::damaged(&path, "an impossible number of starts"))?;
        Ok(Self { database, place, robot, file, boot, mark })
    }

    /// Which start of the robot this is, higher than at any before; until it is [counted](Self::count), which the last one was: 0 for none.
    #[must_use]
    pub fn boot(&self) -> u32 {
        self.boot
    }

    /// What tells this run's file from any other.
    pub fn run(&self) -> Run {
        Run { boot: self.boot, mark: self.mark }
    }

    /// What the robot remembered up to its end.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], [`StoreError::Content`], and those of the disk.
    pub fn memory(&self) -> Result<RobotMemory, StoreError> {
        let path = self.place.path();
        let records = self.records()?;
        let read = RobotMemory::read(records.iter().map(|(key, value)| (key.as_slice(), value.as_slice())));
        read.map_err(|cause| match cause {
            gestalt_strategies::MemoryError::Damaged(what) => StoreError::damaged(path, what),
            cause => StoreError::Content { path: path.to_owned(), cause },
        })
    }

    /// The records as they stand in the file.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and those of the disk.
    pub fn records(&self) -> Result<Records, StoreError> {
        guarded(self.place.path(), || {
            let table = self.database.begin_read()?.open_table(RECORDS)?;
            let mut records = Records::new();
            for record in table.iter()? {
                let (key, value) = record?;
                records.insert(key.value().to_vec(), value.value().to_vec());
            }
            Ok(records)
        })
    }

    /// The classifier as it was last trained. One that cannot be read is none: it is trained again.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and those of the disk.
    pub fn classifier(&self) -> Result<Option<Classifier>, StoreError> {
        let bytes = guarded(self.place.path(), || {
            let table = self.database.begin_read()?.open_table(CLASSIFIER)?;
            Ok(table.get(())?.map(|value| value.value().to_vec()))
        })?;
        Ok(bytes.and_then(|bytes| Classifier::decode(&bytes).ok()))
    }

    /// Writes changes, and a classifier if there is a new one: all of it or nothing, and when this returns it is on
    /// the disk, in the file that has the memory's name.
    ///
    /// # Errors
    /// [`StoreError::Removed`] and [`StoreError::Replaced`] when it was written to a file that has lost its name; those of
    /// the disk; [`StoreError::Damaged`].
    pub fn write(&self, changes: &[RecordChange], classifier: Option<&Classifier>) -> Result<(), StoreError> {
        let path = self.place.path();
        guarded(path, || {
            self.commit(changes, classifier)?;
            // The database keeps two commits, and falls back to the earlier where the later is damaged. So each change
            // stands in both before it counts as written.
            self.commit(&[], None)
        })?;
        self.check()
    }

    /// Makes sure that the open file still has the memory's name.
    ///
    /// # Errors
    /// [`StoreError::Removed`], [`StoreError::Replaced`] and those of the disk.
    pub fn check(&self) -> Result<(), StoreError> {
        let path = self.place.path();
        match self.place.present().map_err(|cause| StoreError::of_system(path, &cause))? {
            Some(file) if file == self.file => Ok(()),
            Some(_) => Err(StoreError::Replaced(path.to_owned())),
            None => Err(StoreError::Removed(path.to_owned())),
        }
    }

    fn commit(&self, changes: &[RecordChange], classifier: Option<&Classifier>) -> Result<(), redb::Error> {
        let write = self.database.begin_write()?;
        {
            let mut about = write.open_table(ABOUT)?;
            let commits = about.get("commits")?.map_or(0, |commits| commits.value());
            about.insert("commits", commits.wrapping_add(1))?;
            let mut table = write.open_table(RECORDS)?;
            for RecordChange { key, value } in changes {
                match value {
                    Some(value) => table.insert(key.as_slice(), value.as_slice())?,
                    None => table.remove(key.as_slice())?,
                };
            }
            if let Some(classifier) = classifier {
                write.open_table(CLASSIFIER)?.insert((), classifier.encode().as_slice())?;
            }
        }
        Ok(write.commit()?)
    }
}

/// Which run of a robot a file was signed in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub boot: u32,
    mark: u64,
}

/// Tells another program's file from a damaged one, before the database tries to make sense of it.
fn check_head(path: &Path, bytes: &Bytes) -> Result<(), StoreError> {
    let system = |cause: std::io::Error| StoreError::of_system(path, &cause);
    let length = bytes.len().map_err(system)?;
    if length < MAGIC.len() as u64 {
        return Err(StoreError::damaged(path, format!("it is {length} bytes long")));
    }
    let mut head = [0; MAGIC.len()];
    bytes.read(0, &mut head).map_err(system)?;
    let right = head.iter().zip(MAGIC).filter(|(found, expected)| **found == *expected).count();
    match right {
        9 => Ok(()),
        // So many do not agree by chance.
        5..9 => Err(StoreError::damaged(path, "its first bytes are others")),
        _ => Err(StoreError::Foreign(path.to_owned())),
    }
}

/// What a file says of itself; `None` for a database of another program.
fn about(database: &Database) -> Result<Option<About>, redb::Error> {
    let read = database.begin_read()?;
    let table = match read.open_table(ABOUT) {
        Ok(table) => table,
        Err(redb::TableError::TableDoesNotExist(_)) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let fact = |name| Ok::<_, redb::Error>(table.get(name)?.map(|value| value.value()));
    let (Some(schema), Some(robot)) = (fact("schema")?, fact("robot")?) else { return Ok(None) };
    let (boot, mark) = (fact("boot")?.unwrap_or(0), fact("mark")?.unwrap_or(0));
    Ok(Some(About { schema, robot, boot, mark }))
}

fn sign(database: &Database, robot: RobotId, boot: u32, mark: u64) -> Result<(), redb::Error> {
    let write = database.begin_write()?;
    {
        let mut table = write.open_table(ABOUT)?;
        table.insert("schema", SCHEMA)?;
        table.insert("robot", u64::from(robot.0))?;
        table.insert("boot", u64::from(boot))?;
        table.insert("mark", mark)?;
        write.open_table(RECORDS)?;
        write.open_table(CLASSIFIER)?;
    }
    Ok(write.commit()?)
}

/// Calls the database, which may panic at bytes that it never wrote.
fn guarded<T>(path: &Path, call: impl FnOnce() -> Result<T, redb::Error>) -> Result<T, StoreError> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(done) => done.map_err(|cause| StoreError::of_database(path, cause)),
        Err(panic) => Err(StoreError::damaged(path, said(&*panic))),
    }
}
