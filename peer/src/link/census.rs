//! Asks all robots for a sign of life after links have changed.
//!
//! Zenoh tells of each liveliness token as it comes and goes, but after many changes at once some of that news was
//! measured to be lost for good (a hundred robots linking up: 1 % of the pairs), while a query finds the token.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Keys, RobotId, Topic};

use super::inbox::Inbox;
use super::session::Node;

/// How long after a change the census is taken, and taken again.
const AFTER: [Duration; 2] = [Duration::from_secs(2), Duration::from_secs(6)];

/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Takes a census some time after every change. Runs until it is aborted.
pub(super) async fn take_census(node: Node, keys: Keys, inbox: Arc<Inbox>) {
    loop {
        inbox.unrest().await;
        let mut absent = None;
        for pause in AFTER {
            tokio::time::sleep(pause).await;
            let before = inbox.tokens();
            let Ok(present) = ask(&node, &keys).await else { continue };
            let missing: BTreeSet<_> = before.difference(&present).copied().collect();
            let twice = absent.map(|absent: BTreeSet<_>| &absent & &missing).unwrap_or_default();
            inbox.on_census(&present, &twice);
            absent = Some(missing);
        }
    }
}

async fn ask(node: &Node, keys: &Keys) -> zenoh::Result<BTreeSet<RobotId>> {
    let replies = node.session().liveliness().get(keys.every_robot("alive")).timeout(PATIENCE).await?;
    let mut present = BTreeSet::new();
    while let Ok(reply) = replies.recv_async().await {
        if let Ok(sample) = reply.result()
            && let Some(Topic::Alive(id)) = keys.parse(sample.key_expr().as_str())
        {
            present.insert(id);
        }
    }
    Ok(present)
}
