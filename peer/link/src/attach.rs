//! How a client comes to one of its swarm's robots and to nobody else, and comes back when that is gone. In a sealed swarm it says things that not everybody may
//! read, and believes what it hears.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::Keys;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout, timeout_at};
use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::session::ZenohId;

use crate::closing::Closing;
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

/// How often it is looked whether the link still stands, and how long is waited after a look in vain.
const STANDS: Duration = Duration::from_secs(1);
const IN_VAIN: Duration = Duration::from_secs(5);

/// A client has one link: how long that to a stranger may take to end, before another one is dialled.
const ENDING: Duration = Duration::from_millis(300);

/// How many answers to a call wait to be looked into; what is lost is said again.
const MAX_ANSWERS: usize = 256;

/// How many endpoints of an answer are tried: each may take as long as a lease, and anybody may answer.
const MAX_ENDPOINTS: usize = 4;

/// How long those that are no robots of the swarm are left aside: one may answer.
const QUIET: Duration = Duration::from_millis(300);

/// How long a robot has to answer through a router that is none.
const BEHIND: Duration = Duration::from_millis(500);

/// After this long a place is dialled again, and so many are kept in mind.
const AGAIN: Duration = Duration::from_secs(1);
const MAX_PLACES: usize = 1024;

/// A session in client mode that is linked to robots of a swarm: of a sealed one to those on the roster, each with the key that it has there. Dropping it ends it.
pub(crate) struct Attached {
    node: Node,
    closing: Closing,
    /// Looks for a robot whenever there is no link to one, if none was named.
    looking: Looking,
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
            return Err(unreached(keys, "neither is an endpoint named, nor is one looked for"));
        }
        let scouting = config.clone();
        // Zenoh would link to whoever is first to answer.
        config.insert_json5("scouting/multicast/enabled", "false").expect("a switch");
        let guard = link.credentials.as_ref().map(|credentials| Guard {
            swarm: swarm_checksum(keys.swarm()),
            door: Arc::new(Door::new(credentials.roster().clone())),
            account: None,
        });
        let node = match Node::open(config, guard, None, |_, _| {}).await {
            Err(LinkError::Start { cause, .. }) => return Err(unreached(keys, &cause)),
            opened => opened?,
        };
        // Whatever becomes of this attempt, the session ends with it.
        let mut attached = Self { node: node.clone(), closing: node.closing(), looking: Looking::default() };
        let search = Search { node, keys: keys.clone(), credentials: link.credentials.clone(), scouting };
        if is_named {
            // Zenoh dials them, for as long as the session is open.
            if timeout(PATIENCE, search.is_linked()).await.is_ok() {
                return Ok(attached);
            }
        } else if let Some(found) = search.look().await? {
            attached.looking = Looking(Some(tokio::spawn(search.stay(found))));
            return Ok(attached);
        }
        let refused = search.node.refused().map(|refused| refused.to_string());
        Err(unreached(keys, refused.as_deref().unwrap_or("none answers")))
    }

    pub fn session(&self) -> &Session {
        self.node.session()
    }

    pub async fn close(self) {
        drop(self.looking);
        self.closing.forget();
        self.node.close().await;
    }
}

/// Ends with what it looks for.
#[derive(Default)]
struct Looking(Option<JoinHandle<()>>);

impl Drop for Looking {
    fn drop(&mut self) {
        if let Some(looking) = &self.0 {
            looking.abort();
        }
    }
}

fn unreached(keys: &Keys, cause: &str) -> LinkError {
    LinkError::Unreached { swarm: keys.swarm().to_owned(), cause: cause.to_owned() }
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

    /// Looks again whenever the link to the session that was found is gone, for good.
    async fn stay(self, mut found: ZenohId) {
        loop {
            sleep(STANDS).await;
            while !self.node.is_linked_to(found) {
                let looked = self.look().await.unwrap_or_else(|error| {
                    tracing::debug!("looking for a robot: {error}");
                    None
                });
                match looked {
                    Some(other) => found = other,
                    None => sleep(IN_VAIN).await,
                }
            }
        }
    }

    /// Dials each that answers as a robot of the swarm would, until one is one. In an open swarm, where none does, a router of another kind will do,
    /// if there are robots of the swarm behind it. `None` when none is found in time.
    ///
    /// Not to be broken off: Zenoh dials nobody again whom it was dialling then, and a link to a stranger could be left.
    async fn look(&self) -> Result<Option<ZenohId>, LinkError> {
        let (answer, mut answers) = mpsc::channel::<Place>(MAX_ANSWERS);
        let sealed = self.credentials.is_some();
        let _calling = zenoh::scout(WhatAmI::Router, self.scouting.clone())
            .callback(move |hello| {
                let endpoints = hello.locators().iter().map(ToString::to_string);
                let endpoints = endpoints.filter(|it| reach::is_tls(it) == sealed).take(MAX_ENDPOINTS);
                let _ = answer.try_send((hello.zid(), endpoints.collect()));
            })
            .await
            .map_err(|error| LinkError::open(&*error))?;
        let began = Instant::now();
        let (mut dialled, mut routers) = (BTreeMap::new(), VecDeque::new());
        while began.elapsed() < PATIENCE {
            let until = if routers.is_empty() { began + PATIENCE } else { began + QUIET };
            let place = match timeout_at(until.into(), answers.recv()).await {
                Ok(Some((_, endpoints))) if endpoints.is_empty() => continue,
                Ok(Some(place)) if self.is_ours(place.0) => place,
                Ok(Some(place)) => {
                    if !sealed && routers.len() < MAX_PLACES && !routers.contains(&place) {
                        routers.push_back(place);
                    }
                    continue;
                }
                Ok(None) => return Err(unreached(&self.keys, "there is no network interface to call on")),
                Err(_) => match routers.pop_front() {
                    Some(place) => place,
                    None => break,
                },
            };
            if dialled.get(&place).is_some_and(|at: &Instant| at.elapsed() < AGAIN) {
                continue;
            }
            let (id, endpoints) = &place;
            let stands = self.node.dial(*id, endpoints).await;
            if self.node.is_linked_to(*id) {
                if self.is_ours(*id) || self.hears_a_robot().await {
                    return Ok(Some(*id));
                }
                self.node.leave(*id).await;
            } else if stands {
                // It was hung up, which takes a moment.
                sleep(ENDING).await;
            }
            if dialled.len() >= MAX_PLACES {
                dialled.clear();
            }
            dialled.insert(place, Instant::now());
        }
        Ok(None)
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

impl fmt::Debug for Attached {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Attached").field(&self.node.id()).finish()
    }
}
