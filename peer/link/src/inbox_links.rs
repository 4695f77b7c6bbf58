//! Which sessions a robot is linked to, as its inbox keeps it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use gestalt_protocol::RobotId;
use zenoh::session::ZenohId;

use crate::identity::robot_of;
use crate::inbox::Inbox;
use crate::session::Far;

impl Inbox {
    /// A link to another session came or went.
    pub(super) fn on_link(&self, Far { id, relays }: Far, up: bool) {
        let Some(robot) = robot_of(id, self.swarm) else { return };
        if robot == self.me {
            return self.account.twin();
        }
        let mut state = self.lock();
        if up {
            self.ways.neighbour(robot);
            state.links.insert(id, robot);
            if relays {
                state.relays.insert(id);
            }
            state.heard.insert(robot, (Instant::now(), None));
            if let Some(sealed) = &self.sealed {
                sealed.roll.meet();
            }
        } else {
            state.links.remove(&id);
            state.relays.remove(&id);
            if !state.links.values().any(|other| *other == robot) {
                state.heard.remove(&robot);
            }
            state.silence.lost(Instant::now());
            self.lost_links.send_modify(|lost| *lost += 1);
        }
        state.links_changed = true;
        self.ready.notify_one();
        self.unrest.notify_one();
    }

    /// The sessions of robots that this one is linked to now.
    pub(super) fn links(&self) -> BTreeMap<ZenohId, RobotId> {
        self.lock().links.clone()
    }

    /// Those of them that relay for others.
    pub(super) fn relays(&self) -> BTreeMap<ZenohId, RobotId> {
        let state = self.lock();
        let relays = state.relays.iter();
        relays.filter_map(|id| Some((*id, *state.links.get(id)?))).collect()
    }

    /// Since when each session that this one is linked to is, and when that last told this robot something.
    pub(super) fn hearing(&self) -> Vec<(ZenohId, RobotId, Instant, Option<Instant>)> {
        let state = self.lock();
        let heard =
            state.links.iter().filter_map(|(id, robot)| Some((*id, *robot, *state.heard.get(robot)?)));
        heard.map(|(id, robot, (since, last))| (id, robot, since, last)).collect()
    }

    /// The robots alive by liveliness, or because they are linked to this one.
    pub(super) fn alive(&self) -> BTreeSet<RobotId> {
        let state = self.lock();
        state.alive.iter().chain(state.links.values()).copied().collect()
    }
}
