//! A file that grows by whole chunks.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// How often what was written is made to survive a power cut.
const SYNC: Duration = Duration::from_secs(1);

/// A file to which bytes are added at each flush, all of them or none: what could not be written whole is cut off again, so that
/// what is there ends with a whole chunk.
#[derive(Debug)]
pub struct Disk {
    file: File,
    pending: Vec<u8>,
    /// How much of the file is whole.
    whole: u64,
    /// Since when something is written that is not synchronised.
    unsynced: Option<Instant>,
    failed: Option<ErrorKind>,
}

impl Disk {
    /// A new file.
    ///
    /// # Errors
    /// Those of the system; `AlreadyExists` for a file that is there, which is never overwritten.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        Ok(Self { file, pending: Vec::new(), whole: 0, unsynced: None, failed: None })
    }

    fn append(&mut self) -> io::Result<()> {
        self.file.write_all(&self.pending)?;
        self.whole += self.pending.len() as u64;
        self.pending.clear();
        let since = *self.unsynced.get_or_insert_with(Instant::now);
        if since.elapsed() >= SYNC {
            self.sync()?;
        }
        Ok(())
    }

    /// Makes all that was flushed survive a power cut.
    ///
    /// # Errors
    /// Those of the system.
    pub fn sync(&mut self) -> io::Result<()> {
        self.unsynced = None;
        self.file.sync_data()
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(kind) = self.failed {
            return Err(kind.into());
        }
        self.pending.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if let Some(kind) = self.failed {
            return Err(kind.into());
        }
        if self.pending.is_empty() {
            return Ok(());
        }
        self.append().inspect_err(|error| {
            self.failed = Some(error.kind());
            self.pending = Vec::new();
            // Where even that fails, readers cut off the torn end.
            let _ = self.file.set_len(self.whole);
        })
    }
}
