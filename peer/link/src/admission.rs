//! Who is let in by a session, and for how many there is room.

use std::sync::Arc;

use gestalt_protocol::RobotId;

use crate::account::Account;
use crate::tls::Door;

/// Who guards the door of a robot of a sealed swarm, or looks at whom a client of one has dialled.
pub(crate) struct Guard {
    /// The checksum of the swarm's name.
    pub swarm: u32,
    pub door: Arc<Door>,
    /// That of the robot. A client, which speaks to robots alone, has none.
    pub account: Option<Arc<Account>>,
}

/// For how many robots that relay for nobody a relay has room.
pub(crate) struct Room {
    /// The robot that runs it, for which there always is.
    pub of: RobotId,
    /// The checksum of the swarm's name.
    pub swarm: u32,
    pub size: usize,
    pub account: Arc<Account>,
}
