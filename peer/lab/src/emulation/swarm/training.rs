//! Many robots learn at once, on as many threads as there are: what each learns depends on nothing but its own samples.

use std::collections::BTreeSet;

use super::Swarm;
use super::robot::Robot;
use crate::emulation::network::Presence;
use crate::emulation::pupil::Pupil;

impl Swarm<'_> {
    /// Those who will be asked to vote in the round of that counter, which that robot opened, learn from all they hold, where a committee votes. They
    /// would when they look, one after the other; of a small swarm they do.
    pub(super) fn train_voters(&mut self, counter: u32, opener: usize) {
        if self.school.is_some() {
            self.read_all();
            let alive = self.network.reachable(opener);
            if let Some(members) = self.scenario.mind.draw(counter, &alive) {
                self.train_together(members.iter().map(|robot| robot.0 as usize - 1).collect());
            }
        }
    }

    /// These learn from all they hold, and go on to follow what changes. Between two showings, when there is nothing that they were not told.
    pub fn keep_up(&mut self, robots: &[usize]) {
        let Some(school) = &self.school else { return };
        for i in robots {
            let Robot { pupil, mind, .. } = &mut self.robots[*i];
            if let Some(pupil) = pupil {
                pupil.keep_up(mind.as_ref(), school);
            }
        }
        self.train_together(robots.iter().copied().collect());
    }

    fn train_together(&mut self, robots: BTreeSet<usize>) {
        let Some(school) = &self.school else { return };
        let network = &self.network;
        let all = self.robots.iter_mut().enumerate();
        let behind = all.filter(|(i, _)| robots.contains(i) && network.presence(*i) == Presence::Up);
        let behind: Vec<&mut Pupil> = behind
            .filter_map(|(_, Robot { pupil, mind, .. })| {
                pupil.as_mut().and_then(|pupil| pupil.prepare(mind.as_ref(), school).then_some(pupil))
            })
            .collect();
        self.crew.on_each(behind, Pupil::learn);
    }
}
