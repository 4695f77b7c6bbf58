//! Who says nothing any more, as a robot's inbox keeps it.

use std::time::{Duration, Instant};

use gestalt_protocol::{MAX_ROBOTS, RobotId};

use crate::inbox::Inbox;

impl Inbox {
    /// A robot said something to all.
    pub(super) fn on_spoken(&self, robot: RobotId) {
        self.lock().silence.spoken(Instant::now());
        self.on_sign(robot);
    }

    /// A robot gave a sign of life.
    pub(super) fn on_sign(&self, robot: RobotId) {
        let mut state = self.lock();
        let state = &mut *state;
        let was_gone = state.silence.heard(robot, Instant::now(), &state.alive);
        if was_gone && state.alive.len() < MAX_ROBOTS && !self.is_stranger(robot) {
            state.alive.insert(robot);
            state.alive_changed = true;
            self.ready.notify_one();
        }
    }

    /// The other robots that are to be asked whether they are there, those after this one first: others begin elsewhere.
    pub(super) fn suspects(&self, since: Instant, span: Duration) -> Vec<RobotId> {
        let mut state = self.lock();
        let state = &mut *state;
        let suspects = state.silence.suspects(&state.alive, Instant::now(), since, span);
        let after = suspects.range(self.me..).chain(suspects.range(..self.me));
        after.copied().filter(|robot| *robot != self.me && !self.is_stranger(*robot)).collect()
    }

    /// Whether a robot gave a sign of life since.
    pub(super) fn was_heard(&self, robot: RobotId, since: Instant) -> bool {
        self.lock().silence.was_heard(robot, since)
    }

    /// A robot does not answer. It counts no more as alive if it gave no sign of life since, until it does or its token is new; a link to it is one.
    pub(super) fn on_silence(&self, robot: RobotId, since: Instant) {
        let mut state = self.lock();
        let is_there =
            state.silence.was_heard(robot, since) || state.links.values().any(|linked| *linked == robot);
        if !is_there && state.alive.remove(&robot) {
            state.silence.give_up(robot);
            state.alive_changed = true;
            self.account.count("silent");
            self.ready.notify_one();
        }
    }
}
