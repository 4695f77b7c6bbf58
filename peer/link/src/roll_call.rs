//! What a robot does about a new roster: hangs up who is on it no more, keeps it on disk, and tells every neighbour. What convicts somebody on it is kept beside it.
//!
//! A roster travels two ways, like everything: whoever changed it says it to all, and each robot passes what it took up on to its neighbours, by
//! links that stand and by those that come later. So it also reaches who was cut off or away.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Keys, Topic};
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::session::ZenohId;

use crate::account::Account;
use crate::inbox::Inbox;
use crate::roll::Roll;
use crate::session::Node;

/// How often each neighbour is told of a roster: the first may come before it listens.
const TOLD: u8 = 3;

/// How long after the one before.
const AGAIN: Duration = Duration::from_millis(700);

/// Acts on every new roster, and tells neighbours of it. Never returns.
pub(crate) async fn keep_roll(
    roll: Arc<Roll>,
    account: Arc<Account>,
    node: Node,
    keys: Keys,
    inbox: Arc<Inbox>,
) -> Result<(), String> {
    let mut told: BTreeMap<ZenohId, (u64, u8)> = BTreeMap::new();
    let mut kept = roll.newest().0;
    loop {
        let (epoch, json) = roll.newest();
        if epoch != kept {
            // First what must not be lost, whoever is at the other end of links.
            roll.keep().await;
            node.look_through();
            kept = epoch;
        }
        let evidence = inbox.unkept();
        if !evidence.is_empty() {
            roll.keep_evidence(evidence).await;
        }
        let links = inbox.links();
        told.retain(|id, _| links.contains_key(id));
        let mut again = false;
        for (id, robot) in links {
            let told = told.entry(id).or_insert((epoch, 0));
            if told.0 != epoch {
                *told = (epoch, 0);
            }
            if told.1 < TOLD {
                told.1 += 1;
                again = true;
                tell(&account, &node, keys.key(&Topic::RosterFor(robot)), json.clone()).await;
            }
        }
        tokio::select! {
            () = roll.news() => {}
            () = tokio::time::sleep(AGAIN), if again => {}
        }
    }
}

async fn tell(account: &Account, node: &Node, key: String, json: Arc<str>) {
    account.sent("roster", json.len());
    let put = node
        .session()
        .put(key, json.as_bytes())
        .encoding(Encoding::APPLICATION_JSON)
        .priority(Priority::InteractiveLow)
        .congestion_control(CongestionControl::Drop)
        .await;
    account.check(put);
}
