//! How a robot finds others, as its configuration file says it.

use serde::{Deserialize, Serialize};

use super::ConfigError;
use gestalt_link::{LinkConfig, Scouting};

/// How a robot finds others, and how many it links to. Endpoints stand in the `zenoh` block.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinksSection {
    /// Looking for robots by UDP multicast.
    pub scouting: ScoutingSection,
    /// The most links that scouting builds up to. Range `2..=16`.
    pub max_links: usize,
}

/// Looking for robots by UDP multicast.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoutingSection {
    /// Off: the endpoints of the `zenoh` block alone.
    pub enabled: bool,
    /// The multicast group and port.
    pub address: String,
    /// The network interface, or `auto`.
    pub interface: String,
}

impl Default for LinksSection {
    fn default() -> Self {
        Self { scouting: ScoutingSection::default(), max_links: LinkConfig::default().max_links }
    }
}

impl Default for ScoutingSection {
    fn default() -> Self {
        let Scouting { address, interface } = Scouting::default();
        Self { enabled: true, address, interface }
    }
}

impl LinksSection {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if (2..=16).contains(&self.max_links) {
            return Ok(());
        }
        let cause = "is outside 2..=16: two links keep a swarm connected, four add redundancy";
        Err(ConfigError::value("links.max_links", format!("{} {cause}", self.max_links)))
    }
}
