//! What goes wrong, and when it is well again.

use gestalt_protocol::RobotId;

use super::Swarm;
use super::queue::Due;
use crate::emulation::network::{Change, Presence};
use crate::emulation::pupil::Pupil;
use crate::emulation::route::{Link, link};
use crate::emulation::scenario::Event;
use crate::emulation::trace::Happening;

impl Swarm<'_> {
    /// Makes something go wrong, or mends it. Where that changes nothing, as a random network lacks the link, it does not happen.
    pub(super) fn fault(&mut self, event: Event) {
        match event {
            Event::Cut(a, b) | Event::Heal(a, b) => {
                let (link, up) = (link(index(a), index(b)), matches!(event, Event::Heal(..)));
                if self.network.set_link(link, up) {
                    self.link_changed(event, link, up);
                }
            }
            Event::Kill(robot) | Event::Restart(robot) | Event::Freeze(robot) | Event::Thaw(robot) => {
                if event.can_befall(self.network.presence(index(robot))) {
                    self.note(&Happening::Fault { event: &event });
                    self.befall(event, index(robot));
                }
            }
        }
    }

    fn befall(&mut self, event: Event, i: usize) {
        if let Some((_, presence)) = event.makes() {
            self.change_presence(i, presence);
        }
        match event {
            Event::Kill(_) => {
                self.robots[i].mind = None;
                self.robots[i].waiting.clear();
                self.robots[i].unread.clear();
                self.robots[i].pupil.iter_mut().for_each(Pupil::stop);
                self.record.forget(i);
            }
            Event::Restart(_) => self.start(i),
            Event::Thaw(_) => self.thaw(i),
            Event::Freeze(_) | Event::Cut(..) | Event::Heal(..) => {}
        }
    }

    fn link_changed(&mut self, event: Event, link: Link, up: bool) {
        self.note(&Happening::Fault { event: &event });
        self.at(self.now + self.scenario.link.detection, Due::Notice(Change::Link(link, up)));
    }

    fn change_presence(&mut self, robot: usize, presence: Presence) {
        self.network.set_presence(robot, presence);
        let change = Change::Robot(robot, presence == Presence::Up);
        self.at(self.now + self.scenario.link.detection, Due::Notice(change));
    }

    /// Chance cuts or heals a link, and goes on until it is calm.
    pub(super) fn churn(&mut self) {
        let Some(churn) = self.scenario.churn else { return };
        let next = self.now + churn.period;
        if next < churn.until {
            self.at(next, Due::Churn);
        }
        if let Some((link, up)) = self.network.flip_any_link() {
            self.link_flipped(link, up);
        }
    }

    /// All that chance cut is well again.
    pub(super) fn calm(&mut self) {
        for link in self.network.heal_flipped_links() {
            self.link_flipped(link, true);
        }
    }

    fn link_flipped(&mut self, link: Link, up: bool) {
        let (a, b) = (self.robots[link.0].id, self.robots[link.1].id);
        let event = if up { Event::Heal(a, b) } else { Event::Cut(a, b) };
        self.link_changed(event, link, up);
    }
}

fn index(robot: RobotId) -> usize {
    robot.0 as usize - 1
}
