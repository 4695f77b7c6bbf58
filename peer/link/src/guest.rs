//! A robot without a mind of its own: it sees and votes through another robot's session, and that one decides.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gestalt_protocol::{RobotId, Status};
use gestalt_strategies::{Classify, Input, Voter};
use tokio::sync::{Notify, broadcast, mpsc};

use super::account::Account;
use super::presence::Presence;
use super::robot::{MAX_COMMANDS, MAX_EVENTS};
use super::{Event, LinkError, Robot};

/// A robot that is a guest of another.
#[derive(Clone, Debug)]
pub struct GuestConfig {
    /// Which robot; no two robots of a swarm share an id.
    pub id: RobotId,
    /// Its name for people.
    pub name: String,
    /// Grows at every start of this robot, so that what it says outranks what it said before.
    pub boot: u32,
}

/// The guests of one robot: its task is told of every change.
#[derive(Debug, Default)]
pub(super) struct Guests {
    state: Mutex<State>,
    changed: Notify,
}

#[derive(Debug, Default)]
struct State {
    present: BTreeSet<RobotId>,
    /// Those before which a hand holds still now.
    shown: BTreeSet<RobotId>,
}

impl Guests {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until a guest has come or gone since the last time.
    pub async fn changed(&self) {
        self.changed.notified().await;
    }

    pub fn present(&self) -> BTreeSet<RobotId> {
        self.lock().present.clone()
    }

    /// Adds a guest; `false` when there is one of that id.
    fn come(&self, guest: RobotId) -> bool {
        let new = self.lock().present.insert(guest);
        self.changed.notify_one();
        new
    }

    fn go(&self, guest: RobotId) {
        self.lock().present.remove(&guest);
        self.changed.notify_one();
    }

    /// A hand holds still before that guest.
    fn shown(&self, guest: RobotId) {
        self.lock().shown.insert(guest);
    }

    /// No hand holds still before that guest any more. Says whether it was the last one to see it: as long as one of them
    /// does, there is something to be seen.
    fn left(&self, guest: RobotId) -> bool {
        let mut state = self.lock();
        state.shown.remove(&guest) && state.shown.is_empty()
    }
}

impl Robot {
    /// Starts a robot that sees and votes through this one's session, while this one's mind decides for both. It has a
    /// liveliness token, a status and votes of its own. It leaves when it is stopped or dropped, or this robot is.
    ///
    /// # Errors
    /// [`LinkError::Guest`] when this robot has a guest of that id, or that id itself; [`LinkError::Open`] when the
    /// session is closed.
    pub async fn guest(&self, config: GuestConfig) -> Result<Self, LinkError> {
        let GuestConfig { id, name, boot } = config;
        let host = self.account.lock().robot;
        if id == host || !self.guests.come(id) {
            return Err(LinkError::Guest(id));
        }
        let departure = Departure { guest: id, guests: self.guests.clone(), host: self.commands.downgrade() };
        let voter = Voter::new(id, boot, self.rounds.clone())?;
        let vocabulary = self.account.lock().vocabulary.clone();
        let status = Status { vocabulary, neighbours: vec![host], ..Status::new(id, name, boot) };
        let account = Arc::new(Account::new(status, self.started));
        let lost_links = self.lost_links.clone();
        let presence = Presence::declare(&self.session, &self.keys, id, account.clone(), lost_links)
            .await
            .map_err(|error| LinkError::open(&*error))?;
        let (commands, command_queue) = mpsc::channel(MAX_COMMANDS);
        let (events, first_events) = broadcast::channel(MAX_EVENTS);
        let classifier = Arc::default();
        let guest = Guest {
            voter,
            presence,
            account: account.clone(),
            host_account: self.account.clone(),
            commands: command_queue,
            events: events.clone(),
            classifier: Arc::clone(&classifier),
            departure,
        };
        let host_events = self.events.subscribe();
        let task = tokio::spawn(guest.run(host_events));
        Ok(Self {
            account,
            started: self.started,
            commands,
            events,
            first_events: Mutex::new(Some(first_events)),
            classifier,
            locators: self.locators.clone(),
            host: task,
            session: self.session.clone(),
            keys: self.keys.clone(),
            rounds: self.rounds.clone(),
            lost_links: self.lost_links.clone(),
            guests: Arc::default(),
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
    events: broadcast::Sender<Event>,
    classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
    departure: Departure,
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
        loop {
            let wake = self.voter.next_wake().map(|wake| self.account.started() + wake);
            tokio::select! {
                command = self.commands.recv() => match command {
                    Some(command) => self.command(command).await,
                    None => break,
                },
                event = host_events.recv() => match event {
                    Ok(event) => self.on_event(event),
                    Err(broadcast::error::RecvError::Lagged(_)) => self.catch_up(),
                    Err(broadcast::error::RecvError::Closed) => break,
                },
                () = super::host::sleep_until(wake) => {}
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
            Event::Announced(_) => {}
            // What the host alone lives through.
            Event::Held(_)
            | Event::Neighbours(_)
            | Event::Shared(_)
            | Event::Answered(..)
            | Event::Remembered(_) => return,
        }
        // An error says that nobody listens, which is fine.
        let _ = self.events.send(event);
    }

    fn note_alive(&self, robots: impl IntoIterator<Item = RobotId>) {
        let alive: BTreeSet<RobotId> = robots.into_iter().chain([self.departure.guest]).collect();
        self.account.lock().alive = alive.into_iter().collect();
    }

    async fn command(&mut self, command: Input) {
        match command {
            Input::Observed(observation) => {
                if !self.voter.observed(self.account.started().elapsed(), &observation) {
                    self.account.count(gestalt_strategies::Refusal::Unclassified.name());
                }
            }
            Input::Learned(classifier) => {
                self.voter.learned(classifier.clone());
                *self.classifier.lock().unwrap_or_else(PoisonError::into_inner) = Some(classifier);
            }
            Input::Blind(blind) => self.voter.blind(blind),
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
