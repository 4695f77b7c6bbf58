//! The relay that a robot runs: a Zenoh router of its own, apart from the robot's session, which can so begin and end while the robot goes on.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_protocol::{Keys, RobotId};
use tokio::task::JoinSet;
use zenoh::session::ZenohId;

use crate::account::Account;
use crate::config::{Cells, LinkConfig};
use crate::error::LinkError;
use crate::identity::{robot_of, swarm_checksum};
use crate::inbox::Inbox;
use crate::keeper::Keeper;
use crate::lookout::Lookout;
use crate::session::{Far, Guard, Node, Room};
use crate::sightings::Place;
use crate::supervisor::cause;
use crate::tls::Door;

/// What relays of a robot are founded on.
pub(crate) struct Foundation {
    pub me: RobotId,
    pub swarm: String,
    pub keys: Keys,
    pub nonce: u64,
    pub link: LinkConfig,
    pub cells: Cells,
    /// Of a sealed swarm.
    pub door: Option<Arc<Door>>,
    pub inbox: Arc<Inbox>,
    pub account: Arc<Account>,
    pub lookout: Arc<Lookout>,
}

/// A running relay. Dropping it leaves its session open: [`Relay::close`] it.
pub(super) struct Relay {
    node: Node,
    inbox: Arc<Inbox>,
    links: Arc<Mutex<BTreeSet<Far>>>,
    /// Keeps the links to other relays.
    keeper: JoinSet<Result<(), String>>,
}

impl Foundation {
    /// Begins the `count`th relay.
    ///
    /// # Errors
    /// [`LinkError::Start`] when its endpoints are taken, as for any session.
    pub(super) async fn found(&self, count: u16) -> Result<Relay, LinkError> {
        let Self { me, swarm, nonce, link, cells, door, inbox, account, .. } = self;
        let config = link.relay(*me, swarm, *nonce, count)?;
        let checksum = swarm_checksum(swarm);
        let door = door.clone();
        let guard = door.map(|door| Guard { swarm: checksum, door, account: Some(account.clone()) });
        let room = Room { of: *me, swarm: checksum, size: cells.size, account: account.clone() };
        let links = Arc::<Mutex<BTreeSet<Far>>>::default();
        let on_link = {
            let (links, inbox, me) = (links.clone(), inbox.clone(), *me);
            move |far: Far, up| {
                // The robot's own session is no neighbour of it.
                if robot_of(far.id, checksum).is_none_or(|robot| robot == me) {
                    return;
                }
                let mut links = links.lock().unwrap_or_else(PoisonError::into_inner);
                let changed = if up { links.insert(far) } else { links.remove(&far) };
                if changed {
                    inbox.on_link(far, up);
                }
            }
        };
        let node = Node::open(config, guard, Some(room), on_link).await?;
        let mut relay = Relay { node, inbox: inbox.clone(), links, keeper: JoinSet::new() };
        relay.keep_links(self);
        Ok(relay)
    }
}

impl Relay {
    pub fn node(&self) -> &Node {
        &self.node
    }

    pub fn id(&self) -> ZenohId {
        self.node.id()
    }

    /// Where it may be dialled.
    pub fn place(&self, lookout: &Lookout) -> Place {
        Place { id: self.node.id(), locators: lookout.reachable(self.node.locators()) }
    }

    /// How many robots hang on it, the one that runs it apart.
    pub fn members(&self) -> usize {
        self.node.members()
    }

    fn keep_links(&mut self, on: &Foundation) {
        let (node, inbox, account) = (self.node.clone(), self.inbox.clone(), on.account.clone());
        let (max_links, lookout) = (on.link.max_links, on.lookout.clone());
        self.keeper.spawn(Keeper::new(on.me, max_links, node, inbox, account, lookout, true).run());
    }

    /// Whether its links to other relays are kept; where that has ended, it begins anew.
    ///
    /// # Errors
    /// What ended it.
    pub fn tend(&mut self, on: &Foundation) -> Result<(), String> {
        let Some(ended) = self.keeper.try_join_next() else { return Ok(()) };
        self.keep_links(on);
        Err(ended.map_or_else(cause, |ended| ended.err().unwrap_or_default()))
    }

    /// Ends it: all who hung on it look for another. Where nobody waits for that to the end, it is to be done once more.
    pub async fn close(&mut self) {
        self.keeper.abort_all();
        let id = self.node.id();
        self.node.close().await;
        self.inbox.ways.end(id);
        // A session that was closed tells of no link any more.
        let links = std::mem::take(&mut *self.links.lock().unwrap_or_else(PoisonError::into_inner));
        for far in links {
            self.inbox.on_link(far, false);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use gestalt_protocol::Status;
    use tokio::sync::broadcast;
    use tokio::time::{sleep, timeout};

    use super::*;
    use crate::Scouting;
    use crate::supervisor::Supervisor;

    const ME: RobotId = RobotId(1);
    const PATIENCE: Duration = Duration::from_secs(60);

    fn foundation() -> Foundation {
        let (swarm, keys, nonce) = ("relay".to_owned(), Keys::new("relay").unwrap(), 1);
        let scouting = Scouting { interface: "lo".to_owned(), ..Scouting::default() };
        let cells = Cells::default();
        let link = LinkConfig { scouting: Some(scouting), cells: Some(cells), ..LinkConfig::default() };
        let account = Arc::new(Account::new(Status::new(ME, "one".to_owned(), 1), Instant::now()));
        let supervisor = Supervisor::new(account.clone(), broadcast::channel(1).0);
        let checksum = swarm_checksum(&swarm);
        let inbox = Arc::new(Inbox::new(ME, checksum, keys.clone(), account.clone(), 0.0, None));
        let zenoh = link.to_zenoh(ME, &swarm, nonce).unwrap();
        let lookout = Arc::new(Lookout::new(ME, &swarm, nonce, inbox.clone(), supervisor, zenoh));
        Foundation { me: ME, swarm, keys, nonce, link, cells, door: None, inbox, account, lookout }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn what_keeps_its_links_begins_anew_when_it_has_ended_and_to_end_twice_is_to_end_once() {
        let foundation = foundation();
        let mut relay = foundation.found(1).await.unwrap();
        assert_eq!(relay.tend(&foundation), Ok(()));
        relay.keeper.abort_all();
        let noticed = async {
            while relay.tend(&foundation).is_ok() {
                sleep(Duration::from_millis(10)).await;
            }
        };
        timeout(PATIENCE, noticed).await.expect("its end is noticed");
        assert_eq!((relay.tend(&foundation), relay.keeper.len()), (Ok(()), 1));
        for _ in 0..2 {
            timeout(PATIENCE, relay.close()).await.expect("it ends");
        }
        assert!(relay.node.session().is_closed());
    }
}
