//! Robots that belong to the swarm no more: what they said is taken out of what is still to be decided.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::RobotId;

use super::rounds::Rounds;

impl Rounds {
    /// Nothing that these said counts any more, in the midst of a round. A decision that counted them is no decision now: the round is
    /// concluded anew from the votes of the others. One of a round that is over stands, as what was true of the swarm then.
    pub(super) fn on_expelled(&mut self, robots: &BTreeSet<RobotId>) {
        let stays = |robot: &RobotId| !self.guests.contains(robot) && !robots.contains(robot);
        let alive = self.alive.iter().filter(stays).collect();
        self.electorate.expel(robots);
        self.waiting.retain(|robot, _| !robots.contains(robot));
        self.far_ahead.retain(|robot, _| !robots.contains(robot));
        self.on_alive(Arc::new(alive));
        self.wanted.take_if(|wanted| robots.contains(&wanted.holder));
        self.heard_pool.take_if(|(author, _)| robots.contains(author));
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.expel(robots);
        }
    }
}
