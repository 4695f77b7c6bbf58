//! Asks by multicast who is there, and keeps what was answered.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use zenoh::config::WhatAmI;
use zenoh::session::ZenohId;

use crate::account::Account;
use crate::failure::Part;
use crate::identity::{is_of_life, robot_of, swarm_checksum};
use crate::inbox::Inbox;
use crate::interfaces::{self, Interfaces};
use crate::reach::is_tls;
use crate::sightings::{Place, Sightings};
use crate::supervisor::Supervisor;

/// How long answers to a call are waited for.
const CALL: Duration = Duration::from_millis(700);

/// What a robot knows of where others can be dialled.
pub(crate) struct Lookout {
    me: RobotId,
    nonce: u64,
    swarm: u32,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    supervisor: Arc<Supervisor>,
    scouting: zenoh::Config,
    started: Instant,
    heard: Mutex<Sightings>,
    interfaces: Mutex<Interfaces>,
}

impl Lookout {
    /// That of a robot in the life with that nonce.
    pub fn new(
        me: RobotId,
        swarm: &str,
        nonce: u64,
        inbox: Arc<Inbox>,
        supervisor: Arc<Supervisor>,
        scouting: zenoh::Config,
    ) -> Self {
        Self {
            me,
            nonce,
            swarm: swarm_checksum(swarm),
            inbox,
            account: supervisor.account().clone(),
            supervisor,
            scouting,
            started: Instant::now(),
            heard: Mutex::default(),
            interfaces: Mutex::default(),
        }
    }

    /// The time by which it says when robots were heard.
    pub fn now(&self) -> Duration {
        self.started.elapsed()
    }

    /// When each robot was heard of last.
    pub fn heard(&self) -> BTreeMap<RobotId, Duration> {
        self.sightings().heard()
    }

    /// Where to try next to reach a robot.
    pub fn next(&self, robot: RobotId) -> Option<Place> {
        self.sightings().next(robot)
    }

    /// A place was dialled.
    pub fn dialled(&self, robot: RobotId, place: &Place, stands: bool) {
        self.sightings().dialled(robot, place, stands);
        if !stands {
            self.account.count("dial_failed");
        }
    }

    /// Asks who is there; the answers come by themselves.
    pub async fn call(self: &Arc<Self>) {
        self.account.count("scouted");
        self.look_at_network();
        let lookout = self.clone();
        let scouting = zenoh::scout(WhatAmI::Router, self.scouting.clone())
            .callback(move |hello| {
                let locators = hello.locators().iter().map(ToString::to_string).collect();
                lookout.on_heard(hello.zid(), locators);
            })
            .await;
        match scouting {
            Ok(scouting) => {
                tokio::spawn(async move {
                    tokio::time::sleep(CALL).await;
                    scouting.stop();
                });
            }
            Err(error) => self.account.error(&format!(
                "cannot look for other robots: {error}: check the scouting address and interface"
            )),
        }
    }

    /// Says where others cannot be found for Zenoh does not know it; not in the midst of a round, for the mend ends the robot.
    fn look_at_network(&self) {
        let is_alone = self.inbox.links().is_empty() && !self.account.lock().open;
        let configured = self.scouting.get_json("scouting/multicast/interface").ok();
        let configured: Option<String> = configured.and_then(|json| serde_json::from_str(&json).ok());
        let unknown = interfaces::unknown(configured.as_deref().unwrap_or("auto"));
        let mut interfaces = self.interfaces.lock().unwrap_or_else(PoisonError::into_inner);
        if interfaces.is_news(self.now(), is_alone, &unknown) {
            let unknown: Vec<String> = unknown.iter().map(ToString::to_string).collect();
            let came = unknown.join(", ");
            let cause = format!("{came} came after the start, and Zenoh reads the computer's addresses once");
            self.supervisor.failed(Part::Network, &cause);
        }
    }

    fn on_heard(&self, id: ZenohId, locators: Vec<String>) {
        let Some(robot) = robot_of(id, self.swarm) else { return };
        let locators = self.reachable(locators);
        if locators.is_empty() || self.inbox.is_stranger(robot) {
            return;
        }
        if robot == self.me {
            // Of a sealed swarm whoever shouts it is no twin: that shows by its key.
            if !is_of_life(id, self.nonce) && !self.inbox.is_sealed() {
                self.account.twin();
            }
            return;
        }
        self.sightings().hear(self.now(), robot, Place { id, locators });
    }

    /// Where a robot is dialled: in a sealed swarm by TLS alone.
    pub fn reachable(&self, mut locators: Vec<String>) -> Vec<String> {
        let sealed = self.inbox.is_sealed();
        locators.retain(|locator| is_tls(locator) == sealed);
        locators
    }

    fn sightings(&self) -> MutexGuard<'_, Sightings> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
