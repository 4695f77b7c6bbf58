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
    pub(super) fn fault(&mut self, event: Event) {
        self.note(&Happening::Fault { event: &event });
        let index = |robot: RobotId| robot.0 as usize - 1;
        match event {
            Event::Cut(a, b) => self.change_link(link(index(a), index(b)), false),
            Event::Heal(a, b) => self.change_link(link(index(a), index(b)), true),
            Event::Kill(robot) => {
                let i = index(robot);
                self.robots[i].mind = None;
                self.robots[i].waiting.clear();
                self.robots[i].unread.clear();
                self.robots[i].pupil.iter_mut().for_each(Pupil::stop);
                self.record.forget(i);
                self.change_presence(i, Presence::Down);
            }
            Event::Restart(robot) if self.network.presence(index(robot)) == Presence::Down => {
                self.change_presence(index(robot), Presence::Up);
                self.start(index(robot));
            }
            Event::Freeze(robot) if self.network.presence(index(robot)) == Presence::Up => {
                self.change_presence(index(robot), Presence::Frozen);
            }
            Event::Thaw(robot) if self.network.presence(index(robot)) == Presence::Frozen => {
                self.change_presence(index(robot), Presence::Up);
                self.thaw(index(robot));
            }
            Event::Restart(_) | Event::Freeze(_) | Event::Thaw(_) => {}
        }
    }

    fn change_link(&mut self, link: Link, up: bool) {
        if self.network.set_link(link, up) {
            self.at(self.now + self.scenario.link.detection, Due::Notice(Change::Link(link, up)));
        }
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
        self.note(&Happening::Fault { event: &event });
        self.at(self.now + self.scenario.link.detection, Due::Notice(Change::Link(link, up)));
    }
}
