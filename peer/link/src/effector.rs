//! What carries out what a robot's mind wants done.

use std::sync::Arc;

use gestalt_protocol::Message;
use gestalt_strategies::Output;
use tokio::sync::broadcast;

use crate::account::Account;
use crate::apprentice::Apprentice;
use crate::event::Event;
use crate::voice::Voice;

/// By which a mind acts on the world. Nothing of it waits for another robot.
pub(crate) struct Effector {
    pub account: Arc<Account>,
    pub events: broadcast::Sender<Event>,
    pub apprentice: Option<Apprentice>,
    pub voice: Voice,
}

impl Effector {
    /// Does what the mind wants done.
    pub fn carry_out(&mut self, output: Output) {
        match output {
            Output::Broadcast(envelope) => {
                self.voice.broadcast(&envelope);
                match envelope.message {
                    Message::Samples(samples) => {
                        self.tell(Event::Shared(samples.samples.iter().map(|sample| sample.id).collect()));
                    }
                    Message::Holding(holding) => self.tell(Event::Holding(holding)),
                    _ => {}
                }
            }
            Output::Tell(neighbour, envelope) => self.voice.tell(neighbour, &envelope),
            Output::Hold(decision) => {
                let mut status = self.account.lock();
                status.round = status.round.max(Some(decision.round));
                drop(status);
                self.voice.hold(decision.round);
                self.tell(Event::Held(decision));
            }
            Output::Announce(announcement) => {
                self.voice.announce(&announcement);
                self.tell(Event::Announced(announcement));
            }
            Output::Ask(question) => {
                self.voice.ask(&question);
                self.tell(Event::Asked(question));
            }
            Output::Opened(round) => {
                let mut status = self.account.lock();
                (status.round, status.open) = (Some(round), true);
                drop(status);
                self.tell(Event::Opened(round));
            }
            Output::Closed(round) => {
                // Under the name it ended with: it may have merged with one of a smaller name meanwhile.
                let mut status = self.account.lock();
                (status.round, status.open) = (Some(round), false);
                drop(status);
                self.tell(Event::Closed(round));
            }
            Output::Answer(instructor, answer) => {
                self.voice.answer(&instructor, &answer);
                self.tell(Event::Answered(instructor, answer));
            }
            Output::Train(changes) => {
                if let Some(apprentice) = &self.apprentice {
                    apprentice.train(changes);
                }
            }
            Output::Remember { revision, changes } => {
                if let Some(apprentice) = &self.apprentice {
                    apprentice.remember(revision, changes);
                }
            }
        }
    }

    /// Tells the program around the robot.
    pub fn tell(&self, event: Event) {
        // An error says that nobody listens, which is fine.
        let _ = self.events.send(event);
    }
}
