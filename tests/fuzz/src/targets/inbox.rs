//! Whatever arrives at a robot of a sealed swarm: a key and a payload, looked at as `gestalt-link` does, then taken in by its mind.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, Envelope, Instruction, Keys, MAX_ROBOTS, Message, Question, RobotId, Topic,
    decode_json,
};
use gestalt_strategies::{Input, Instructed, is_refuted};
use gestalt_trust::Witness;
use rand::RngExt;

use crate::gate::Gate;
use crate::memory::bounded;
use crate::robot::Robot;
use crate::{swarm, values};

/// The robot that all of this arrives at.
const ME: RobotId = RobotId(1);

/// Messages one after the other: a byte of which the highest bit says that the payload's votes are signed by whoever they name, the
/// others how much later it comes; the length of the key, the key; the length of the payload in two bytes, the payload.
///
/// Nobody but a member votes, and no table grows out of its bounds.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    let mut inbox = Inbox::new();
    let mut rest = bytes;
    while let Some(delivery) = Delivery::next(&mut rest) {
        inbox.now += Duration::from_millis(u64::from(delivery.how & 0x7f) * 20);
        if let Ok(key) = str::from_utf8(delivery.key) {
            inbox.on_sample(key, delivery.payload, delivery.how & 0x80 != 0);
        }
    }
    inbox.robot.check();
}

/// One message.
struct Delivery<'a> {
    how: u8,
    key: &'a [u8],
    payload: &'a [u8],
}

impl<'a> Delivery<'a> {
    /// Takes one off; the last may be cut short.
    fn next(bytes: &mut &'a [u8]) -> Option<Self> {
        let (&[how, length], rest) = bytes.split_first_chunk()?;
        let (key, rest) = rest.split_at_checked(usize::from(length))?;
        let (length, rest) = rest.split_first_chunk()?;
        let (payload, rest) = rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()));
        *bytes = rest;
        Some(Self { how, key, payload })
    }
}

struct Inbox {
    keys: Keys,
    gate: Gate,
    witness: Witness,
    robot: Robot,
    now: Duration,
}

impl Inbox {
    fn new() -> Self {
        let (gate, mut robot) = (Gate::default(), Robot::new(ME, false));
        robot.handle(Duration::ZERO, Input::Believe(Arc::new(swarm::Members)));
        let keys = Keys::new("demo").expect("a name");
        Self { keys, gate, witness: Witness::new(swarm::roster()), robot, now: Duration::ZERO }
    }

    fn on_sample(&mut self, key: &str, payload: &[u8], seal: bool) -> Option<()> {
        let input = match self.keys.parse(key)? {
            Topic::Vote(id) => {
                let envelope = Self::read(payload, seal)?;
                if envelope.author != id
                    || id == ME
                    || !matches!(envelope.message, Message::Vote(_) | Message::Samples(_))
                {
                    return None;
                }
                let envelope = self.gate.message(self.now, envelope).ok()?;
                let signature = envelope.signature?;
                let liar = self.witness.observe(&envelope.statement(), &signature);
                if let Some(evidence) = liar {
                    let convicted =
                        evidence.check(swarm::roster(), is_refuted).expect("both halves were believed");
                    assert_eq!(convicted.robot, id);
                }
                Input::Received(envelope)
            }
            Topic::Sample(id) => {
                let envelope = Self::read(payload, false)?;
                match &envelope.message {
                    Message::Samples(samples)
                        if envelope.author == id
                            && samples.first().is_some_and(|first| first.author == id) =>
                    {
                        Input::Received(envelope)
                    }
                    _ => return None,
                }
            }
            Topic::Repair(ME) => {
                let envelope = Self::read(payload, seal)?;
                if envelope.author == ME
                    || matches!(
                        envelope.message,
                        Message::Vote(_) | Message::Holding(_) | Message::Announced(_) | Message::Asked(_)
                    )
                {
                    return None;
                }
                Input::Received(self.gate.message(self.now, envelope).ok()?)
            }
            Topic::RobotDecision(id) => {
                let envelope = Self::read(payload, seal)?;
                if envelope.author != id || id == ME || !matches!(envelope.message, Message::Holding(_)) {
                    return None;
                }
                Input::Received(self.gate.message(self.now, envelope).ok()?)
            }
            Topic::Decision => {
                let mut announcement: Announcement = bounded(payload, || decode_json(payload)).ok()?;
                announcement.check().ok()?;
                if seal {
                    swarm::seal_decision(&mut announcement.decision, 0xff);
                    swarm::seal_announcement(&mut announcement);
                }
                self.gate.announcement(self.now, &announcement).ok()?;
                Input::Announced(announcement)
            }
            Topic::Question => {
                let mut question: Question = bounded(payload, || decode_json(payload)).ok()?;
                question.check().ok()?;
                if seal {
                    swarm::seal_question(&mut question);
                }
                self.gate.message(self.now, question.clone().into()).ok()?;
                Input::Asked(question)
            }
            Topic::Feedback(by) => {
                let instruction: Instruction = bounded(payload, || decode_json(payload)).ok()?;
                let at = self.now.as_millis() as u64;
                Input::Instructed(Instructed { by, at, instruction, said: None })
            }
            Topic::Answer(to) => {
                let answer: Answer = bounded(payload, || decode_json(payload)).ok()?;
                Input::Answered(to, answer.at, answer.robot)
            }
            _ => return None,
        };
        self.robot.handle(self.now, input);
        let ballot = self.robot.mind().ballot().map_or(0, |ballot| ballot.len());
        assert!(ballot <= swarm::MEMBERS as usize && ballot <= MAX_ROBOTS, "{ballot} members vote");
        Some(())
    }

    fn read(payload: &[u8], seal: bool) -> Option<Envelope> {
        let mut envelope = bounded(payload, || Envelope::decode(payload)).ok()?;
        if seal {
            match &mut envelope.message {
                Message::Vote(_) | Message::Holding(_) => swarm::seal(&mut envelope),
                Message::Lessons(lessons) => lessons.lessons.iter_mut().for_each(swarm::seal_lesson),
                Message::Give(give) => {
                    give.votes.iter_mut().for_each(swarm::seal_vote);
                    give.holders.iter_mut().for_each(swarm::seal_holder);
                    give.decision.iter_mut().for_each(|decision| swarm::seal_decision(decision, 0xff));
                    swarm::seal(&mut envelope);
                }
                _ => {}
            }
        }
        Some(envelope)
    }
}

/// A few messages to begin with, each under its key.
pub fn seed(rng: &mut impl rand::Rng) -> Vec<u8> {
    let keys = Keys::new("demo").expect("a name");
    let mut bytes = Vec::new();
    for _ in 0..rng.random_range(1..5) {
        let mut envelope = values::envelope(rng);
        let author = envelope.author;
        let json = |value: serde_json::Result<Vec<u8>>| value.expect("it is JSON");
        let (topic, payload) = match rng.random_range(0..8) {
            0 => {
                let round = values::round(rng);
                envelope.message = Message::Vote(values::vote(rng, round, 3));
                (Topic::Vote(author), envelope.encode())
            }
            1 => (Topic::Sample(author), envelope.encode()),
            2 | 3 => (Topic::Repair(ME), envelope.encode()),
            4 => {
                envelope.message = Message::Holding(values::holding(rng));
                (Topic::RobotDecision(author), envelope.encode())
            }
            6 => (Topic::Question, json(serde_json::to_vec(&values::question(rng)))),
            5 => (Topic::Decision, json(serde_json::to_vec(&values::announcement(rng)))),
            _ => (
                Topic::Feedback(values::instructor(rng)),
                json(serde_json::to_vec(&values::instruction(rng))),
            ),
        };
        let key = keys.key(&topic);
        bytes.extend([0x80 | rng.random_range(0..0x30), key.len() as u8]);
        bytes.extend(key.as_bytes());
        bytes.extend((payload.len() as u16).to_le_bytes());
        bytes.extend(payload);
    }
    bytes
}
