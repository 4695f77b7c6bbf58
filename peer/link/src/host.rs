//! The one task that owns a robot's mind: what arrives goes in, what comes out is carried out.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use gestalt_protocol::RobotId;
use gestalt_strategies::mind::Mind;
use gestalt_strategies::{Classify, Fuse, Input};
use tokio::sync::mpsc;

use crate::apprentice::Apprentice;
use crate::effector::Effector;
use crate::event::Event;
use crate::given::Given;
use crate::guard::Sight;
use crate::guests::Guests;
use crate::identity::{self, fresh_nonce};
use crate::inbox::Inbox;
use crate::memory::Found;
use crate::mind::new_mind;
use crate::seal::Seal;
use crate::supervisor::Supervisor;
use crate::wake::sleep_until;

/// The mind, and everything around it that its task needs.
pub(crate) struct Host {
    pub me: RobotId,
    pub mind: Mind,
    pub started: Instant,
    pub inbox: Arc<Inbox>,
    pub supervisor: Arc<Supervisor>,
    pub commands: mpsc::Receiver<Input>,
    pub given: Arc<Given>,
    pub guests: Arc<Guests>,
    /// Your own fusion rule.
    pub fusion: Option<Arc<dyn Fuse>>,
    pub seal: Option<Arc<Seal>>,
    /// For the program around the robot to look at.
    pub classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
    pub effector: Effector,
    pub sight: Sight,
}

impl Host {
    /// Serves the mind until the robot's handle is gone, or a part has failed that it cannot do without.
    pub async fn run(mut self) {
        let (inbox, guests, given) = (self.inbox.clone(), self.guests.clone(), self.given.clone());
        let ended = self.supervisor.ended();
        tokio::pin!(ended);
        self.believe();
        loop {
            let wake = self.mind.next_wake().map(|wake| self.started + wake);
            let wake = wake.into_iter().chain(self.effector.voice.due()).min();
            tokio::select! {
                () = inbox.ready() => {
                    for input in inbox.take() {
                        self.step(input);
                    }
                    self.effector.voice.accuse();
                    self.effector.voice.pass_on();
                }
                command = self.commands.recv() => match command {
                    Some(input) => {
                        self.take_given();
                        self.step(input);
                    }
                    None => break,
                },
                () = given.there() => self.take_given(),
                found = found(&mut self.effector.apprentice) => self.take_up(found),
                () = guests.changed() => self.step(Input::Guests(guests.present())),
                () = sleep_until(wake) => self.step(Input::Tick),
                _ = &mut ended => break,
            }
        }
        // What is still to be written and said is, before the robot is gone.
        tokio::task::block_in_place(|| drop(self));
    }

    /// Takes up the classifier that the program gave last, if it has not yet.
    fn take_given(&mut self) {
        let Some((classifier, model)) = self.given.take() else { return };
        let Some(input) = self.note(Input::Learned(classifier)) else { return };
        if let Input::Learned(guarded) = &input {
            self.effector.account.judges_with(guarded.vocabulary(), model);
        }
        self.take_in(input);
    }

    fn step(&mut self, input: Input) {
        let Some(input) = self.note(input) else { return };
        let announced =
            if let Input::Announced(announcement) = &input { Some(announcement.clone()) } else { None };
        self.take_in(input);
        // Whoever acts on it is told of none that this robot refuses.
        if let Some(announcement) = announced.filter(|_| self.mind.announcement_stands()) {
            self.effector.tell(Event::Announced(announcement));
        }
    }

    fn take_in(&mut self, input: Input) {
        self.handle(input);
        // The classifier may just have failed.
        if let Some(blind) = self.sight.news() {
            self.handle(Input::Blind(blind));
        }
        self.effector.voice.publish_hold(&mut self.mind);
        self.inbox.note_contradictions(self.mind.take_contradictions());
        self.report_learning();
        for (refusal, count) in self.mind.refusals().iter() {
            if count > 0 {
                self.effector.account.set(refusal.name(), count);
            }
        }
    }

    /// In a sealed swarm: the mind is told who may teach.
    fn believe(&mut self) {
        if let Some(believer) = self.inbox.believer() {
            self.handle(Input::Believe(believer));
        }
    }

    fn handle(&mut self, input: Input) {
        // Each output at once: the program is told of a decision before the robot signs that it holds it.
        let effector = &mut self.effector;
        self.mind.handle_into(self.started.elapsed(), input, &mut |output| effector.carry_out(output));
    }

    /// Tells the program of what arrives, and says what of it is for the mind.
    fn note(&mut self, input: Input) -> Option<Input> {
        match &input {
            Input::Alive(alive) => {
                self.tell_alive(&**alive | &self.guests.present());
            }
            Input::Guests(guests) => {
                let tokens = self.inbox.tokens();
                self.tell_alive(&tokens | guests);
            }
            Input::Neighbours(neighbours) => {
                self.effector.account.lock().neighbours = neighbours.iter().copied().collect();
                self.effector.tell(Event::Neighbours(neighbours.clone()));
            }
            Input::Asked(question) => self.effector.tell(Event::Asked(question.clone())),
            Input::Learned(classifier) => {
                let guarded = self.sight.guard(classifier.clone())?;
                *self.classifier.lock().unwrap_or_else(PoisonError::into_inner) = Some(classifier.clone());
                return Some(Input::Learned(guarded));
            }
            // Blind is also one whose classifier failed, whatever its camera shows.
            Input::Blind(blind) => {
                self.sight.told(*blind);
                return Some(Input::Tick);
            }
            Input::Remembered(revision) => self.effector.tell(Event::Remembered(*revision)),
            _ => {}
        }
        Some(input)
    }

    /// Begins anew with what this robot knew before, on a disk that came late. What it learned since its start was
    /// acknowledged to nobody; of that, what others know comes back from them.
    fn take_up(&mut self, found: Found) {
        let Some(apprentice) = &self.effector.apprentice else { return };
        let Found { memory, classifier, boot } = found;
        let learning = apprentice.learning().clone();
        // Its rounds are counted anew from what is remembered: another life, by name too.
        let life = identity::life(boot, fresh_nonce());
        let mind = new_mind(
            self.me,
            life,
            self.mind.config().clone(),
            self.fusion.clone(),
            self.seal.as_deref(),
            None,
        )
        .map_err(|error| error.to_string())
        .and_then(|mind| {
            mind.learning(learning.setup(self.me, boot, Some(memory))).map_err(|error| error.to_string())
        });
        let mind = match mind {
            Ok(mind) => mind,
            Err(error) => {
                let why =
                    format!("the memory that came late is not taken up, and nothing is remembered: {error}");
                apprentice.refuse(&why);
                return self.effector.account.error(&why);
            }
        };
        apprentice.take_up();
        self.mind = mind;
        self.believe();
        self.sight.begin_anew();
        self.effector.account.count("memory_taken_up");
        let open = {
            let mut status = self.effector.account.lock();
            status.boot = boot;
            std::mem::take(&mut status.open).then_some(status.round).flatten()
        };
        if let Some(round) = open {
            self.effector.tell(Event::Closed(round));
        }
        let known = self.classifier.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let classifier =
            learning.first_classifier(classifier).map(|first| first as Arc<dyn Classify>).or(known);
        if let Some(classifier) = classifier {
            self.step(Input::Learned(classifier));
        }
        self.step(Input::Alive(Arc::new(self.inbox.tokens())));
        self.step(Input::Neighbours(self.inbox.links().into_values().collect()));
        self.step(Input::Guests(self.guests.present()));
    }

    fn tell_alive(&self, mut alive: BTreeSet<RobotId>) {
        alive.remove(&self.me);
        self.effector.account.lock().alive = alive.iter().copied().chain([self.me]).collect();
        self.effector.tell(Event::Alive(alive));
    }

    /// Puts what was learned into the status, when it has changed.
    fn report_learning(&mut self) {
        if let Some(apprentice) = &mut self.effector.apprentice
            && apprentice.has_news(&self.mind)
        {
            let learning = apprentice.status(&self.mind);
            self.effector.account.lock().learning = learning;
        }
    }
}

async fn found(apprentice: &mut Option<Apprentice>) -> Found {
    match apprentice {
        Some(apprentice) => apprentice.found().await,
        None => std::future::pending().await,
    }
}
