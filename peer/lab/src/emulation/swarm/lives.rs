//! Who starts, who goes on, and who knows of whom.

use std::sync::Arc;

use gestalt_protocol::RobotId;
use gestalt_strategies::{Classify, Input, Mind, MindConfig};

use super::Swarm;
use super::seed::{learning, life, stream};
use crate::emulation::network::Presence;

impl Swarm<'_> {
    /// A robot starts, for the first time or again: with what is on its disk, if it learns.
    pub(super) fn start(&mut self, i: usize) {
        let robot = &mut self.robots[i];
        if robot.lies.is_some() {
            return;
        }
        robot.boot += 1;
        robot.looking = false;
        let life = life(self.seed, i, robot.boot);
        robot.knows = Default::default();
        let config: MindConfig = self.scenario.mind.clone();
        let classifier: Option<Arc<dyn Classify>> =
            match (&mut robot.pupil, &self.school, &self.scenario.learning) {
                (Some(pupil), Some(school), Some(teaching)) => {
                    let rng = stream(self.seed, learning(i, robot.boot));
                    let (me, robots) = ((robot.id, life), teaching.of_robots());
                    let with = (&robots, &self.rules.learning, &self.shelf);
                    robot.mind = Some(pupil.start(me, config, school, with, rng));
                    pupil.classifier().map(|classifier| classifier.clone() as Arc<dyn Classify>)
                }
                _ => {
                    robot.mind = Mind::new(robot.id, life, config).ok();
                    robot.observer.classifier()
                }
            };
        if let Some(rule) = &self.rules.fusion {
            robot.mind = robot.mind.take().map(|mind| mind.fused_by(rule.clone()));
        }
        match classifier {
            Some(classifier) => self.tell_mind(i, Input::Learned(classifier)),
            // What it remembers is to be trained.
            None if self.school.is_some() => self.tell_mind(i, Input::Tick),
            None => {}
        }
    }

    /// A robot that stood still goes on, and hears what waited for it.
    pub(super) fn thaw(&mut self, i: usize) {
        for parcel in std::mem::take(&mut self.robots[i].waiting) {
            self.arrive(i, parcel);
        }
        let remembered = self.robots[i].pupil.as_ref().map(|pupil| pupil.remembered);
        self.tell_mind(i, remembered.map_or(Input::Tick, Input::Remembered));
        self.tell_who_is_there();
    }

    /// Tells every robot who is alive and who its neighbours are, where that has changed.
    pub(super) fn tell_who_is_there(&mut self) {
        for i in 0..self.robots.len() {
            if self.network.presence(i) != Presence::Up {
                continue;
            }
            let now = (self.network.reachable(i), self.network.neighbours(i));
            let before = std::mem::replace(&mut self.robots[i].knows, now.clone());
            if before.0 != now.0 {
                self.tell_mind(i, Input::Alive(now.0.clone()));
            }
            if before.1 != now.1 {
                let neighbours = now.1.into_iter().map(|i| RobotId(i as u32 + 1)).collect();
                self.tell_mind(i, Input::Neighbours(neighbours));
            }
        }
    }
}
