//! Asks all robots for a sign of life after links have changed.
//!
//! Zenoh tells of each liveliness token as it comes and goes, but after many changes at once some of that news was
//! measured to be lost for good (a hundred robots linking up: 1 % of the pairs), while a query finds the token.
//! What no query finds is that a robot is gone: who is silent is asked itself.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gestalt_protocol::{Keys, MAX_ROBOTS, RobotId, Topic};
use tokio::sync::oneshot;
use zenoh::query::Reply;

use crate::inbox::Inbox;
use crate::session::Node;
use crate::silent::ask_the_silent;

/// How long after a change the census is taken, and after that one the next, in a swarm of a few robots.
const AFTER: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(4)];

/// This many robots more take a census the same time later: it costs every robot an answer to every robot.
const FEW: u32 = 20;

/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Takes a census some time after every change, and asks who is silent. Never returns.
pub(crate) async fn take_census(node: Node, keys: Keys, inbox: Arc<Inbox>) -> Result<(), String> {
    tokio::join!(count(&node, &keys, &inbox), ask_the_silent(&node, &keys, &inbox));
    Ok(())
}

async fn count(node: &Node, keys: &Keys, inbox: &Arc<Inbox>) {
    loop {
        inbox.unrest().await;
        let mut absent = None;
        for pause in AFTER {
            let robots = u32::try_from(inbox.tokens().len()).unwrap_or(u32::MAX);
            tokio::time::sleep(pause + pause * (robots / FEW)).await;
            let before = inbox.tokens();
            let Ok(present) = ask(node, keys, inbox).await else { continue };
            let missing: BTreeSet<_> = before.difference(&present).copied().collect();
            let twice = absent.map(|absent: BTreeSet<_>| &absent & &missing).unwrap_or_default();
            inbox.on_census(&present, &twice);
            absent = Some(missing);
        }
    }
}

/// The robots that answer. They come by a call and not by a queue: what this session knows already, Zenoh hands over before it returns from
/// asking, and more than a queue holds would block it for ever, with the session locked.
async fn ask(node: &Node, keys: &Keys, inbox: &Arc<Inbox>) -> zenoh::Result<BTreeSet<RobotId>> {
    let (present, known) = (Arc::new(Mutex::new(BTreeSet::new())), inbox.tokens());
    // Dropped with the call, when all have answered or the time is up.
    let (answering, all) = oneshot::channel::<()>();
    let (found, keys_of, members) = (present.clone(), keys.clone(), inbox.clone());
    let hear = move |reply: Reply| {
        let _answering = &answering;
        if let Ok(sample) = reply.result()
            && let Some(Topic::Alive(id)) = keys_of.parse(sample.key_expr().as_str())
            && !members.is_stranger(id)
        {
            let mut found = lock(&found);
            if found.len() < MAX_ROBOTS || known.contains(&id) {
                found.insert(id);
            }
        }
    };
    let every = keys.every_robot("alive");
    node.session().liveliness().get(every).timeout(PATIENCE).callback(hear).await?;
    // An error says that nobody answers any more.
    let _ = all.await;
    let present = std::mem::take(&mut *lock(&present));
    Ok(present)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
