//! A disk that loses what was not synced when its power is cut, and that can be full.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

use redb::StorageBackend;

use super::super::StoreError;
use super::super::bytes::Bytes;
use super::super::place::{FileId, Fill, Place};

/// A disk with one file, in memory.
#[derive(Clone, Debug, Default)]
pub struct Disk(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    /// What survives a power cut.
    synced: Option<Vec<u8>>,
    /// What is read while there is power.
    cached: Option<Vec<u8>>,
    /// What was written since the last sync, in order.
    unsynced: Vec<(u64, Vec<u8>)>,
    /// Writes and syncs so far.
    operations: u64,
    /// The power goes at that operation.
    cut_at: Option<u64>,
    /// No byte more is taken.
    full: bool,
    /// Nothing can be opened for writing.
    locked: bool,
}

impl Disk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// The power goes at operation number `at`, counted from 1.
    pub fn cut_at(&self, at: u64) {
        self.lock().cut_at = Some(at);
    }

    /// Writes and syncs so far.
    pub fn operations(&self) -> u64 {
        self.lock().operations
    }

    pub fn fill(&self, full: bool) {
        self.lock().full = full;
    }

    /// Somebody removes the file.
    pub fn remove(&self) {
        let mut state = self.lock();
        (state.cached, state.synced) = (None, None);
        state.unsynced.clear();
    }

    /// A disk with these bytes on it.
    pub fn holding(file: Vec<u8>) -> Self {
        let state = State { cached: Some(file.clone()), synced: Some(file), ..State::default() };
        Self(Arc::new(Mutex::new(state)))
    }

    pub fn lock_up(&self, locked: bool) {
        self.lock().locked = locked;
    }

    /// The disk as it is after its power was cut: what was synced, and of the rest each write that `kept` says, which may
    /// be only its first half.
    pub fn after_cut(&self, mut kept: impl FnMut() -> Kept) -> Self {
        let state = self.lock();
        let mut file = state.synced.clone();
        for (offset, bytes) in &state.unsynced {
            let bytes = match kept() {
                Kept::None => continue,
                Kept::Half => &bytes[..bytes.len() / 2],
                Kept::All => bytes,
            };
            if let Some(file) = &mut file {
                put(file, *offset, bytes);
            }
        }
        file.map_or_else(Self::default, Self::holding)
    }
}

/// What becomes of an unsynced write.
#[derive(Clone, Copy)]
pub enum Kept {
    None,
    Half,
    All,
}

fn put(file: &mut Vec<u8>, offset: u64, bytes: &[u8]) {
    let (offset, end) = (offset as usize, offset as usize + bytes.len());
    if file.len() < end {
        file.resize(end, 0);
    }
    file[offset..end].copy_from_slice(bytes);
}

impl State {
    /// Counts an operation, which fails once the power is gone.
    fn operate(&mut self) -> io::Result<()> {
        self.operations += 1;
        if self.cut_at.is_some_and(|at| self.operations >= at) {
            return Err(io::Error::other("no power"));
        }
        Ok(())
    }

    fn file(&mut self) -> io::Result<&mut Vec<u8>> {
        self.cached.as_mut().ok_or_else(|| ErrorKind::NotFound.into())
    }
}

/// The file, while it is made (`draft`) or once it is there.
#[derive(Debug)]
struct OfDisk(Disk);

impl StorageBackend for OfDisk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.0.lock().file()?.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let mut state = self.0.lock();
        let (start, end) = (offset as usize, offset as usize + out.len());
        out.copy_from_slice(state.file()?.get(start..end).ok_or(ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        let mut state = self.0.lock();
        state.operate()?;
        if state.full && len > state.file()?.len() as u64 {
            return Err(ErrorKind::StorageFull.into());
        }
        state.file()?.resize(len as usize, 0);
        // The length is the file system's own business, which journals it.
        if let Some(synced) = &mut state.synced {
            synced.resize(len as usize, 0);
        }
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        let mut state = self.0.lock();
        state.operate()?;
        if state.synced.is_some() {
            state.synced = state.cached.clone();
        }
        state.unsynced.clear();
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let mut state = self.0.lock();
        state.operate()?;
        if state.full {
            return Err(ErrorKind::StorageFull.into());
        }
        put(state.file()?, offset, data);
        state.unsynced.push((offset, data.to_vec()));
        Ok(())
    }
}

impl Place for Disk {
    fn path(&self) -> &Path {
        Path::new("a disk that fails")
    }

    fn is_there(&self) -> io::Result<bool> {
        Ok(self.lock().cached.is_some())
    }

    fn open(&self) -> io::Result<(Bytes, FileId)> {
        if self.lock().locked {
            return Err(ErrorKind::ReadOnlyFilesystem.into());
        }
        Ok((Bytes::new(OfDisk(self.clone())), FileId(0, 0)))
    }

    fn copy(&self) -> io::Result<(Bytes, FileId)> {
        Ok((Bytes::in_memory(self.lock().file()?)?, FileId(0, 0)))
    }

    fn make(&self, fill: Fill<'_>) -> Result<(), StoreError> {
        self.lock().cached = Some(Vec::new());
        let filled = fill(Bytes::new(OfDisk(self.clone())));
        let mut state = self.lock();
        if filled.is_ok() {
            state.synced = state.cached.clone();
        } else {
            state.cached = None;
        }
        filled
    }

    fn present(&self) -> io::Result<Option<FileId>> {
        Ok(self.lock().cached.is_some().then_some(FileId(0, 0)))
    }
}
