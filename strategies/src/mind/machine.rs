//! The mind itself: the rounds, and the learning that follows them.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Announcement, Envelope, HeldBatch, Message, RobotId};
use gestalt_rounds::{
    Classify, Follow, Fuse, Input as AboutRounds, Life, Rounds, RoundsConfig, RoundsConfigError, Sign,
    Vocabulary,
};

use super::answers::Answers;
use super::asks::{Asks, Passed};
use super::exchanges::Exchanges;
use super::input::{Concern, Input};
use super::output::Output;
use crate::learning::{Learning, LearningError, LearningSetup, RobotMemory, Shelf};

/// The state machine in every robot: what the world tells it goes in, what it wants done comes out.
///
/// Time is an argument, the duration since any fixed moment, the same for all calls; it never runs back. On one machine
/// the same inputs at the same times give the same outputs.
///
/// A robot alone, whose classifier takes the features for the probabilities:
///
/// ```
/// use std::sync::Arc;
/// use std::time::Duration;
///
/// use gestalt_protocol::{ClassId, RobotId};
/// use gestalt_strategies::{Classify, ClassifyError, Input, Life, Mind, MindConfig, Observation, Output, Vocabulary};
///
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
/// let mut mind = Mind::new(RobotId(7), Life { boot: 1, nonce: 0x3F9A_01C7 }, MindConfig::default())?;
/// let ms = Duration::from_millis;
/// mind.handle(ms(0), Input::Learned(Arc::new(Verbatim(Vocabulary::new(["left", "right"])?))));
/// mind.handle(ms(0), Input::Open);
/// mind.handle(ms(40), Input::Observed(Observation { features: vec![0.02, 0.98], quality: 1.0 }));
/// // Its vote is said, and with it all that is to be waited for.
/// let due = mind.next_wake().expect("a vote is to be said");
/// let outputs = mind.handle(due, Input::Tick);
/// assert!(outputs.iter().any(|output| matches!(output, Output::Broadcast(_))));
/// assert_eq!(mind.held().expect("it is sure").class, Some(ClassId(1)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Mind {
    pub(super) rounds: Rounds,
    pub(super) learning: Option<Learning>,
    pub(super) answers: Answers,
    pub(super) exchanges: Exchanges,
    pub(super) asks: Asks,
    /// Of this life, in the names of its rounds and samples.
    nonce: u32,
    /// Batches of one author each that give different samples one number.
    pub(super) contradictions: Vec<(HeldBatch, HeldBatch)>,
}

impl Mind {
    /// The mind of robot `me` in one of its lives, whose `nonce` names the rounds that it opens and the samples that it
    /// shares. It has no classifier until [`Input::Learned`]: until then it relays, fuses and decides, but gives no evidence.
    ///
    /// # Errors
    /// [`RoundsConfigError`] for a configuration that [`RoundsConfig::validate`] refuses.
    pub fn new(me: RobotId, life: Life, config: RoundsConfig) -> Result<Self, RoundsConfigError> {
        Ok(Self {
            rounds: Rounds::new(me, life, config)?,
            learning: None,
            answers: Answers::default(),
            exchanges: Exchanges::default(),
            asks: Asks::default(),
            nonce: life.nonce,
            contradictions: Vec::new(),
        })
    }

    /// The same mind, in which votes are fused by the user's rule, see [`Rounds::fused_by`].
    #[must_use]
    pub fn fused_by(mut self, rule: Arc<dyn Fuse>) -> Self {
        self.rounds = self.rounds.fused_by(rule);
        self
    }

    /// The same mind, that announces gestures by these names, see [`Rounds::naming`].
    #[must_use]
    pub fn naming(mut self, vocabulary: Vocabulary) -> Self {
        self.rounds = self.rounds.naming(vocabulary);
        self
    }

    /// The decision held as this robot says it to whoever asks, see [`Rounds::held_aloud`].
    #[must_use]
    pub fn held_aloud(&mut self) -> Option<Announcement> {
        self.rounds.held_aloud()
    }

    /// The same mind, that signs what it stands by, see [`Rounds::signed_by`]. One that learns is told so before it is [set up](Self::learning) to: what it may share has
    /// to be enough for a signature as well.
    #[must_use]
    pub fn signed_by(mut self, signer: Arc<dyn Sign>) -> Self {
        self.rounds = self.rounds.signed_by(signer);
        self
    }

    /// The same mind, of a robot that has lived before, see [`Rounds::started_again`]. One that learns is told so by a memory that is not empty, too.
    #[must_use]
    pub fn started_again(mut self) -> Self {
        self.rounds = self.rounds.started_again();
        self
    }

    /// The same mind, set up to learn: it keeps what it sees, labels it by what instructors say, shares and forgets.
    ///
    /// # Errors
    /// See [`LearningError`].
    pub fn learning(mut self, setup: LearningSetup) -> Result<Self, LearningError> {
        let counter = setup.memory.as_ref().and_then(RobotMemory::newest_counter);
        let starts_again = setup.memory.as_ref().is_some_and(|memory| !memory.is_empty());
        let vocabulary = setup.vocabulary.clone();
        self.learning = Some(Learning::new(self.me(), self.nonce, self.rounds.signs(), setup)?);
        self.rounds = self.rounds.counting_from(counter).naming(vocabulary);
        self.call_by_names();
        Ok(if starts_again { self.started_again() } else { self })
    }

    /// The same mind, which holds what other minds of this process hold as well in one place with them.
    #[must_use]
    pub fn with_shelf(mut self, shelf: Arc<Shelf>) -> Self {
        if let Some(learning) = &mut self.learning {
            learning.shelf = shelf;
        }
        self
    }

    /// Signed batches of one author that give different samples one number, as they were met since this was last asked: they convict it. At most eight.
    pub fn take_contradictions(&mut self) -> Vec<(HeldBatch, HeldBatch)> {
        std::mem::take(&mut self.contradictions)
    }

    /// Takes in one input at the time `now` and says what is to be done.
    pub fn handle(&mut self, now: Duration, input: Input) -> Vec<Output> {
        let mut out = Vec::new();
        self.handle_into(now, input, &mut |output| out.push(output));
        out
    }

    /// The same for a host that does not wait for the rest: `carry_out` is given each output as soon as it is known, so that a decision is held before
    /// this robot signs that it holds it.
    pub fn handle_into(&mut self, now: Duration, input: Input, carry_out: &mut dyn FnMut(Output)) {
        let now = now.max(self.rounds.now());
        let mut out = Vec::new();
        let about_rounds = match input.concern() {
            Concern::Rounds(input) => self.learn_along(now, input, &mut out),
            Concern::Word(word) => self.on_instructed(now, word),
            Concern::Disallowed(word) => self.on_disallowed(now, word),
            Concern::Answered(by, at, robot) => self.on_answered(by, at, robot),
            Concern::Asked(question) => self.on_asked(now, question),
            Concern::Believe(believer) => self.on_believe(believer),
            Concern::Remembered(revision) => self.on_remembered(revision),
        };
        out.drain(..).for_each(&mut *carry_out);
        let round = self.rounds.round();
        let follower: &mut dyn Follow = match &mut self.learning {
            Some(learning) => {
                learning.refresh_digest();
                learning
            }
            None => &mut (),
        };
        let mut passed = Passed::of(&about_rounds);
        self.rounds.handle_into(now, about_rounds, follower, &mut |output| {
            passed.note(&output);
            carry_out(output.into());
        });
        if let Some(learning) = &mut self.learning {
            let speak = learning.pass_over(self.rounds.silent());
            if !speak.is_empty() {
                self.exchanges.readmit(&speak);
            }
        }
        if self.rounds.round() != round {
            self.exchanges.forget_declined_lessons();
        }
        self.carry_on_learning(&mut out);
        self.answer_when_due(&mut out);
        self.carry_on_asking(now, passed, &mut out);
        out.into_iter().for_each(carry_out);
    }

    /// When the mind wants its next [`Input::Tick`], if nothing else comes before.
    #[must_use]
    pub fn next_wake(&self) -> Option<Duration> {
        let follower: &dyn Follow = match &self.learning {
            Some(learning) => learning,
            None => &(),
        };
        [self.rounds.next_wake_with(follower), self.answer_due(), self.questions_due()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Learns from what concerns the rounds, before they take it in.
    fn learn_along(&mut self, now: Duration, input: AboutRounds, out: &mut Vec<Output>) -> AboutRounds {
        let input = match input {
            // The rounds have no part in these.
            AboutRounds::Received(Envelope {
                author,
                stamp,
                message: Message::Samples(samples),
                signature,
            }) if author != self.me() => {
                self.on_batch(author, HeldBatch { robot: author, stamp, samples, signature });
                return AboutRounds::Tick;
            }
            AboutRounds::Received(Envelope { author, message: Message::Batches(batches), .. })
                if author != self.me() =>
            {
                batches.batches.into_iter().for_each(|batch| self.on_batch(author, batch));
                return AboutRounds::Tick;
            }
            input => input,
        };
        match &input {
            AboutRounds::Observed(observation) => {
                if let (Some(learning), Some(round)) = (&mut self.learning, self.rounds.looking()) {
                    learning.look(now, round, &observation.features);
                }
            }
            AboutRounds::Learned(classifier) => self.on_learned(classifier),
            AboutRounds::Received(envelope) if envelope.author != self.me() => {
                self.on_received(envelope, out);
            }
            AboutRounds::Alive(robots) => {
                if let Some(learning) = &mut self.learning {
                    self.exchanges.readmit(&learning.meet(robots.clone()));
                }
            }
            AboutRounds::Neighbours(robots) => self.exchanges.keep(|robot| robots.contains(&robot)),
            _ => {}
        }
        input
    }

    fn on_received(&mut self, envelope: &Envelope, out: &mut Vec<Output>) {
        let author = envelope.author;
        match &envelope.message {
            Message::Have(have) if !have.answer => self.compare_knowledge(author, have.knowledge, out),
            Message::Know(know) => self.on_know(author, know, out),
            Message::Lessons(lessons) => self.on_lessons(author, &lessons.lessons),
            Message::Namings(namings) => self.on_namings(author, namings),
            Message::Vote(_)
            | Message::Have(_)
            | Message::Samples(_)
            | Message::Batches(_)
            | Message::Give(_)
            | Message::Holding(_)
            | Message::Announced(_)
            | Message::Asked(_) => {}
        }
    }

    fn on_learned(&mut self, classifier: &Arc<dyn Classify>) {
        if let Some(learning) = &mut self.learning {
            learning.settle_aside(&**classifier);
        }
    }

    fn on_remembered(&mut self, revision: u64) -> AboutRounds {
        if let Some(learning) = &mut self.learning {
            learning.note_remembered(revision);
        }
        AboutRounds::Tick
    }

    /// Chooses samples to share, as far as the bounds allow.
    pub(super) fn share(&mut self) {
        if let Some(learning) = &mut self.learning {
            let classifier = self.rounds.classifier().cloned();
            let rounds = &mut self.rounds;
            learning.share(classifier.as_deref(), rounds.signs(), |samples| {
                let Envelope { author: robot, stamp, signature, .. } =
                    rounds.stamped(Message::Samples(samples.clone()));
                HeldBatch { robot, stamp, samples, signature }
            });
        }
    }

    /// Says what is to be trained and remembered, and shares what is remembered as shared.
    fn carry_on_learning(&mut self, out: &mut Vec<Output>) {
        let Some(learning) = &mut self.learning else { return };
        learning.refresh_digest();
        let changes = learning.take_training();
        if !changes.is_empty() {
            out.push(Output::Train(changes));
        }
        if let Some((revision, changes)) = learning.take_changes() {
            out.push(Output::Remember { revision, changes });
        }
        while let Some(batch) = learning.take_unsent() {
            out.push(Output::Broadcast(batch.into()));
        }
    }

    pub(super) fn tell(&mut self, robot: RobotId, message: Message, out: &mut Vec<Output>) {
        out.push(Output::Tell(robot, self.rounds.stamped(message)));
    }
}
