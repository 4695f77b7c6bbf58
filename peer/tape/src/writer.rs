//! A recording while it is written: MCAP, one chunk at a time.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;

use crate::definition::definition;
use crate::kind::Kind;
use crate::passing::Entry;
use crate::sink::{Sink, WriteError};

/// The name of the metadata that says what is recorded.
pub const ABOUT: &str = "gestalt";

/// The name of the metadata that says, at the end, what was recorded and what was lost.
pub const END: &str = "gestalt.end";

/// The most channels of a recording. Whoever may say anything may say it under the key of any robot.
const MAX_CHANNELS: usize = 16_384;

/// Writes a recording. Messages collect in memory until [`flush`](TapeWriter::flush), which writes them as one chunk.
pub struct TapeWriter<W: Write> {
    mcap: mcap::Writer<NoSeek<W>>,
    schemas: BTreeMap<Kind, u16>,
    channels: BTreeMap<(Kind, String), Channel>,
    pending: usize,
}

struct Channel {
    id: u16,
    /// The sequence number of its next message.
    next: u32,
}

impl<W: Write> TapeWriter<W> {
    /// Begins a recording that says this of itself.
    ///
    /// # Errors
    /// [`WriteError`] when nothing can be written.
    pub fn new(out: W, about: BTreeMap<String, String>) -> Result<Self, WriteError> {
        let library = concat!("gestalt-tape ", env!("CARGO_PKG_VERSION"));
        // A chunk is a flush; and no seeking back, so that what is on the disk is never changed again.
        let options =
            WriteOptions::new().compression(None).chunk_size(None).library(library).disable_seeking(true);
        let mcap = options.create(NoSeek::new(out))?;
        let mut writer = Self { mcap, schemas: BTreeMap::new(), channels: BTreeMap::new(), pending: 0 };
        writer.mcap.write_metadata(&Metadata { name: ABOUT.to_owned(), metadata: about })?;
        writer.flush()?;
        Ok(writer)
    }

    /// Takes in one message; `false` when there is no room for another channel.
    ///
    /// # Errors
    /// [`WriteError`] when a recording cannot hold it.
    pub fn write(&mut self, entry: &Entry) -> Result<bool, WriteError> {
        let Some((id, sequence)) = self.place(entry)? else { return Ok(false) };
        let header =
            MessageHeader { channel_id: id, sequence, log_time: entry.at, publish_time: entry.published };
        self.mcap.write_to_known_channel(&header, &entry.data)?;
        self.pending += entry.data.len();
        Ok(true)
    }

    /// How many bytes wait for the next flush.
    #[must_use]
    pub fn pending(&self) -> usize {
        self.pending
    }

    /// Writes what waits as one chunk, and hands it to the system.
    ///
    /// # Errors
    /// [`WriteError`]: what waited is not in the file, or not whole.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.pending = 0;
        Ok(self.mcap.flush()?)
    }

    /// Ends the recording with what is to be said of it, an index and a footer; gives back where it was written.
    ///
    /// # Errors
    /// [`WriteError`]: without a footer a recording is read to its last whole chunk.
    pub fn finish(mut self, end: BTreeMap<String, String>) -> Result<W, WriteError> {
        self.mcap.write_metadata(&Metadata { name: END.to_owned(), metadata: end })?;
        self.mcap.finish()?;
        let mut out = self.mcap.into_inner().into_inner();
        out.flush()?;
        Ok(out)
    }

    /// The channel of a message and its number there; `None` when there is no room for another channel.
    fn place(&mut self, entry: &Entry) -> Result<Option<(u16, u32)>, WriteError> {
        let name = (entry.kind, entry.channel.clone());
        if let Some(channel) = self.channels.get_mut(&name) {
            let sequence = channel.next;
            channel.next = channel.next.wrapping_add(1);
            return Ok(Some((channel.id, sequence)));
        }
        if self.channels.len() >= MAX_CHANNELS {
            return Ok(None);
        }
        let (schema, encoding) = (self.schema(entry.kind)?, entry.kind.encoding());
        let id = self.mcap.add_channel(schema, &entry.channel, encoding, &BTreeMap::new())?;
        self.channels.insert(name, Channel { id, next: 1 });
        Ok(Some((id, 0)))
    }

    fn schema(&mut self, kind: Kind) -> Result<u16, WriteError> {
        if let Some(id) = self.schemas.get(&kind) {
            return Ok(*id);
        }
        let (encoding, data) = definition(kind);
        let id = self.mcap.add_schema(kind.schema(), encoding, &data)?;
        self.schemas.insert(kind, id);
        Ok(id)
    }
}

impl<W: Write + Send + 'static> Sink for TapeWriter<W> {
    fn write(&mut self, entry: &Entry) -> Result<bool, WriteError> {
        Self::write(self, entry)
    }

    fn pending(&self) -> usize {
        Self::pending(self)
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        Self::flush(self)
    }

    fn finish(self, end: BTreeMap<String, String>) -> Result<(), WriteError> {
        Self::finish(self, end).map(drop)
    }
}
