//! Asks all robots for a sign of life after links have changed.
//!
//! Zenoh tells of each liveliness token as it comes and goes, but after many changes at once some of that news was
//! measured to be lost for good (a hundred robots linking up: 1 % of the pairs), while a query finds the token.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Keys, RobotId, Topic};

use crate::inbox::Inbox;
use crate::session::Node;

/// How long after a change the census is taken, and after that one the next, in a swarm of a few robots.
const AFTER: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(4)];

/// This many robots more take a census the same time later: it costs every robot an answer to every robot.
const FEW: u32 = 20;

/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Takes a census some time after every change. Never returns.
pub(crate) async fn take_census(node: Node, keys: Keys, inbox: Arc<Inbox>) -> Result<(), String> {
    loop {
        inbox.unrest().await;
        let mut absent = None;
        for pause in AFTER {
            let robots = u32::try_from(inbox.tokens().len()).unwrap_or(u32::MAX);
            tokio::time::sleep(pause + pause * (robots / FEW)).await;
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
