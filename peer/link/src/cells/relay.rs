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
    _keeper: JoinSet<Result<(), String>>,
}

impl Foundation {
    /// Begins the `count`th relay.
    ///
    /// # Errors
    /// [`LinkError::Start`] when its endpoints are taken, as for any session.
    pub(super) async fn found(&self, count: u16) -> Result<Relay, LinkError> {
        let Self { me, swarm, nonce, link, cells, door, inbox, account, lookout, .. } = self;
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
        let (of_links, heard, counts, around) =
            (node.clone(), inbox.clone(), account.clone(), lookout.clone());
        let mut keeper = JoinSet::new();
        keeper.spawn(Keeper::new(*me, link.max_links, of_links, heard, counts, around, true).run());
        Ok(Relay { node, inbox: inbox.clone(), links, _keeper: keeper })
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

    /// Ends it: all who hung on it look for another.
    pub async fn close(self) {
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
