//! Pictures and log lines as Foxglove's protobuf messages, which Rerun reads too: it takes JSON for opaque bytes.
//!
//! Two messages of six plain fields need no generator: what is written here is the protobuf wire format, varints and
//! length-delimited fields, for `foxglove/CompressedImage.proto`, `foxglove/Log.proto` and their descriptors.

use crate::kind::Kind;

/// How serious a log line is, as `foxglove.Log.Level`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Something happened.
    Info = 2,
    /// Something is wrong, and it goes on.
    Warning = 3,
    /// Something failed.
    Error = 4,
}

/// A picture as `foxglove.CompressedImage`: when it was taken, nanoseconds since 1970, whose it is, and `jpeg` or `png`.
#[must_use]
pub fn compressed_image(at: u64, frame: &str, picture: &[u8], format: &str) -> Vec<u8> {
    let mut message = Message::default();
    message.message(1, &timestamp(at)).bytes(2, picture).text(3, format).text(4, frame);
    message.0
}

/// A line of the log as `foxglove.Log`.
#[must_use]
pub fn log(at: u64, level: Level, name: &str, words: &str) -> Vec<u8> {
    let mut message = Message::default();
    message.message(1, &timestamp(at)).number(2, level as u64).text(3, words).text(4, name);
    message.0
}

/// The `FileDescriptorSet` of a kind that is protobuf; `None` for JSON.
#[must_use]
pub fn descriptor(kind: Kind) -> Option<Vec<u8>> {
    let file = match kind {
        Kind::Frame => {
            let fields =
                [("timestamp", 1, TIME), ("data", 2, BYTES), ("format", 3, TEXT), ("frame_id", 4, TEXT)];
            file("foxglove/CompressedImage.proto", "foxglove", &described("CompressedImage", &fields))
        }
        Kind::Log => {
            let fields = [
                ("timestamp", 1, TIME),
                ("level", 2, LEVEL),
                ("message", 3, TEXT),
                ("name", 4, TEXT),
                ("file", 5, TEXT),
                ("line", 6, FIXED),
            ];
            let mut log = described("Log", &fields);
            let mut levels = Message::default();
            levels.text(1, "Level");
            for (number, name) in (0..).zip(["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"]) {
                let mut level = Message::default();
                level.text(1, name).number(2, number);
                levels.message(2, &level);
            }
            log.message(4, &levels);
            file("foxglove/Log.proto", "foxglove", &log)
        }
        _ => return None,
    };
    let time = described("Timestamp", &[("seconds", 1, INT64), ("nanos", 2, INT32)]);
    let time = self::file("google/protobuf/timestamp.proto", "google.protobuf", &time);
    let mut file = file;
    file.text(3, "google/protobuf/timestamp.proto");
    let mut set = Message::default();
    set.message(1, &time).message(1, &file);
    Some(set.0)
}

/// The type of a field: its number in `descriptor.proto`, and the name of a type that is a message or an enumeration.
type Type = (u64, &'static str);
const INT64: Type = (3, "");
const INT32: Type = (5, "");
const FIXED: Type = (7, "");
const TEXT: Type = (9, "");
const TIME: Type = (11, ".google.protobuf.Timestamp");
const BYTES: Type = (12, "");
const LEVEL: Type = (14, ".foxglove.Log.Level");

/// A `DescriptorProto`.
fn described(name: &str, fields: &[(&str, u64, Type)]) -> Message {
    let mut described = Message::default();
    described.text(1, name);
    for (name, number, (kind, type_name)) in fields {
        let mut field = Message::default();
        // 4 is the label: each may be left out.
        field.text(1, name).number(3, *number).number(4, 1).number(5, *kind);
        if !type_name.is_empty() {
            field.text(6, type_name);
        }
        described.message(2, &field);
    }
    described
}

/// A `FileDescriptorProto`.
fn file(name: &str, package: &str, message: &Message) -> Message {
    let mut file = Message::default();
    file.text(1, name).text(2, package).message(4, message).text(12, "proto3");
    file
}

fn timestamp(at: u64) -> Message {
    const SECOND: u64 = 1_000_000_000;
    let mut time = Message::default();
    time.number(1, at / SECOND).number(2, at % SECOND);
    time
}

/// A protobuf message while it is written.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(&mut self, field: u64, value: u64) -> &mut Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn bytes(&mut self, field: u64, bytes: &[u8]) -> &mut Self {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
        self
    }

    fn text(&mut self, field: u64, text: &str) -> &mut Self {
        self.bytes(field, text.as_bytes())
    }

    fn message(&mut self, field: u64, message: &Self) -> &mut Self {
        self.bytes(field, &message.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_line_has_the_bytes_that_protoc_gives_it() {
        // protoc --encode=foxglove.Log: timestamp { seconds: 5 nanos: 300 } level: WARNING message: "hi" name: "a"
        let expected = [0x0a, 5, 0x08, 5, 0x10, 0xac, 0x02, 0x10, 3, 0x1a, 2, b'h', b'i', 0x22, 1, b'a'];
        assert_eq!(log(5_000_000_300, Level::Warning, "a", "hi"), expected);
    }

    #[test]
    fn what_is_protobuf_has_a_descriptor_and_nothing_else_has() {
        for kind in Kind::ALL {
            assert_eq!(descriptor(kind).is_some(), !kind.is_json(), "{kind:?}");
        }
    }
}
