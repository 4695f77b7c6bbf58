//! What is shown and taught.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Gesture, Instruction, Outcome, RobotId, RoundId, Topic};
use gestalt_strategies::{Input, Observation};
use rand::RngExt;

use super::network::{Due, Swarm, json};
use super::port::Parcel;
use super::shown::Shown;
use super::world::{CLASSES, features, instructor, key_of};
use crate::attack::Setting;
use crate::trust::{Roster, Speaker, WordHeading, word};

/// How long a gesture is shown.
const SHOWN_FOR: Duration = Duration::from_secs(3);

/// The time between two frames.
const FRAME: Duration = Duration::from_millis(150);

impl Swarm {
    /// Begins to show a gesture: robot 1 is told that there is one.
    pub fn begin(&mut self, class: u32) {
        self.gesture = Some(class % CLASSES);
        let began = self.now;
        self.shown.push(Shown {
            class: class % CLASSES,
            began,
            held: Vec::new(),
            announced: None,
            settled: None,
        });
        self.tell(0, Input::Open);
    }

    /// Goes on showing it until it has been shown long enough since that time, and notes what became of it. Says which round it was.
    pub fn end(&mut self, began: Duration) -> RoundId {
        self.pass((began + SHOWN_FOR).saturating_sub(self.now));
        self.gesture = None;
        let held: Vec<Option<u32>> = self.minds().map(|mind| Some(mind.held()?.class?.0)).collect();
        let of_it = self.announced.iter().filter(|(at, ..)| *at >= began);
        let of_held = of_it.filter(|(.., decision)| held.contains(&decision.class.map(|class| class.0)));
        let announced = of_held.clone().next().map(|(at, ..)| *at - began);
        let mut settling = of_held.filter(|(.., decision)| decision.is_final && decision.class.is_some());
        let settled = settling.next().map(|(at, ..)| *at - began);
        if let Some(shown) = self.shown.last_mut() {
            (shown.held, shown.announced, shown.settled) = (held, announced, settled);
        }
        self.mind(1).round().unwrap_or(RoundId { counter: 0, opener: RobotId(0), life: 0 })
    }

    /// Shows a gesture from beginning to end.
    pub fn show(&mut self, class: u32) -> RoundId {
        let began = self.now;
        self.begin(class);
        self.end(began)
    }

    pub(super) fn frame(&mut self, i: usize, looks: u64) {
        if !self.robots[i].looking || self.robots[i].looks != looks {
            return;
        }
        if let Some(shown) = self.gesture {
            let errors = self.plan.errors;
            let chance = &mut self.robots[i].chance;
            let mistaken = chance.random::<f64>() < errors;
            let other = chance.random_range(1..CLASSES);
            let seen = if mistaken { (shown + other) % CLASSES } else { shown };
            let features = features(seen, chance);
            self.tell(i, Input::Observed(Observation { features, quality: 1.0 }));
        }
        self.at(self.now + FRAME, Due::Frame(i, looks));
    }

    /// An instructor says something, which all robots hear. Says when.
    pub fn say(&mut self, by: &str, instruction: &Instruction) -> u64 {
        let parcel = self.word(by, instruction);
        let at = parcel.at;
        for i in 0..self.robots.len() {
            let arrives = self.now + Duration::from_millis(1 + i as u64);
            self.at(arrives, Due::Arrive(i, parcel.clone()));
        }
        self.air.push(parcel);
        self.pass(Duration::from_secs(2));
        at
    }

    /// The word of an instructor as it travels: with their signature in a sealed swarm.
    pub fn word(&mut self, by: &str, instruction: &Instruction) -> Parcel {
        let (by, bytes) = (instructor(by), json(instruction));
        // Each word has a count of its own.
        self.said = self.time().max(self.said + 1);
        let at = self.said;
        if self.plan.setting == Setting::Open {
            return Parcel { key: self.keys.key(&Topic::Feedback(by)), bytes, attachment: None, at };
        }
        let heading = WordHeading { speaker: Speaker::Own(by.clone()), count: at };
        let attachment = Some(word::sign(&key_of(&by), &self.roster.swarm_id(), &by, &heading, &bytes));
        Parcel { key: self.keys.key(&Topic::Word(by)), bytes, attachment, at }
    }

    /// Ada says which gesture it was. Says when.
    pub fn teach(&mut self, round: RoundId, class: u32) -> u64 {
        self.say("ada", &Instruction::Was { round, class: Gesture::Class(ClassId(class)) })
    }

    /// Whether that became of the last word that was answered.
    pub fn answered(&self, outcome: Outcome) -> bool {
        self.answers.last().is_some_and(|answer| answer.outcome == outcome)
    }

    /// The gestures shown so far.
    pub fn shown(&self) -> &[Shown] {
        &self.shown
    }

    /// What was announced so far, when, and by whom.
    pub fn announced(&self) -> &[(Duration, RobotId, Decision)] {
        &self.announced
    }

    /// A robot ends and starts again, with its memory or without.
    pub fn restart(&mut self, robot: u32, forgets: bool) {
        let sealed = (self.plan.setting == Setting::Sealed).then_some(&self.roster);
        let i = robot as usize - 1;
        self.robots[i].restart(&self.plan, sealed, forgets);
        self.introduce(i);
    }

    /// All robots end, and start again under that roster, some without their memories.
    pub fn restart_all(&mut self, roster: Option<Roster>, forgets: impl Fn(u32) -> bool) {
        self.roster = roster.unwrap_or_else(|| self.roster.clone());
        let sealed = (self.plan.setting == Setting::Sealed).then_some(&self.roster);
        for robot in &mut self.robots {
            robot.restart(&self.plan, sealed, forgets(robot.id.0));
        }
        (0..self.robots.len()).for_each(|i| self.introduce(i));
        self.pass(Duration::from_millis(100));
    }

    /// These robots are switched off.
    pub fn stop(&mut self, robots: impl IntoIterator<Item = u32>) {
        let off: BTreeSet<RobotId> = robots.into_iter().map(RobotId).collect();
        self.tokens = &self.tokens - &off;
        self.cut(off.iter().map(|robot| robot.0));
        for i in 0..self.robots.len() {
            if off.contains(&self.robots[i].id) {
                self.tell(i, Input::Blind(true));
            } else {
                self.tell(i, Input::Alive(Arc::new(self.tokens.clone())));
            }
        }
    }

    /// Nothing arrives any more between these robots and the others; with nobody named, everything does.
    pub fn cut(&mut self, robots: impl IntoIterator<Item = u32>) {
        self.cut = robots.into_iter().map(RobotId).collect::<BTreeSet<_>>();
    }
}
