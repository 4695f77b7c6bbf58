//! What makes one robot known to the swarm: that it is alive, how it is, and its votes.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_protocol::{Envelope, Keys, RobotId, Topic};
use tokio::sync::watch;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};
use zenoh::sample::Locality;
use zenoh::session::ZenohId;
use zenoh::{Session, Wait};

use crate::account::Account;
use crate::failure::Part;
use crate::identity::is_of_another;
use crate::supervisor::Supervisor;
use crate::token::keep_token;

/// When a new robot asks whether its id is taken: late enough that its links stand.
const TWIN_CHECK: Duration = Duration::from_secs(3);

/// The parameter of a query that asks whether a robot is there, and not how it is.
pub(crate) const BRIEFLY: &str = "briefly";

/// A robot's declarations on a session. Dropping it withdraws them; its liveliness token goes when the supervisor's parts
/// are ended.
pub(crate) struct Presence {
    vote: Publisher<'static>,
    held: Publisher<'static>,
    account: Arc<Account>,
    _status: Queryable<()>,
}

impl Presence {
    pub async fn declare(
        session: &Session,
        keys: &Keys,
        me: RobotId,
        account: Arc<Account>,
        lost_links: watch::Receiver<u64>,
        supervisor: &Arc<Supervisor>,
    ) -> zenoh::Result<Self> {
        let status_key = keys.key(&Topic::Status(me));
        let (of_status, node, own) = (account.clone(), session.zid(), status_key.clone());
        account.lock().session = node.to_string();
        let status = session
            .declare_queryable(&status_key)
            .callback(move |query| on_status(&of_status, node, &own, &query))
            .await?;
        let vote = session
            .declare_publisher(keys.key(&Topic::Vote(me)))
            .priority(Priority::DataHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .await?;
        let held = session
            .declare_publisher(keys.key(&Topic::RobotDecision(me)))
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .await?;
        let alive = keys.key(&Topic::Alive(me));
        let token = session.liveliness().declare_token(&alive).await?;
        let (session, asking, mut first) = (session.clone(), account.clone(), Some(token));
        supervisor.keep(Part::Presence, move || {
            let token = keep_token(session.clone(), alive.clone(), lost_links.clone(), first.take());
            let twin = ask_for_twin(session.clone(), status_key.clone(), asking.clone());
            async { tokio::try_join!(token, twin).map(|_| ()) }
        });
        Ok(Self { vote, held, account, _status: status })
    }

    /// Says a vote to all.
    pub fn vote(&self, envelope: &Envelope) -> Vec<u8> {
        let bytes = envelope.encode();
        self.account.sent("vote", bytes.len());
        self.account.check(self.vote.put(bytes.as_slice()).wait());
        bytes
    }

    /// Says to all what the robot holds.
    pub fn hold(&self, envelope: &Envelope) {
        let bytes = envelope.encode();
        self.account.sent("robot_decision", bytes.len());
        self.account.check(self.held.put(bytes).wait());
    }
}

/// Whether whoever asks for a robot's status, by its own words, asks as a robot of the same id: by a session of another life, or of a guest's host.
fn is_twin(from: Option<&str>, node: ZenohId) -> bool {
    from.and_then(|from| from.parse().ok()).is_some_and(|from| is_of_another(from, node))
}

/// Answers a query for the status; one that a robot of the same id sends is a twin's. Under the robot's own key, whatever was asked
/// for: of several answers under one key Zenoh keeps one.
fn on_status(account: &Account, node: ZenohId, own: &str, query: &Query) {
    if is_twin(query.parameters().get("from"), node) {
        account.twin();
    }
    if query.parameters().contains_key(BRIEFLY) {
        account.sent("status", 0);
        let _ = query.reply(own, "").wait();
        return;
    }
    let clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis();
    let json = {
        let mut status = account.lock();
        status.clock_ms = Some(u64::try_from(clock).unwrap_or(u64::MAX));
        serde_json::to_string(&*status)
            .expect("every field of a status, with string keys and finite numbers, has a place in JSON")
    };
    account.sent("status", json.len());
    let _ = query.reply(own, json).encoding(Encoding::APPLICATION_JSON).wait();
}

/// Asks once whether anyone else answers to this robot's id.
async fn ask_for_twin(session: Session, status_key: String, account: Arc<Account>) -> Result<(), String> {
    tokio::time::sleep(TWIN_CHECK).await;
    let query = format!("{status_key}?from={}", session.zid());
    let replies = session.get(query).priority(Priority::DataLow).allowed_destination(Locality::Remote);
    let replies = replies.await.map_err(|error| format!("asking for a robot of the same id: {error}"))?;
    while let Ok(reply) = replies.recv_async().await {
        if reply.result().is_ok() {
            account.twin();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::zenoh_id;

    #[test]
    fn whoever_says_anything_but_a_robots_session_is_no_twin() {
        let id = |robot, nonce| zenoh_id(RobotId(robot), "demo", nonce);
        let node = id(7, 1 << 40).parse().unwrap();
        let strangers = [Some("x"), Some(""), Some("abc"), None];
        assert!(!strangers.into_iter().any(|from| is_twin(from, node)));
        assert!(!is_twin(Some(&id(7, 1 << 40)), node), "itself");
        assert!(is_twin(Some(&id(7, 2 << 40)), node));
        // A guest asks by its host.
        assert!(is_twin(Some(&id(8, 1 << 40)), node));
    }
}
