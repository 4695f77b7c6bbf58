//! A decision as it is said aloud.

use serde::{Deserialize, Serialize};

use crate::decision::{Certificate, Decision};
use crate::decode::DecodeError;
use crate::id::{ClassId, RobotId, RoundId, Stamp};
use crate::naming::MAX_TITLE;
use crate::signature::Signature;

/// A decision as a robot announces it for the swarm: the JSON on `decision`.
///
/// Whoever holds a decision may announce it, so who does is no part of the decision: two robots that announce the same one hold the same.
/// The announcer stands by all of it, also by what no vote covers: the name of the round, who drew it, whether it is final.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Spelt")]
pub struct Announcement {
    /// The decision, its fields beside the others.
    #[serde(flatten)]
    pub decision: Decision,
    /// The label of its class; `None` for "no decision", and where its announcer has no such vocabulary.
    pub label: Option<String>,
    /// The robot that says it.
    pub announcer: RobotId,
    /// The announcer's stamp on it.
    pub stamp: Stamp,
    /// The announcer's signature under the [`Envelope`](crate::Envelope) that it is; robots of an open swarm sign nothing.
    pub signature: Option<Signature>,
}

/// The fields of an [`Announcement`] as they are read: one that is flattened would first keep all that it does not know.
#[derive(Deserialize)]
struct Spelt {
    round: RoundId,
    class: Option<ClassId>,
    confidence: f64,
    author: RobotId,
    #[serde(rename = "final")]
    is_final: bool,
    certificate: Certificate,
    label: Option<String>,
    announcer: RobotId,
    stamp: Stamp,
    signature: Option<Signature>,
}

impl Announcement {
    /// Whether it is one that a robot may make.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        check(&self.decision, self.label.as_deref())
    }
}

impl Announced {
    /// As [`Announcement::check`].
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        check(&self.decision, self.label.as_deref())
    }
}

/// A label of any length would make of a lie what is too long to be evidence.
fn check(decision: &Decision, label: Option<&str>) -> Result<(), DecodeError> {
    if label.is_some_and(|label| label.len() > MAX_TITLE) {
        return Err(DecodeError::Impossible("a label of no gesture: at most 99 bytes"));
    }
    decision.check()
}

impl From<Spelt> for Announcement {
    fn from(spelt: Spelt) -> Self {
        let Spelt { round, class, confidence, author, is_final, certificate, .. } = spelt;
        let Spelt { label, announcer, stamp, signature, .. } = spelt;
        let decision = Decision { round, class, confidence, author, is_final, certificate };
        Self { decision, label, announcer, stamp, signature }
    }
}

/// What an announcer signs: the message that an [`Announcement`] is. It travels as JSON alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Announced {
    /// The decision.
    pub decision: Decision,
    /// The label of its class.
    pub label: Option<String>,
}
