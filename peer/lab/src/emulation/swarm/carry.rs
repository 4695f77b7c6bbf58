//! What minds are told, what they want done, and what becomes of it.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Answer, Message};
use gestalt_strategies::{Input, Output};

use super::Swarm;
use super::parcel::{Parcel, as_json, json_bytes, over_the_wire};
use super::queue::Due;
use super::turn::{Deed, Turn};
use crate::emulation::network::{Kind, Presence};
use crate::emulation::trace::Happening;

/// What waits for a frozen robot, at most; what comes after is lost, as in a full buffer.
const WAITING: usize = 10_000;

impl Swarm<'_> {
    /// Gives a mind an input, and carries out what it wants done.
    pub(super) fn tell_mind(&mut self, i: usize, input: Input) {
        if self.network.presence(i) != Presence::Up {
            return;
        }
        debug_assert!(
            self.robots[i].ahead.is_over(),
            "it is told something that it did not know of when it went ahead"
        );
        let mut deeds = Vec::new();
        self.robots[i].tell(self.now, input, &mut deeds);
        self.carry_out(i, deeds);
    }

    /// Lets a robot do what is due for it, if it has not done it ahead, and carries out what it wants done.
    pub(super) fn take_turn(&mut self, i: usize, turn: &Turn) {
        let up = self.network.presence(i) == Presence::Up;
        let robot = &mut self.robots[i];
        let ahead = robot.ahead.recall(self.now, turn);
        self.taken_ahead += u64::from(ahead.is_some());
        let deeds = ahead.unwrap_or_else(|| robot.act(self.now, turn, up, self.school.as_deref()));
        self.carry_out(i, deeds);
    }

    pub(super) fn carry_out(&mut self, i: usize, deeds: Vec<Deed>) {
        let robot = self.robots[i].id;
        for deed in deeds {
            match deed {
                Deed::Wakes(at) => self.at(at, Due::Wake(i)),
                Deed::Looks(round, first, n) => {
                    self.note(&Happening::Opened { robot, round });
                    self.record.open(self.now, i, round);
                    self.at(first, Due::Frame(i, n));
                }
                Deed::LooksOn(at, n) => self.at(at, Due::Frame(i, n)),
                Deed::Judges(probabilities) => self.record.frame(&probabilities, self.shown),
                Deed::Learns(samples) => self.note(&Happening::Learn { robot, samples }),
                Deed::Remembers(revision) => {
                    self.at(self.now, Due::Remembered(i, self.robots[i].boot, revision));
                }
                Deed::Wants(output) => self.fulfil(i, output),
            }
        }
    }

    fn fulfil(&mut self, i: usize, output: Output) {
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
            Output::Closed(round) => {
                self.note(&Happening::Closed { robot, round });
                self.record.close(self.now, i);
            }
            Output::Answer(by, answer) => {
                let Answer { at, outcome, samples, .. } = answer;
                self.note(&Happening::Answer { robot, outcome, samples });
                let bytes = json_bytes(&answer);
                self.broadcast(i, bytes, Kind::Words, &Parcel::Answered(by, at, robot));
            }
            Output::Opened(_) | Output::Train(_) | Output::Remember { .. } => {
                unreachable!("a robot does that by itself")
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
            Presence::Up => {
                let waits = matches!(&parcel, Parcel::Said(said) if self.robots[i].may_read_later(said));
                self.take_turn(i, &Turn::Hears(parcel));
                if waits {
                    self.leave();
                }
            }
        }
    }
}
