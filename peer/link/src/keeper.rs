//! Finds other robots by multicast and keeps the links that [`neighbourhood`](crate::neighbourhood) chooses.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use tokio::sync::mpsc;
use zenoh::config::WhatAmI;
use zenoh::session::ZenohId;

use crate::account::Account;
use crate::identity::{robot_of, swarm_checksum};
use crate::inbox::Inbox;
use crate::neighbourhood::{Neighbourhood, View};
use crate::session::Node;

/// How often links are looked after.
const PERIOD: Duration = Duration::from_millis(500);

/// How often when no link has come or gone for a while.
const IDLE_PERIOD: Duration = Duration::from_secs(3);
const UNREST: Duration = Duration::from_secs(10);

/// How long answers to a call are waited for.
const CALL: Duration = Duration::from_millis(700);

/// The most robots kept in mind as heard.
const MAX_HEARD: usize = 4096;

/// A robot that could not be dialled so often in a row is gone, unless it is heard anew.
const MAX_FAILURES: u32 = 3;

/// The task that looks after the links of one robot.
pub(super) struct Keeper {
    me: RobotId,
    swarm: u32,
    neighbourhood: Neighbourhood,
    node: Node,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    scouting: zenoh::Config,
    heard: BTreeMap<RobotId, Sighting>,
    busy: BTreeSet<RobotId>,
    news: (mpsc::UnboundedSender<Sign>, mpsc::UnboundedReceiver<Sign>),
}

struct Sighting {
    id: ZenohId,
    locators: Vec<String>,
    at: Instant,
    failures: u32,
}

enum Sign {
    Heard(ZenohId, Vec<String>),
    Dialled(RobotId, bool),
}

impl Keeper {
    pub(super) fn new(
        me: RobotId,
        swarm: &str,
        max_links: usize,
        node: Node,
        inbox: Arc<Inbox>,
        account: Arc<Account>,
        scouting: zenoh::Config,
    ) -> Self {
        Self {
            me,
            swarm: swarm_checksum(swarm),
            neighbourhood: Neighbourhood::new(me, max_links),
            node,
            inbox,
            account,
            scouting,
            heard: BTreeMap::new(),
            busy: BTreeSet::new(),
            news: mpsc::unbounded_channel(),
        }
    }

    /// Never returns.
    pub(super) async fn run(mut self) -> Result<(), String> {
        let started = Instant::now();
        let mut busy_until = started + UNREST;
        let mut before = BTreeMap::new();
        loop {
            let links = self.inbox.links();
            if links != before || !self.busy.is_empty() {
                busy_until = Instant::now() + UNREST;
                before = links;
            }
            let period = if Instant::now() < busy_until { PERIOD } else { IDLE_PERIOD };
            let next = tokio::time::sleep(period);
            tokio::pin!(next);
            loop {
                tokio::select! {
                    Some(sign) = self.news.1.recv() => self.on_sign(sign),
                    () = &mut next => break,
                }
            }
            self.look_after(started).await;
        }
    }

    fn on_sign(&mut self, sign: Sign) {
        match sign {
            Sign::Heard(id, locators) => self.on_heard(id, locators),
            Sign::Dialled(robot, stands) => {
                self.busy.remove(&robot);
                if !stands {
                    self.account.count("dial_failed");
                    self.on_failure(robot);
                }
            }
        }
    }

    fn on_failure(&mut self, robot: RobotId) {
        let Some(heard) = self.heard.get_mut(&robot) else { return };
        heard.failures += 1;
        if heard.failures >= MAX_FAILURES {
            self.heard.remove(&robot);
        }
    }

    fn on_heard(&mut self, id: ZenohId, locators: Vec<String>) {
        let Some(robot) = robot_of(id, self.swarm) else { return };
        let locators = self.reachable(locators);
        if locators.is_empty() || self.inbox.is_stranger(robot) {
            return;
        }
        if robot == self.me {
            if id != self.node.id() {
                self.account.twin();
            }
            return;
        }
        if self.heard.len() < MAX_HEARD || self.heard.contains_key(&robot) {
            self.heard.insert(robot, Sighting { id, locators, at: Instant::now(), failures: 0 });
        }
    }

    /// Where a robot is dialled: in a sealed swarm by TLS alone.
    fn reachable(&self, mut locators: Vec<String>) -> Vec<String> {
        let sealed = self.inbox.is_sealed();
        locators.retain(|locator| locator.starts_with("tls/") == sealed);
        locators
    }

    async fn look_after(&mut self, started: Instant) {
        let links = self.inbox.links();
        let view = View {
            heard: self
                .heard
                .iter()
                .map(|(robot, heard)| (*robot, heard.at.saturating_duration_since(started)))
                .collect(),
            linked: links.values().copied().collect(),
            alive: self.inbox.alive(),
        };
        let plan = self.neighbourhood.plan(started.elapsed(), &view);
        for robot in plan.dial {
            self.dial(robot);
        }
        for (id, robot) in links {
            if plan.drop.contains(&robot) {
                self.account.count("links_dropped");
                self.node.hang_up(id).await;
            }
        }
        if plan.scout {
            self.call().await;
        }
    }

    fn dial(&mut self, robot: RobotId) {
        let Some(heard) = self.heard.get(&robot) else { return };
        if !self.busy.insert(robot) {
            return;
        }
        self.account.count("links_dialled");
        let (node, news, id, locators) =
            (self.node.clone(), self.news.0.clone(), heard.id, heard.locators.clone());
        tokio::spawn(async move {
            // A panic inside Zenoh makes no link.
            let dialled = tokio::spawn(async move { node.dial(id, &locators).await });
            let stands = dialled.await.unwrap_or(false);
            // The keeper may be gone: then nobody needs to know.
            let _ = news.send(Sign::Dialled(robot, stands));
        });
    }

    /// Asks who is there; the answers come as news.
    async fn call(&self) {
        self.account.count("scouted");
        let news = self.news.0.clone();
        let scouting = zenoh::scout(WhatAmI::Router, self.scouting.clone())
            .callback(move |hello| {
                let locators = hello.locators().iter().map(ToString::to_string).collect();
                let _ = news.send(Sign::Heard(hello.zid(), locators));
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
}
