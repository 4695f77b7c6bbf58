//! A robot without a mind of its own: it sees and votes through another robot's session, and that one decides.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_protocol::{Holding, RobotId, Status};
use gestalt_strategies::{Classify, Input, Voter};
use gestalt_trust::Identity;
use tokio::sync::{broadcast, mpsc};

use crate::account::Account;
use crate::error::LinkError;
use crate::event::{Event, MAX_COMMANDS, MAX_EVENTS};
use crate::failure::{Failure, Part};
use crate::given::Given;
use crate::guard::Sight;
use crate::guests::Guests;
use crate::inbox::Inbox;
use crate::presence::Presence;
use crate::robot::Robot;
use crate::seal::{Seal, SealError};
use crate::supervisor::{Supervisor, run_apart};
use crate::wake::sleep_until;

/// A robot that is a guest of another.
#[derive(Clone, Debug)]
pub struct GuestConfig {
    /// Which robot; no two robots of a swarm share an id.
    pub id: RobotId,
    /// Its name for people.
    pub name: String,
    /// Grows at every start of this robot, so that what it says outranks what it said before.
    pub boot: u32,
    /// Its key in a sealed swarm; `None` in an open one.
    pub identity: Option<Arc<Identity>>,
}

impl Robot {
    /// Whether the swarm's newest roster has this robot with its key: in an open swarm, always.
    #[must_use]
    pub fn is_enrolled(&self) -> bool {
        let robot = self.account.lock().robot;
        self.inbox.enrols(robot, self.seal.as_deref())
    }

    /// Starts a robot that sees and votes through this one's session, while this one's mind decides for both. It has a
    /// liveliness token, a status and votes of its own. It leaves when it is stopped or dropped, or this robot is.
    ///
    /// # Errors
    /// [`LinkError::Guest`] when this robot has a guest of that id, or that id itself; [`LinkError::Seal`] when the roster does not have
    /// it with the key that is here; [`LinkError::Open`] when the session is closed.
    pub async fn guest(&self, config: GuestConfig) -> Result<Self, LinkError> {
        let GuestConfig { id, name, boot, identity } = config;
        let host = self.account.lock().robot;
        if id == host || !self.guests.come(id) {
            return Err(LinkError::Guest(id));
        }
        let departure = Departure { guest: id, guests: self.guests.clone(), host: self.commands.downgrade() };
        let mut voter = Voter::new(id, boot, self.rounds.clone())?;
        let seal =
            self.seal.as_deref().zip(identity).map(|(seal, identity)| Arc::new(seal.of_guest(identity)));
        if self.seal.is_some() {
            let own = seal.as_deref().filter(|own| self.inbox.enrols(id, Some(own)));
            voter = voter.signed_by(own.ok_or(SealError::NotEnrolled(id))?.signer());
        }
        let Status { vocabulary, rounds, .. } = self.account.lock().clone();
        let status = Status {
            vocabulary,
            neighbours: vec![host],
            sealed: self.seal.is_some(),
            rounds,
            ..Status::new(id, name, boot)
        };
        let account = Arc::new(Account::new(status, self.started));
        let (events, first_events) = broadcast::channel(MAX_EVENTS);
        let supervisor = Supervisor::new(account.clone(), events.clone());
        let lost_links = self.lost_links.clone();
        let presence =
            Presence::declare(&self.session, &self.keys, id, account.clone(), lost_links, &supervisor)
                .await
                .map_err(|error| LinkError::open(&*error))?;
        let (commands, command_queue) = mpsc::channel(MAX_COMMANDS);
        let (given, classifier) = (Arc::<Given>::default(), Arc::default());
        let guest = Guest {
            voter,
            presence,
            account: account.clone(),
            host_account: self.account.clone(),
            commands: command_queue,
            given: given.clone(),
            events: events.clone(),
            classifier: Arc::clone(&classifier),
            departure,
            sight: Sight::new(supervisor.clone()),
            seal: seal.clone(),
            inbox: self.inbox.clone(),
        };
        let (host_events, host_ended) = (self.events.subscribe(), self.supervisor.ended());
        let task = tokio::spawn(serve(guest, host_events, host_ended, supervisor.clone()));
        Ok(Self {
            account,
            started: self.started,
            commands,
            given,
            events,
            first_events: Mutex::new(Some(first_events)),
            classifier,
            locators: self.locators.clone(),
            host: task,
            supervisor,
            session: self.session.clone(),
            keys: self.keys.clone(),
            inbox: self.inbox.clone(),
            rounds: self.rounds.clone(),
            lost_links: self.lost_links.clone(),
            guests: Arc::default(),
            seal,
        })
    }
}

/// The task of one guest.
struct Guest {
    voter: Voter,
    presence: Presence,
    account: Arc<Account>,
    host_account: Arc<Account>,
    commands: mpsc::Receiver<Input>,
    given: Arc<Given>,
    events: broadcast::Sender<Event>,
    classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
    departure: Departure,
    sight: Sight,
    seal: Option<Arc<Seal>>,
    inbox: Arc<Inbox>,
}

/// Runs a guest's task, and what is kept beside it, to the end.
async fn serve(
    guest: Guest,
    host_events: broadcast::Receiver<Event>,
    host_ended: impl Future<Output = Failure> + Send + 'static,
    supervisor: Arc<Supervisor>,
) {
    let run = async move {
        tokio::select! {
            () = guest.run(host_events) => Ok(()),
            failure = host_ended => Err(failure),
        }
    };
    match run_apart(supervisor.clone(), Part::Mind, run).await {
        Ok(Ok(())) => {}
        Ok(Err(failure)) => supervisor.end(Part::Host, failure.to_string()),
        Err(cause) => supervisor.end(Part::Mind, cause),
    }
    supervisor.stop().await;
}

/// Takes a guest off the host's list when it is dropped.
struct Departure {
    guest: RobotId,
    guests: Arc<Guests>,
    /// Weak: guests do not keep their host.
    host: mpsc::WeakSender<Input>,
}

impl Drop for Departure {
    fn drop(&mut self) {
        self.guests.go(self.guest);
        if self.guests.left(self.guest)
            && let Some(host) = self.host.upgrade()
        {
            // A host that is gone, or too busy to be told, ends the round by its deadline.
            let _ = host.try_send(Input::Left);
        }
    }
}

impl Guest {
    /// Runs until the robot's handle is gone, or the host is.
    async fn run(mut self, mut host_events: broadcast::Receiver<Event>) {
        self.catch_up();
        let given = self.given.clone();
        loop {
            let wake = self.voter.next_wake().map(|wake| self.account.started() + wake);
            tokio::select! {
                command = self.commands.recv() => match command {
                    Some(command) => {
                        self.take_given();
                        self.command(command).await;
                    }
                    None => break,
                },
                () = given.there() => self.take_given(),
                event = host_events.recv() => match event {
                    Ok(Event::Holding(holding)) => self.hold(holding).await,
                    Ok(event) => self.on_event(event),
                    Err(broadcast::error::RecvError::Lagged(_)) => self.catch_up(),
                    Err(broadcast::error::RecvError::Closed) => break,
                },
                () = sleep_until(wake) => {}
            }
            // The host takes what it says as it comes.
            if !self.inbox.enrols(self.departure.guest, self.seal.as_deref()) {
                self.account.count("expelled");
                break;
            }
            // The classifier may just have failed.
            if let Some(blind) = self.sight.news() {
                self.voter.blind(blind);
            }
            if let Some(vote) = self.voter.speak(self.account.started().elapsed()) {
                self.presence.vote(&vote);
                self.tell_host(Input::Received(vote)).await;
            }
        }
    }

    /// Takes over where the host stands.
    fn catch_up(&mut self) {
        let (round, open, alive) = {
            let host = self.host_account.lock();
            (host.round, host.open, host.alive.clone())
        };
        self.note_alive(alive);
        match round {
            Some(round) if open => self.on_event(Event::Opened(round)),
            Some(round) if self.voter.round().is_some() => self.on_event(Event::Closed(round)),
            _ => {}
        }
    }

    fn on_event(&mut self, event: Event) {
        match &event {
            Event::Opened(round) => {
                self.voter.opened(self.account.started().elapsed(), *round);
                let mut status = self.account.lock();
                (status.round, status.open) = (Some(*round), true);
            }
            Event::Closed(round) => {
                self.voter.closed();
                let mut status = self.account.lock();
                (status.round, status.open) = (Some(*round), false);
            }
            Event::Alive(robots) => {
                let host = self.host_account.lock().robot;
                self.note_alive(robots.iter().copied().chain([host]));
            }
            Event::Announced(_) | Event::Asked(_) => {}
            // What the host alone lives through.
            Event::Held(_)
            | Event::Holding(_)
            | Event::Neighbours(_)
            | Event::Shared(_)
            | Event::Answered(..)
            | Event::Remembered(_)
            | Event::Failed { .. } => return,
        }
        // An error says that nobody listens, which is fine.
        let _ = self.events.send(event);
    }

    /// Says that it holds what its host does.
    async fn hold(&mut self, holding: Holding) {
        if let Some(said) = self.voter.holds(holding) {
            self.presence.hold(&said);
            self.tell_host(Input::Received(said)).await;
        }
    }

    fn note_alive(&self, robots: impl IntoIterator<Item = RobotId>) {
        let alive: BTreeSet<RobotId> = robots.into_iter().chain([self.departure.guest]).collect();
        self.account.lock().alive = alive.into_iter().collect();
    }

    /// Takes up the classifier that the program gave last, if it has not yet.
    fn take_given(&mut self) {
        let Some((classifier, model)) = self.given.take() else { return };
        let Some(guarded) = self.sight.guard(classifier.clone()) else { return };
        self.account.judges_with(guarded.vocabulary(), model);
        self.voter.learned(guarded);
        *self.classifier.lock().unwrap_or_else(PoisonError::into_inner) = Some(classifier);
    }

    async fn command(&mut self, command: Input) {
        match command {
            Input::Observed(observation) => {
                if !self.voter.observed(self.account.started().elapsed(), &observation) {
                    self.account.count(gestalt_strategies::Refusal::Unclassified.name());
                }
            }
            Input::Blind(blind) => self.sight.told(blind),
            Input::Shown(_) => {
                self.departure.guests.shown(self.departure.guest);
                self.tell_host(command).await;
            }
            Input::Left => {
                if self.departure.guests.left(self.departure.guest) {
                    self.tell_host(Input::Left).await;
                }
            }
            other => self.tell_host(other).await,
        }
    }

    async fn tell_host(&self, input: Input) {
        if let Some(host) = self.departure.host.upgrade() {
            // A host that has gone ends its guests by their events.
            let _ = host.send(input).await;
        }
    }
}
