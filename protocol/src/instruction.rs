//! What a human says to the swarm.

use serde::{Deserialize, Serialize};

/// A human's word to the swarm, JSON on `instructor/<id>/feedback`: for example `{"say": "open"}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "say", rename_all = "snake_case", from = "Read")]
pub enum Instruction {
    /// "Look now": open a round. Without effect while one is open.
    Open,
}

/// How an [`Instruction`] is read. Its variants have braces because serde lets unknown keys pass beside a variant
/// without.
#[derive(Deserialize)]
#[serde(tag = "say", rename_all = "snake_case", deny_unknown_fields)]
enum Read {
    Open {},
}

impl From<Read> for Instruction {
    fn from(read: Read) -> Self {
        match read {
            Read::Open {} => Self::Open,
        }
    }
}
