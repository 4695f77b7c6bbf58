//! How a client of a sealed swarm comes to one of its robots and to nobody else: it says things that not everybody may read, and believes what it hears.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::session::ZenohId;

use crate::config::LinkConfig;
use crate::error::LinkError;
use crate::identity::{robot_of, swarm_checksum};
use crate::reach;
use crate::session::{Guard, Node};
use crate::tls::{Credentials, Door};

/// How long a robot is looked for.
const PATIENCE: Duration = Duration::from_secs(5);

/// How often it is looked whether one was reached.
const LOOK_AFTER: Duration = Duration::from_millis(20);

/// A client has one link: how long that to a stranger may take to end, before another one is dialled.
const ENDING: Duration = Duration::from_millis(300);

/// How many answers to a call wait to be looked into; what is lost is said again.
const MAX_ANSWERS: usize = 256;

/// A session in client mode that is linked to robots on the roster, each with the key that it has there. Dropping it ends it.
pub(crate) struct Attached(Option<Node>);

/// Where somebody says that a session is.
type Place = (ZenohId, Vec<String>);

impl Attached {
    /// Attaches to a robot at one of the endpoints that `link` names, or else to one that answers a call.
    ///
    /// # Errors
    /// [`LinkError::Config`] names what Zenoh cannot take, [`LinkError::Open`] says that no robot could be reached.
    pub async fn open(swarm: &str, link: &LinkConfig, credentials: &Credentials) -> Result<Self, LinkError> {
        let config = link.client()?;
        let is_named = reach::names_any(&config);
        if !is_named && link.scouting.is_none() {
            return Err(LinkError::Open(
                "neither an endpoint of a robot is named, nor is one looked for: name one with -e".to_owned(),
            ));
        }
        let scouting = config.clone();
        let door = Arc::new(Door::new(credentials.roster().clone()));
        let guard = Guard { swarm: swarm_checksum(swarm), door, account: None };
        let node = match Node::open(config, Some(guard), None, |_, _| {}).await {
            Err(LinkError::Start { cause, .. }) => return Err(LinkError::unreached_for(&cause)),
            opened => opened?,
        };
        // Whatever becomes of this attempt, the session ends with it.
        let attached = Self(Some(node.clone()));
        let looking = async {
            if is_named {
                // Zenoh dials them, for as long as the session is open.
                while !node.is_linked() {
                    sleep(LOOK_AFTER).await;
                }
                Ok(())
            } else {
                look(&node, swarm, credentials, scouting).await
            }
        };
        if let Ok(found) = timeout(PATIENCE, looking).await {
            return found.map(|()| attached);
        }
        let refused = node.refused().map(|refused| {
            format!(": {refused}; if it is a robot that was enrolled since, take the newest roster.json")
        });
        Err(LinkError::Open(format!("no robot of this swarm was reached{}", refused.unwrap_or_default())))
    }

    pub fn session(&self) -> Option<Session> {
        self.0.as_ref().map(|node| node.session().clone())
    }

    pub async fn close(mut self) {
        if let Some(node) = self.0.take() {
            node.close().await;
        }
    }
}

/// Dials each that answers as a robot on the roster would, by TLS, until one is one. Anybody may answer, in anybody's name.
async fn look(
    node: &Node,
    swarm: &str,
    credentials: &Credentials,
    scouting: zenoh::Config,
) -> Result<(), LinkError> {
    let (swarm, robots) = (swarm_checksum(swarm), &credentials.roster().members().robots);
    let (answer, mut answers) = mpsc::channel::<Place>(MAX_ANSWERS);
    let _calling = zenoh::scout(WhatAmI::Router, scouting)
        .callback(move |hello| {
            let locators = hello.locators().iter().map(ToString::to_string);
            let _ = answer.try_send((hello.zid(), locators.filter(|it| it.starts_with("tls/")).collect()));
        })
        .await
        .map_err(|error| LinkError::open(&*error))?;
    let mut dialled = BTreeSet::new();
    while let Some(place) = answers.recv().await {
        let (id, locators) = &place;
        let is_enrolled = robot_of(*id, swarm).is_some_and(|robot| robots.contains_key(&robot));
        if !is_enrolled || locators.is_empty() || dialled.contains(&place) {
            continue;
        }
        let stands = node.dial(*id, locators).await;
        if node.is_linked() {
            return Ok(());
        }
        if stands {
            sleep(ENDING).await;
        }
        dialled.insert(place);
    }
    Err(LinkError::Open("the calls for robots have ended".to_owned()))
}

impl Drop for Attached {
    fn drop(&mut self) {
        if let (Some(node), Ok(runtime)) = (self.0.take(), tokio::runtime::Handle::try_current()) {
            runtime.spawn(async move { node.close().await });
        }
    }
}

impl fmt::Debug for Attached {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Attached").field(&self.0.as_ref().map(Node::id)).finish()
    }
}
