//! A message as it is recorded: JSON that eyes and viewers can read, from which the bytes that travelled come back.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use gestalt_protocol::{
    Announcement, Answer, DecodeError, Envelope, Gesture, HeldVote, Holder, Instruction, MAX_MESSAGE,
    Message, Question, RobotId, Samples, Stamp, Status, Topic, Vector, decode_json,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Whether a robot is there, as it is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Alive {
    /// Which robot.
    pub robot: RobotId,
    /// Whether it is there.
    pub alive: bool,
}

/// The name of the property that holds the bytes as they travelled.
const WIRE: &str = "wire";

/// The JSON of a message that came under that key. Where it alone does not give back the bytes of the message, they are in it too, as
/// `wire`.
///
/// # Errors
/// [`DecodeError`] for bytes that are no message of that key.
pub fn view(topic: &Topic, payload: &[u8]) -> Result<Value, DecodeError> {
    let mut view = match topic {
        Topic::Vote(robot) => vote(*robot, payload)?,
        Topic::Sample(robot) => batch(*robot, payload)?,
        Topic::RobotDecision(robot) => holding(*robot, payload)?,
        Topic::Decision => {
            let announced: Announcement = decode_json(payload)?;
            announced.check()?;
            let mut view = plain(&announced)?;
            // A rule of somebody's own is an object in JSON; a viewer wants one type.
            view["certificate"]["rule"] = json!(announced.decision.certificate.rule.name());
            view
        }
        Topic::Question => {
            let question: Question = decode_json(payload)?;
            question.check()?;
            plain(&question)?
        }
        Topic::Status(_) => plain(&decode_json::<Status>(payload)?)?,
        Topic::Alive(_) => plain(&decode_json::<Alive>(payload)?)?,
        Topic::Feedback(_) => instruction(&decode_json(payload)?)?,
        Topic::Answer(_) => {
            let answer: Answer = decode_json(payload)?;
            let mut view = plain(&answer)?;
            view["to"] = instruction(&answer.to)?;
            view
        }
        Topic::Evidence if payload.len() <= MAX_MESSAGE => json!({"bytes": payload.len()}),
        Topic::Evidence => return Err(DecodeError::TooLong { length: payload.len(), limit: MAX_MESSAGE }),
        Topic::Repair(_)
        | Topic::Frame(_)
        | Topic::Taken(_)
        | Topic::Roster
        | Topic::RosterFor(_)
        | Topic::Word(_) => {
            return Err(DecodeError::Impossible("a kind of message that is not recorded as JSON"));
        }
    };
    if wire(topic, &view).as_deref() != Some(payload) {
        view[WIRE] = json!(BASE64.encode(payload));
    }
    Ok(view)
}

/// What came under that key and is no message of it. Its bytes are kept up to 4 KiB.
#[must_use]
pub fn unreadable(key: &str, payload: &[u8], cause: &DecodeError) -> Value {
    const KEPT: usize = 4096;
    let mut view = json!({"key": key, "cause": cause.to_string(), "bytes": payload.len()});
    if payload.len() <= KEPT {
        view[WIRE] = json!(BASE64.encode(payload));
    }
    view
}

/// The bytes that travelled, from the JSON of [`view`]; `None` for JSON that it never gives.
#[must_use]
pub fn wire(topic: &Topic, view: &Value) -> Option<Vec<u8>> {
    if let Some(wire) = view.get(WIRE) {
        return BASE64.decode(wire.as_str()?).ok();
    }
    match topic {
        Topic::Vote(_) => Some(Envelope::from(HeldVote::deserialize(view).ok()?).encode()),
        Topic::RobotDecision(_) => Some(Envelope::from(Holder::deserialize(view).ok()?).encode()),
        Topic::Decision => spoken::<Announcement>(view),
        Topic::Question => spoken::<Question>(view),
        Topic::Status(_) => spoken::<Status>(view),
        Topic::Alive(_) => spoken::<Alive>(view),
        Topic::Feedback(_) => spoken::<Instruction>(view),
        Topic::Answer(_) => spoken::<Answer>(view),
        _ => None,
    }
}

fn spoken<'a, T: Deserialize<'a> + Serialize>(view: &'a Value) -> Option<Vec<u8>> {
    serde_json::to_vec(&T::deserialize(view).ok()?).ok()
}

/// A vote that its author says under its own key; anything else there is no vote.
fn vote(robot: RobotId, payload: &[u8]) -> Result<Value, DecodeError> {
    let Envelope { author, stamp, message: Message::Vote(vote), signature } = Envelope::decode(payload)?
    else {
        return Err(DecodeError::Impossible("another message than a vote"));
    };
    by(author, robot)?;
    plain(&HeldVote { robot, stamp, vote, signature })
}

/// A robot's word under its own key on what it holds; anything else there is none.
fn holding(robot: RobotId, payload: &[u8]) -> Result<Value, DecodeError> {
    let Envelope { author, stamp, message: Message::Holding(holding), signature } =
        Envelope::decode(payload)?
    else {
        return Err(DecodeError::Impossible("another message than what a robot holds"));
    };
    by(author, robot)?;
    plain(&Holder { robot, stamp, holding, signature })
}

fn batch(robot: RobotId, payload: &[u8]) -> Result<Value, DecodeError> {
    let Envelope { author, stamp, message: Message::Samples(samples), signature } =
        Envelope::decode(payload)?
    else {
        return Err(DecodeError::Impossible("another message than samples"));
    };
    by(author, robot)?;
    #[derive(Serialize)]
    struct Batch {
        robot: RobotId,
        stamp: Stamp,
        space: String,
        samples: Vec<Value>,
        signature: Option<gestalt_protocol::Signature>,
    }
    let Samples { space, samples } = samples;
    let sample = |sample: &gestalt_protocol::SharedSample| {
        let (precision, vector) = match &sample.vector {
            Vector::F32(values) => ("f32", json!(values)),
            // Two bytes a component, the lower one first: the number that they are, not yet the half that it stands for.
            Vector::F16(bytes) => {
                let halves = bytes.chunks_exact(2).map(|half| u16::from_le_bytes([half[0], half[1]]));
                ("f16", json!(halves.collect::<Vec<u16>>()))
            }
            Vector::I8(values) => ("i8", json!(values)),
        };
        json!({
            "author": sample.id.author, "life": sample.id.life, "number": sample.id.number,
            "class": sample.class, "round": sample.round, "vector": vector, "precision": precision,
        })
    };
    let samples = samples.iter().map(sample).collect();
    plain(&Batch { robot, stamp, space: space.to_string(), samples, signature })
}

fn by(author: RobotId, robot: RobotId) -> Result<(), DecodeError> {
    if author == robot { Ok(()) } else { Err(DecodeError::Impossible("another author than the key's robot")) }
}

/// An instructor's word, in which a gesture named by its label stands apart from one named by its class.
fn instruction(word: &Instruction) -> Result<Value, DecodeError> {
    let mut view = plain(word)?;
    let named = match word {
        Instruction::Was { class, .. } => Some(("class", class)),
        Instruction::Right { of, .. } | Instruction::Wrong { of, .. } => Some(("of", of)),
        Instruction::Same { class, .. } | Instruction::Retire { class } | Instruction::Restore { class } => {
            Some(("class", class))
        }
        Instruction::Open | Instruction::Retract { .. } | Instruction::New { .. } => None,
    };
    let other = match word {
        Instruction::Same { of, .. } => Some(("of", of)),
        _ => None,
    };
    for (name, gesture) in named.into_iter().chain(other) {
        if let (Gesture::Label(label), Some(fields)) = (gesture, view.as_object_mut()) {
            fields.remove(name);
            fields.insert(format!("{name}_label"), json!(label));
        }
    }
    Ok(view)
}

/// The JSON of a value, without what is absent.
fn plain(value: &impl Serialize) -> Result<Value, DecodeError> {
    let value = serde_json::to_value(value).map_err(|error| DecodeError::Malformed(error.to_string()))?;
    Ok(present(value))
}

fn present(value: Value) -> Value {
    match value {
        Value::Object(fields) => {
            let there = fields.into_iter().filter(|(_, value)| !value.is_null());
            Value::Object(there.map(|(name, value)| (name, present(value))).collect::<Map<_, _>>())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(present).collect()),
        other => other,
    }
}
