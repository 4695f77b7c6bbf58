//! A robot of a swarm, as the program around it holds it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use gestalt_protocol::{Camera, Keys, RobotId, RoundId, Status};
use gestalt_strategies::{Classify, Fuse, Input, MindConfig, Observation, Vocabulary, is_refuted};
use gestalt_trust::{Channels, Judge};
use serde_json::Value;
use tokio::runtime::{Handle, RuntimeFlavor};
use tokio::sync::{broadcast, mpsc, watch};
use tokio::task::JoinHandle;
use zenoh::Session;

use crate::account::Account;
use crate::apprentice::{Apprentice, Prepared, RobotLearning};
use crate::cells::{CellKeeper, Foundation};
use crate::census::take_census;
use crate::config::LinkConfig;
use crate::deafness::mend_deafness;
use crate::effector::Effector;
use crate::error::LinkError;
use crate::event::{Event, MAX_COMMANDS, MAX_EVENTS};
use crate::failure::{Failure, Part};
use crate::given::Given;
use crate::guard::Sight;
use crate::guests::Guests;
use crate::host::Host;
use crate::identity::{self, swarm_checksum};
use crate::inbox::{Inbox, Sealed};
use crate::keeper::Keeper;
use crate::lookout::Lookout;
use crate::mind::new_mind;
use crate::outbox::Outbox;
use crate::presence::Presence;
use crate::roll::Roll;
use crate::roll_call::keep_roll;
use crate::seal::{Seal, SealError};
use crate::session::{Guard, Node};
use crate::subscriptions::listen;
use crate::supervisor::{Supervisor, run_apart, watch_session};
use crate::voice::Voice;
use crate::words::Words;

/// Everything a robot needs to take part in a swarm.
#[derive(Clone, Debug)]
pub struct RobotConfig {
    /// Which robot; no two robots of a swarm share an id.
    pub id: RobotId,
    /// Its name for people.
    pub name: String,
    /// Grows at every start of this robot, so that what it says outranks what it said before: see [`boot_number`](super::boot_number).
    /// A number that comes twice convicts a sealed robot for good, see [`counted_boot`](super::counted_boot). A robot with a memory on
    /// disk counts its starts there, from this number on.
    pub boot: u32,
    /// The swarm's name: 1 to 64 of the characters `A-Z a-z 0-9 _ -`.
    pub swarm: String,
    /// How it takes part in rounds.
    pub mind: MindConfig,
    /// Your own fusion rule, in place of the one that `mind` names: the same at all robots of a swarm.
    pub fusion: Option<Arc<dyn Fuse>>,
    /// How it is linked to others.
    pub link: LinkConfig,
    /// The gestures' labels, for a robot that announces decisions without a classifier of its own.
    pub vocabulary: Option<Vocabulary>,
    /// How it learns; `None` for a robot that keeps to the classifier it is given.
    pub learning: Option<RobotLearning>,
    /// Differs at every start, see [`fresh_nonce`](super::fresh_nonce).
    pub nonce: u64,
    /// What makes it one of a sealed swarm; `None` for an open one, in which robots are who they say they are.
    pub seal: Option<Seal>,
}

/// A running robot. Dropping it ends it without waiting; [`Robot::stop`] waits until its session is closed.
#[derive(Debug)]
pub struct Robot {
    pub(super) account: Arc<Account>,
    pub(super) supervisor: Arc<Supervisor>,
    pub(super) started: Instant,
    pub(super) commands: mpsc::Sender<Input>,
    pub(super) given: Arc<Given>,
    pub(super) events: broadcast::Sender<Event>,
    /// For the first who asks: a link may stand before there was time to.
    pub(super) first_events: Mutex<Option<broadcast::Receiver<Event>>>,
    pub(super) classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
    pub(super) locators: Vec<String>,
    pub(super) host: JoinHandle<()>,
    pub(super) session: Session,
    pub(super) keys: Keys,
    pub(super) inbox: Arc<Inbox>,
    pub(super) rounds: MindConfig,
    pub(super) lost_links: watch::Receiver<u64>,
    pub(super) guests: Arc<Guests>,
    pub(super) seal: Option<Arc<Seal>>,
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
        let RobotConfig { id, name, boot, swarm, mind, fusion, mut link, vocabulary, learning, nonce, seal } =
            config;
        seal.as_ref().map_or(Ok(()), |seal| seal.check(id, &swarm))?;
        let seal = seal.map(Arc::new);
        let credentials = seal.as_ref().map(|seal| seal.credentials(id)).transpose();
        link.credentials = credentials.map_err(SealError::from)?;
        let vocabulary = vocabulary.or_else(|| learning.as_ref().map(|learning| learning.vocabulary.clone()));
        let mut prepared = learning.map(|learning| Prepared::open(id, boot, learning)).transpose()?;
        let boot = prepared.as_ref().map_or(boot, |prepared| prepared.boot);
        let rounds = mind;
        let mut mind = new_mind(
            id,
            identity::life(boot, nonce),
            rounds.clone(),
            fusion.clone(),
            seal.as_deref(),
            vocabulary.clone(),
        )?;
        if let Some(prepared) = &mut prepared {
            mind = prepared.bring_up(mind)?;
        }
        let keys = Keys::new(&swarm)?;
        let zenoh = link.to_zenoh(id, &swarm, nonce)?;
        let started = Instant::now();
        let status = Status {
            vocabulary: vocabulary.as_ref().map(|v| v.labels().to_vec()).unwrap_or_default(),
            alive: vec![id],
            sealed: seal.is_some(),
            rounds: rounds_in_words(mind.config()),
            ..Status::new(id, name, boot)
        };
        let account = Arc::new(Account::new(status, started));
        let (events, first_events) = broadcast::channel(MAX_EVENTS);
        let supervisor = Supervisor::new(account.clone(), events.clone());
        let sealed = seal.as_ref().map(|seal| {
            let Seal { identity, roster, roster_file, .. } = &**seal;
            let key = identity.public_key();
            let roll = Roll::new(id, key, roster.clone(), roster_file.clone(), account.clone());
            let words = Words::new(id, identity.clone(), roster.swarm_id(), keys.clone());
            let channels = Channels::new(id, identity.clone(), roster.swarm_id());
            Sealed {
                judge: Mutex::new(Judge::new(roster.clone(), is_refuted)),
                roll: Arc::new(roll),
                words: Mutex::new(words),
                channels: Mutex::new(channels),
            }
        });
        let roll = sealed.as_ref().map(|sealed| sealed.roll.clone());
        let inbox = Arc::new(Inbox::new(
            id,
            swarm_checksum(&swarm),
            keys.clone(),
            account.clone(),
            link.loss,
            sealed,
        ));
        inbox.recall();
        let mut first_classifier = None;
        let apprentice = match prepared {
            Some(prepared) => {
                first_classifier = prepared.classifier();
                Some(Apprentice::start(prepared, id, &inbox, &account, &supervisor)?)
            }
            None => None,
        };
        let door = roll.as_ref().map(|roll| roll.door());
        let lookout =
            Arc::new(Lookout::new(id, &swarm, nonce, inbox.clone(), supervisor.clone(), zenoh.clone()));
        let cell = link.cells.map(|cells| {
            let (swarm, link, door, inbox) = (swarm.clone(), link.clone(), door.clone(), inbox.clone());
            let (account, lookout, keys) = (account.clone(), lookout.clone(), keys.clone());
            let foundation =
                Foundation { me: id, swarm, keys, nonce, link, cells, door, inbox, account, lookout };
            Arc::new(CellKeeper::new(foundation))
        });
        let on_link = {
            let (inbox, cell) = (inbox.clone(), cell.clone());
            move |far, up| match &cell {
                Some(cell) => cell.on_link(far, up),
                None => inbox.on_link(far, up),
            }
        };
        let guard =
            door.map(|door| Guard { swarm: swarm_checksum(&swarm), door, account: Some(account.clone()) });
        let node = Node::open(zenoh, guard, None, on_link).await?;
        let locators = node.locators();
        account.lock().learning = apprentice.as_ref().and_then(|apprentice| apprentice.status(&mind));
        let declared = declare(id, &node, &keys, &inbox, &account, &supervisor).await;
        let voice = match declared {
            Ok(voice) => voice,
            Err(error) => {
                supervisor.stop().await;
                node.close().await;
                return Err(error);
            }
        };
        if let Some(cell) = cell.clone() {
            let node = node.clone();
            supervisor.keep(Part::Links, move || cell.clone().run(node.clone()));
        } else if link.scouting.is_some() {
            let (node, inbox, account) = (node.clone(), inbox.clone(), account.clone());
            supervisor.keep(Part::Links, move || {
                let (node, inbox, account) = (node.clone(), inbox.clone(), account.clone());
                Keeper::new(id, link.max_links, node, inbox, account, lookout.clone(), false).run()
            });
        }
        if let Some(roll) = roll {
            let (account, node, keys, inbox) = (account.clone(), node.clone(), keys.clone(), inbox.clone());
            supervisor.keep(Part::Roster, move || {
                keep_roll(roll.clone(), account.clone(), node.clone(), keys.clone(), inbox.clone())
            });
        }
        let (linked, heard, mended, idle) =
            (node.clone(), inbox.clone(), account.clone(), rounds.repair_idle);
        let most = link.cells.map_or(0, |cells| cells.size);
        supervisor.keep(Part::Deafness, move || {
            mend_deafness(linked.clone(), heard.clone(), mended.clone(), idle, most)
        });
        let (of_census, of_keys, counted) = (node.clone(), keys.clone(), inbox.clone());
        supervisor
            .keep(Part::Census, move || take_census(of_census.clone(), of_keys.clone(), counted.clone()));
        let (of_ways, in_use, of_node) = (inbox.clone(), keys.clone(), node.clone());
        supervisor.keep(Part::Links, move || {
            let (inbox, node, keys) = (of_ways.clone(), of_node.clone(), in_use.clone());
            async move { inbox.ways.keep(node, keys).await }
        });
        let (watched, watching) = (node.session().clone(), supervisor.clone());
        supervisor.keep(Part::Session, move || watch_session(watched.clone(), watching.clone()));
        let (commands, command_queue) = mpsc::channel(MAX_COMMANDS);
        let (classifier, given, guests) = (Arc::default(), Arc::<Given>::default(), Arc::<Guests>::default());
        let (session, lost_links) = (node.session().clone(), inbox.lost_links());
        let host = Host {
            me: id,
            fusion,
            seal: seal.clone(),
            mind,
            started,
            inbox: inbox.clone(),
            supervisor: supervisor.clone(),
            commands: command_queue,
            given: given.clone(),
            guests: guests.clone(),
            classifier: Arc::clone(&classifier),
            effector: Effector { account: account.clone(), events: events.clone(), apprentice, voice },
            sight: Sight::new(supervisor.clone()),
        };
        let robot = Self {
            account,
            started,
            commands,
            given,
            events,
            first_events: Mutex::new(Some(first_events)),
            classifier,
            locators,
            host: tokio::spawn(serve(host, supervisor.clone(), node, cell)),
            supervisor,
            session,
            keys,
            inbox,
            rounds,
            lost_links,
            guests,
            seal,
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

    /// Puts a new classifier in the place of the old one. `model` is its name for people, in the status as soon as it is in use.
    pub fn learned(&self, classifier: Arc<dyn Classify>, model: &str) {
        self.given.put(classifier, model);
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

    /// The endpoint that other robots dial: with TLS in a sealed swarm.
    #[must_use]
    pub fn for_robots(&self) -> Option<&str> {
        let tls = self.locators.iter().find(|locator| locator.starts_with("tls/"));
        tls.or(self.locators.first()).map(String::as_str)
    }

    /// The endpoint that clients on this computer attach to: without a key also in a sealed swarm.
    #[must_use]
    pub fn for_clients(&self) -> Option<&str> {
        let plain = self.locators.iter().find(|locator| locator.starts_with("tcp/"));
        plain.or(self.locators.first()).map(String::as_str)
    }

    /// The endpoints it listens on, with the ports it was given.
    #[must_use]
    pub fn locators(&self) -> &[String] {
        &self.locators
    }

    /// Waits until the robot has ended though nobody stopped it: a part of it failed that it cannot do without. Its status
    /// stays readable here; all it could still write is written, and its session is closed, when [`Robot::stop`] returns.
    pub async fn ended(&self) -> Failure {
        self.supervisor.ended().await
    }

    /// Makes a part of this robot panic, so that a test sees what becomes of it.
    #[cfg(any(test, feature = "test-hooks"))]
    pub fn make_fail(&self, part: Part) {
        self.supervisor.make_fail(part);
    }

    /// Leaves the swarm and waits until its session is closed.
    pub async fn stop(self) {
        drop(self.commands);
        if let Err(error) = self.host.await {
            tracing::error!("the robot's task ended badly: {error}");
        }
    }
}

/// The parameters of a robot's rounds, as its status says them.
///
/// # Panics
/// Never: parameters have a place in JSON.
#[must_use]
pub fn rounds_in_words(rounds: &MindConfig) -> BTreeMap<String, Value> {
    match serde_json::to_value(rounds).expect("parameters, with string keys, have a place in JSON") {
        Value::Object(rounds) => rounds.into_iter().collect(),
        _ => BTreeMap::new(),
    }
}

/// Makes a robot known to the swarm.
async fn declare(
    id: RobotId,
    node: &Node,
    keys: &Keys,
    inbox: &Arc<Inbox>,
    account: &Arc<Account>,
    supervisor: &Arc<Supervisor>,
) -> Result<Voice, LinkError> {
    let session = node.session();
    let outbox = Outbox::start(session.clone(), account.clone(), supervisor.clone())?;
    let declared = async {
        listen(session, keys, id, inbox).await?;
        let lost_links = inbox.lost_links();
        let presence = Presence::declare(session, keys, id, account.clone(), lost_links, supervisor).await?;
        Voice::declare(id, session, keys, inbox.clone(), outbox, presence, account.clone()).await
    };
    declared.await.map_err(|error| LinkError::open(&*error))
}

/// Runs the mind's task, and all that is kept beside it, to the end.
async fn serve(host: Host, supervisor: Arc<Supervisor>, node: Node, cell: Option<Arc<CellKeeper>>) {
    if let Err(cause) = run_apart(supervisor.clone(), Part::Mind, host.run()).await {
        supervisor.end(Part::Mind, cause);
    }
    supervisor.stop().await;
    node.close().await;
    if let Some(cell) = cell {
        cell.close().await;
    }
}
