//! Many robots of one process, that find each other by multicast.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_link::{LinkConfig, RobotConfig, Scouting};
use gestalt_strategies::MindConfig;

use crate::Watched;

/// Many robots share the processor with each other and with whatever else runs here: Zenoh's own lease.
const LEASE: Duration = Duration::from_secs(10);

/// That robot as one of many, which looks for the others on the loopback interface.
#[must_use]
pub fn in_crowd(plain: RobotConfig) -> RobotConfig {
    // A group and port of this process alone.
    let port = 20_000 + std::process::id() % 20_000;
    let scouting = Scouting { address: format!("239.255.77.77:{port}"), interface: "lo".to_owned() };
    let link = LinkConfig { scouting: Some(scouting), lease: LEASE, ..plain.link };
    // A busy machine may take long to bring the votes together; no round is to end undecided for that.
    let mind = MindConfig { deadline: Duration::from_secs(30), ..MindConfig::default() };
    RobotConfig { link, mind, ..plain }
}

/// Seconds of processor time this process has used.
///
/// # Panics
/// Where the system does not say it as Linux does.
#[must_use]
pub fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    let ticks = |i: usize| fields[i].parse::<f64>().unwrap();
    (ticks(11) + ticks(12)) / 100.0
}

/// The robots' counters, summed.
#[must_use]
pub fn sums(robots: &[Watched]) -> BTreeMap<String, u64> {
    let mut sums = BTreeMap::new();
    for (name, count) in robots.iter().flat_map(|robot| robot.robot.status().counters) {
        *sums.entry(name).or_default() += count;
    }
    sums
}
