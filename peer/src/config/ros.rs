//! What ROS sees of a robot, as its configuration file says it.

use std::time::Duration;

use gestalt_protocol::RobotId;
use gestalt_ros::{NameError, NodeName};
use serde::{Deserialize, Serialize};

use super::ConfigError;

/// A robot as a node of a ROS 2 system that runs `rmw_zenoh`: `<namespace>/robot_<id>`, which shows what the robot sees.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RosNodeSection {
    /// Whether it is one.
    pub enabled: bool,
    /// The Zenoh router of the ROS system; `null`: the one on this machine, `tcp/localhost:7447`.
    pub router: Option<String>,
    /// The ROS domain, `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// The node's namespace.
    pub namespace: String,
    /// How many pictures a second it shows at most, while somebody subscribes; `0.1..=30`.
    pub views_per_second: f64,
}

impl Default for RosNodeSection {
    fn default() -> Self {
        Self {
            enabled: false,
            router: None,
            domain: 0,
            namespace: "/gestalt".to_owned(),
            views_per_second: 2.0,
        }
    }
}

impl RosNodeSection {
    /// The node of a robot.
    ///
    /// # Errors
    /// When the namespace is none in ROS.
    pub fn node(&self, robot: RobotId) -> Result<NodeName, NameError> {
        NodeName::new(&self.namespace, &format!("robot_{robot}"))
    }

    /// The least time between two pictures.
    #[must_use]
    pub fn every(&self) -> Duration {
        Duration::from_secs_f64(self.views_per_second.clamp(0.1, 30.0).recip())
    }

    /// Each value outside its range. `sees`: whether the robot has a camera.
    pub(super) fn check(&self, robot: RobotId, sees: bool) -> Vec<ConfigError> {
        let mut found = Vec::new();
        if let Err(error) = self.node(robot) {
            found.push(ConfigError::value("ros.namespace", error));
        }
        if !(0.1..=30.0).contains(&self.views_per_second) {
            let rate = self.views_per_second;
            found.push(ConfigError::value(
                "ros.views_per_second",
                format!("{rate} pictures a second: set it within 0.1..=30"),
            ));
        }
        if self.enabled && !sees {
            found.push(ConfigError::value(
                "ros.enabled",
                "a robot without a camera has nothing to show: set camera.source, or ros.enabled to false (decisions go to ROS by `gestalt ros`)",
            ));
        }
        found
    }
}
