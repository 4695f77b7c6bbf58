//! How a client comes to one of its swarm's robots and to nobody else, and comes back when that is gone. In a sealed swarm it says things that not everybody may
//! read, and believes what it hears.

use std::collections::{BTreeSet, VecDeque};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::Keys;
use tokio::sync::{Notify, mpsc};
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::session::ZenohId;

use crate::config::LinkConfig;
use crate::error::LinkError;
use crate::identity::{robot_of, serves, swarm_checksum};
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

/// How long nobody answers before those are tried that are no robots of the swarm.
const QUIET: Duration = Duration::from_millis(300);

/// How long a robot has to answer through a router that is none.
const BEHIND: Duration = Duration::from_millis(500);

/// How many of these are kept in mind.
const MAX_ROUTERS: usize = 64;

/// A session in client mode that is linked to robots of a swarm: of a sealed one to those on the roster, each with the key that it has there. Dropping it ends it.
pub(crate) struct Attached {
    /// `None` once it is closed.
    node: Option<Node>,
    /// Looks for a robot whenever there is no link to one, if none was named.
    looking: Option<JoinHandle<()>>,
}

/// Where somebody says that a session is.
type Place = (ZenohId, Vec<String>);

impl Attached {
    /// Attaches to a robot at one of the endpoints that `link` names, or else to one that answers a call.
    ///
    /// # Errors
    /// [`LinkError::Config`] names what Zenoh cannot take, [`LinkError::Unreached`] says that no robot could be reached.
    pub async fn open(keys: &Keys, link: &LinkConfig) -> Result<Self, LinkError> {
        let mut config = link.client()?;
        let is_named = reach::names_any(&config);
        if !is_named && link.scouting.is_none() {
            return Err(LinkError::Open(
                "neither an endpoint of a robot is named, nor is one looked for: name one with -e".to_owned(),
            ));
        }
        let scouting = config.clone();
        // Zenoh would link to whoever is first to answer.
        config.insert_json5("scouting/multicast/enabled", "false").expect("a switch");
        let guard = link.credentials.as_ref().map(|credentials| Guard {
            swarm: swarm_checksum(keys.swarm()),
            door: Arc::new(Door::new(credentials.roster().clone())),
            account: None,
        });
        let gone = Arc::new(Notify::new());
        let on_link = {
            let gone = gone.clone();
            move |_, stands: bool| {
                if !stands {
                    gone.notify_one();
                }
            }
        };
        let node = match Node::open(config, guard, None, on_link).await {
            Err(LinkError::Start { cause, .. }) => return Err(unreached(keys, cause)),
            opened => opened?,
        };
        // Whatever becomes of this attempt, the session ends with it.
        let mut attached = Self { node: Some(node.clone()), looking: None };
        let search = Search { node, keys: keys.clone(), credentials: link.credentials.clone(), scouting };
        let found = match is_named {
            // Zenoh dials them, for as long as the session is open.
            true => timeout(PATIENCE, search.is_linked()).await.map(Ok),
            false => timeout(PATIENCE, search.look()).await,
        };
        if let Ok(found) = found {
            found?;
            attached.looking = (!is_named).then(|| tokio::spawn(search.stay(gone)));
            return Ok(attached);
        }
        Err(unreached(
            keys,
            match search.node.refused() {
                Some(refused) => format!(
                    "{refused}; if it is a robot that was enrolled since, take the newest roster.json"
                ),
                None => "none answers".to_owned(),
            },
        ))
    }

    pub fn session(&self) -> &Session {
        self.node.as_ref().expect("it is closed once").session()
    }

    pub async fn close(mut self) {
        if let Some(node) = self.end() {
            node.close().await;
        }
    }

    fn end(&mut self) -> Option<Node> {
        if let Some(looking) = self.looking.take() {
            looking.abort();
        }
        self.node.take()
    }
}

fn unreached(keys: &Keys, cause: String) -> LinkError {
    LinkError::Unreached { swarm: keys.swarm().to_owned(), cause }
}

/// Looks for a robot among those who answer. Anybody may answer, in anybody's name.
struct Search {
    node: Node,
    keys: Keys,
    credentials: Option<Credentials>,
    /// The configuration of the calls.
    scouting: zenoh::Config,
}

impl Search {
    async fn is_linked(&self) {
        while !self.node.is_linked() {
            sleep(LOOK_AFTER).await;
        }
    }

    /// Looks again whenever the link is gone, for good.
    async fn stay(self, gone: Arc<Notify>) {
        loop {
            gone.notified().await;
            while !self.node.is_linked() {
                // Whoever was dialled in vain is dialled again in the next look.
                match timeout(PATIENCE, self.look()).await {
                    Ok(Ok(())) | Err(_) => {}
                    Ok(Err(error)) => {
                        tracing::debug!("looking for a robot: {error}");
                        sleep(PATIENCE).await;
                    }
                }
            }
        }
    }

    /// Dials each that answers as a robot of the swarm would, until one is one. In an open swarm, where none does, a router of another kind will do,
    /// if there are robots of the swarm behind it.
    async fn look(&self) -> Result<(), LinkError> {
        let (answer, mut answers) = mpsc::channel::<Place>(MAX_ANSWERS);
        let sealed = self.credentials.is_some();
        let _calling = zenoh::scout(WhatAmI::Router, self.scouting.clone())
            .callback(move |hello| {
                let locators = hello.locators().iter().map(ToString::to_string);
                let _ = answer.try_send((
                    hello.zid(),
                    locators.filter(|it| it.starts_with("tls/") == sealed).collect(),
                ));
            })
            .await
            .map_err(|error| LinkError::open(&*error))?;
        let (mut dialled, mut routers) = (BTreeSet::new(), VecDeque::new());
        loop {
            let place = match timeout(QUIET, answers.recv()).await {
                Ok(Some(place)) if self.is_ours(place.0) => place,
                Ok(Some(place)) => {
                    if !sealed && routers.len() < MAX_ROUTERS && !routers.contains(&place) {
                        routers.push_back(place);
                    }
                    continue;
                }
                Ok(None) => return Err(LinkError::Open("the calls for robots have ended".to_owned())),
                Err(_) => match routers.pop_front() {
                    Some(place) => place,
                    None => continue,
                },
            };
            if place.1.is_empty() || dialled.contains(&place) {
                continue;
            }
            let stands = self.node.dial(place.0, &place.1).await;
            if self.node.is_linked() && (self.is_ours(place.0) || self.hears_a_robot().await) {
                return Ok(());
            }
            self.node.leave(place.0).await;
            if stands {
                sleep(ENDING).await;
            }
            dialled.insert(place);
        }
    }

    /// Whether the session with that id says that it is a robot of the swarm.
    fn is_ours(&self, id: ZenohId) -> bool {
        let swarm = swarm_checksum(self.keys.swarm());
        match &self.credentials {
            Some(credentials) => robot_of(id, swarm)
                .is_some_and(|robot| credentials.roster().members().robots.contains_key(&robot)),
            None => serves(id, swarm),
        }
    }

    /// Whether a robot of the swarm is there.
    async fn hears_a_robot(&self) -> bool {
        let alive =
            self.node.session().liveliness().get(self.keys.every_robot("alive")).timeout(BEHIND).await;
        match alive {
            Ok(alive) => alive.recv_async().await.is_ok_and(|reply| reply.result().is_ok()),
            Err(_) => false,
        }
    }
}

impl Drop for Attached {
    fn drop(&mut self) {
        if let (Some(node), Ok(runtime)) = (self.end(), tokio::runtime::Handle::try_current()) {
            runtime.spawn(async move { node.close().await });
        }
    }
}

impl fmt::Debug for Attached {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Attached").field(&self.node.as_ref().map(Node::id)).finish()
    }
}
