//! Against whom there is evidence, and who is still to hear of it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::RobotId;

use crate::evidence::{Conviction, Evidence, Lie};

/// The most bytes of evidence that are kept for those who come later. Who lied beyond that is convicted all the same.
const KEPT_BYTES: usize = 16 * 1024 * 1024;

/// All of it is told again this often at most, whoever comes and goes.
const AGAIN: Duration = Duration::from_secs(5);

/// The evidence that convicted somebody.
#[derive(Clone, Debug, Default)]
pub(crate) struct Docket {
    kept: BTreeMap<RobotId, Evidence>,
    /// Found here, and told to nobody yet.
    untold: BTreeSet<RobotId>,
    /// Whether somebody is here who was not, and when that was last seen to.
    again: bool,
    told: Option<Duration>,
    /// Convicted since it was last asked who was.
    fallen: Vec<(RobotId, Lie)>,
}

impl Docket {
    /// Takes in what convicted that robot; `found`: here, so that others are to be told.
    pub fn enter(&mut self, Conviction { robot, lie, .. }: Conviction, evidence: Evidence, found: bool) {
        self.fallen.push((robot, lie));
        let bytes: usize = self.kept.values().map(Evidence::length).sum();
        if bytes + evidence.length() <= KEPT_BYTES {
            self.kept.insert(robot, evidence);
            if found {
                self.untold.insert(robot);
            }
        }
    }

    /// Forgets whoever is not kept.
    pub fn retain(&mut self, keeps: impl Fn(RobotId) -> bool) {
        self.kept.retain(|robot, _| keeps(*robot));
        self.untold.retain(|robot| keeps(*robot));
        self.fallen.retain(|(robot, _)| keeps(*robot));
    }

    /// What is to be told to all now.
    pub fn untold(&mut self, now: Duration) -> Vec<(RobotId, Evidence)> {
        let mut untold = std::mem::take(&mut self.untold);
        if self.again && self.told.is_none_or(|told| now.saturating_sub(told) >= AGAIN || now < told) {
            (self.again, self.told) = (false, Some(now));
            untold.extend(self.kept.keys());
        }
        untold.into_iter().filter_map(|robot| Some((robot, self.kept.get(&robot)?.clone()))).collect()
    }

    /// Somebody is here who was not.
    pub fn tell_again(&mut self) {
        self.again = !self.kept.is_empty();
    }

    /// Who was convicted since this was last asked, and of what.
    pub fn fallen(&mut self) -> Vec<(RobotId, Lie)> {
        std::mem::take(&mut self.fallen)
    }
}
