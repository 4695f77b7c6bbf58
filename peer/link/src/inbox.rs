//! Between Zenoh's threads, which must never wait, and the one task that owns the mind.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gestalt_protocol::{
    Announcement, Envelope, Instruction, InstructorId, Keys, MAX_JSON, MAX_MESSAGE, MAX_ROBOTS, MAX_WORD,
    Message, RobotId, Stamp, Topic, decode_json,
};
use gestalt_strategies::{Input, Instructed};
use gestalt_trust::{Channels, Distrust, Evidence, Judge};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tokio::sync::{Notify, watch};
use zenoh::sample::{Sample, SampleKind};
use zenoh::session::ZenohId;

use super::account::{Account, Refusal};
use super::checks::Checks;
use super::echoes::Echoes;
use super::roll::Roll;
use super::silence::Silence;
use super::waiting::Waiting;
use super::ways::Ways;
use super::words::{Vouched, Words};

/// Everything that arrives, checked, until the mind's task takes it.
///
/// Votes wait in a ring of one per robot: the latest replaces the earlier. Everything else waits in a queue, and
/// what that refuses is counted.
pub(super) struct Inbox {
    pub(super) me: RobotId,
    pub(super) swarm: u32,
    pub(super) keys: Keys,
    pub(super) account: Arc<Account>,
    state: Mutex<State>,
    /// In a sealed swarm: who lets in what its members said, what is done about its roster, and by which right instructors speak.
    pub(super) sealed: Option<Sealed>,
    /// The keys that are in use.
    pub(super) ways: Ways,
    /// For trials: the part of what arrives that is dropped, and the chance that chooses it.
    loss: f64,
    chance: Mutex<ChaCha8Rng>,
    pub(super) ready: Notify,
    checks: Checks,
    /// Held while it is said who is believed from now on, before anything else is.
    pub(super) expelling: Mutex<()>,
    pub(super) unrest: Notify,
    pub(super) lost_links: watch::Sender<u64>,
}

pub(super) struct Sealed {
    pub judge: Mutex<Judge>,
    pub roll: Arc<Roll>,
    pub words: Mutex<Words>,
    /// What this robot says to others alone, and they to it.
    pub channels: Mutex<Channels>,
}

#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) votes: BTreeMap<RobotId, Envelope>,
    pub(super) waiting: Waiting,
    own_votes: Echoes,
    pub(super) links: BTreeMap<ZenohId, RobotId>,
    /// Those of them that relay for others.
    pub(super) relays: BTreeSet<ZenohId>,
    /// Since when each of those is linked, and when it last told this robot something.
    pub(super) heard: BTreeMap<RobotId, (Instant, Option<Instant>)>,
    pub(super) alive: BTreeSet<RobotId>,
    pub(super) silence: Silence,
    pub(super) links_changed: bool,
    pub(super) alive_changed: bool,
    /// Words that this robot signed, and are yet to be said.
    pub(super) vouched: Vec<Vouched>,
}

impl State {
    /// Whether there is nothing to take.
    fn is_empty(&self) -> bool {
        !self.alive_changed && !self.links_changed && self.waiting.len() == 0 && self.votes.is_empty()
    }
}

impl fmt::Debug for Inbox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Inbox").field("me", &self.me).finish_non_exhaustive()
    }
}

impl Inbox {
    pub(super) fn new(
        me: RobotId,
        swarm: u32,
        keys: Keys,
        account: Arc<Account>,
        loss: f64,
        sealed: Option<Sealed>,
    ) -> Self {
        let state = Mutex::new(State::default());
        Self {
            me,
            swarm,
            keys,
            account,
            state,
            sealed,
            ways: Ways::default(),
            loss,
            chance: Mutex::new(ChaCha8Rng::seed_from_u64(u64::from(me.0))),
            ready: Notify::new(),
            checks: Checks::default(),
            expelling: Mutex::default(),
            unrest: Notify::new(),
            lost_links: watch::Sender::new(0),
        }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the judge of a sealed swarm says.
    pub(super) fn judged<T>(&self, ask: impl FnOnce(&mut Judge, Duration) -> T) -> Option<T> {
        let judge = &self.sealed.as_ref()?.judge;
        Some(ask(&mut judge.lock().unwrap_or_else(PoisonError::into_inner), self.account.started().elapsed()))
    }

    /// Whether the swarm is a sealed one.
    pub(super) fn is_sealed(&self) -> bool {
        self.sealed.is_some()
    }

    /// Whether that robot is none of a sealed swarm's.
    pub(super) fn is_stranger(&self, robot: RobotId) -> bool {
        self.judged(|judge, _| judge.is_member(robot)) == Some(false)
    }

    /// Whether a member said that; in an open swarm everybody is believed.
    pub(super) fn believe(&self, envelope: &Envelope) -> Result<(), Distrust> {
        self.judged(|judge, now| judge.envelope(now, envelope)).unwrap_or(Ok(()))
    }

    /// Waits until there is something to take.
    pub(super) async fn ready(&self) {
        self.ready.notified().await;
    }

    /// Waits until a robot or a link has come or gone since the last time.
    pub(super) async fn unrest(&self) {
        self.unrest.notified().await;
    }

    /// Tells how many links have gone so far.
    pub(super) fn lost_links(&self) -> watch::Receiver<u64> {
        self.lost_links.subscribe()
    }

    /// Takes everything that has arrived, changes of the neighbourhood first.
    pub(super) fn take(&self) -> Vec<Input> {
        if self.lock().is_empty() {
            self.checks.wait();
        }
        let mut state = self.lock();
        let state = &mut *state;
        let mut inputs = Vec::with_capacity(state.waiting.len() + state.votes.len() + 2);
        if std::mem::take(&mut state.alive_changed) {
            inputs.push(Input::Alive(Arc::new(state.alive.clone())));
        }
        if std::mem::take(&mut state.links_changed) {
            inputs.push(Input::Neighbours(state.links.values().copied().collect()));
        }
        inputs.extend(state.waiting.take());
        inputs.extend(std::mem::take(&mut state.votes).into_values().map(Input::Received));
        inputs
    }

    /// Remembers a vote of this robot's own, so that an echo of it is told from a twin's vote.
    pub(super) fn said(&self, stamp: Stamp, vote: &[u8]) {
        self.lock().own_votes.said(stamp, vote);
    }

    /// Whatever arrives under a key of the swarm.
    pub(super) fn on_sample(&self, sample: &Sample) {
        if self.is_lost() {
            return;
        }
        let key = sample.key_expr().as_str();
        // Nothing that is said in a swarm can be deleted.
        if sample.kind() != SampleKind::Put {
            return self.account.refused("deletion", key, 0, &Refusal::Kind);
        }
        let expulsions = self.lock().waiting.expulsions();
        let topic = self.keys.parse(key);
        // Whose word it is stands in the key of what a robot says to all.
        let author = match &topic {
            Some(Topic::Vote(id) | Topic::Sample(id) | Topic::RobotDecision(id)) => Some(*id),
            _ => None,
        };
        let (kind, taken) = match topic {
            Some(Topic::Vote(id)) => ("vote", self.on_vote(id, sample, expulsions)),
            Some(Topic::Sample(id)) => ("sample", self.on_shared(id, sample, expulsions)),
            Some(Topic::Repair(id)) if id == self.me => ("repair", self.on_repair(sample, expulsions)),
            Some(Topic::RobotDecision(id)) => ("robot_decision", self.on_holding(id, sample, expulsions)),
            Some(Topic::Decision) => ("decision", self.on_decision(sample, expulsions)),
            Some(Topic::Question) => ("question", self.on_question(sample, expulsions)),
            Some(Topic::Evidence) => ("evidence", self.on_evidence(sample)),
            Some(Topic::Feedback(by)) => ("feedback", self.on_feedback(by, sample)),
            Some(Topic::Word(by)) => ("word", self.on_word(by, sample)),
            Some(Topic::Roster) => ("roster", self.on_roster(sample)),
            Some(Topic::RosterFor(id)) if id == self.me => ("roster", self.on_roster(sample)),
            Some(Topic::Answer(to)) => ("answer", self.on_answer(to, sample)),
            _ => ("other", Err(Refusal::Key)),
        };
        self.expel_fallen();
        let bytes = sample.payload().len();
        match taken {
            Ok(()) => {
                author.into_iter().for_each(|author| self.on_spoken(author));
                self.ready.notify_one();
                self.account.received(kind, bytes);
            }
            Err(cause) => {
                let found = matches!(cause, Refusal::Distrust(Distrust::Convicted));
                self.account.refused(kind, key, bytes, &cause);
                if found {
                    self.ready.notify_one();
                }
            }
        }
    }

    fn is_lost(&self) -> bool {
        self.loss > 0.0
            && self.chance.lock().unwrap_or_else(PoisonError::into_inner).random::<f64>() < self.loss
    }

    fn on_vote(&self, id: RobotId, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let bytes = payload(sample, MAX_MESSAGE)?;
        let envelope = Envelope::decode(&bytes)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        if !matches!(envelope.message, Message::Vote(_)) {
            return Err(Refusal::Kind);
        }
        let _under_way = self.is_sealed().then(|| self.checks.begin(&self.ready));
        self.believe(&envelope)?;
        let mut state = self.lock();
        // It may have been expelled, or given another key, while its vote was checked. It repeats what it may still say.
        if state.waiting.expulsions() != expulsions {
            return Err(Refusal::Distrust(Distrust::Expelled));
        }
        if id == self.me {
            let own = &state.own_votes;
            let echo = own.is_one(&bytes)
                || self.is_sealed() && own.may_be_one(envelope.stamp, self.account.lock().boot);
            return if echo { Ok(()) } else { Err(Refusal::Twin) };
        }
        if state.votes.len() >= MAX_ROBOTS && !state.votes.contains_key(&id) {
            return Err(Refusal::Full);
        }
        let newer = state.votes.get(&id).is_none_or(|waiting| waiting.stamp < envelope.stamp);
        if newer {
            state.votes.insert(id, envelope);
        }
        Ok(())
    }

    fn on_shared(&self, id: RobotId, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let envelope = Envelope::decode(&payload(sample, MAX_MESSAGE)?)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        match &envelope.message {
            // Zenoh's routing can loop for a moment after a heal; what it brings back is this robot's own.
            Message::Samples(_) if id == self.me => Ok(()),
            Message::Samples(samples) if samples.are_by(id) => {
                self.believe(&envelope)?;
                self.queue(Input::Received(envelope), sample, expulsions)
            }
            Message::Samples(_) => Err(Refusal::Author),
            _ => Err(Refusal::Kind),
        }
    }

    fn on_repair(&self, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let bytes = payload(sample, MAX_MESSAGE)?;
        let mut envelope = Envelope::decode(&bytes)?;
        if envelope.author == self.me {
            // In a sealed swarm no robot shares a secret with itself to show who says it.
            return Err(if self.is_sealed() { Distrust::Forged.into() } else { Refusal::Twin });
        }
        self.was_told(&envelope, &bytes, sample)?;
        // What is said to all comes under a key of its own.
        let to_all = matches!(
            envelope.message,
            Message::Vote(_)
                | Message::Samples(_)
                | Message::Holding(_)
                | Message::Announced(_)
                | Message::Asked(_)
        );
        if to_all {
            return Err(Refusal::Kind);
        }
        if let Some((_, last)) = self.lock().heard.get_mut(&envelope.author) {
            *last = Some(Instant::now());
        }
        if matches!(envelope.message, Message::Lessons(_) | Message::Namings(_)) {
            self.believe(&envelope)?;
        }
        let distrust = self.judged(|judge, now| judge.passed_on(now, &mut envelope));
        if let Some(distrust) = distrust.flatten() {
            let (key, bytes) = (sample.key_expr().as_str(), sample.payload().len());
            self.account.refused("repair", key, bytes, &Refusal::Distrust(distrust));
        }
        self.queue(Input::Received(envelope), sample, expulsions)
    }

    fn on_decision(&self, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let announcement: Announcement = decode_json(&payload(sample, MAX_JSON)?)?;
        announcement.check()?;
        self.judged(|judge, now| judge.announcement(now, &announcement)).unwrap_or(Ok(()))?;
        self.queue(Input::Announced(announcement), sample, expulsions)
    }

    fn on_evidence(&self, sample: &Sample) -> Result<(), Refusal> {
        let evidence = Evidence::decode(&payload(sample, Evidence::MAX_LENGTH)?)?;
        Ok(self.judged(|judge, now| judge.evidence(now, evidence)).ok_or(Refusal::Kind)??)
    }

    /// Evidence against members that is to be told to all now.
    pub(super) fn untold(&self) -> Vec<Evidence> {
        let untold = self.judged(Judge::untold).unwrap_or_default();
        untold.into_iter().map(|(_, evidence)| evidence).collect()
    }

    /// Evidence that is to be kept on disk, each once.
    pub(super) fn unkept(&self) -> Vec<(RobotId, Evidence)> {
        self.judged(|judge, _| judge.unkept()).unwrap_or_default()
    }

    fn on_holding(&self, id: RobotId, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let envelope = Envelope::decode(&payload(sample, MAX_MESSAGE)?)?;
        if envelope.author != id {
            return Err(Refusal::Author);
        }
        match &envelope.message {
            Message::Holding(_) => {
                self.believe(&envelope)?;
                // Zenoh's routing can loop for a moment after a heal; what it brings back is this robot's own.
                if id == self.me { Ok(()) } else { self.queue(Input::Received(envelope), sample, expulsions) }
            }
            _ => Err(Refusal::Kind),
        }
    }

    fn on_feedback(&self, by: InstructorId, sample: &Sample) -> Result<(), Refusal> {
        // Words are kept whole until later ones take their place: no longer ones than in a sealed swarm.
        let instruction: Instruction = decode_json(&payload(sample, MAX_WORD)?)?;
        if self.sealed.is_some() {
            return self.on_local_word(by, instruction, sample);
        }
        let said = sample.timestamp().map(|time| time.get_time().as_u64());
        let at = said.unwrap_or_else(|| unsaid_time(SystemTime::now(), &sample.payload().to_bytes()));
        self.queue_word(Input::Instructed(Instructed { by, at, instruction, said: None }), sample)
    }

    /// Hands over what this robot's own threads have done.
    pub(super) fn deliver(&self, input: Input) {
        self.lock().waiting.deliver(input);
        self.ready.notify_one();
    }

    /// What came in a message, and was checked when robots had been expelled that often, waits for the mind.
    pub(super) fn queue(&self, input: Input, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        self.lock().waiting.add(input, sample.payload().len(), expulsions)
    }

    /// What somebody says once waits for the mind, which looks again at who may say it.
    pub(super) fn queue_word(&self, input: Input, sample: &Sample) -> Result<(), Refusal> {
        let mut state = self.lock();
        let expulsions = state.waiting.expulsions();
        state.waiting.add(input, sample.payload().len(), expulsions)
    }
}

/// The time of a word whose client did not say it, the same at robots whose clocks agree, or nearly so: it tells words apart, and
/// their counts put them in order.
fn unsaid_time(now: SystemTime, word: &[u8]) -> u64 {
    let span = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs() / 2 * 2;
    span << 32 | u64::from(crc32fast::hash(word))
}

/// The bytes of a payload, looked into only if they are few enough.
pub(super) fn payload(sample: &Sample, limit: usize) -> Result<std::borrow::Cow<'_, [u8]>, Refusal> {
    let length = sample.payload().len();
    if length > limit {
        return Err(gestalt_protocol::DecodeError::TooLong { length, limit }.into());
    }
    Ok(sample.payload().to_bytes())
}
