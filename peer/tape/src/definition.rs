//! The schema of a kind of message as a reader is told it: in a recording, or live.

use crate::foxglove::descriptor;
use crate::kind::Kind;
use crate::schema::schema;

/// How the schema of a kind is written, `jsonschema` or `protobuf`, and the schema: JSON, or a `FileDescriptorSet`.
#[must_use]
pub fn definition(kind: Kind) -> (&'static str, Vec<u8>) {
    let json = schema(kind).map(|schema| ("jsonschema", schema.to_string().into_bytes()));
    json.unwrap_or_else(|| ("protobuf", descriptor(kind).unwrap_or_default()))
}
