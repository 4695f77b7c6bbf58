//! Keeps the links that [`neighbourhood`](crate::neighbourhood) chooses to robots that were heard.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use tokio::sync::mpsc;

use crate::account::Account;
use crate::inbox::Inbox;
use crate::lookout::Lookout;
use crate::neighbourhood::{Neighbourhood, View};
use crate::session::Node;
use crate::sightings::Place;

/// How often links are looked after.
const PERIOD: Duration = Duration::from_millis(500);

/// How often when no link has come or gone for a while.
const IDLE_PERIOD: Duration = Duration::from_secs(3);
const UNREST: Duration = Duration::from_secs(10);

/// The task that looks after the links of one session that relays: to others that do.
pub(super) struct Keeper {
    neighbourhood: Neighbourhood,
    node: Node,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    lookout: Arc<Lookout>,
    /// Whether it is the relay of a cell: then there are robots that nobody hears, for they relay for nobody.
    of_cell: bool,
    busy: BTreeSet<RobotId>,
    news: (mpsc::UnboundedSender<Dialled>, mpsc::UnboundedReceiver<Dialled>),
}

/// A robot was dialled at a place; whether a link to it stands.
struct Dialled(RobotId, Place, bool);

impl Keeper {
    pub(super) fn new(
        me: RobotId,
        max_links: usize,
        node: Node,
        inbox: Arc<Inbox>,
        account: Arc<Account>,
        lookout: Arc<Lookout>,
        of_cell: bool,
    ) -> Self {
        Self {
            neighbourhood: Neighbourhood::new(me, max_links, of_cell),
            node,
            inbox,
            account,
            lookout,
            of_cell,
            busy: BTreeSet::new(),
            news: mpsc::unbounded_channel(),
        }
    }

    /// Never returns.
    pub(super) async fn run(mut self) -> Result<(), String> {
        let mut busy_until = Instant::now() + UNREST;
        let mut before = BTreeMap::new();
        loop {
            let links = self.inbox.relays();
            if links != before || !self.busy.is_empty() {
                busy_until = Instant::now() + UNREST;
                before = links;
            }
            let period = if Instant::now() < busy_until { PERIOD } else { IDLE_PERIOD };
            let next = tokio::time::sleep(period);
            tokio::pin!(next);
            loop {
                tokio::select! {
                    Some(dialled) = self.news.1.recv() => self.on_dialled(&dialled),
                    () = &mut next => break,
                }
            }
            self.look_after().await;
        }
    }

    fn on_dialled(&mut self, Dialled(robot, place, stands): &Dialled) {
        self.busy.remove(robot);
        self.lookout.dialled(*robot, place, *stands);
    }

    async fn look_after(&mut self) {
        let (links, heard) = (self.inbox.relays(), self.lookout.heard());
        let linked: BTreeSet<RobotId> = links.values().copied().collect();
        let mut alive = self.inbox.alive();
        if self.of_cell {
            alive.retain(|robot| heard.contains_key(robot) || linked.contains(robot));
        }
        let plan = self.neighbourhood.plan(self.lookout.now(), &View { heard, linked, alive });
        for robot in plan.dial {
            self.dial(robot);
        }
        for (id, robot) in links {
            if plan.drop.contains(&robot) {
                self.account.count("links_dropped");
                self.node.hang_up(id);
            }
        }
        if plan.scout {
            self.lookout.call().await;
        }
    }

    fn dial(&mut self, robot: RobotId) {
        let Some(place) = self.lookout.next(robot) else { return };
        if !self.busy.insert(robot) {
            return;
        }
        self.account.count("links_dialled");
        let (node, news) = (self.node.clone(), self.news.0.clone());
        tokio::spawn(async move {
            // A panic inside Zenoh makes no link.
            let Place { id, locators } = place.clone();
            let dialled = tokio::spawn(async move { node.dial(id, &locators).await });
            let stands = dialled.await.unwrap_or(false);
            // The keeper may be gone: then nobody needs to know.
            let _ = news.send(Dialled(robot, place, stands));
        });
    }
}
