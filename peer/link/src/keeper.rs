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

/// Whose links so often in a row end before they are looked after hangs up by itself.
const SEVERAL: u32 = 3;

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
    brief: Brief,
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
            brief: Brief::default(),
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
        if *stands && self.brief.is_hung_up(*robot) && self.inbox.is_sealed() {
            self.account.error(&format!(
                "robot {robot} hangs up at once: it may not have this robot's key on its roster; give both the newest one"
            ));
        }
    }

    async fn look_after(&mut self) {
        let (links, heard) = (self.inbox.relays(), self.lookout.heard());
        let linked: BTreeSet<RobotId> = links.values().copied().collect();
        self.brief.stand(&linked);
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

/// How many links to each robot were made since one was seen to stand.
#[derive(Debug, Default)]
struct Brief(BTreeMap<RobotId, u32>);

impl Brief {
    /// One more was made; whether that one hangs up at once, as those before.
    fn is_hung_up(&mut self, robot: RobotId) -> bool {
        let made = self.0.entry(robot).or_default();
        *made = made.saturating_add(1);
        *made > SEVERAL
    }

    /// Links to these stand.
    fn stand(&mut self, linked: &BTreeSet<RobotId>) {
        self.0.retain(|robot, _| !linked.contains(robot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_ends_several_links_in_a_row_before_they_are_looked_after_hangs_up_at_once() {
        let (mut brief, one, other) = (Brief::default(), RobotId(1), RobotId(2));
        for _ in 0..SEVERAL {
            assert!(!brief.is_hung_up(one) && !brief.is_hung_up(other));
            brief.stand(&[other].into());
        }
        assert!(brief.is_hung_up(one) && !brief.is_hung_up(other));
        brief.stand(&[one].into());
        assert!(!brief.is_hung_up(one));
    }
}
