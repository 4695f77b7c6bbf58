//! What travels between robots, and what it costs to write it.

use std::sync::Arc;

use gestalt_protocol::{Announcement, Envelope, InstructorId, Question, RobotId};
use gestalt_strategies::{Input, Instructed};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// What travels.
#[derive(Clone)]
pub(super) enum Parcel {
    Said(Arc<Envelope>),
    Announced(Arc<Announcement>),
    Asked(Arc<Question>),
    Instructed(Arc<Instructed>),
    Answered(InstructorId, u64, RobotId),
}

impl Parcel {
    /// What a mind is told when it arrives.
    pub fn opened(&self) -> Input {
        match self {
            Self::Said(envelope) => Input::Received((**envelope).clone()),
            Self::Announced(announcement) => Input::Announced((**announcement).clone()),
            Self::Asked(question) => Input::Asked((**question).clone()),
            Self::Instructed(instructed) => Input::Instructed((**instructed).clone()),
            Self::Answered(by, at, robot) => Input::Answered(by.clone(), *at, *robot),
        }
    }
}

/// What a message becomes by being written and read, and how many bytes that takes.
pub(super) fn over_the_wire(envelope: &Envelope) -> (Arc<Envelope>, usize) {
    let bytes = envelope.encode();
    let read = Envelope::decode(&bytes).expect("what a mind says can be read");
    (Arc::new(read), bytes.len())
}

/// How many bytes something takes that travels as JSON.
pub(super) fn json_bytes(value: &impl Serialize) -> usize {
    serde_json::to_vec(value).expect("what people say holds nothing that JSON cannot").len()
}

/// The same for what travels as JSON.
pub(super) fn as_json<T: Serialize + DeserializeOwned>(said: &T) -> (Arc<T>, usize) {
    let json = serde_json::to_vec(said).expect("a decision holds nothing that JSON cannot");
    let read = gestalt_protocol::decode_json(&json).expect("what was written can be read");
    (Arc::new(read), json.len())
}
