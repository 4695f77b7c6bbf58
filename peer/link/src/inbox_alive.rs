//! Who is alive, as a robot's inbox keeps it: by Zenoh's tokens, and by who answers when all are asked.

use std::collections::BTreeSet;
use std::time::Instant;

use gestalt_protocol::{MAX_ROBOTS, RobotId, Topic};
use gestalt_trust::Distrust;
use zenoh::sample::{Sample, SampleKind};

use crate::account::Refusal;
use crate::inbox::Inbox;

impl Inbox {
    /// A robot's liveliness token came or went.
    pub(super) fn on_liveliness(&self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let Some(Topic::Alive(id)) = self.keys.parse(key) else {
            return self.account.refused("alive", key, 0, &Refusal::Key);
        };
        if self.is_stranger(id) {
            return self.account.refused("alive", key, 0, &Distrust::Stranger.into());
        }
        let mut state = self.lock();
        state.silence.changed(id);
        let changed = match sample.kind() {
            SampleKind::Put if state.alive.len() >= MAX_ROBOTS && !state.alive.contains(&id) => {
                return self.account.refused("alive", key, 0, &Refusal::Crowd);
            }
            SampleKind::Put => state.alive.insert(id),
            SampleKind::Delete => {
                state.silence.lost(Instant::now());
                state.alive.remove(&id)
            }
        };
        if changed {
            // Whoever comes listens before it says that it is there.
            if sample.kind() == SampleKind::Put {
                self.judged(|judge, _| judge.tell_again());
                self.ways.speaker(id);
            }
            state.alive_changed = true;
            self.ready.notify_one();
            self.unrest.notify_one();
        }
    }

    /// Corrects who is alive: those who answered a census are, those who stayed away twice are not.
    pub(super) fn on_census(&self, present: &BTreeSet<RobotId>, gone: &BTreeSet<RobotId>) {
        let mut state = self.lock();
        let before = state.alive.clone();
        state.alive.retain(|id| !gone.contains(id));
        for robot in present {
            if state.alive.len() < MAX_ROBOTS && !self.is_stranger(*robot) && !state.silence.is_gone(*robot) {
                state.alive.insert(*robot);
            }
        }
        if state.alive != before {
            self.account.count("census_corrections");
            state.alive_changed = true;
            self.ready.notify_one();
        }
    }

    /// The robots alive by liveliness.
    pub(super) fn tokens(&self) -> BTreeSet<RobotId> {
        self.lock().alive.clone()
    }
}
