//! What minds are told, what they want done, and what becomes of it.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Answer, Message};
use gestalt_strategies::{Input, Output};
use rand::RngExt;

use super::Swarm;
use super::parcel::{Parcel, as_json, json_bytes, over_the_wire};
use super::queue::Due;
use crate::emulation::network::{Kind, Presence};
use crate::emulation::pupil::Pupil;
use crate::emulation::trace::Happening;

/// What waits for a frozen robot, at most; what comes after is lost, as in a full buffer.
const WAITING: usize = 10_000;

impl Swarm<'_> {
    /// Gives a mind an input and carries out what it wants done.
    pub(super) fn tell_mind(&mut self, i: usize, input: Input) {
        if self.network.presence(i) != Presence::Up {
            return;
        }
        self.robots[i].read();
        let Some(mind) = &mut self.robots[i].mind else { return };
        let outputs = mind.handle(self.now, input);
        let wake = mind.next_wake();
        if self.robots[i].wake != wake {
            self.robots[i].wake = wake;
            if let Some(wake) = wake {
                self.at(wake.max(self.now), Due::Wake(i));
            }
        }
        for output in outputs {
            self.carry_out(i, output);
        }
    }

    fn carry_out(&mut self, i: usize, output: Output) {
        let robot = self.robots[i].id;
        match output {
            Output::Broadcast(envelope) => {
                for envelope in self.poisoned(i, envelope) {
                    let (envelope, bytes) = over_the_wire(&envelope);
                    let kind = match envelope.message {
                        Message::Samples(_) => Kind::Samples,
                        Message::Holding(_) => Kind::Decision,
                        _ => Kind::Vote,
                    };
                    let reaches = self.broadcast(i, bytes, kind, &Parcel::Said(envelope));
                    self.note(&Happening::Broadcast { robot, bytes, reaches });
                }
            }
            Output::Tell(to, envelope) => {
                for envelope in self.poisoned(i, envelope) {
                    let (envelope, bytes) = over_the_wire(&envelope);
                    let target = to.0 as usize - 1;
                    let samples = matches!(envelope.message, Message::Batches(_));
                    let taken = self.network.tell(i, target, bytes, samples);
                    self.note(&Happening::Tell { robot, to, bytes, arrives: taken.is_some() });
                    if let Some(taken) = taken {
                        self.at(self.now + taken, Due::Arrive(target, Parcel::Said(envelope)));
                    }
                }
            }
            Output::Hold(decision) => {
                self.note(&Happening::Hold { robot, decision: (&decision).into() });
                self.record.hold(self.now, i, &decision);
            }
            Output::Announce(announcement) => {
                self.note(&Happening::Announce { robot, decision: (&announcement.decision).into() });
                self.record.announce(&announcement.decision);
                let (announcement, bytes) = as_json(&announcement);
                self.broadcast(i, bytes, Kind::Decision, &Parcel::Announced(announcement));
            }
            Output::Ask(question) => {
                self.note(&Happening::Ask { robot, question: &question });
                self.hear_question(i, &question);
                let (question, bytes) = as_json(&question);
                self.broadcast(i, bytes, Kind::Words, &Parcel::Asked(question));
            }
            Output::Opened(round) => {
                self.note(&Happening::Opened { robot, round });
                self.record.open(self.now, i);
                let robot = &mut self.robots[i];
                robot.looking = true;
                robot.looks += 1;
                let phase: f64 = robot.rng.random();
                let (first, looks) = (robot.observer.period() * phase, robot.looks);
                self.at(self.now + Duration::from_secs_f64(first), Due::Frame(i, looks));
            }
            Output::Closed(round) => {
                self.note(&Happening::Closed { robot, round });
                self.record.close(self.now, i);
                self.robots[i].looking = false;
                self.robots[i].pupil.iter_mut().for_each(Pupil::rest);
            }
            Output::Answer(by, answer) => {
                let Answer { at, outcome, samples, .. } = answer;
                self.note(&Happening::Answer { robot, outcome, samples });
                let bytes = json_bytes(&answer);
                self.broadcast(i, bytes, Kind::Words, &Parcel::Answered(by, at, robot));
            }
            Output::Train(changes) => {
                if let Some(pupil) = &mut self.robots[i].pupil {
                    pupil.train_later(changes);
                }
            }
            Output::Remember { revision, changes } => {
                let boot = self.robots[i].boot;
                if let Some(pupil) = &mut self.robots[i].pupil {
                    pupil.remember(revision, changes);
                    self.at(self.now, Due::Remembered(i, boot, revision));
                }
            }
        }
    }

    pub(super) fn broadcast(&mut self, i: usize, bytes: usize, kind: Kind, parcel: &Parcel) -> usize {
        let arrivals = self.network.broadcast(i, bytes, kind);
        let reaches = arrivals.len();
        let mut arrivals: Vec<_> = arrivals.into_iter().map(|(to, taken)| (self.now + taken, to)).collect();
        arrivals.sort_unstable();
        if let Some((first, _)) = arrivals.first() {
            self.at(*first, Due::Spread(arrivals.into(), parcel.clone()));
        }
        reaches
    }

    /// Lets a parcel arrive where it is due, and waits for the rest: of a broadcast to a thousand robots one event is
    /// queued, not a thousand.
    pub(super) fn spread(&mut self, mut arrivals: VecDeque<(Duration, usize)>, parcel: Parcel) {
        while let Some((at, to)) = arrivals.pop_front() {
            if at > self.now {
                arrivals.push_front((at, to));
                return self.at(at, Due::Spread(arrivals, parcel));
            }
            self.arrive(to, parcel.clone());
        }
    }

    pub(super) fn arrive(&mut self, i: usize, parcel: Parcel) {
        match self.network.presence(i) {
            Presence::Down => {}
            Presence::Frozen => {
                let waiting = &mut self.robots[i].waiting;
                if waiting.len() < WAITING {
                    waiting.push_back(parcel);
                }
            }
            Presence::Up if self.robots[i].lies.is_some() => self.deceive(&parcel),
            Presence::Up => match parcel {
                Parcel::Said(envelope) if self.robots[i].may_read_later(&envelope) => self.leave(i, envelope),
                parcel => self.tell_mind(i, parcel.opened()),
            },
        }
    }
}
