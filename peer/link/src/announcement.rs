//! A decision as clients read it.

use gestalt_protocol::Decision;
use serde::{Deserialize, Serialize};

/// A decision with the words for it: the JSON on `decision` and `robot/<id>/decision`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Announcement {
    /// The decision, its fields beside `label`.
    #[serde(flatten)]
    pub decision: Decision,
    /// The label of its class; `None` for "no decision", and where the robot that writes it has no vocabulary.
    #[serde(default)]
    pub label: Option<String>,
}
