//! Where a robot hears: what the inbox of `gestalt-link` does with bytes under a key, before the mind hears of it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, DecodeError, Envelope, HeldBatch, Instruction, InstructorId, Keys, MAX_JSON,
    MAX_MESSAGE, MAX_WORD, Message, Question, RobotId, SignedWord, Topic, decode_json,
};
use gestalt_strategies::{Believe, Input, Instructed};

use super::believer::Believer;
use crate::trust::{Channels, Distrust, Evidence, EvidenceError, Judge, RosterError};

/// How many of its own latest votes a robot recognises when they come back to it.
const OWN_VOTES: usize = 64;

/// A message on its way: the key that it is under, its bytes, and the time that a router stamped on it.
#[derive(Clone, Debug)]
pub struct Parcel {
    /// The key.
    pub key: String,
    /// The payload.
    pub bytes: Vec<u8>,
    /// What travels beside it.
    pub attachment: Option<Vec<u8>>,
    /// In the swarm's own time.
    pub at: u64,
}

/// Where one robot hears, and what it refused there.
#[derive(Debug)]
pub struct Port {
    me: RobotId,
    keys: Keys,
    judge: Option<Judge>,
    /// To each other robot of a sealed swarm.
    channels: Option<Channels>,
    own_votes: VecDeque<Vec<u8>>,
    refused: BTreeMap<String, u64>,
}

/// Why something that arrives goes no further.
enum Refusal {
    Bytes(DecodeError),
    Key,
    Author,
    Kind,
    Twin,
    Distrust(Distrust),
    Evidence,
    Roster,
}

impl From<RosterError> for Refusal {
    fn from(_: RosterError) -> Self {
        Self::Roster
    }
}

impl From<EvidenceError> for Refusal {
    fn from(_: EvidenceError) -> Self {
        Self::Evidence
    }
}

impl From<DecodeError> for Refusal {
    fn from(error: DecodeError) -> Self {
        Self::Bytes(error)
    }
}

impl From<Distrust> for Refusal {
    fn from(cause: Distrust) -> Self {
        Self::Distrust(cause)
    }
}

impl Refusal {
    fn name(&self) -> &'static str {
        match self {
            Self::Bytes(DecodeError::Empty) => "empty",
            Self::Bytes(DecodeError::TooLong { .. }) => "too_long",
            Self::Bytes(DecodeError::Version { .. }) => "version",
            Self::Bytes(DecodeError::Malformed(_)) => "malformed",
            Self::Bytes(DecodeError::Trailing(_)) => "trailing",
            Self::Bytes(DecodeError::Impossible(_)) => "impossible",
            Self::Key => "key",
            Self::Author => "author",
            Self::Kind => "kind",
            Self::Twin => "twin",
            Self::Evidence => "false",
            Self::Roster => "untrue",
            Self::Distrust(cause) => cause.name().trim_start_matches("refused_"),
        }
    }
}

impl Port {
    /// That of robot `me`, in a sealed swarm with a judge, and channels to the others.
    pub fn new(me: RobotId, keys: Keys, sealed: Option<(Judge, Channels)>) -> Self {
        let (judge, channels) = sealed.unzip();
        Self { me, keys, judge, channels, own_votes: VecDeque::new(), refused: BTreeMap::new() }
    }

    /// What was refused here, by counter.
    pub fn refused(&self) -> &BTreeMap<String, u64> {
        &self.refused
    }

    /// Remembers a vote of this robot's own, so that an echo of it is told from a twin's vote.
    pub fn said(&mut self, vote: Vec<u8>) {
        if self.own_votes.len() == OWN_VOTES {
            self.own_votes.pop_front();
        }
        self.own_votes.push_back(vote);
    }

    /// What shows that robot that it was told this by this one, in a sealed swarm.
    pub fn tag(&mut self, to: RobotId, message: &[u8]) -> Option<Vec<u8>> {
        let tag = self.channels.as_mut()?.tag(self.judge.as_ref()?.roster(), to, message).ok()?;
        Some(tag.to_vec())
    }

    /// What the mind is to hear of that message, if anything.
    pub fn take(&mut self, now: Duration, parcel: &Parcel) -> Option<Input> {
        let (kind, taken) = match self.keys.parse(&parcel.key) {
            Some(Topic::Vote(id)) => ("vote", self.on_vote(now, id, &parcel.bytes)),
            Some(Topic::Sample(id)) => ("sample", self.on_shared(now, id, &parcel.bytes)),
            Some(Topic::Repair(id)) if id == self.me => ("repair", self.on_repair(now, parcel)),
            Some(Topic::RobotDecision(id)) => ("robot_decision", self.on_holding(now, id, &parcel.bytes)),
            Some(Topic::Decision) => ("decision", self.on_decision(now, &parcel.bytes)),
            Some(Topic::Question) => ("question", self.on_question(now, &parcel.bytes)),
            Some(Topic::Evidence) => ("evidence", self.on_evidence(now, &parcel.bytes)),
            Some(Topic::Roster) => ("roster", self.on_roster(&parcel.bytes)),
            // Links between members carry none without a signature.
            Some(Topic::Feedback(_)) if self.judge.is_some() => {
                ("feedback", Err(Refusal::Distrust(Distrust::Unsigned)))
            }
            Some(Topic::Feedback(by)) => {
                let heard = within(&parcel.bytes, MAX_WORD).and_then(|()| json::<Instruction>(&parcel.bytes));
                let word = |instruction| {
                    Input::Instructed(Instructed { by, at: parcel.at, instruction, said: None })
                };
                ("feedback", heard.map(|instruction| Some(word(instruction))))
            }
            Some(Topic::Word(by)) => ("word", self.on_word(now, by, parcel)),
            Some(Topic::Answer(to)) => ("answer", self.on_answer(now, to, parcel)),
            _ => ("other", Err(Refusal::Key)),
        };
        taken.unwrap_or_else(|refusal| {
            self.refuse(kind, &refusal);
            None
        })
    }

    fn refuse(&mut self, kind: &str, refusal: &Refusal) {
        *self.refused.entry(format!("refused_{kind}_{}", refusal.name())).or_default() += 1;
    }

    fn on_vote(&mut self, now: Duration, id: RobotId, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let envelope = decode(bytes)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        if !matches!(envelope.message, Message::Vote(_)) {
            return Err(Refusal::Kind);
        }
        self.judge(now, &envelope)?;
        if id == self.me {
            let echo = self.own_votes.iter().any(|own| own == bytes);
            return if echo { Ok(None) } else { Err(Refusal::Twin) };
        }
        Ok(Some(Input::Received(envelope)))
    }

    fn on_shared(&mut self, now: Duration, id: RobotId, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let envelope = decode(bytes)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        match &envelope.message {
            Message::Samples(_) if id == self.me => Ok(None),
            Message::Samples(samples) if samples.first().is_some_and(|first| first.author == id) => {
                self.judge(now, &envelope)?;
                Ok(Some(Input::Received(envelope)))
            }
            Message::Samples(_) => Err(Refusal::Author),
            _ => Err(Refusal::Kind),
        }
    }

    fn on_repair(&mut self, now: Duration, parcel: &Parcel) -> Result<Option<Input>, Refusal> {
        let mut envelope = decode(&parcel.bytes)?;
        if envelope.author == self.me {
            return Err(Refusal::Twin);
        }
        if let (Some(judge), Some(channels)) = (&self.judge, &mut self.channels) {
            judge.key(envelope.author)?;
            let from = (envelope.author, envelope.stamp);
            channels.check(judge.roster(), from, &parcel.bytes, parcel.attachment.as_deref())?;
        }
        match envelope.message {
            Message::Vote(_)
            | Message::Samples(_)
            | Message::Holding(_)
            | Message::Announced(_)
            | Message::Asked(_) => {
                return Err(Refusal::Kind);
            }
            Message::Lessons(_) | Message::Namings(_) => self.judge(now, &envelope)?,
            _ => {}
        }
        let distrust = self.judge.as_mut().and_then(|judge| judge.passed_on(now, &mut envelope));
        if let Some(distrust) = distrust {
            // The rest of it may be true.
            self.refuse("repair", &Refusal::Distrust(distrust));
        }
        Ok(Some(Input::Received(envelope)))
    }

    fn on_decision(&mut self, now: Duration, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let announcement: Announcement = json(bytes)?;
        announcement.check()?;
        if let Some(judge) = &mut self.judge {
            judge.announcement(now, &announcement)?;
        }
        Ok(Some(Input::Announced(announcement)))
    }

    fn on_question(&mut self, now: Duration, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let question: Question = json(bytes)?;
        question.check()?;
        self.judge(now, &question.clone().into())?;
        Ok(Some(Input::Asked(question)))
    }

    fn on_holding(&mut self, now: Duration, id: RobotId, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let envelope = decode(bytes)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        match envelope.message {
            Message::Holding(_) => {
                self.judge(now, &envelope)?;
                Ok((id != self.me).then_some(Input::Received(envelope)))
            }
            _ => Err(Refusal::Kind),
        }
    }

    fn on_evidence(&mut self, now: Duration, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let judge = self.judge.as_mut().ok_or(Refusal::Kind)?;
        judge.evidence(now, Evidence::decode(bytes)?)?;
        Ok(None)
    }

    fn on_word(
        &mut self,
        now: Duration,
        by: InstructorId,
        parcel: &Parcel,
    ) -> Result<Option<Input>, Refusal> {
        let judge = self.judge.as_mut().ok_or(Refusal::Kind)?;
        within(&parcel.bytes, MAX_WORD)?;
        let instruction: Instruction = json(&parcel.bytes)?;
        let (heading, roles) = judge.word(now, &by, &parcel.bytes, parcel.attachment.as_deref())?;
        let allowed = roles.permit(&instruction);
        let attachment = parcel.attachment.clone().unwrap_or_default();
        let signed = SignedWord { word: parcel.bytes.clone(), attachment };
        let said = Instructed { by, at: heading.count, instruction, said: Some(signed) };
        if allowed {
            return Ok(Some(Input::Instructed(said)));
        }
        Ok(Some(Input::Disallowed(said)))
    }

    fn on_answer(
        &mut self,
        now: Duration,
        to: InstructorId,
        parcel: &Parcel,
    ) -> Result<Option<Input>, Refusal> {
        let answer: Answer = json(&parcel.bytes)?;
        if let Some(judge) = &mut self.judge {
            judge.answer(now, answer.robot, &to, &parcel.bytes, parcel.attachment.as_deref())?;
        }
        Ok(Some(Input::Answered(to, answer.at, answer.robot)))
    }

    fn on_roster(&mut self, bytes: &[u8]) -> Result<Option<Input>, Refusal> {
        let judge = self.judge.as_mut().ok_or(Refusal::Kind)?;
        let Some(next) = judge.roster().successor(bytes)? else { return Ok(None) };
        let before = judge.roster().members().robots.clone();
        let after = next.members().robots.clone();
        judge.adopt(next)?;
        let gone = before.into_iter().filter(|(robot, key)| after.get(robot) != Some(key));
        Ok(Some(Input::Expelled(gone.map(|(robot, _)| robot).collect())))
    }

    /// In a sealed swarm: who knows by the roster of today whose words count.
    pub fn believer(&self) -> Option<Arc<dyn Believe>> {
        let judge = self.judge.as_ref()?;
        let roster = judge.roster().clone();
        let robots = roster.members().robots.keys().copied();
        Some(Arc::new(Believer {
            convicted: robots.filter(|robot| judge.convicts(*robot)).collect(),
            roster,
        }))
    }

    fn judge(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Refusal> {
        Ok(self.judge.as_mut().map_or(Ok(()), |judge| judge.envelope(now, envelope))?)
    }

    /// Whether that robot was convicted here.
    pub fn convicts(&self, robot: RobotId) -> bool {
        self.judge.as_ref().is_some_and(|judge| judge.convicts(robot))
    }

    /// Who was convicted here since this was last asked: the mind is to hear of it.
    pub fn fallen(&mut self) -> Option<Input> {
        let fallen = self.judge.as_mut().map(Judge::fallen).unwrap_or_default();
        let fallen: BTreeSet<RobotId> = fallen.into_iter().map(|(robot, _)| robot).collect();
        (!fallen.is_empty()).then_some(Input::Expelled(fallen))
    }

    /// What the mind found that convicts an author of samples.
    pub fn note_contradictions(&mut self, found: Vec<(HeldBatch, HeldBatch)>) {
        let Some(judge) = &mut self.judge else { return };
        for (one, other) in found {
            judge.two_samples(one, other);
        }
    }

    /// The evidence that was found here, as it is told to all.
    pub fn untold(&mut self, now: Duration) -> Vec<Vec<u8>> {
        let untold = self.judge.as_mut().map(|judge| judge.untold(now)).unwrap_or_default();
        untold.into_iter().map(|(_, evidence)| evidence.encode()).collect()
    }

    /// Those of these tokens that it takes for robots': in a sealed swarm members', each other is refused.
    pub fn tokens(&mut self, shown: &BTreeSet<RobotId>) -> BTreeSet<RobotId> {
        let Some(judge) = &self.judge else { return shown.clone() };
        let (members, strangers): (BTreeSet<RobotId>, BTreeSet<RobotId>) =
            shown.iter().partition(|robot| judge.is_member(**robot));
        strangers.iter().for_each(|_| self.refuse("alive", &Refusal::Distrust(Distrust::Stranger)));
        members
    }
}

fn decode(bytes: &[u8]) -> Result<Envelope, Refusal> {
    within(bytes, MAX_MESSAGE)?;
    Ok(Envelope::decode(bytes)?)
}

fn json<T: serde::de::DeserializeOwned>(bytes: &[u8]) -> Result<T, Refusal> {
    within(bytes, MAX_JSON)?;
    Ok(decode_json(bytes)?)
}

/// Bytes are looked into only if they are few enough.
fn within(bytes: &[u8], limit: usize) -> Result<(), Refusal> {
    let length = bytes.len();
    if length > limit { Err(DecodeError::TooLong { length, limit }.into()) } else { Ok(()) }
}
