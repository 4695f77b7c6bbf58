//! A channel as clients are told of it.

use std::sync::Arc;

use axum::extract::ws::Message;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use gestalt_tape::{Kind, definition};
use serde_json::{Value, json};

use super::wire::text;

/// A list of channels is told in messages of about this many bytes: there are clients that take no more than a million.
const PART: usize = 256 * 1024;

/// A channel: the key of the swarm's messages with a slash in front, as in a recording.
#[derive(Debug)]
pub(super) struct Channel {
    /// Its number; none is ever used for two channels.
    pub id: u32,
    pub kind: Kind,
    pub topic: String,
    /// Of its kind, and the same for all of that.
    pub schema: Arc<Schema>,
}

/// The schema of a kind, as it is written in JSON.
#[derive(Debug)]
pub(super) struct Schema {
    encoding: &'static str,
    text: String,
}

impl Schema {
    pub fn of(kind: Kind) -> Self {
        let (encoding, data) = definition(kind);
        let text = match encoding {
            "protobuf" => BASE64.encode(data),
            _ => String::from_utf8_lossy(&data).into_owned(),
        };
        Self { encoding, text }
    }
}

impl Channel {
    fn advertisement(&self) -> Value {
        json!({
            "id": self.id, "topic": self.topic, "encoding": self.kind.encoding(), "schemaName": self.kind.schema(),
            "schemaEncoding": self.schema.encoding, "schema": self.schema.text,
        })
    }
}

/// Says that these channels are there; at least one message.
pub(super) fn advertise(channels: &[Arc<Channel>]) -> Vec<Message> {
    let (mut messages, mut part, mut size) = (Vec::new(), Vec::new(), 0);
    let said = |part: &mut Vec<Value>| text(&json!({"op": "advertise", "channels": std::mem::take(part)}));
    for channel in channels {
        if size > PART {
            messages.push(said(&mut part));
            size = 0;
        }
        size += channel.schema.text.len() + channel.topic.len() + 200;
        part.push(channel.advertisement());
    }
    if messages.is_empty() || !part.is_empty() {
        messages.push(said(&mut part));
    }
    messages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_told_in_parts_that_any_client_takes_and_none_is_left_out() {
        let schema = Arc::new(Schema::of(Kind::Status));
        let channel =
            |id| Channel { id, kind: Kind::Status, topic: format!("/{id}"), schema: schema.clone() };
        let channels: Vec<_> = (0..500).map(|id| Arc::new(channel(id))).collect();
        let mut told = Vec::new();
        for message in advertise(&channels) {
            let text = message.into_text().unwrap();
            assert!(text.len() < 1 << 20, "{} bytes", text.len());
            let message: Value = serde_json::from_str(&text).unwrap();
            let ids = message["channels"].as_array().unwrap().iter().map(|channel| channel["id"].as_u64());
            told.extend(ids.map(Option::unwrap));
        }
        assert_eq!(told, (0..500).collect::<Vec<_>>());
        assert_eq!(advertise(&[]).len(), 1, "one message at least is sent");
    }
}
