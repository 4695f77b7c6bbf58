//! What a human says to the swarm.

use serde::{Deserialize, Serialize};

/// A human's word to the swarm, JSON on `instructor/<id>/feedback`: for example `{"say": "open"}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "say", rename_all = "snake_case", deny_unknown_fields)]
pub enum Instruction {
    /// "Look now": open a round. Without effect while one is open.
    Open,
}
