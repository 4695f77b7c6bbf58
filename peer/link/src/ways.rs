//! Has Zenoh keep its routes for what robots say again and again.
//!
//! A route is kept for a key that somebody declared. For any other it is worked out anew with each message, by a walk through all keys that
//! there are: among three hundred robots that took most of the time of a round. So the keys are declared of those who are there.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{Keys, MAX_ROBOTS, RobotId, Topic};
use tokio::sync::Notify;
use zenoh::Session;
use zenoh::key_expr::KeyExpr;
use zenoh::session::ZenohId;

use crate::session::Node;

/// Of each robot its votes and what it holds, and of each neighbour what it is told: what else is said is said seldom.
const MAX_WAYS: usize = 3 * MAX_ROBOTS;

/// Links are made when many robots start, and Zenoh makes none while it takes in a key. So keys wait so long, and until nobody was new for
/// a while: on a slow machine a hundred robots have not found each other before. Where somebody always is, they wait no longer than that.
const SETTLED: Duration = Duration::from_secs(8);
const CALM: Duration = Duration::from_secs(3);
const LONGEST: Duration = Duration::from_secs(40);

/// So many keys are declared at a time, and so long is the pause between.
const FEW: usize = 16;
const PAUSE: Duration = Duration::from_millis(50);

/// What is said so often that its route is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Way {
    Vote,
    Holding,
    Repair,
}

/// The keys of a swarm that are in use.
#[derive(Debug, Default)]
pub(crate) struct Ways {
    state: Mutex<State>,
    news: Notify,
}

#[derive(Debug, Default)]
struct State {
    known: BTreeSet<(RobotId, Way)>,
    undeclared: Vec<(RobotId, Way)>,
    /// By session: dropped, they are declared no more.
    kept: BTreeMap<ZenohId, Vec<KeyExpr<'static>>>,
}

impl Ways {
    /// That robot is there, and votes.
    pub fn speaker(&self, robot: RobotId) {
        self.note(robot, &[Way::Vote, Way::Holding]);
    }

    /// That robot is a neighbour, and told what this one has.
    pub fn neighbour(&self, robot: RobotId) {
        self.note(robot, &[Way::Repair]);
    }

    fn note(&self, robot: RobotId, ways: &[Way]) {
        let mut state = self.lock();
        for &way in ways {
            if state.known.len() < MAX_WAYS && state.known.insert((robot, way)) {
                state.undeclared.push((robot, way));
                self.news.notify_one();
            }
        }
    }

    /// Declares them some time after they came into use, a few at a time. Never returns.
    pub async fn keep(&self, node: Node, keys: Keys) -> Result<(), String> {
        loop {
            self.news.notified().await;
            let began = Instant::now();
            tokio::time::sleep(SETTLED).await;
            self.calm(began + LONGEST).await;
            let new = std::mem::take(&mut self.lock().undeclared);
            for (i, few) in new.chunks(FEW).enumerate() {
                for session in node.sessions() {
                    if let Err(error) = self.declare(&session, &keys, few).await {
                        // They are declared when this begins anew.
                        self.lock().undeclared.extend_from_slice(&new[i * FEW..]);
                        self.news.notify_one();
                        return Err(error);
                    }
                }
                tokio::time::sleep(PAUSE).await;
            }
        }
    }

    /// Waits until there was no news for a while, or until then.
    async fn calm(&self, end: Instant) {
        // What came while it waited is no news any more.
        let mut seen = self.lock().known.len();
        loop {
            tokio::time::sleep(CALM).await;
            let known = self.lock().known.len();
            if known == seen || Instant::now() >= end {
                return;
            }
            seen = known;
        }
    }

    /// Declares all that are in use on a session that is new.
    pub async fn begin(&self, session: &Session, keys: &Keys) -> Result<(), String> {
        let known: Vec<(RobotId, Way)> = self.lock().known.iter().copied().collect();
        self.declare(session, keys, &known).await
    }

    /// That session is closed.
    pub fn end(&self, session: ZenohId) {
        // Dropped when nothing is locked: what is dropped asks Zenoh to forget it.
        let kept = self.lock().kept.remove(&session);
        drop(kept);
    }

    async fn declare(&self, session: &Session, keys: &Keys, ways: &[(RobotId, Way)]) -> Result<(), String> {
        for (robot, way) in ways {
            let topic = match way {
                Way::Vote => Topic::Vote(*robot),
                Way::Holding => Topic::RobotDecision(*robot),
                Way::Repair => Topic::Repair(*robot),
            };
            let declared = session.declare_keyexpr(keys.key(&topic)).await;
            let key = declared.map_err(|error| format!("declaring a key: {error}"))?;
            self.lock().kept.entry(session.zid()).or_default().push(key);
        }
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
