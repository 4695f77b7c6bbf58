//! How a fusion centre serves robots that only stream.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::RobotId;
use serde::{Deserialize, Serialize};

use super::{CameraChoice, ConfigError};

/// A fusion centre: it processes the frames of robots without a computer.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CenterSection {
    /// Who decides.
    pub fuse: Fuse,
    /// The most robots served at a time. Range `1..=256`.
    pub max_robots: usize,
    /// Perception threads; `null`: one per core. Range `1..=64`.
    pub workers: Option<usize>,
    /// Into how many of a robot's frames one look (`rounds.decorrelation`) is divided; no more are asked for. `None`: every frame
    /// that its camera takes. Range `1..=32`.
    pub frames_per_look: Option<u32>,
    /// A robot silent for this long counts as frozen; one with a slow camera has the time of three frames.
    #[serde(with = "humantime_serde")]
    pub frozen_after: Duration,
    /// A robot silent for this long has left the swarm, and no round waits for it; never before it counts as frozen. At least `frozen_after`.
    #[serde(with = "humantime_serde")]
    pub gone_after: Duration,
    /// What is known of single robots, by id.
    pub robots: BTreeMap<RobotId, StreamingSection>,
}

/// Who decides for robots that a centre serves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fuse {
    /// The centre: each robot votes, one mind decides.
    #[default]
    Central,
    /// Each robot: all have minds of their own, which gossip as on-board robots do.
    Swarm,
}

/// What is known of a robot that only streams.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StreamingSection {
    /// Its display name; `null`: its camera's and its id.
    pub name: Option<String>,
    /// Its camera; `null`: what it says itself, or else the centre's `camera.model`.
    pub camera: Option<CameraChoice>,
}

impl Default for CenterSection {
    fn default() -> Self {
        Self {
            fuse: Fuse::Central,
            max_robots: 64,
            workers: None,
            frames_per_look: Some(3),
            frozen_after: Duration::from_secs(2),
            gone_after: Duration::from_secs(10),
            robots: BTreeMap::new(),
        }
    }
}

impl CenterSection {
    /// Each value outside its range.
    pub(super) fn check(&self) -> Vec<ConfigError> {
        let mut found = Vec::new();
        if !(1..=256).contains(&self.max_robots) {
            let cause = format!("{} is outside 1..=256: 64 suits most machines", self.max_robots);
            found.push(ConfigError::value("center.max_robots", cause));
        }
        if let Some(workers) = self.workers.filter(|workers| !(1..=64).contains(workers)) {
            let cause = format!("{workers} is outside 1..=64: null means one per core");
            found.push(ConfigError::value("center.workers", cause));
        }
        if let Some(frames) = self.frames_per_look.filter(|frames| !(1..=32).contains(frames)) {
            let cause = format!("{frames} is outside 1..=32: null means every frame");
            found.push(ConfigError::value("center.frames_per_look", cause));
        }
        let day = Duration::from_secs(24 * 60 * 60);
        if self.frozen_after.is_zero() || self.gone_after < self.frozen_after || self.gone_after > day {
            let cause = "must be at least center.frozen_after, which must be above 0, and at most a day";
            found.push(ConfigError::value("center.gone_after", cause));
        }
        let cameras = self.robots.iter().filter_map(|(robot, about)| {
            about.camera.as_ref()?.check(&format!("center.robots.{robot}.camera")).err()
        });
        found.extend(cameras);
        found
    }
}
