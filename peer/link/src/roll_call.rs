//! What a robot does about a new roster: hangs up who is on it no more, keeps it on disk, and tells every neighbour. What convicts somebody on it is kept beside it.
//!
//! A roster travels two ways, like everything: whoever changed it says it to all, and each robot passes what it took up on to its neighbours, by
//! links that stand and by those that come later. So it also reaches who was cut off or away.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Keys, Topic};
use tokio::time::Instant;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::session::ZenohId;

use crate::account::Account;
use crate::inbox::Inbox;
use crate::roll::Roll;
use crate::session::Node;

/// How often each neighbour is told of a roster: the first may come before it listens.
const TOLD: u32 = 3;

/// How long after the one before.
const AGAIN: Duration = Duration::from_millis(700);

/// How long who is on it no more, and so is told by neighbours alone, is left to hear so.
const FAREWELL: Duration = Duration::from_millis(100);

/// How often it is told of one that is new besides, each time after twice as long: somebody may flood it with others meanwhile.
const TOLD_LATER: u32 = 6;

/// How long after what could not be written it is tried again.
const RETRY: Duration = Duration::from_secs(5);

/// Acts on every new roster, keeps it, and tells neighbours of it. Never returns.
pub(crate) async fn keep_roll(
    roll: Arc<Roll>,
    account: Arc<Account>,
    node: Node,
    keys: Keys,
    inbox: Arc<Inbox>,
) -> Result<(), String> {
    // A disk that hangs keeps no link up, and no neighbour from hearing of it.
    tokio::join!(keep(&roll, &inbox), follow(&roll, &account, &node, &keys, &inbox));
    Ok(())
}

/// Writes every new roster, and what convicts somebody.
async fn keep(roll: &Roll, inbox: &Inbox) {
    let mut news = roll.news();
    let mut kept = roll.first();
    let mut evidence = Vec::new();
    loop {
        let epoch = roll.newest().0;
        if epoch != kept && roll.keep().await {
            kept = epoch;
        }
        evidence.extend(inbox.unkept());
        if !evidence.is_empty() && roll.keep_evidence(evidence.clone()).await {
            evidence.clear();
        }
        tokio::select! {
            _ = news.changed() => {}
            () = tokio::time::sleep(RETRY), if epoch != kept || !evidence.is_empty() => {}
        }
    }
}

/// Tells neighbours when there is a new roster, those who are on it no more too, and looks through the links then.
async fn follow(roll: &Roll, account: &Account, node: &Node, keys: &Keys, inbox: &Inbox) {
    let mut news = roll.news();
    let mut told: BTreeMap<ZenohId, Told> = BTreeMap::new();
    // A newer one may have come before this began.
    let first = roll.first();
    let mut followed = first;
    loop {
        let (epoch, json) = roll.newest();
        let links = inbox.links();
        told.retain(|id, _| links.contains_key(id));
        let mut next: Option<Instant> = None;
        for (id, robot) in links {
            let told = told.entry(id).or_insert_with(|| Told::new(epoch));
            if told.epoch != epoch {
                *told = Told::new(epoch);
            }
            let times = if epoch == first { TOLD } else { TOLD + TOLD_LATER };
            if told.times < times && Instant::now() >= told.next {
                let later = (told.times + 1).saturating_sub(TOLD);
                told.next = Instant::now() + AGAIN * 2_u32.pow(later);
                told.times += 1;
                tell(account, node, keys.key(&Topic::RosterFor(robot)), json.clone()).await;
            }
            if told.times < times {
                next = Some(next.map_or(told.next, |next| next.min(told.next)));
            }
        }
        if epoch != followed {
            tokio::time::sleep(FAREWELL).await;
            node.look_through();
            followed = epoch;
        }
        tokio::select! {
            _ = news.changed() => {}
            () = tokio::time::sleep_until(next.unwrap_or_else(Instant::now)), if next.is_some() => {}
        }
    }
}

/// How often a neighbour was told of a roster, and when it is next.
struct Told {
    epoch: u64,
    times: u32,
    next: Instant,
}

impl Told {
    fn new(epoch: u64) -> Self {
        Self { epoch, times: 0, next: Instant::now() }
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
