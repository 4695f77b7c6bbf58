//! Reads a recording, also one that is torn or damaged.
//!
//! Framing is read here, so that each record's place is known and a claimed length is never believed; what stands in a record is
//! the library's to read. A chunk is read whole or not at all: its checksum is compared first.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use gestalt_protocol::Keys;
use mcap::records::{Record, op};
use thiserror::Error;

use crate::kind::Kind;
use crate::writer::{ABOUT, END};

/// The longest record that is read, in bytes; a chunk of a recording is far shorter.
const MAX_RECORD: u64 = 64 << 20;

/// How many damaged places are named; the rest are counted.
const MAX_NAMED: usize = 100;

/// A file that is no recording to be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// It cannot be read.
    #[error("cannot read the recording: {0}")]
    Disk(#[from] io::Error),
    /// It begins otherwise than an MCAP file.
    #[error("this is no MCAP file: give one that `gestalt record` wrote")]
    NotMcap,
    /// Another program compressed it.
    #[error(
        "its chunks are compressed by {0}, which is not read here: `mcap decompress` of the MCAP command line unpacks them"
    )]
    Compressed(String),
}

/// One message of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded<'a> {
    /// What it is.
    pub kind: Kind,
    /// The channel: the Zenoh key with a slash in front.
    pub channel: &'a str,
    /// When it was received, in nanoseconds since 1970.
    pub at: u64,
    /// When it was said, by its author's clock; else when it was received.
    pub published: u64,
    /// JSON, or protobuf, by its kind.
    pub data: &'a [u8],
}

impl Recorded<'_> {
    /// The keys of the swarm whose channel it is on.
    #[must_use]
    pub fn keys(&self) -> Option<Keys> {
        Keys::new(self.channel.strip_prefix("/gestalt/")?.split('/').next()?).ok()
    }
}

/// What state a recording is in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Condition {
    /// How many messages were read, of whatever kind.
    pub messages: u64,
    /// What the recording says of itself.
    pub about: BTreeMap<String, String>,
    /// What it says at its end of what was lost; `None` where it has no end.
    pub end: Option<BTreeMap<String, String>>,
    /// Where it was torn off: the length of what could be read. `None` for one that ends as it should.
    pub torn: Option<u64>,
    /// Places that are damaged, and what is wrong there; what they held was skipped.
    pub damage: Vec<(u64, String)>,
    /// Damaged places beyond those named.
    pub more_damage: u64,
    /// Messages whose channel was introduced in a damaged place.
    pub nameless: u64,
}

impl Condition {
    /// What is wrong with it, a sentence each; none for a recording that is whole.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks: Vec<String> =
            self.damage.iter().map(|(at, what)| format!("damaged at byte {at}: {what}")).collect();
        if self.more_damage > 0 {
            remarks.push(format!("damaged at {} more places", self.more_damage));
        }
        if self.nameless > 0 {
            remarks.push(format!("{} messages are of channels whose names were lost", self.nameless));
        }
        if let Some(at) = self.torn {
            remarks.push(format!(
                "torn off: it has no footer, and was read up to byte {at}, its last whole chunk"
            ));
        }
        remarks
    }

    fn damaged(&mut self, at: u64, what: String) {
        if self.damage.len() < MAX_NAMED {
            self.damage.push((at, what));
        } else {
            self.more_damage += 1;
        }
    }
}

/// Reads a recording from its beginning, message by message, in the order in which they were written.
///
/// It is gone through twice: the names of channels stand at the end once more, for where the chunk that introduces them is damaged.
///
/// # Errors
/// [`ReadError`]; what is torn or damaged is no error, see [`Condition`].
pub fn read(input: &mut (impl Read + Seek), visit: impl FnMut(Recorded<'_>)) -> Result<Condition, ReadError> {
    let mut naming = Reading {
        visit: |_: Recorded<'_>| {},
        channels: Channels::default(),
        condition: Condition::default(),
    };
    let begin = input.stream_position()?;
    naming.all(input)?;
    input.seek(SeekFrom::Start(begin))?;
    let mut reading = Reading { visit, channels: naming.channels, condition: Condition::default() };
    reading.all(input)?;
    Ok(reading.condition)
}

/// An opcode of one byte and a length of eight.
const HEAD: usize = 9;

fn heading(head: &[u8]) -> Option<(u8, u64)> {
    let (opcode, length) = head.split_first()?;
    Some((*opcode, u64::from_le_bytes(length.try_into().ok()?)))
}

/// The channels, as they are named first.
#[derive(Default)]
struct Channels {
    kinds: BTreeMap<u16, Option<Kind>>,
    names: BTreeMap<u16, (Option<Kind>, String)>,
}

struct Reading<V> {
    visit: V,
    channels: Channels,
    condition: Condition,
}

impl<V: FnMut(Recorded<'_>)> Reading<V> {
    /// Reads all records, up to the footer.
    fn all(&mut self, input: &mut impl Read) -> Result<(), ReadError> {
        let mut magic = Vec::new();
        input.take(mcap::MAGIC.len() as u64).read_to_end(&mut magic)?;
        if magic != mcap::MAGIC {
            return Err(ReadError::NotMcap);
        }
        let mut at = mcap::MAGIC.len() as u64;
        let (mut head, mut body) = (Vec::new(), Vec::new());
        loop {
            head.clear();
            input.take(HEAD as u64).read_to_end(&mut head)?;
            let Some((opcode, length)) = heading(&head) else {
                self.condition.torn = Some(at);
                return Ok(());
            };
            if length > MAX_RECORD {
                let what = format!("a record of {length} bytes, so nothing after it can be found");
                self.condition.damaged(at, what);
                return Ok(());
            }
            body.clear();
            input.take(length).read_to_end(&mut body)?;
            if (body.len() as u64) < length {
                self.condition.torn = Some(at);
                return Ok(());
            }
            match opcode {
                op::FOOTER => return Ok(()),
                op::CHUNK => self.chunk(&body, at)?,
                // Outside of a chunk no checksum stands for a message.
                op::MESSAGE => {}
                other => self.record(other, &body, at),
            }
            at += HEAD as u64 + length;
        }
    }

    fn chunk(&mut self, body: &[u8], at: u64) -> Result<(), ReadError> {
        let Ok(Record::Chunk { header, data }) = mcap::parse_record(op::CHUNK, body) else {
            self.condition.damaged(at, "a chunk whose head cannot be read".to_owned());
            return Ok(());
        };
        if !header.compression.is_empty() {
            return Err(ReadError::Compressed(header.compression.chars().take(32).collect()));
        }
        if header.uncompressed_crc != 0 && header.uncompressed_crc != crc32fast::hash(&data) {
            let what = format!("a chunk of {} bytes with another checksum than it says", data.len());
            self.condition.damaged(at, what);
            return Ok(());
        }
        let mut rest: &[u8] = &data;
        while !rest.is_empty() {
            let Some((opcode, inner, after)) = split(rest) else {
                self.condition.damaged(at, "a chunk that ends within a record".to_owned());
                return Ok(());
            };
            self.record(opcode, inner, at);
            rest = after;
        }
        Ok(())
    }

    /// Reads one record. Whatever is no concern of ours is passed over.
    fn record(&mut self, opcode: u8, body: &[u8], at: u64) {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA) {
            return;
        }
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header, .. }) => {
                self.channels.kinds.entry(header.id).or_insert(Kind::of_schema(&header.name));
            }
            Ok(Record::Channel(channel)) => {
                let kind = self.channels.kinds.get(&channel.schema_id).copied().flatten();
                self.channels.names.entry(channel.id).or_insert((kind, channel.topic));
            }
            Ok(Record::Message { header, data }) => {
                self.condition.messages += 1;
                match self.channels.names.get(&header.channel_id) {
                    Some((Some(kind), channel)) => {
                        let (at, published) = (header.log_time, header.publish_time);
                        (self.visit)(Recorded { kind: *kind, channel, at, published, data: &data });
                    }
                    // Another program's.
                    Some((None, _)) => {}
                    None => self.condition.nameless += 1,
                }
            }
            Ok(Record::Metadata(metadata)) if metadata.name == ABOUT => {
                self.condition.about = metadata.metadata;
            }
            Ok(Record::Metadata(metadata)) if metadata.name == END => {
                self.condition.end = Some(metadata.metadata);
            }
            Ok(_) => {}
            Err(error) => self.condition.damaged(at, format!("a record that cannot be read: {error}")),
        }
    }
}

/// The first record of a chunk, and what follows it.
fn split(chunk: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (head, rest) = chunk.split_at_checked(HEAD)?;
    let (opcode, length) = heading(head)?;
    let (body, after) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((opcode, body, after))
}
