//! Who votes in the newest round, of a large swarm.

use std::collections::BTreeSet;

use gestalt_protocol::RobotId;

use super::members::Committee;
use super::rounds::Rounds;
use crate::committee::draw;
use crate::round::Voice;

impl Rounds {
    /// Draws who votes in the newest round, at its beginning or when other robots are there. `new`: who came since.
    pub(super) fn draw(&mut self, new: &BTreeSet<RobotId>) {
        let count = self.electorate.count();
        let before = self.committee.take();
        let Some(round) = self.round.as_mut() else { return };
        round.look_again();
        let size = self.config.committee_of(count);
        self.committee = size.map(|size| {
            let members = self.electorate.members(&self.alive).chain([self.me]);
            let members = draw(round.id.counter, size, count, members);
            let late = before.into_iter().flat_map(|before| before.late).chain(new.iter().copied()).collect();
            let expected = members.iter().copied().filter(|robot| self.alive.contains(*robot)).collect();
            Committee { members, expected, late }
        });
        let is_member = self.committee.as_ref().is_none_or(|committee| committee.members.contains(&self.me));
        // Of two parts of a swarm that see each other no more, one at most goes on to vote.
        let votes = self.committee.is_none() || is_member && self.electorate.sees_most();
        let opened = round.id.opener == self.me && round.id.life == self.nonce;
        round.speak_as(match (votes, opened) {
            (true, _) => Voice::Votes,
            (false, true) => Voice::Opens,
            (false, false) => Voice::Silent,
        });
    }

    /// Draws anew where it has turned out that the swarm is larger, or smaller, than it seemed.
    pub(super) fn draw_if_the_size_calls_for_it(&mut self) {
        let calls = self.config.committee_of(self.electorate.count()).is_some();
        if self.round.is_some() && calls != self.committee.is_some() {
            self.draw(&BTreeSet::new());
        }
    }

    /// The round is over that was open for long enough to say something: whoever of the committee was there all the while and never said
    /// anything is a name without a robot. But where most of the swarm cannot be seen, its members say nothing.
    pub(super) fn note_silence(&mut self) {
        let Some((round, committee)) = self.round.as_ref().zip(self.committee.as_ref()) else { return };
        if self.electorate.sees_most() {
            let silent = committee
                .members
                .difference(&committee.late)
                .copied()
                .filter(|robot| self.alive.contains(*robot) && round.ballot.stamp(*robot).is_none());
            self.electorate.asked_in_vain(silent);
        }
    }

    /// Whether that robot counts for the quorum of the newest round.
    pub(super) fn counts(&self, robot: RobotId) -> bool {
        self.committee.as_ref().is_none_or(|committee| committee.members.contains(&robot))
    }

    /// Whether this robot's own evidence is asked for in the newest round. Where a committee votes that it is not in, it need not judge what
    /// it sees.
    #[must_use]
    pub fn votes(&self) -> bool {
        self.round.as_ref().is_none_or(|round| round.voice() == Voice::Votes)
    }
}
