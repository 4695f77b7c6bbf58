//! The page of the swarm that a robot serves, as its configuration file says it.

use gestalt_desk::Address;
use serde::{Deserialize, Serialize};

/// The page.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WebSection {
    /// Where it is served; nowhere unless this is set.
    pub listen: Option<Address>,
}
