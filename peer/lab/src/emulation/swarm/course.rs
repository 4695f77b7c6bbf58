//! The course of events: what is shown, what is seen of it, and what the instructor says.

use std::sync::Arc;

use gestalt_protocol::{ClassId, Gesture, Instruction, InstructorId, RoundId};
use gestalt_strategies::{Input, Instructed, Mind};
use rand::RngExt;
use rand::seq::SliceRandom;

use super::Swarm;
use super::parcel::{Parcel, json_bytes};
use super::queue::Due;
use super::seed::{frames, stream};
use crate::emulation::answering::AskedBy;
use crate::emulation::network::{Kind, Presence};
use crate::emulation::scenario::Order;
use crate::emulation::teaching::Feedback;
use crate::emulation::trace::Happening;

/// Who teaches.
const INSTRUCTOR: &str = "script";

impl Swarm<'_> {
    /// Another gesture is shown to all; one of the robots that can notices it first.
    pub(super) fn show(&mut self, n: u32) {
        self.end_showing();
        self.shown = self.draw_gesture();
        let luck = self.course.random::<u64>();
        for (i, robot) in self.robots.iter_mut().enumerate() {
            robot.rng = stream(self.seed, frames(n, i));
            robot.observer.share(luck);
            robot.observer.show(self.shown, &mut robot.rng);
            robot.phase = robot.rng.random();
            robot.is_first = true;
        }
        let up = self.honest();
        if up.is_empty() {
            return;
        }
        let opener = up[(luck % up.len() as u64) as usize];
        let happening = Happening::Shown { class: self.shown, opener: self.robots[opener].id };
        self.note(&happening);
        self.record.show(self.now, self.shown);
        let before = self.robots[opener].mind.as_ref().and_then(Mind::round);
        self.tell_mind(opener, Input::Open);
        let after = self.robots[opener].mind.as_ref().and_then(Mind::round);
        // A robot that is still busy with the round before does not open another.
        let opened = after.filter(|round| Some(*round) != before);
        if let Some(round) = opened {
            self.train_voters(round.counter, opener);
        }
        if let Some(teaching) = self.scenario.learning.as_ref().filter(|_| opened.is_some()) {
            self.at(self.now + teaching.after, Due::Teach(n, opener));
        }
    }

    fn draw_gesture(&mut self) -> ClassId {
        let classes = self.scenario.classes;
        match self.scenario.order {
            Order::Random => ClassId(self.course.random_range(0..classes as u64) as u32),
            Order::InTurn => {
                if self.turn.is_empty() {
                    self.turn = (0..classes).map(|class| ClassId(class as u32)).collect();
                    self.turn.shuffle(&mut self.course);
                }
                self.turn.pop().unwrap_or(ClassId(0))
            }
        }
    }

    /// The instructor, who stands at that robot, says what it was that was shown.
    pub(super) fn teach(&mut self, n: u32, i: usize) {
        let Some(teaching) = &self.scenario.learning else { return };
        let mind = self.robots[i].mind.as_ref().filter(|_| self.network.presence(i) == Presence::Up);
        let Some((mind, round)) = mind.and_then(|mind| Some((mind, mind.round()?))) else { return };
        let held = mind.held().and_then(|held| held.class);
        let by_others = teaching.answering.asked_by != AskedBy::Swarm;
        let instruction = match (teaching.feedback, held) {
            (Feedback::Full, _) => {
                let class = self.names(None);
                return self.tell_class(i, round, class);
            }
            (Feedback::Asked, _) => {
                if by_others && self.is_asked(i) {
                    let class = self.names(None);
                    self.tell_class(i, round, class);
                }
                return;
            }
            (Feedback::Partial, Some(decided)) => {
                let of = Gesture::Class(decided);
                if (decided == self.shown) != self.errs() {
                    Instruction::Right { round, of }
                } else {
                    Instruction::Wrong { round, of }
                }
            }
            (Feedback::Partial, None) | (Feedback::None, _) => return,
        };
        self.say(i, instruction, u64::from(n));
    }

    /// The instructor, who stands at that robot, says that it was that gesture.
    pub(super) fn tell_class(&mut self, i: usize, round: RoundId, class: ClassId) {
        let n = self.record.showings.len().saturating_sub(1) as u64;
        self.say(i, Instruction::Was { round, class: Gesture::Class(class) }, n);
    }

    fn say(&mut self, i: usize, instruction: Instruction, at: u64) {
        if self.network.presence(i) != Presence::Up {
            return;
        }
        let robot = self.robots[i].id;
        self.asking.labels += 1;
        self.record.tell(&instruction);
        self.note(&Happening::Instruct { robot, instruction: &instruction });
        let by: InstructorId = INSTRUCTOR.parse().expect("it is a name");
        let bytes = json_bytes(&instruction);
        let instructed = Arc::new(Instructed { by, at, instruction, said: None });
        self.broadcast(i, bytes, Kind::Words, &Parcel::Instructed(instructed.clone()));
        self.arrive(i, Parcel::Instructed(instructed));
    }

    /// Makes a robot's classifier follow its samples.
    pub(super) fn train(&mut self, i: usize) {
        let up = self.network.presence(i) == Presence::Up;
        if let Some(school) = self.school.as_ref().filter(|_| up) {
            let mut deeds = Vec::new();
            self.robots[i].train(self.now, school, &mut deeds);
            self.carry_out(i, deeds);
        }
    }

    pub(super) fn end_showing(&mut self) {
        let up = self.honest();
        // Who had decided before it looked, looks now: else showings that are easy would count less, and by each rule others.
        for i in &up {
            if let Some(probabilities) = self.robots[*i].first_frame() {
                self.record.frame(&probabilities, self.shown);
            }
        }
        self.record.end_showing(self.now, &up);
    }

    /// The robots that are up and do not lie.
    fn honest(&self) -> Vec<usize> {
        self.network.up().filter(|i| self.robots[*i].lies.is_none()).collect()
    }
}
