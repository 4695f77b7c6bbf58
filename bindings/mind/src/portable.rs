//! A mind and the chores of its host that need no host: decoding, encoding, training when asked to.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, Envelope, Instruction, InstructorId, Keys, MAX_JSON, MAX_ROBOTS, Message, Question,
    RobotId, Topic, decode_json,
};
use gestalt_strategies::{
    Classifier, Classify, ClassifyError, Input, Instructed, Learner, LearningSetup, Mind, Observation,
    Output, OwnRules, Untrained, Vocabulary, outcome,
};
use serde::Serialize;
use serde_json::json;

use crate::error::MindError;
use crate::model_file::ModelFile;
use crate::outbox::{Outbox, OutgoingMessage};
use crate::settings::Settings;
use crate::verbatim::{self, Verbatim};

/// A robot's mind behind numbers, JSON and bytes.
///
/// Time is an argument, the duration since any fixed moment; one that runs back is taken for the latest so far. The same
/// calls at the same times give the same messages, byte for byte. What the mind wants said waits until the host takes it; the
/// host owes a [`tick`](Self::tick) at [`next_wake`](Self::next_wake).
///
/// ```
/// use std::time::Duration;
/// use gestalt_mind::{PortableMind, Settings};
///
/// let settings = Settings::parse(br#"{"robot": 7, "boot": 1, "seed": 42, "vocabulary": ["left", "right"]}"#)?;
/// let mut mind = PortableMind::new(settings)?;
/// let ms = Duration::from_millis;
/// mind.open(ms(0));
/// mind.observe(ms(40), &[0.02, 0.98], 1.0)?;
/// let due = mind.next_wake().expect("a vote is to be said");
/// mind.tick(due);
/// assert_eq!(mind.next_message().expect("its null vote").key, "gestalt/gestalt/robot/7/vote");
/// assert!(mind.decision().expect("it is sure").contains(r#""label":"right""#));
/// # Ok::<(), gestalt_mind::MindError>(())
/// ```
#[derive(Debug)]
pub struct PortableMind {
    settings: Settings,
    rules: OwnRules,
    keys: Keys,
    mind: Mind,
    sight: Sight,
    /// Of a mind that learns, once it has its model.
    learner: Option<Learner>,
    /// What the classifier has not followed yet: the host trains when it likes, or never.
    untrained: Untrained,
    outbox: Outbox,
    /// Whether anything was told to the mind, but what it judges with.
    begun: bool,
}

/// What observed numbers mean.
#[derive(Clone, Copy, Debug)]
enum Sight {
    Nothing,
    Probabilities(usize),
    Features(usize),
}

impl PortableMind {
    /// The mind of a robot that starts.
    ///
    /// # Errors
    /// See [`MindError`].
    pub fn new(settings: Settings) -> Result<Self, MindError> {
        Self::with_rules(settings, OwnRules::default())
    }

    /// The same, where the host has rules of its own for which samples to share and to forget.
    ///
    /// # Errors
    /// See [`MindError`].
    pub fn with_rules(settings: Settings, rules: OwnRules) -> Result<Self, MindError> {
        let mut mind = Self {
            keys: Keys::new(&settings.swarm)?,
            mind: Mind::new(somebody(settings.robot)?, settings.life(), settings.rounds.clone())?,
            sight: Sight::Nothing,
            learner: None,
            untrained: Untrained::default(),
            outbox: Outbox::default(),
            begun: false,
            rules,
            settings,
        };
        if let Some(vocabulary) = mind.settings.vocabulary.clone() {
            mind.sight = Sight::Probabilities(vocabulary.classes());
            mind.judge_by(Duration::ZERO, Arc::new(Verbatim(vocabulary)));
        }
        Ok(mind)
    }

    /// Reads the bytes of a model file: from now on the mind observes features. A mind that learns takes its model before all else.
    ///
    /// # Errors
    /// [`MindError::Model`], and those of [`Self::use_classifier`].
    pub fn load_model(&mut self, now: Duration, file: &[u8]) -> Result<(), MindError> {
        self.use_classifier(now, Arc::new(ModelFile::decode(file)?.classifier))
    }

    /// Judges by this classifier from now on: the mind observes features.
    ///
    /// # Errors
    /// [`MindError::Vocabulary`], [`MindError::TooLate`], [`MindError::Learner`] and [`MindError::Learning`].
    pub fn use_classifier(&mut self, now: Duration, classifier: Arc<Classifier>) -> Result<(), MindError> {
        let settings = &self.settings;
        if settings.vocabulary.as_ref().is_some_and(|named| named != classifier.vocabulary()) {
            return Err(MindError::Vocabulary);
        }
        if let Some(config) = settings.learning.clone() {
            if self.begun {
                return Err(MindError::TooLate);
            }
            let (space, vocabulary) = (classifier.space().clone(), classifier.vocabulary().clone());
            let mut learner = Learner::new(space.clone(), vocabulary.clone(), config.learner.clone())?;
            learner.build_on(&classifier)?;
            let mind = Mind::new(settings.robot, settings.life(), settings.rounds.clone())?;
            let (rng, rules) = (Box::new(settings.rng()), self.rules.clone());
            let setup = LearningSetup { config, space, vocabulary, rng, memory: None, rules };
            self.mind = mind.learning(setup)?;
            self.learner = Some(learner);
        }
        self.sight = Sight::Features(classifier.space().features());
        self.judge_by(now, classifier);
        Ok(())
    }

    fn judge_by(&mut self, now: Duration, classifier: Arc<dyn Classify>) {
        let outputs = self.mind.handle(now, Input::Learned(classifier));
        outputs.into_iter().for_each(|output| self.carry_out(output));
    }

    /// A frame showed a hand: the feature vector of it or, without a model, the probability of each gesture. `quality` is how
    /// far that is to be trusted, `0.0..=1.0`.
    ///
    /// # Errors
    /// [`MindError::Sightless`], [`MindError::Spaceless`], [`MindError::Features`], [`MindError::Probabilities`] and
    /// [`MindError::Quality`].
    pub fn observe(&mut self, now: Duration, values: &[f32], quality: f32) -> Result<(), MindError> {
        if !(0.0..=1.0).contains(&quality) {
            return Err(MindError::Quality(quality));
        }
        if self.settings.learning.is_some() && self.learner.is_none() {
            return Err(MindError::Spaceless);
        }
        match self.sight {
            Sight::Nothing => return Err(MindError::Sightless),
            Sight::Probabilities(classes) => verbatim::check(values, classes)?,
            Sight::Features(expected) if values.len() != expected => {
                return Err(ClassifyError::Length { found: values.len(), expected }.into());
            }
            Sight::Features(_) => {
                if let Some(place) = values.iter().position(|x| !x.is_finite()) {
                    return Err(ClassifyError::NotFinite(place).into());
                }
            }
        }
        self.tell(now, Input::Observed(Observation { features: values.to_vec(), quality }));
        Ok(())
    }

    /// A message arrived under that key of the swarm, as another robot's [`OutgoingMessage`] or a client wrote it. An instructor's
    /// words go into [`Self::instructed`], which also takes their time.
    ///
    /// # Errors
    /// [`MindError::Message`], [`MindError::Key`] and [`MindError::Mismatch`].
    pub fn received(&mut self, now: Duration, key: &str, payload: &[u8]) -> Result<(), MindError> {
        let refused = |cause| MindError::Message { key: shortened(key), cause };
        let topic = self.keys.parse(key).ok_or_else(|| MindError::Key(shortened(key)))?;
        let input = match topic {
            Topic::Vote(_) | Topic::Sample(_) | Topic::Repair(_) | Topic::RobotDecision(_) => {
                let envelope = Envelope::decode(payload).map_err(refused)?;
                if !self.belongs(&topic, &envelope) {
                    return Err(MindError::Mismatch(shortened(key)));
                }
                Input::Received(envelope)
            }
            Topic::Decision => {
                let announcement: Announcement = decode_json(payload).map_err(refused)?;
                announcement.check().map_err(refused)?;
                Input::Announced(announcement)
            }
            Topic::Question => {
                let question: Question = decode_json(payload).map_err(refused)?;
                question.check().map_err(refused)?;
                Input::Asked(question)
            }
            Topic::Answer(instructor) => {
                let answer: Answer = decode_json(payload).map_err(refused)?;
                Input::Answered(instructor, answer.at, answer.robot)
            }
            Topic::Status(_)
            | Topic::Alive(_)
            | Topic::Frame(_)
            | Topic::Taken(_)
            | Topic::Evidence
            | Topic::Roster
            | Topic::RosterFor(_)
            | Topic::Word(_)
            | Topic::Feedback(_) => return Err(MindError::Key(shortened(key))),
        };
        self.tell(now, input);
        Ok(())
    }

    /// Whether a message of that author and kind may come under that topic.
    fn belongs(&self, topic: &Topic, envelope: &Envelope) -> bool {
        let author = envelope.author;
        match (topic, &envelope.message) {
            (Topic::Vote(robot), Message::Vote(_)) | (Topic::RobotDecision(robot), Message::Holding(_)) => {
                author == *robot
            }
            (Topic::Sample(robot), Message::Samples(samples)) => {
                author == *robot && samples.first().is_some_and(|first| first.author == author)
            }
            (
                Topic::Repair(_),
                Message::Vote(_)
                | Message::Samples(_)
                | Message::Holding(_)
                | Message::Announced(_)
                | Message::Asked(_),
            ) => false,
            (Topic::Repair(to), _) => *to == self.settings.robot && author != self.settings.robot,
            _ => false,
        }
    }

    /// An envelope arrived by a radio that carries no keys: it names its author itself. What was not meant for this robot is for
    /// the host to leave out.
    ///
    /// # Errors
    /// [`MindError::Message`] and [`MindError::Mismatch`].
    pub fn received_envelope(&mut self, now: Duration, envelope: &[u8]) -> Result<(), MindError> {
        let envelope =
            Envelope::decode(envelope).map_err(|cause| MindError::Message { key: String::new(), cause })?;
        if let Message::Samples(samples) = &envelope.message
            && samples.first().is_none_or(|first| first.author != envelope.author)
        {
            return Err(MindError::Mismatch(String::new()));
        }
        self.tell(now, Input::Received(envelope));
        Ok(())
    }

    /// An instructor says something, as JSON ([`Instruction`]), at a time that is the same at every robot: any number that
    /// grows with every word of that instructor.
    ///
    /// # Errors
    /// [`MindError::Instructor`] and [`MindError::Message`].
    pub fn instructed(
        &mut self,
        now: Duration,
        instructor: &str,
        at: u64,
        word: &[u8],
    ) -> Result<(), MindError> {
        let by: InstructorId =
            instructor.parse().map_err(|_| MindError::Instructor(shortened(instructor)))?;
        let key = || self.keys.key(&Topic::Feedback(by.clone()));
        let instruction: Instruction =
            decode_json(word).map_err(|cause| MindError::Message { key: key(), cause })?;
        self.tell(now, Input::Instructed(Instructed { by, at, instruction, said: None }));
        Ok(())
    }

    /// Time has passed.
    pub fn tick(&mut self, now: Duration) {
        self.tell(now, Input::Tick);
    }

    /// A gesture is being shown: opens a round, unless one is open or was opened just now.
    pub fn open(&mut self, now: Duration) {
        self.tell(now, Input::Open);
    }

    /// Whether the camera shows nothing at all: a blind robot takes part, and need not be waited for.
    pub fn set_blind(&mut self, now: Duration, blind: bool) {
        self.tell(now, Input::Blind(blind));
    }

    /// The robots that are alive now; whether this one is among them makes no difference.
    ///
    /// # Errors
    /// [`MindError::TooMany`].
    pub fn set_alive(&mut self, now: Duration, robots: &[u32]) -> Result<(), MindError> {
        let robots = robots_of(robots)?;
        self.tell(now, Input::Alive(Arc::new(robots)));
        Ok(())
    }

    /// The robots this one can hear directly now, without itself: with them it compares what it knows.
    ///
    /// # Errors
    /// [`MindError::TooMany`] and [`MindError::Itself`].
    pub fn set_neighbours(&mut self, now: Duration, robots: &[u32]) -> Result<(), MindError> {
        let robots = robots_of(robots)?;
        if robots.contains(&self.settings.robot) {
            return Err(MindError::Itself(self.settings.robot));
        }
        self.tell(now, Input::Neighbours(robots));
        Ok(())
    }

    fn tell(&mut self, now: Duration, input: Input) {
        self.begun = true;
        let outputs = self.mind.handle(now, input);
        outputs.into_iter().for_each(|output| self.carry_out(output));
    }

    fn carry_out(&mut self, output: Output) {
        let me = self.settings.robot;
        match output {
            Output::Broadcast(envelope) => {
                let topic = match &envelope.message {
                    Message::Samples(_) => Topic::Sample(me),
                    Message::Holding(_) => Topic::RobotDecision(me),
                    _ => Topic::Vote(me),
                };
                self.say(&topic, None, false, envelope.encode());
            }
            Output::Tell(to, envelope) => self.say(&Topic::Repair(to), Some(to), false, envelope.encode()),
            Output::Announce(announcement) => self.say_json(&Topic::Decision, &announcement),
            Output::Ask(question) => self.say_json(&Topic::Question, &question),
            Output::Answer(instructor, answer) => self.say_json(&Topic::Answer(instructor), &answer),
            // The host asks what it holds, and whether a round is open.
            Output::Hold(_) | Output::Opened(_) | Output::Closed(_) => {}
            Output::Train(changes) => changes.into_iter().for_each(|change| self.untrained.add(change)),
            // A mind without a memory is owed nothing for it.
            Output::Remember { .. } => {}
        }
    }

    fn say_json(&mut self, topic: &Topic, value: &impl Serialize) {
        // Every value that a mind says has a spelling.
        let payload = serde_json::to_vec(value).unwrap_or_default();
        debug_assert!((1..=MAX_JSON).contains(&payload.len()), "{topic:?}");
        self.say(topic, None, true, payload);
    }

    fn say(&mut self, topic: &Topic, to: Option<RobotId>, json: bool, payload: Vec<u8>) {
        self.outbox.put(OutgoingMessage { key: self.keys.key(topic), to, json, payload });
    }

    /// The next message to carry; it stays until [`Self::next_message`] takes it.
    #[must_use]
    pub fn first_message(&self) -> Option<&OutgoingMessage> {
        self.outbox.first()
    }

    /// Takes the next message to carry.
    pub fn next_message(&mut self) -> Option<OutgoingMessage> {
        self.outbox.take()
    }

    /// When the mind wants its next [`Self::tick`], if nothing else comes before.
    #[must_use]
    pub fn next_wake(&self) -> Option<Duration> {
        self.mind.next_wake()
    }

    /// Whether this robot takes part in a round now: it should look.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.mind.is_open()
    }

    /// Whether samples came or went that the classifier has not followed.
    #[must_use]
    pub fn wants_training(&self) -> bool {
        !self.untrained.is_empty()
    }

    /// Makes the classifier follow its samples, and judges by it; whether there was anything to follow. It may take
    /// seconds: the host chooses when.
    ///
    /// # Errors
    /// [`MindError::Learner`] for a sample that cannot be trained on; the others are.
    pub fn train(&mut self, now: Duration) -> Result<bool, MindError> {
        let Some(learner) = self.learner.as_mut().filter(|_| !self.untrained.is_empty()) else {
            return Ok(false);
        };
        let mut first = None;
        self.untrained.take().teach(learner, |error| first = first.take().or(Some(error)));
        let classifier = learner.learn()?;
        self.judge_by(now, classifier);
        first.map_or(Ok(true), |error| Err(error.into()))
    }

    /// The decision held for the newest round, as JSON as it is announced; whether it is final is only known of one that was
    /// announced.
    #[must_use]
    pub fn decision(&self) -> Option<String> {
        let decision = self.mind.held()?;
        let mut value = json!(decision);
        value["label"] = json!(self.mind.label_of(decision));
        let (came_to, reason) = outcome(decision, self.mind.config());
        (value["outcome"], value["reason"]) = (json!(came_to), json!(reason));
        Some(value.to_string())
    }

    /// What is worth knowing of this mind, as JSON: its round, what it holds, what it has learned, and what it refused and lost
    /// so far, by cause.
    #[must_use]
    pub fn status(&self) -> String {
        let refused = self.mind.refusals().iter().filter(|(_, count)| *count > 0);
        let refused: serde_json::Map<_, _> =
            refused.map(|(cause, count)| (cause.name().to_owned(), json!(count))).collect();
        json!({
            "robot": self.settings.robot,
            "round": self.mind.round(),
            "open": self.mind.is_open(),
            "class": self.mind.held().and_then(|held| held.class),
            "vocabulary": self.mind.vocabulary().map(Vocabulary::labels),
            "learning": self.mind.learned(),
            "refused": refused,
            "untaken": self.outbox.dropped(),
        })
        .to_string()
    }
}

fn robots_of(robots: &[u32]) -> Result<BTreeSet<RobotId>, MindError> {
    if robots.len() > MAX_ROBOTS {
        return Err(MindError::TooMany { found: robots.len(), most: MAX_ROBOTS });
    }
    robots.iter().copied().map(RobotId).map(somebody).collect()
}

/// The robot, unless its number is that which means all.
fn somebody(robot: RobotId) -> Result<RobotId, MindError> {
    if robot.0 == u32::MAX { Err(MindError::Nobody(robot)) } else { Ok(robot) }
}

/// The beginning of a text of any length, for an error.
fn shortened(text: &str) -> String {
    text.chars().take(80).collect()
}
