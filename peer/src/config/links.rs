//! How a robot finds others, as its configuration file says it.

use serde::{Deserialize, Serialize};

use super::ConfigError;
use gestalt_link::{Cells, LinkConfig, Scouting};

/// How a robot finds others, and how many it links to. Endpoints stand in the `zenoh` block.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinksSection {
    /// Looking for robots by UDP multicast.
    pub scouting: ScoutingSection,
    /// The most links that scouting builds up to. Range `2..=16`.
    pub max_links: usize,
    /// Whether robots form cells, and how large: for swarms of more than a hundred.
    pub cells: Option<Cells>,
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
        Self { scouting: ScoutingSection::default(), max_links: LinkConfig::default().max_links, cells: None }
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
        if !(2..=16).contains(&self.max_links) {
            let cause = "is outside 2..=16: two links keep a swarm connected, four add redundancy";
            return Err(ConfigError::value("links.max_links", format!("{} {cause}", self.max_links)));
        }
        let Some(Cells { size }) = self.cells else { return Ok(()) };
        if !(1..=Cells::MAX_SIZE).contains(&size) {
            let cause = format!("{size} is outside 1..={}: 32 is well tried", Cells::MAX_SIZE);
            return Err(ConfigError::value("links.cells.size", cause));
        }
        if !self.scouting.enabled {
            let cause =
                "relays are found by scouting, which is off: links: {scouting: {enabled: true}}, or no cells";
            return Err(ConfigError::value("links.cells", cause));
        }
        Ok(())
    }
}
