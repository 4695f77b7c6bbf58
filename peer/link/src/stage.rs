//! Says again what a swarm once said, so that clients can be tried without robots.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_protocol::{Keys, RobotId, Topic};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::key_expr::KeyExpr;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Query;

use super::identity::{fresh_nonce, stage_id};
use super::session::Node;
use super::{LinkConfig, LinkError};

/// A session that speaks for all robots of a swarm. Clients attach to it as to a robot, and hear what is said, who is there, how each
/// robot was last, and what was decided last.
pub struct Stage {
    node: Node,
    keys: Keys,
    there: BTreeMap<RobotId, LivelinessToken>,
    /// What queries are answered with, by key.
    latest: Arc<Mutex<BTreeMap<String, Vec<u8>>>>,
}

impl Stage {
    /// Opens the session, for a swarm of that name.
    ///
    /// # Errors
    /// [`LinkError::Config`] names what Zenoh cannot take, [`LinkError::Start`] an endpoint that is taken.
    pub async fn open(swarm: &str, link: &LinkConfig) -> Result<Self, LinkError> {
        let keys = Keys::new(swarm)?;
        let node = Node::open(link.stage(&stage_id(swarm, fresh_nonce()))?, None, None, |_, _| {}).await?;
        let latest = Arc::<Mutex<BTreeMap<String, Vec<u8>>>>::default();
        for key in [keys.every_robot("status"), keys.key(&Topic::Decision)] {
            let latest = latest.clone();
            let answer = move |query: Query| answer(&latest, &query);
            let declared = node.session().declare_queryable(key).callback(answer).background().await;
            declared.map_err(|error| LinkError::open(&*error))?;
        }
        Ok(Self { node, keys, there: BTreeMap::new(), latest })
    }

    /// The endpoints that clients attach to.
    #[must_use]
    pub fn locators(&self) -> Vec<String> {
        self.node.locators()
    }

    /// Says that on the key of a topic. A status is not said, but what queries are answered with from now on.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn say(&self, topic: &Topic, bytes: Vec<u8>) -> Result<(), LinkError> {
        let key = self.keys.key(topic);
        if matches!(topic, Topic::Status(_) | Topic::Decision) {
            let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
            latest.insert(key.clone(), bytes.clone());
        }
        let encoding = match topic {
            Topic::Status(_) => return Ok(()),
            Topic::Vote(_) | Topic::Sample(_) | Topic::Evidence => Encoding::ZENOH_BYTES,
            _ => Encoding::APPLICATION_JSON,
        };
        let put = self.node.session().put(key, bytes).encoding(encoding);
        put.await.map_err(|error| LinkError::open(&*error))
    }

    /// Has a robot come, or leave.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn present(&mut self, robot: RobotId, is_there: bool) -> Result<(), LinkError> {
        if !is_there {
            self.there.remove(&robot);
        } else if !self.there.contains_key(&robot) {
            let token =
                self.node.session().liveliness().declare_token(self.keys.key(&Topic::Alive(robot))).await;
            self.there.insert(robot, token.map_err(|error| LinkError::open(&*error))?);
        }
        Ok(())
    }

    /// Ends the session; all robots are gone then.
    pub async fn close(self) {
        drop(self.there);
        self.node.close().await;
    }
}

/// On Zenoh's threads.
fn answer(latest: &Mutex<BTreeMap<String, Vec<u8>>>, query: &Query) {
    let known = latest.lock().unwrap_or_else(PoisonError::into_inner).clone();
    for (key, bytes) in known {
        let asked = KeyExpr::try_from(key.as_str()).is_ok_and(|key| query.key_expr().intersects(&key));
        if asked && let Err(error) = query.reply(key, bytes).encoding(Encoding::APPLICATION_JSON).wait() {
            tracing::debug!("answering a query: {error}");
        }
    }
}
