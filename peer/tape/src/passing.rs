//! What comes to a recorder, and what becomes of it in the file.

use gestalt_protocol::{DecodeError, FrameHeader, ImageEncoding, Keys, MAX_FRAME, RobotId, Topic};
use serde_json::{Value, json};

use crate::foxglove::{self, Level};
use crate::kind::Kind;
use crate::ledger::Ledger;
use crate::view::{self, Alive};

/// One thing that was said in a swarm, as it travelled.
#[derive(Clone, Debug, PartialEq)]
pub struct Passing {
    /// What it is about.
    pub topic: Topic,
    /// Its bytes.
    pub payload: Vec<u8>,
    /// What travelled beside them: the header of a frame.
    pub attachment: Option<Vec<u8>>,
    /// When it was received, in nanoseconds since 1970.
    pub at: u64,
    /// When it was said, if its message tells; by its author's clock.
    pub published: Option<u64>,
}

/// One message of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// What it is.
    pub kind: Kind,
    /// The channel: the Zenoh key with a slash in front.
    pub channel: String,
    /// When it was received, in nanoseconds since 1970.
    pub at: u64,
    /// When it was said, by its author's clock; else when it was received.
    pub published: u64,
    /// JSON, or protobuf, by its kind.
    pub data: Vec<u8>,
}

impl Passing {
    /// That a robot came or left.
    #[must_use]
    pub fn presence(robot: RobotId, alive: bool, at: u64) -> Self {
        let payload = serde_json::to_vec(&Alive { robot, alive }).unwrap_or_default();
        Self { topic: Topic::Alive(robot), payload, attachment: None, at, published: None }
    }

    /// How much memory it takes, about, in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        size_of::<Self>() + self.payload.len() + self.attachment.as_ref().map_or(0, Vec::len)
    }

    /// As it is recorded; `None` for what is not. What is no message of its key is recorded as unreadable.
    #[must_use]
    pub fn entry(&self, keys: &Keys) -> Option<Entry> {
        let kind = Kind::of(&self.topic)?;
        let key = keys.key(&self.topic);
        let (at, published) = (self.at, self.published.unwrap_or(self.at));
        let data = match kind {
            Kind::Frame => self.picture(),
            _ => view::view(&self.topic, &self.payload).map(|view| bytes(&view)),
        };
        Some(match data {
            Ok(data) => Entry { kind, channel: format!("/{key}"), at, published, data },
            Err(cause) => Entry {
                kind: Kind::Unreadable,
                // One channel for all: whoever may say anything may say it under any key.
                channel: beside(keys, Kind::Unreadable.name()),
                at,
                published,
                data: bytes(&view::unreadable(&key, &self.payload, &cause)),
            },
        })
    }

    /// A streamed frame; the picture itself is not looked into.
    fn picture(&self) -> Result<Vec<u8>, DecodeError> {
        let length = self.payload.len();
        if length > MAX_FRAME {
            return Err(DecodeError::TooLong { length, limit: MAX_FRAME });
        }
        let header = FrameHeader::decode(self.attachment.as_deref().unwrap_or_default())?;
        let format = match header.encoding {
            ImageEncoding::Jpeg => "jpeg",
            ImageEncoding::Png => "png",
        };
        let taken = self.at.saturating_sub(u64::from(header.age_us) * 1000);
        let Topic::Frame(robot) = &self.topic else { return Err(DecodeError::Impossible("no frame")) };
        Ok(foxglove::compressed_image(taken, &format!("robot {robot}"), &self.payload, format))
    }
}

impl Entry {
    /// A line of the log of a recording, at that time in nanoseconds since 1970.
    #[must_use]
    pub fn log(keys: &Keys, at: u64, level: Level, words: &str) -> Self {
        Self::own(keys, Kind::Log, at, foxglove::log(at, level, "recorder", words))
    }

    /// What was received, written and lost so far.
    #[must_use]
    pub fn report(keys: &Keys, at: u64, ledger: &Ledger) -> Self {
        let Ledger { received, written, dropped, bytes: on_disk, unattached_ms, .. } = ledger;
        let report = json!({
            "received": received, "written": written, "dropped": dropped, "bytes": on_disk,
            "unattached_ms": unattached_ms,
        });
        Self::own(keys, Kind::Recorder, at, bytes(&report))
    }

    /// The channels of the whole swarm that every recording may have, and those of a robot that is there.
    #[must_use]
    pub fn channels(keys: &Keys, robot: Option<RobotId>) -> Vec<(Kind, String)> {
        let topics = match robot {
            None => vec![Topic::Decision, Topic::Question],
            Some(id) => {
                vec![
                    Topic::Alive(id),
                    Topic::Status(id),
                    Topic::Vote(id),
                    Topic::RobotDecision(id),
                    Topic::Sample(id),
                ]
            }
        };
        let of_swarm =
            topics.iter().filter_map(|topic| Some((Kind::of(topic)?, format!("/{}", keys.key(topic)))));
        let own = Kind::ALL.into_iter().filter(|kind| kind.is_recorders() && robot.is_none());
        of_swarm.chain(own.map(|kind| (kind, beside(keys, kind.name())))).collect()
    }

    fn own(keys: &Keys, kind: Kind, at: u64, data: Vec<u8>) -> Self {
        Self { kind, channel: beside(keys, kind.name()), at, published: at, data }
    }
}

/// A channel of the recorder's own, beside those of the swarm.
fn beside(keys: &Keys, name: &str) -> String {
    let decision = keys.key(&Topic::Decision);
    format!("/{}{name}", decision.trim_end_matches("decision"))
}

/// A JSON value has a text, always.
fn bytes(value: &Value) -> Vec<u8> {
    value.to_string().into_bytes()
}
