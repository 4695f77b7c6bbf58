//! Foxglove's WebSocket protocol, `foxglove.sdk.v1`: what travels, as bytes and JSON.

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};
use serde::Deserialize;
use serde_json::{Value, json};
use thiserror::Error;

/// The name of the protocol, which a client must offer.
pub(super) const SUBPROTOCOL: &str = "foxglove.sdk.v1";

/// The longest message of a client, in bytes: a subscription to thousands of channels fits.
pub(super) const MAX_REQUEST: usize = 256 * 1024;

/// What a client asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Messages of these channels.
    Subscribe(Vec<Subscription>),
    /// Nothing more under these subscriptions.
    Unsubscribe(Vec<u32>),
    /// The connection graph, or no more of it.
    Graph(bool),
    /// A service.
    Call(Call),
}

/// A subscription, by a number of the client's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub id: u32,
    pub channel_id: u32,
}

/// The call of a service, by a number of the client's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Call {
    pub service: u32,
    pub id: u32,
    pub encoding: String,
    pub payload: Vec<u8>,
}

/// Why a message is no request.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(super) enum Malformed {
    #[error("a message that is no JSON object with 'op' and what belongs to it: {0}")]
    Json(String),
    #[error("the operation '{0}' is none of this protocol")]
    Operation(String),
    #[error("this server has not the capability {0}")]
    Capability(&'static str),
    #[error("a binary message of no known kind: it begins with {0:?}")]
    Opcode(Option<u8>),
    #[error("a service call that ends too early")]
    Short,
    #[error("a service call whose encoding has no name in UTF-8")]
    Encoding,
}

/// How serious a [`status`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    Warning = 1,
    Error = 2,
}

impl Request {
    /// A text message.
    pub fn of_text(text: &str) -> Result<Self, Malformed> {
        #[derive(Deserialize)]
        struct Operation {
            op: String,
        }
        #[derive(Deserialize)]
        struct Subscribe {
            subscriptions: Vec<Subscription>,
        }
        #[derive(Deserialize)]
        #[serde(rename_all = "camelCase")]
        struct Unsubscribe {
            subscription_ids: Vec<u32>,
        }
        let Operation { op } = read(text)?;
        match op.as_str() {
            "subscribe" => read(text).map(|Subscribe { subscriptions }| Self::Subscribe(subscriptions)),
            "unsubscribe" => {
                read(text).map(|Unsubscribe { subscription_ids }| Self::Unsubscribe(subscription_ids))
            }
            "subscribeConnectionGraph" => Ok(Self::Graph(true)),
            "unsubscribeConnectionGraph" => Ok(Self::Graph(false)),
            "advertise" | "unadvertise" => Err(Malformed::Capability("clientPublish")),
            "getParameters" | "setParameters" => Err(Malformed::Capability("parameters")),
            "subscribeParameterUpdates" | "unsubscribeParameterUpdates" => {
                Err(Malformed::Capability("parametersSubscribe"))
            }
            "fetchAsset" => Err(Malformed::Capability("assets")),
            _ => Err(Malformed::Operation(op.chars().take(40).collect())),
        }
    }

    /// A binary message.
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, Malformed> {
        match bytes.split_first() {
            Some((2, rest)) => Call::read(rest).map(Self::Call),
            Some((1, _)) => Err(Malformed::Capability("clientPublish")),
            Some((3, _)) => Err(Malformed::Capability("playbackControl")),
            other => Err(Malformed::Opcode(other.map(|(opcode, _)| *opcode))),
        }
    }
}

impl Call {
    fn read(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut rest = bytes;
        let mut number = || {
            let (number, after) = rest.split_first_chunk().ok_or(Malformed::Short)?;
            rest = after;
            Ok(u32::from_le_bytes(*number))
        };
        let (service, id, length) = (number()?, number()?, number()?);
        let length = usize::try_from(length).map_err(|_| Malformed::Short)?;
        let (encoding, payload) = rest.split_at_checked(length).ok_or(Malformed::Short)?;
        let encoding = std::str::from_utf8(encoding).map_err(|_| Malformed::Encoding)?.to_owned();
        Ok(Self { service, id, encoding, payload: payload.to_vec() })
    }

    /// What came of it, in the encoding that it was asked in.
    pub fn response(&self, payload: &[u8]) -> Message {
        let mut bytes = vec![3];
        bytes.extend(self.service.to_le_bytes());
        bytes.extend(self.id.to_le_bytes());
        bytes.extend(u32::try_from(self.encoding.len()).unwrap_or_default().to_le_bytes());
        bytes.extend(self.encoding.as_bytes());
        bytes.extend(payload);
        Message::Binary(bytes.into())
    }

    /// That nothing came of it.
    pub fn failure(&self, words: &str) -> Message {
        text(&json!({
            "op": "serviceCallFailure", "serviceId": self.service, "callId": self.id, "message": words,
        }))
    }
}

/// One message of a channel, received at that time in nanoseconds since 1970.
pub(super) fn message_data(subscription: u32, at: u64, data: &Bytes) -> Message {
    let mut bytes = Vec::with_capacity(13 + data.len());
    bytes.push(1);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(at.to_le_bytes());
    bytes.extend_from_slice(data);
    Message::Binary(bytes.into())
}

/// Something that people should know. One with a name replaces the one before, until it is taken back.
pub(super) fn status(level: Level, words: &str, id: Option<&str>) -> Message {
    let mut status = json!({"op": "status", "level": level as u8, "message": words});
    if let Some(id) = id {
        status["id"] = json!(id);
    }
    text(&status)
}

pub(super) fn remove_status(ids: &[&String]) -> Message {
    text(&json!({"op": "removeStatus", "statusIds": ids}))
}

pub(super) fn unadvertise(channel: u32) -> Message {
    text(&json!({"op": "unadvertise", "channelIds": [channel]}))
}

/// A JSON value has a text, always.
pub(super) fn text(value: &Value) -> Message {
    Message::Text(Utf8Bytes::from(value.to_string()))
}

fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Malformed> {
    serde_json::from_str(text).map_err(|error| Malformed::Json(error.to_string()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn binary(message: Message) -> Vec<u8> {
        let Message::Binary(bytes) = message else { panic!("{message:?} is not binary") };
        bytes.to_vec()
    }

    /// The bytes are those of the snapshots in Foxglove's own SDK.
    #[test]
    fn binary_messages_have_the_bytes_of_the_sdk() {
        let json = br#"{"key": "value"}"#;
        let data = Bytes::from_static(json);
        let expected = [&[1, 30, 0, 0, 0, 0xd2, 4, 0, 0, 0, 0, 0, 0], &json[..]].concat();
        assert_eq!(binary(message_data(30, 1234, &data)), expected);
        let call = Call { service: 10, id: 12, encoding: "json".to_owned(), payload: json.to_vec() };
        let rest = [&[10, 0, 0, 0, 12, 0, 0, 0, 4, 0, 0, 0], &b"json"[..], json].concat();
        assert_eq!(Request::of_bytes(&[&[2], &rest[..]].concat()), Ok(Request::Call(call.clone())));
        assert_eq!(binary(call.response(json)), [&[3], &rest[..]].concat());
    }

    #[test]
    fn requests_are_read_as_clients_write_them() {
        let subscribe =
            r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":10},{"id":2,"channelId":20}]}"#;
        let expected = [(1, 10), (2, 20)].map(|(id, channel_id)| Subscription { id, channel_id });
        assert_eq!(Request::of_text(subscribe), Ok(Request::Subscribe(expected.to_vec())));
        assert_eq!(
            Request::of_text(r#"{"op":"unsubscribe","subscriptionIds":[1,2,3]}"#),
            Ok(Request::Unsubscribe(vec![1, 2, 3]))
        );
        assert_eq!(Request::of_text(r#"{"op":"subscribeConnectionGraph"}"#), Ok(Request::Graph(true)));
        assert_eq!(
            Request::of_text(r#"{"op":"fetchAsset","uri":"package://x","requestId":1}"#),
            Err(Malformed::Capability("assets"))
        );
        for wrong in
            ["", "[]", "{}", r#"{"op":"subscribe"}"#, r#"{"op":"subscribe","subscriptions":[{"id":-1}]}"#]
        {
            assert!(matches!(Request::of_text(wrong), Err(Malformed::Json(_))), "{wrong}");
        }
        assert!(matches!(Request::of_text(r#"{"op":"dance"}"#), Err(Malformed::Operation(_))));
        assert_eq!(Request::of_bytes(&[]), Err(Malformed::Opcode(None)));
        assert_eq!(Request::of_bytes(&[2, 1, 0, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0]), Err(Malformed::Short));
    }

    proptest! {
        #[test]
        fn nothing_that_comes_makes_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Request::of_bytes(&bytes);
            let _ = Request::of_bytes(&[&[2], &bytes[..]].concat());
            let _ = Request::of_text(&String::from_utf8_lossy(&bytes));
        }
    }
}
