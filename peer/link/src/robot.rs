//! A robot of a swarm, as the program around it holds it.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use gestalt_protocol::{Answer, Camera, Decision, InstructorId, Keys, RobotId, RoundId, SampleId, Status};
use gestalt_strategies::mind::Mind;
use gestalt_strategies::{Classify, Input, MindConfig, Observation, Vocabulary};
use tokio::runtime::{Handle, RuntimeFlavor};
use tokio::sync::{broadcast, mpsc, watch};
use tokio::task::JoinHandle;
use zenoh::Session;

use super::account::Account;
use super::apprentice::{Apprentice, Prepared, RobotLearning};
use super::guest::Guests;
use super::host::Host;
use super::identity::swarm_checksum;
use super::inbox::Inbox;
use super::keeper::Keeper;
use super::session::Node;
use super::{Announcement, LinkConfig, LinkError};

/// How many observations and instructions of the program may wait for the robot's task.
pub(super) const MAX_COMMANDS: usize = 1024;

/// How many events a receiver may lag behind before it misses some.
pub(super) const MAX_EVENTS: usize = 1024;

/// Everything a robot needs to take part in a swarm.
#[derive(Clone, Debug)]
pub struct RobotConfig {
    /// Which robot; no two robots of a swarm share an id.
    pub id: RobotId,
    /// Its name for people.
    pub name: String,
    /// Grows at every start of this robot, so that what it says outranks what it said before. A robot with a memory
    /// on disk counts its starts there, from this number on.
    pub boot: u32,
    /// The swarm's name: 1 to 64 of the characters `A-Z a-z 0-9 _ -`.
    pub swarm: String,
    /// How it takes part in rounds.
    pub mind: MindConfig,
    /// How it is linked to others.
    pub link: LinkConfig,
    /// The gestures' labels, for a robot that announces decisions without a classifier of its own.
    pub vocabulary: Option<Vocabulary>,
    /// How it learns; `None` for a robot that keeps to the classifier it is given.
    pub learning: Option<RobotLearning>,
    /// Differs at every start, see [`fresh_nonce`](super::fresh_nonce).
    pub nonce: u64,
}

/// What a robot lets the program around it know.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// It takes part in that round: show it frames.
    Opened(RoundId),
    /// That round is over for it.
    Closed(RoundId),
    /// It now holds that decision.
    Held(Decision),
    /// That decision was announced for the swarm, by this robot or another.
    Announced(Announcement),
    /// The robots it is linked to now.
    Neighbours(BTreeSet<RobotId>),
    /// The robots alive now, itself aside.
    Alive(BTreeSet<RobotId>),
    /// It shared these samples.
    Shared(Vec<SampleId>),
    /// It answered that instructor.
    Answered(InstructorId, Answer),
    /// All that it knew at that revision of its memory is on the disk.
    Remembered(u64),
}

/// A running robot. Dropping it ends it without waiting; [`Robot::stop`] waits until its session is closed.
#[derive(Debug)]
pub struct Robot {
    pub(super) account: Arc<Account>,
    pub(super) started: Instant,
    pub(super) commands: mpsc::Sender<Input>,
    pub(super) events: broadcast::Sender<Event>,
    /// For the first who asks: a link may stand before there was time to.
    pub(super) first_events: Mutex<Option<broadcast::Receiver<Event>>>,
    pub(super) classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
    pub(super) locators: Vec<String>,
    pub(super) host: JoinHandle<()>,
    pub(super) session: Session,
    pub(super) keys: Keys,
    pub(super) rounds: MindConfig,
    pub(super) lost_links: watch::Receiver<u64>,
    pub(super) guests: Arc<Guests>,
}

impl Robot {
    /// Starts a robot: opens its Zenoh session and takes part in the swarm from then on.
    ///
    /// # Errors
    /// See [`LinkError`]. Links that cannot be made yet are no error: they are tried for ever.
    pub async fn start(config: RobotConfig) -> Result<Self, LinkError> {
        if Handle::current().runtime_flavor() == RuntimeFlavor::CurrentThread {
            return Err(LinkError::Runtime);
        }
        let RobotConfig { id, name, boot, swarm, mind, link, vocabulary, learning, nonce } = config;
        let vocabulary = vocabulary.or_else(|| learning.as_ref().map(|learning| learning.vocabulary.clone()));
        let mut prepared = learning.map(|learning| Prepared::open(id, boot, learning)).transpose()?;
        let boot = prepared.as_ref().map_or(boot, |prepared| prepared.boot);
        let rounds = mind;
        let mut mind = Mind::new(id, boot, rounds.clone())?;
        if let Some(prepared) = &mut prepared {
            mind = mind.learning(prepared.setup(id))?;
        }
        let keys = Keys::new(&swarm)?;
        let zenoh = link.to_zenoh(id, &swarm, nonce)?;
        let started = Instant::now();
        let status = Status {
            vocabulary: vocabulary.as_ref().map(|v| v.labels().to_vec()).unwrap_or_default(),
            alive: vec![id],
            ..Status::new(id, name, boot)
        };
        let account = Arc::new(Account::new(status, started));
        let inbox =
            Arc::new(Inbox::new(id, swarm_checksum(&swarm), keys.clone(), account.clone(), link.loss));
        let mut first_classifier = None;
        let apprentice = match prepared {
            Some(prepared) => {
                first_classifier = prepared.classifier();
                Some(Apprentice::start(prepared, &inbox, &account)?)
            }
            None => None,
        };
        let on_link = {
            let inbox = inbox.clone();
            move |id, up| inbox.on_link(id, up)
        };
        let node = Node::open(zenoh.clone(), on_link).await?;
        let locators = node.locators();
        let (commands, command_queue) = mpsc::channel(MAX_COMMANDS);
        let (events, first_events) = broadcast::channel(MAX_EVENTS);
        let keeper = link.scouting.is_some().then(|| {
            Keeper::new(id, &swarm, link.max_links, node.clone(), inbox.clone(), account.clone(), zenoh)
        });
        account.lock().learning = apprentice.as_ref().and_then(|apprentice| apprentice.status(&mind));
        let classifier = Arc::new(Mutex::new(None));
        let guests = Arc::<Guests>::default();
        let (session, lost_links) = (node.session().clone(), inbox.lost_links());
        let host = Host {
            me: id,
            mind,
            started,
            node: node.clone(),
            keys: keys.clone(),
            inbox,
            account: account.clone(),
            commands: command_queue,
            guests: guests.clone(),
            events: events.clone(),
            vocabulary,
            apprentice,
            classifier: classifier.clone(),
        };
        let host = match host.declare().await {
            Ok(declared) => tokio::spawn(declared.run(keeper)),
            Err(error) => {
                node.close().await;
                return Err(error);
            }
        };
        let first_events = Mutex::new(Some(first_events));
        let robot = Self {
            account,
            started,
            commands,
            events,
            first_events,
            classifier,
            locators,
            host,
            session,
            keys,
            rounds,
            lost_links,
            guests,
        };
        if let Some(classifier) = first_classifier {
            robot.learned(classifier, "from before");
        }
        Ok(robot)
    }

    /// Says: a gesture is being shown now.
    pub fn open_round(&self) {
        self.tell(Input::Open);
    }

    /// Says: a hand moved from `began` on, and now holds still. See [`Input::Shown`].
    pub fn shown(&self, began: Instant) {
        self.tell(Input::Shown(began.saturating_duration_since(self.started)));
    }

    /// Says: the hand that held still is moving again, or gone. See [`Input::Left`].
    pub fn left(&self) {
        self.tell(Input::Left);
    }

    /// Says whether its camera shows anything at all, see [`Input::Blind`].
    pub fn blind(&self, blind: bool) {
        self.tell(Input::Blind(blind));
    }

    /// When it started: the zero of its own time.
    #[must_use]
    pub fn started(&self) -> Instant {
        self.started
    }

    /// Hands over what a frame showed.
    pub fn observe(&self, observation: Observation) {
        self.tell(Input::Observed(observation));
    }

    /// Puts a new classifier in the place of the old one. `model` is its name for people.
    pub fn learned(&self, classifier: Arc<dyn Classify>, model: &str) {
        let mut status = self.account.lock();
        status.vocabulary = classifier.vocabulary().labels().to_vec();
        model.clone_into(&mut status.model);
        drop(status);
        self.tell(Input::Learned(classifier));
    }

    /// The classifier it judges with now; `None` for one that has none yet.
    #[must_use]
    pub fn classifier(&self) -> Option<Arc<dyn Classify>> {
        self.classifier.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn tell(&self, input: Input) {
        if self.commands.try_send(input).is_err() {
            self.account.count("refused_command_full");
        }
    }

    /// What happens to it from now on; for who asks first, from its start on. A receiver that lags by more than 1,024
    /// events is told how many it missed.
    #[must_use]
    pub fn events(&self) -> broadcast::Receiver<Event> {
        let first = self.first_events.lock().unwrap_or_else(PoisonError::into_inner).take();
        first.unwrap_or_else(|| self.events.subscribe())
    }

    /// The round that it takes part in now.
    #[must_use]
    pub fn open(&self) -> Option<RoundId> {
        let status = self.account.lock();
        status.round.filter(|_| status.open)
    }

    /// Its account of itself, as the query on `robot/<id>/status` gives it.
    #[must_use]
    pub fn status(&self) -> Status {
        self.account.lock().clone()
    }

    /// Changes what the status says of its camera.
    pub fn update_camera(&self, change: impl FnOnce(&mut Camera)) {
        change(&mut self.account.lock().camera);
    }

    /// Puts an error of the program around it into its status.
    pub fn report_error(&self, what: &str) {
        self.account.error(what);
    }

    /// Adds to a counter of its status, by name.
    pub fn count(&self, name: &str) {
        self.account.count(name);
    }

    /// Sets a counter of its status that is kept elsewhere, by name.
    pub fn set(&self, name: &str, value: u64) {
        self.account.set(name, value);
    }

    /// The endpoints it listens on, with the ports it was given.
    #[must_use]
    pub fn locators(&self) -> &[String] {
        &self.locators
    }

    /// Leaves the swarm and waits until its session is closed.
    pub async fn stop(self) {
        drop(self.commands);
        if let Err(error) = self.host.await {
            tracing::error!("the robot's task ended badly: {error}");
        }
    }
}
