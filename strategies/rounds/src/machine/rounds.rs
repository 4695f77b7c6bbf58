//! The machine itself: what it holds, and the one verb that moves it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Envelope, HeldVote, Message, Pool, RobotId, RoundId, Stamp};

use super::allowance::Allowance;
use super::follow::Follow;
use super::input::Input;
use super::members::Committee;
use super::output::Output;
use super::partners::Partners;
use super::wanted::Wanted;
use crate::called::Called;
use crate::classify::Classify;
use crate::config::{RoundsConfig, RoundsConfigError};
use crate::electorate::Electorate;
use crate::fuse::Fuse;
use crate::life::Life;
use crate::others::Others;
use crate::refusal::Refusals;
use crate::round::Round;
use crate::sign::Sign;
use crate::vocabulary::Vocabulary;

/// Decisions are heard this often, in the long run: rounds are no faster.
const DECISIONS_EVERY: Duration = Duration::from_millis(250);

/// And so many at once, as when a part of the swarm comes back.
const BURST: u32 = 16;

/// The rounds of one robot: what the world tells it goes in, what it wants done comes out.
///
/// Time is an argument, the duration since any fixed moment, the same for all calls; it never runs back. On one machine
/// the same inputs at the same times give the same outputs.
///
/// Two robots that decide together, each with a classifier of its own, and a network of five lines:
///
/// ```
/// use std::sync::Arc;
/// use std::time::Duration;
///
/// use gestalt_protocol::RobotId;
/// use gestalt_rounds::{Classify, ClassifyError, Input, Life, Observation, Output, Rounds, RoundsConfig, Vocabulary};
///
/// /// Takes the features for the probabilities.
/// #[derive(Debug)]
/// struct Verbatim(Vocabulary);
///
/// impl Classify for Verbatim {
///     fn vocabulary(&self) -> &Vocabulary {
///         &self.0
///     }
///
///     fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
///         Ok(features.iter().map(|p| f64::from(*p)).collect())
///     }
/// }
///
/// let now = Duration::ZERO;
/// let robots = [RobotId(0), RobotId(1)];
/// let mut swarm: Vec<Rounds> = Vec::new();
/// for robot in robots {
///     let life = Life { boot: 1, nonce: 0x3F9A_01C7 };
///     let mut rounds = Rounds::new(robot, life, RoundsConfig::default())?;
///     let vocabulary = Vocabulary::new(["left", "right"])?;
///     rounds.handle(now, Input::Learned(Arc::new(Verbatim(vocabulary))));
///     rounds.handle(now, Input::Alive(Arc::new(robots.into())));
///     swarm.push(rounds);
/// }
///
/// // Neither is sure enough alone; together they are.
/// let saw = |p: f32| Input::Observed(Observation { features: vec![1.0 - p, p], quality: 1.0 });
/// let mut inbox = vec![(0, Input::Open), (1, Input::Open), (0, saw(0.93)), (1, saw(0.95))];
/// let mut decided = Vec::new();
/// for ms in 1..1000 {
///     let now = Duration::from_millis(ms);
///     inbox.extend([(0, Input::Tick), (1, Input::Tick)]);
///     for (robot, input) in std::mem::take(&mut inbox) {
///         for output in swarm[robot].handle(now, input) {
///             match output {
///                 Output::Broadcast(said) => inbox.push((1 - robot, Input::Received(said))),
///                 Output::Announce(announcement) => {
///                     decided.push(announcement.clone());
///                     inbox.push((1 - robot, Input::Announced(announcement)));
///                 }
///                 _ => {}
///             }
///         }
///     }
/// }
/// assert_eq!(decided.len(), 1, "one robot speaks for all");
/// assert_eq!(decided[0].label.as_deref(), Some("right"));
/// assert_eq!(decided[0].decision.certificate.votes.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Rounds {
    pub(super) me: RobotId,
    /// Of this life, in the names of the rounds that it opens.
    pub(super) nonce: u32,
    pub(super) config: RoundsConfig,
    pub(super) fusion: Arc<dyn Fuse>,
    /// Of what others found of how alike robots are and this one holds decisions by: what rests on most rounds.
    pub(super) heard_pool: Option<(RobotId, Pool)>,
    pub(super) classifier: Option<Arc<dyn Classify>>,
    /// What gestures are called while there is no classifier.
    pub(super) vocabulary: Option<Vocabulary>,
    /// What gestures are called that were named since.
    pub(super) names: BTreeMap<ClassId, Called>,
    pub(super) signer: Option<Arc<dyn Sign>>,
    /// The votes that were cast, and that others are yet to be told.
    pub(super) unsaid: Vec<Envelope>,
    /// The stamp of the last message said.
    pub(super) stamp: Stamp,
    pub(super) now: Duration,
    /// The newest round known.
    pub(super) round: Option<Round>,
    /// When the last one before it began that this robot took part in or that was decided, or it itself if this robot took part in it.
    pub(super) took_part: Option<Duration>,
    /// The names of earlier rounds under its count in which this robot held a gesture, or of which an instructor spoke: names of this one they never become.
    pub(super) past: BTreeSet<RoundId>,
    /// The highest counter heard of, also of a round about which nothing else is known yet.
    pub(super) highest: Option<u32>,
    /// The greatest counter of decisions heard since a round was opened that are none here: so far those count who made them.
    pub(super) counted_elsewhere: Option<u32>,
    /// What robots said last of rounds far beyond it. Of those alone who are there.
    pub(super) far_ahead: BTreeMap<RobotId, u32>,
    /// The counter that this life began with, and when it began.
    pub(super) began: (u32, Option<Duration>),
    /// Whether this robot has lived before, and has been in no round since from its beginning.
    pub(super) afresh: bool,
    /// Whether what another robot announced last was one that this robot found nothing against.
    pub(super) announcement_stands: bool,
    pub(super) electorate: Electorate,
    /// Who votes in the newest round, where not all do.
    pub(super) committee: Option<Committee>,
    /// The greatest decision that a robot said it holds and that is lacking here, and when it is asked for.
    pub(super) wanted: Option<Wanted>,
    /// The other robots alive, guests among them.
    pub(super) alive: Others,
    /// How many of them have a smaller id: whoever speaks for the swarm waits this many turns.
    pub(super) turns: u32,
    pub(super) guests: BTreeSet<RobotId>,
    pub(super) partners: Partners,
    /// How often others may compare what they have with this robot.
    pub(super) haves: Allowance,
    /// How often each may give it a decision,
    pub(super) given: Allowance,
    /// and how often each may announce one.
    pub(super) announced: Allowance,
    /// How often a robot may end a round that is neither decided nor over, by beginning a newer one.
    pub(super) preempted: Allowance,
    /// The latest votes in newer rounds that were refused so as not to end the open one: their time comes when that is over.
    pub(super) waiting: BTreeMap<RobotId, HeldVote>,
    pub(super) refusals: Refusals,
    pub(super) duplicate: Option<Stamp>,
    /// The round for which this robot still looks, though it may be decided: its learning wants more of it.
    pub(super) looking: Option<RoundId>,
    /// Since when the hand had moved that now holds still and has had no round yet.
    pub(super) shown: Option<Duration>,
    pub(super) blind: bool,
}

/// What comes of one input: for the host, and for whoever follows the rounds.
pub(super) struct Effects<'a> {
    pub follower: &'a mut dyn Follow,
    /// Is given what is to be done as soon as that is known.
    pub carry_out: &'a mut dyn FnMut(Output),
}

impl Rounds {
    /// The rounds of robot `me` in one of its lives. It has no classifier until [`Input::Learned`]: until then it relays, fuses and
    /// decides, but gives no evidence.
    ///
    /// # Errors
    /// [`RoundsConfigError`] for a configuration that [`RoundsConfig::validate`] refuses.
    pub fn new(me: RobotId, life: Life, config: RoundsConfig) -> Result<Self, RoundsConfigError> {
        config.validate()?;
        Ok(Self {
            me,
            nonce: life.nonce,
            classifier: None,
            vocabulary: None,
            names: BTreeMap::new(),
            signer: None,
            unsaid: Vec::new(),
            stamp: Stamp { boot: life.boot, sequence: 0 },
            now: Duration::ZERO,
            round: None,
            took_part: None,
            past: BTreeSet::new(),
            far_ahead: BTreeMap::new(),
            highest: None,
            counted_elsewhere: None,
            began: (0, None),
            afresh: false,
            announcement_stands: false,
            electorate: Electorate::new(config.all_vote_up_to()),
            committee: None,
            wanted: None,
            alive: Others::new(me, Arc::default()),
            turns: 0,
            guests: BTreeSet::new(),
            partners: Partners::new(config.repair_idle),
            // Who goes by the same configuration turns to a neighbour once in that time, and answers.
            haves: Allowance::new(config.repair_busy / 4, BURST),
            given: Allowance::new(DECISIONS_EVERY, BURST),
            announced: Allowance::new(DECISIONS_EVERY, BURST),
            preempted: Allowance::new(config.deadline, 1),
            waiting: BTreeMap::new(),
            fusion: Arc::new(config.rule),
            heard_pool: None,
            config,
            refusals: Refusals::default(),
            duplicate: None,
            looking: None,
            shown: None,
            blind: false,
        })
    }

    /// The same rounds, of a robot that has lived before: it counts for no gesture of a round that may have begun before this life, until it is in one that
    /// did not. It may have counted for another, and forgotten it.
    #[must_use]
    pub fn started_again(mut self) -> Self {
        self.afresh = true;
        self
    }

    /// The same rounds, that go on counting from there: from the newest that an earlier life knew of.
    #[must_use]
    pub fn counting_from(mut self, counter: Option<u32>) -> Self {
        self.highest = self.highest.max(counter);
        self.began.0 = counter.unwrap_or_default();
        self
    }

    /// The same rounds, in which votes are fused by the user's rule; the configuration's `rule` then names it. All
    /// robots of a swarm need the same.
    #[must_use]
    pub fn fused_by(mut self, rule: Arc<dyn Fuse>) -> Self {
        self.config.rule = rule.rule();
        self.fusion = rule;
        self
    }

    /// The same rounds, in which gestures have these names where this robot announces them, until a classifier brings its own.
    #[must_use]
    pub fn naming(mut self, vocabulary: Vocabulary) -> Self {
        self.vocabulary = Some(vocabulary);
        self
    }

    /// Gestures that were named have these names from now on where this robot announces them.
    pub fn call(&mut self, names: BTreeMap<ClassId, Called>) {
        self.names = names;
    }

    /// The same rounds, in which this robot signs what it stands by: votes, what it holds, gives and announces, samples and what it passes on
    /// of instructors.
    #[must_use]
    pub fn signed_by(mut self, signer: Arc<dyn Sign>) -> Self {
        self.signer = Some(signer);
        self.electorate.require_keys();
        self
    }

    /// Takes in one input at the time `now` and says what is to be done.
    pub fn handle(&mut self, now: Duration, input: Input) -> Vec<Output> {
        self.handle_with(now, input, &mut ())
    }

    /// The same for a robot whose learning follows the rounds: the same one at every call.
    pub fn handle_with(&mut self, now: Duration, input: Input, follower: &mut dyn Follow) -> Vec<Output> {
        let mut out = Vec::new();
        self.handle_into(now, input, follower, &mut |output| out.push(output));
        out
    }

    /// The same for a host that does not wait for the rest: `carry_out` is given each output as soon as it is known, so that a decision is held before
    /// this robot signs that it holds it.
    pub fn handle_into(
        &mut self,
        now: Duration,
        input: Input,
        follower: &mut dyn Follow,
        carry_out: &mut dyn FnMut(Output),
    ) {
        self.now = now.max(self.now);
        self.began.1.get_or_insert(self.now);
        let mut effects = Effects { follower, carry_out };
        match input {
            Input::Tick => {}
            Input::Open => self.on_open(&mut effects),
            Input::Shown(began) => self.shown = Some(began.min(self.now)),
            Input::Left => self.on_left(),
            Input::Blind(blind) => self.on_blind(blind),
            Input::Observed(observation) => {
                self.on_observed(&observation, effects.follower.learns());
            }
            Input::Received(envelope) => self.on_received(envelope, &mut effects),
            Input::Announced(announcement) => self.on_announced(announcement, &mut effects),
            Input::Alive(robots) => self.on_alive(robots),
            Input::Guests(robots) => self.on_guests(robots),
            Input::Neighbours(robots) => self.on_neighbours(robots, &mut effects),
            Input::Expelled(robots) => self.on_expelled(&robots),
            Input::Learned(classifier) => self.on_learned(classifier),
        }
        self.advance(&mut effects);
    }

    /// When the machine wants its next [`Input::Tick`], if nothing else comes before.
    #[must_use]
    pub fn next_wake(&self) -> Option<Duration> {
        self.next_wake_with(&())
    }

    /// The same for a robot whose learning follows the rounds.
    #[must_use]
    pub fn next_wake_with(&self, follower: &dyn Follow) -> Option<Duration> {
        let round = self.round.as_ref();
        let (patience, deadline) = round
            .filter(|round| round.open && round.agreement.held().is_none())
            .map(|round| round.patience_and_deadline(&self.config))
            .unzip();
        let rest = [
            round.and_then(|round| round.vote_due(&self.config)),
            patience.filter(|patience| *patience > self.now),
            deadline,
            self.closing(),
            self.looking_until(follower),
            self.showing(),
            self.partners.due(&self.alive),
            self.wanted.as_ref().map(|wanted| wanted.due),
        ];
        let rest = rest.into_iter().flatten().min();
        // Asked at every input, as most of it is: how many hold the decision is counted where that may be what comes next.
        let may_be_next = |earliest: &Duration| rest.is_none_or(|rest| *earliest < rest);
        let announcement = self.earliest_announcement().filter(may_be_next).and_then(|_| self.announcement());
        rest.into_iter().chain(announcement).min()
    }

    /// Does whatever is due.
    fn advance(&mut self, effects: &mut Effects<'_>) {
        self.speak();
        self.decide(effects);
        if self.closing().is_some_and(|due| self.now >= due) {
            self.close(effects);
        }
        if self.showing().is_some_and(|due| self.now >= due) {
            self.on_open(effects);
            self.shown = None;
        }
        if self.is_to_announce() {
            self.announce(effects);
        }
        if !self.is_open() {
            self.hear_waiting(effects);
        }
        // Those of a round that was joined just now.
        self.say_votes(effects);
        if self.looking_until(effects.follower).is_some_and(|until| self.now >= until) {
            self.stop_looking(effects);
        }
        self.ask_when_due(effects);
        self.repair_when_due(effects);
    }

    /// A robot by its name, if there is reason to believe that there is one.
    pub(super) fn known(&self, robot: RobotId) -> Option<RobotId> {
        Some(robot).filter(|robot| self.partners.is_neighbour(*robot) || self.alive.contains(*robot))
    }

    /// Keeps an account of those alone who are there.
    pub(super) fn forget_accounts(&mut self) {
        let (now, alive, partners) = (self.now, &self.alive, &self.partners);
        let known = |robot: RobotId| alive.contains(robot) || partners.is_neighbour(robot);
        for allowance in [&mut self.haves, &mut self.given, &mut self.announced, &mut self.preempted] {
            allowance.forget(now, known);
        }
        self.far_ahead.retain(|robot, _| known(*robot));
        self.forget_waiting();
    }

    /// A message as this robot's next: whatever it says, of rounds or of what it learned, counts in one sequence. Those that
    /// others are to believe are signed; the rest are hints, and what they lead to is.
    #[must_use]
    pub fn stamped(&mut self, message: Message) -> Envelope {
        let is_hint = match &message {
            // Who gives a decision stands by it.
            Message::Give(give) => give.decision.is_none(),
            message => matches!(message, Message::Have(_) | Message::Know(_) | Message::Batches(_)),
        };
        let envelope = self.unsigned(message);
        let signer = self.signer.as_deref().filter(|_| !is_hint);
        Envelope { signature: signer.map(|signer| signer.sign(&envelope.statement())), ..envelope }
    }

    /// A message as this robot's next, which is yet to be signed.
    pub(super) fn unsigned(&mut self, message: Message) -> Envelope {
        self.stamp.sequence = self.stamp.sequence.saturating_add(1);
        Envelope { author: self.me, stamp: self.stamp, message, signature: None }
    }
}
