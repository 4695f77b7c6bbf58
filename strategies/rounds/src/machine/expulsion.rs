//! Robots that belong to the swarm no more: what they said is taken out of what is still to be decided.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::RobotId;

use super::rounds::Rounds;
use crate::others::Others;

impl Rounds {
    /// Nothing that these said counts any more, in the midst of a round. A decision that counted them is no decision now: the round is
    /// concluded anew from the votes of the others. One of a round that is over stands, as what was true of the swarm then.
    pub(super) fn on_expelled(&mut self, robots: &BTreeSet<RobotId>) {
        self.guests.retain(|guest| !robots.contains(guest));
        let stays = |robot: &RobotId| !robots.contains(robot);
        let alive: Arc<BTreeSet<RobotId>> = Arc::new(self.alive.iter().filter(stays).collect());
        // They have not just gone: who has counts for a while yet.
        self.alive = Others::new(self.me, alive.clone());
        self.electorate.expel(robots);
        self.waiting.retain(|robot, _| !robots.contains(robot));
        self.far_ahead.retain(|robot, _| !robots.contains(robot));
        self.on_alive(alive);
        self.wanted.take_if(|wanted| robots.contains(&wanted.holder));
        self.heard_pool.take_if(|(author, _)| robots.contains(author));
        if let Some(round) = self.round.as_mut().filter(|round| round.open) {
            round.expel(robots);
        }
    }
}
