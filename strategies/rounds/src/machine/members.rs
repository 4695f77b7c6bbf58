//! Who was drawn to vote in the newest round, of a large swarm.

use std::collections::BTreeSet;

use gestalt_protocol::RobotId;

use crate::electorate::{Electorate, Expected};
use crate::others::Others;

/// The committee of the newest round, as this robot draws it from all that it knows of.
#[derive(Clone, Debug)]
pub(super) struct Committee {
    pub members: BTreeSet<RobotId>,
    /// The others of them that are alive.
    pub expected: BTreeSet<RobotId>,
    /// Those of them that came while the round was open: they may not have heard of it.
    pub late: BTreeSet<RobotId>,
}

/// The other robots of whom a vote is to be expected in the newest round.
pub(super) fn expected<'a>(
    committee: Option<&'a Committee>,
    electorate: &'a Electorate,
    alive: &'a Others,
) -> Expected<'a> {
    match committee {
        Some(committee) => Expected::Drawn(&committee.expected),
        None => electorate.expected(alive),
    }
}
