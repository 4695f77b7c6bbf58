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
use crate::sightings::{Place, Sightings};

/// How often links are looked after.
const PERIOD: Duration = Duration::from_millis(500);

/// How often when no link has come or gone for a while.
const IDLE_PERIOD: Duration = Duration::from_secs(3);
const UNREST: Duration = Duration::from_secs(10);

/// How long answers to a call are waited for.
const CALL: Duration = Duration::from_millis(700);

/// The task that looks after the links of one robot.
pub(super) struct Keeper {
    me: RobotId,
    swarm: u32,
    neighbourhood: Neighbourhood,
    node: Node,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    scouting: zenoh::Config,
    heard: Sightings,
    started: Instant,
    busy: BTreeSet<RobotId>,
    news: (mpsc::UnboundedSender<Sign>, mpsc::UnboundedReceiver<Sign>),
}

enum Sign {
    Heard(ZenohId, Vec<String>),
    Dialled(RobotId, Place, bool),
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
            heard: Sightings::default(),
            started: Instant::now(),
            busy: BTreeSet::new(),
            news: mpsc::unbounded_channel(),
        }
    }

    /// Never returns.
    pub(super) async fn run(mut self) -> Result<(), String> {
        let mut busy_until = Instant::now() + UNREST;
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
            self.look_after().await;
        }
    }

    fn on_sign(&mut self, sign: Sign) {
        match sign {
            Sign::Heard(id, locators) => self.on_heard(id, locators),
            Sign::Dialled(robot, place, stands) => {
                self.busy.remove(&robot);
                self.heard.dialled(robot, &place, stands);
                if !stands {
                    self.account.count("dial_failed");
                }
            }
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
        self.heard.hear(self.started.elapsed(), robot, Place { id, locators });
    }

    /// Where a robot is dialled: in a sealed swarm by TLS alone.
    fn reachable(&self, mut locators: Vec<String>) -> Vec<String> {
        let sealed = self.inbox.is_sealed();
        locators.retain(|locator| locator.starts_with("tls/") == sealed);
        locators
    }

    async fn look_after(&mut self) {
        let links = self.inbox.links();
        let view = View {
            heard: self.heard.heard(),
            linked: links.values().copied().collect(),
            alive: self.inbox.alive(),
        };
        let plan = self.neighbourhood.plan(self.started.elapsed(), &view);
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
        let Some(place) = self.heard.next(robot) else { return };
        if !self.busy.insert(robot) {
            return;
        }
        self.account.count("links_dialled");
        let (node, news) = (self.node.clone(), self.news.0.clone());
        tokio::spawn(async move {
            // A panic inside Zenoh makes no link.
            let Place { id, locators } = place.clone();
            let dialled = tokio::spawn(async move { node.dial(id, &locators).await });
            let stands = dialled.await.unwrap_or(false);
            // The keeper may be gone: then nobody needs to know.
            let _ = news.send(Sign::Dialled(robot, place, stands));
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
