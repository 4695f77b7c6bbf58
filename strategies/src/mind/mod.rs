//! The robot's mind: a state machine that turns what a robot sees and hears into votes and decisions.

mod config;
mod inspect;
mod instruct;
mod knowledge;
mod learning;
mod refusal;
mod repair;

use std::cmp::Ordering;
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Answer, Decision, Envelope, InstructorId, Message, RobotId, RoundId, Stamp, Vote};

pub use config::{MindConfig, MindConfigError};
pub use instruct::Instructed;
use instruct::Waiting;
use learning::Learning;
pub use learning::{
    Change, LearningConfig, LearningConfigError, LearningError, LearningSetup, Memory, MemoryError,
    TrainingChange,
};
pub use refusal::{Refusal, Refusals};
use repair::Repair;

use crate::ballot::{Cast, Scale};
use crate::round::Round;
use crate::{Classify, Observation};

/// What the world tells the mind.
#[derive(Clone, Debug)]
pub enum Input {
    /// Time has passed; the host owes one at [`Mind::next_wake`], more do no harm.
    Tick,
    /// The robot's host says, by a schedule or for other reasons of its own: a gesture is being shown.
    Open,
    /// The robot's own motion detector says: a hand moved from that time on, and now holds still. Opens a round, unless
    /// the newest one was opened after the hand had begun to move: that one is about this gesture.
    Shown(Duration),
    /// The robot's own motion detector says: the hand that held still is moving again, or gone. What was shown can be seen
    /// no more, so this robot's round ends early.
    Left,
    /// Whether the robot's camera shows anything at all. One that is blind takes part, and says that it need not be waited
    /// for. Until told otherwise, a robot sees.
    Blind(bool),
    /// A human says something.
    Instructed(Instructed),
    /// That robot has answered what that instructor said at that time.
    Answered(InstructorId, u64, RobotId),
    /// A frame showed a hand.
    Observed(Observation),
    /// A robot's message arrived, by whichever way.
    Received(Envelope),
    /// That robot says it holds this decision (`robot/<id>/decision`).
    Heard(RobotId, Decision),
    /// This decision was announced for the swarm (`decision`).
    Announced(Decision),
    /// The robots alive now, by liveliness; whether it includes this robot makes no difference.
    Alive(BTreeSet<RobotId>),
    /// The robots that see and vote through this robot's host, and leave deciding and announcing to this mind.
    Guests(BTreeSet<RobotId>),
    /// The robots this one is directly linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// A new classifier takes the place of the old one.
    Learned(Arc<dyn Classify>),
    /// All that was to be remembered up to this revision is safe.
    Remembered(u64),
}

/// What the mind wants done. The host carries out all of them, in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Say this to all robots (a vote on `robot/<me>/vote`, samples on `robot/<me>/sample`): the fast way.
    Broadcast(Envelope),
    /// Say this to one neighbour (`robot/<id>/repair`): the sure way.
    Tell(RobotId, Envelope),
    /// This robot now holds that decision: publish it (`robot/<me>/decision`).
    Hold(Decision),
    /// As the spokesrobot: announce the swarm's decision (`decision`).
    Announce(Decision),
    /// This robot takes part in that round from now on: look.
    Opened(RoundId),
    /// That round is over for this robot: no further looking.
    Closed(RoundId),
    /// Answer that instructor (`instructor/<id>/answer`).
    Answer(InstructorId, Answer),
    /// Make the classifier follow these changes of its samples, beside the loop; then say [`Input::Learned`].
    Train(Vec<TrainingChange>),
    /// Write these changes where a kill at any moment leaves all or none of them; then say [`Input::Remembered`].
    Remember {
        /// Counts up.
        revision: u64,
        /// What has changed since the one before.
        changes: Vec<Change>,
    },
}

/// A round this many counters ahead of the newest known is refused: nobody shows a million gestures unnoticed.
const FAR_AHEAD: u32 = 1_000_000;

/// The state machine in every robot: what the world tells it goes in, what it wants done comes out.
///
/// Time is an argument, the duration since any fixed moment, the same for all calls; it never runs back. The same
/// inputs at the same times give the same outputs.
#[derive(Debug)]
pub struct Mind {
    me: RobotId,
    config: MindConfig,
    classifier: Option<Arc<dyn Classify>>,
    /// The stamp of the last message said.
    stamp: Stamp,
    now: Duration,
    /// The newest round known.
    round: Option<Round>,
    /// The highest counter heard of, also of a round about which nothing else is known yet.
    highest: Option<u32>,
    /// The other robots alive, guests among them.
    alive: BTreeSet<RobotId>,
    /// How many of them have a smaller id: whoever speaks for the swarm waits this many turns.
    turns: u32,
    guests: BTreeSet<RobotId>,
    repair: Repair,
    refusals: Refusals,
    duplicate: Option<Stamp>,
    learning: Option<Learning>,
    answers: Vec<Waiting>,
    /// The words answered last, by whomever.
    answered: VecDeque<(InstructorId, u64)>,
    /// The round for which this robot still looks, though it may be decided: it is to learn from it.
    looking: Option<RoundId>,
    /// Since when the hand had moved that now holds still and has had no round yet.
    shown: Option<Duration>,
    blind: bool,
}

impl Mind {
    /// The mind of robot `me` in its `boot`th life; `boot` must grow with each restart, or the robot's votes are
    /// taken for old ones. It has no classifier until [`Input::Learned`]: until then it relays, fuses and decides,
    /// but gives no evidence.
    ///
    /// # Errors
    /// [`MindConfigError`] for a configuration that [`MindConfig::validate`] refuses.
    pub fn new(me: RobotId, boot: u32, config: MindConfig) -> Result<Self, MindConfigError> {
        config.validate()?;
        Ok(Self {
            me,
            classifier: None,
            stamp: Stamp { boot, sequence: 0 },
            now: Duration::ZERO,
            round: None,
            highest: None,
            alive: BTreeSet::new(),
            turns: 0,
            guests: BTreeSet::new(),
            repair: Repair::new(config.repair_idle),
            config,
            refusals: Refusals::default(),
            duplicate: None,
            learning: None,
            answers: Vec::new(),
            answered: VecDeque::new(),
            looking: None,
            shown: None,
            blind: false,
        })
    }

    /// The same mind, set up to learn: it keeps what it sees, labels it by what instructors say, shares and forgets.
    ///
    /// # Errors
    /// See [`LearningError`].
    pub fn learning(mut self, setup: LearningSetup) -> Result<Self, LearningError> {
        self.learning = Some(Learning::new(self.me, setup)?);
        Ok(self)
    }

    /// Takes in one input at the time `now` and says what is to be done.
    pub fn handle(&mut self, now: Duration, input: Input) -> Vec<Output> {
        let mut out = Vec::new();
        self.now = now.max(self.now);
        match input {
            Input::Tick => {}
            Input::Open => self.on_open(&mut out),
            Input::Shown(began) => self.shown = Some(began.min(self.now)),
            Input::Left => self.on_left(),
            Input::Blind(blind) => self.on_blind(blind),
            Input::Instructed(instructed) => self.on_instructed(instructed, &mut out),
            Input::Answered(by, at, robot) => self.on_answered(&by, at, robot),
            Input::Observed(observation) => self.on_observed(&observation),
            Input::Received(envelope) => self.on_received(envelope, &mut out),
            Input::Heard(robot, decision) => self.on_heard(robot, decision, &mut out),
            Input::Announced(decision) => self.on_announced(decision, &mut out),
            Input::Alive(robots) => self.on_alive(robots),
            Input::Guests(robots) => self.on_guests(robots),
            Input::Neighbours(robots) => self.on_neighbours(robots, &mut out),
            Input::Learned(classifier) => self.on_learned(classifier),
            Input::Remembered(revision) => self.on_remembered(revision),
        }
        self.advance(&mut out);
        out
    }

    /// When the mind wants its next [`Input::Tick`], if nothing else comes before.
    #[must_use]
    pub fn next_wake(&self) -> Option<Duration> {
        let round = self.round.as_ref();
        let (patience, deadline) = round
            .filter(|round| round.open && round.agreement.held().is_none())
            .map(|round| round.patience_and_deadline(&self.config))
            .unzip();
        [
            round.and_then(|round| round.vote_due(&self.config)),
            patience.filter(|patience| *patience > self.now),
            deadline,
            self.closing(),
            self.announcement(),
            self.looking_until(),
            self.showing(),
            self.answer_due(),
            self.repair.due(&self.alive),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    fn on_open(&mut self, out: &mut Vec<Output>) {
        if self.round.as_ref().is_some_and(|round| round.open) || self.now < self.refractory_until() {
            return;
        }
        match self.highest.map_or(Some(1), |highest| highest.checked_add(1)) {
            Some(counter) => self.join(RoundId { counter, opener: self.me }, out),
            None => self.refusals.add(Refusal::CountersUsedUp),
        }
    }

    /// Until when a request to open a round may be a copy of the one for the newest round.
    fn refractory_until(&self) -> Duration {
        self.round.as_ref().map_or(Duration::ZERO, |round| round.since + self.config.refractory)
    }

    /// When a round is to be opened for the gesture shown; never for one that has had its round, and not before the
    /// round of an earlier gesture is over.
    fn showing(&self) -> Option<Duration> {
        let began = self.shown?;
        let round = self.round.as_ref();
        let waits = round.is_none_or(|round| !round.open && round.since < began);
        waits.then(|| self.refractory_until())
    }

    fn on_left(&mut self) {
        self.shown = None;
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.end_early(self.now, &self.config);
        }
    }

    fn on_blind(&mut self, blind: bool) {
        if self.blind != blind
            && let Some(round) = &mut self.round
        {
            round.outdate();
        }
        self.blind = blind;
    }

    fn on_observed(&mut self, observation: &Observation) {
        if let (Some(learning), Some(round)) = (&mut self.learning, self.looking) {
            learning.look(self.now, round, &observation.features);
        }
        let Some(round) = self.round.as_mut().filter(|round| round.open) else { return };
        let Some(classifier) = &self.classifier else {
            // Who learns has none until it was taught.
            if self.learning.is_none() {
                self.refusals.add(Refusal::NoClassifier);
            }
            return;
        };
        if !round.observe(self.now, observation, &**classifier, &self.config) {
            self.refusals.add(Refusal::Unclassified);
        }
    }

    fn on_received(&mut self, envelope: Envelope, out: &mut Vec<Output>) {
        let Envelope { author, stamp, message } = envelope;
        if author == self.me {
            // The own words may come back; words never said are another's.
            if stamp.boot != self.stamp.boot || stamp > self.stamp {
                self.meet_duplicate(stamp);
            }
            return;
        }
        match message {
            Message::Vote(vote) => {
                self.hear_vote(author, stamp, vote, out);
            }
            Message::Have(have) => self.on_have(author, &have, out),
            Message::Give(give) => self.on_give(author, give, out),
            Message::Samples(samples) => self.on_samples(author, &samples),
            Message::Know(know) => self.on_know(author, &know, out),
            Message::Lessons(lessons) => self.on_lessons(&lessons.lessons),
        }
    }

    fn on_heard(&mut self, robot: RobotId, decision: Decision, out: &mut Vec<Output>) {
        if robot != self.me {
            self.hear_decision(Some(robot), decision, out);
        }
    }

    fn on_announced(&mut self, decision: Decision, out: &mut Vec<Output>) {
        let (counter, class) = (decision.round.counter, decision.class);
        self.hear_decision(None, decision, out);
        if let Some(round) = self.round.as_mut().filter(|round| round.id.counter == counter) {
            round.agreement.note_announced(self.now, class);
        }
    }

    fn on_alive(&mut self, robots: BTreeSet<RobotId>) {
        self.alive = &robots | &self.guests;
        self.alive.remove(&self.me);
        // This mind speaks for its guests too: its turn is that of the smallest of them all.
        let first = self.guests.first().map_or(self.me, |guest| self.me.min(*guest));
        self.turns = u32::try_from(self.alive.range(..first).count()).unwrap_or(u32::MAX);
    }

    fn on_guests(&mut self, robots: BTreeSet<RobotId>) {
        let others: BTreeSet<RobotId> = self.alive.difference(&self.guests).copied().collect();
        self.guests = robots;
        self.on_alive(others);
    }

    fn on_learned(&mut self, classifier: Arc<dyn Classify>) {
        let before = self.classifier.as_ref().map(|old| old.vocabulary().id());
        if let Some(round) = self.round.as_mut().filter(|_| before != Some(classifier.vocabulary().id())) {
            round.look_afresh();
        }
        if let Some(learning) = &mut self.learning {
            learning.settle_aside(&*classifier);
        }
        self.classifier = Some(classifier);
    }

    fn on_remembered(&mut self, revision: u64) {
        if let Some(learning) = &mut self.learning {
            learning.note_remembered(revision);
        }
    }

    /// Chooses samples to share, as far as the bounds allow.
    fn share(&mut self) {
        if let Some(learning) = &mut self.learning {
            learning.share(self.classifier.as_deref(), self.alive.is_empty());
        }
    }

    /// Does whatever is due.
    fn advance(&mut self, out: &mut Vec<Output>) {
        self.speak(out);
        self.decide(out);
        if self.closing().is_some_and(|due| self.now >= due) {
            self.close(out);
        }
        if self.showing().is_some_and(|due| self.now >= due) {
            self.on_open(out);
            self.shown = None;
        }
        if self.announcement().is_some_and(|due| self.now >= due) {
            self.announce(out);
        }
        if self.looking_until().is_some_and(|until| self.now >= until) {
            self.stop_looking(out);
        }
        self.repair_when_due(out);
        self.carry_on_learning(out);
        self.answer_when_due(out);
    }

    /// Says what is to be trained and remembered, and shares what is remembered as shared.
    fn carry_on_learning(&mut self, out: &mut Vec<Output>) {
        let Some(learning) = &mut self.learning else { return };
        let changes = learning.take_training();
        if !changes.is_empty() {
            out.push(Output::Train(changes));
        }
        if let Some((revision, changes)) = learning.take_changes() {
            out.push(Output::Remember { revision, changes });
        }
        while let Some(samples) = self.learning.as_mut().and_then(Learning::take_unsent) {
            if !samples.samples.is_empty() {
                let envelope = self.stamped(Message::Samples(samples));
                out.push(Output::Broadcast(envelope));
            }
        }
    }

    /// A message as this robot's next.
    fn stamped(&mut self, message: Message) -> Envelope {
        self.stamp.sequence = self.stamp.sequence.saturating_add(1);
        Envelope { author: self.me, stamp: self.stamp, message }
    }

    /// Says this robot's vote when it is due.
    fn speak(&mut self, out: &mut Vec<Output>) {
        let vocabulary = self.classifier.as_ref().map(|classifier| classifier.vocabulary().id());
        let Some(round) = self.round.as_mut() else { return };
        let said = round.speak(self.now, self.me, &mut self.stamp, vocabulary, self.blind, &self.config);
        out.extend(said.map(Output::Broadcast));
    }

    /// Concludes when the votes suffice or the time is over, and holds the greatest decision known.
    fn decide(&mut self, out: &mut Vec<Output>) {
        let own_scale = self.own_scale();
        let Some(round) = self.round.as_mut() else { return };
        let concludes = round.open && round.agreement.held().is_none();
        let scale = own_scale.or_else(|| concludes.then(|| round.ballot.prevailing_scale())?);
        round.conclude(self.now, self.me, &self.alive, scale, &self.config);
        // While the votes may still suffice, the "no decision" of a robot that heard less ends nothing.
        let or_none = !round.open || self.now >= round.patience_and_deadline(&self.config).1;
        if let Some(decision) = round.agreement.settle(self.now, or_none) {
            if let Some(learning) = &mut self.learning {
                learning.decided(decision.round, decision.class);
            }
            out.push(Output::Hold(decision.clone()));
        }
    }

    /// When the open round closes: what is decided is left a while to meet what others decided.
    fn closing(&self) -> Option<Duration> {
        let round = self.round.as_ref().filter(|round| round.open)?;
        Some(round.agreement.held_since()? + self.config.settle)
    }

    fn close(&mut self, out: &mut Vec<Output>) {
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.open = false;
        }
        if self.looking_until().is_none() {
            self.stop_looking(out);
        }
    }

    /// Until when this robot looks at a round that is over: it saw something, and is to learn from more of it.
    fn looking_until(&self) -> Option<Duration> {
        let round = self.round.as_ref().filter(|round| !round.open)?;
        let learning = self.learning.as_ref().filter(|_| self.looking.is_some())?;
        let (_, deadline) = round.patience_and_deadline(&self.config);
        let more = self.now < deadline && learning.wants_more(round.id);
        Some(if more { deadline } else { self.now })
    }

    fn stop_looking(&mut self, out: &mut Vec<Output>) {
        if self.looking.take().is_some()
            && let Some(round) = &self.round
        {
            // Under the name it ended with: it may have merged with one of a smaller opener meanwhile.
            out.push(Output::Closed(round.id));
        }
    }

    /// When this robot is to announce the decision it holds: the live robot of the smallest id is the
    /// spokesrobot, each next one waits a while longer for the one before.
    fn announcement(&self) -> Option<Duration> {
        let wait = self.config.settle.saturating_add(self.config.takeover.saturating_mul(self.turns));
        self.round.as_ref()?.agreement.announcement(wait)
    }

    fn announce(&mut self, out: &mut Vec<Output>) {
        let Some(agreement) = self.round.as_mut().map(|round| &mut round.agreement) else { return };
        if let Some(decision) = agreement.held().cloned() {
            agreement.note_announced(self.now, decision.class);
            out.push(Output::Announce(decision));
        }
    }

    /// Takes part in a round from now on; an older one that is still open is over.
    fn join(&mut self, id: RoundId, out: &mut Vec<Output>) {
        self.enter(id, true, out);
        out.push(Output::Opened(id));
        self.repair.hurry(self.now, &self.config);
        self.speak(out);
    }

    /// Makes this the newest round known, with or without taking part in it.
    fn enter(&mut self, id: RoundId, open: bool, out: &mut Vec<Output>) {
        self.close(out);
        self.stop_looking(out);
        self.highest = self.highest.max(Some(id.counter));
        self.round = Some(Round::new(id, self.now, open));
        self.looking = open.then_some(id);
        if let Some(learning) = &mut self.learning {
            learning.live(id);
        }
    }

    /// Where a round that was heard of stands to the newest one known; refuses one too far ahead. Equal counters
    /// merge here, on the smaller opener.
    fn place(&mut self, id: RoundId) -> Option<Ordering> {
        if self.highest.is_some_and(|highest| id.counter > highest.saturating_add(FAR_AHEAD)) {
            self.refusals.add(Refusal::FarAhead);
            return None;
        }
        self.highest = self.highest.max(Some(id.counter));
        let Some(round) = &mut self.round else { return Some(Ordering::Greater) };
        let order = id.counter.cmp(&round.id.counter);
        if order.is_eq() {
            round.id.opener = round.id.opener.min(id.opener);
            if let Some(learning) = &mut self.learning {
                learning.live(id);
            }
        }
        Some(order)
    }

    /// Counts a robot's vote, by whichever way it came. Says whether it was news.
    fn hear_vote(&mut self, robot: RobotId, stamp: Stamp, vote: Vote, out: &mut Vec<Output>) -> bool {
        if robot == self.me {
            // From an earlier life it is merely old.
            if stamp > self.stamp {
                self.meet_duplicate(stamp);
            }
            return false;
        }
        if vote.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return false;
        }
        let scale = Scale { vocabulary: vote.vocabulary, classes: vote.evidence.len() };
        if !vote.evidence.is_empty() && self.own_scale().is_some_and(|own| own != scale) {
            self.refusals.add(Refusal::Vocabulary);
            return false;
        }
        match self.place(vote.round) {
            None | Some(Ordering::Less) => return false,
            Some(Ordering::Greater) => self.join(vote.round, out),
            Some(Ordering::Equal) => {}
        }
        let Some(round) = self.round.as_mut() else { return false };
        match round.ballot.cast(robot, stamp, vote) {
            Cast::Counted => true,
            Cast::Known => false,
            Cast::Full => {
                self.refusals.add(Refusal::BallotFull);
                false
            }
        }
    }

    /// Takes in a decision, by whichever way it came. Says whether it was news.
    fn hear_decision(&mut self, holder: Option<RobotId>, decision: Decision, out: &mut Vec<Output>) -> bool {
        if decision.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return false;
        }
        match self.place(decision.round) {
            None | Some(Ordering::Less) => return false,
            // What is decided elsewhere needs no looking; unless it cannot be believed on one robot's word.
            Some(Ordering::Greater) if self.config.liars == 0 => self.enter(decision.round, false, out),
            Some(Ordering::Greater) => self.join(decision.round, out),
            Some(Ordering::Equal) => {}
        }
        let Some(round) = self.round.as_mut() else { return false };
        round.agreement.hear(holder, decision, self.config.liars)
    }

    fn meet_duplicate(&mut self, stamp: Stamp) {
        self.refusals.add(Refusal::DuplicateId);
        self.duplicate = Some(stamp);
    }

    fn own_scale(&self) -> Option<Scale> {
        let vocabulary = self.classifier.as_ref()?.vocabulary();
        Some(Scale { vocabulary: vocabulary.id(), classes: vocabulary.classes() })
    }
}

#[cfg(test)]
mod tests;
