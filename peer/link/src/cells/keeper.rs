//! Does what [`choice`](super::choice) says: joins relays, founds one, and gives it up.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::RobotId;
use tokio::sync::{Mutex, watch};
use zenoh::session::ZenohId;

use super::choice::{Choice, Step, View};
use super::relay::{Foundation, Relay};
use crate::identity::{is_of_life, robot_of, swarm_checksum};
use crate::session::{Far, Node};
use crate::sightings::Place;

/// How often it is looked at what to do: until there has been a relay for a while, and then. When the link to it comes or goes, at once.
const PERIOD: Duration = Duration::from_millis(100);
const REST: Duration = Duration::from_secs(2);

/// Keeps one robot in a cell.
pub(crate) struct CellKeeper {
    foundation: Foundation,
    /// The relay that the robot's session is linked to, and whose it is.
    uplink: watch::Sender<Option<(ZenohId, RobotId)>>,
    state: Mutex<State>,
}

struct State {
    choice: Choice,
    relay: Option<Relay>,
    founded: u16,
}

impl CellKeeper {
    pub fn new(foundation: Foundation) -> Self {
        let choice = Choice::new(foundation.me, foundation.nonce);
        let state = Mutex::new(State { choice, relay: None, founded: 0 });
        Self { foundation, uplink: watch::Sender::new(None), state }
    }

    /// A link of the robot's own session came or went.
    pub fn on_link(&self, far: Far, up: bool) {
        let Foundation { me, swarm, nonce, inbox, account, .. } = &self.foundation;
        let Some(robot) = robot_of(far.id, swarm_checksum(swarm)) else { return };
        if far.relays {
            self.uplink.send_if_modified(|uplink| match uplink {
                _ if up => uplink.replace((far.id, robot)) != Some((far.id, robot)),
                Some((id, _)) if *id == far.id => uplink.take().is_some(),
                _ => false,
            });
        }
        if robot != *me {
            inbox.on_link(far, up);
        } else if !is_of_life(far.id, *nonce) {
            account.twin();
        }
    }

    /// Keeps the robot of that session in a cell. Never returns, unless what keeps the relay's links failed: it begins anew, and so may this.
    pub async fn run(self: Arc<Self>, node: Node) -> Result<(), String> {
        let mut uplink = self.uplink.subscribe();
        loop {
            let is_settled = self.step(&node).await?;
            let pause = tokio::time::sleep(if is_settled { REST } else { PERIOD });
            tokio::select! {
                () = pause => {}
                _ = uplink.changed() => {}
            }
        }
    }

    /// Does the next step; whether there has been a relay for a while.
    async fn step(&self, node: &Node) -> Result<bool, String> {
        let Foundation { lookout, account, .. } = &self.foundation;
        let mut state = self.state.lock().await;
        let State { choice, relay, .. } = &mut *state;
        relay.as_mut().map_or(Ok(()), |relay| relay.tend(&self.foundation))?;
        let uplink = *self.uplink.borrow();
        let members = relay.as_ref().map(Relay::members);
        account.set("relays_run", u64::from(relay.is_some()));
        account.set("cell_members", members.unwrap_or_default() as u64);
        let view = View { heard: lookout.heard(), relay: uplink.map(|(_, robot)| robot), members };
        match choice.plan(lookout.now(), &view) {
            Step::Rest => {}
            Step::Look => lookout.call().await,
            Step::Join(robot) => {
                if self.join(node, robot, relay.as_ref()).await {
                    choice.dialled(lookout.now(), robot);
                } else {
                    choice.failed(lookout.now(), robot);
                }
            }
            Step::Found => self.found(node, &mut state).await,
            Step::GiveUp => {
                account.count("relays_given_up");
                node.relays_by(None);
                close(&mut state.relay).await;
            }
        }
        Ok(state.choice.is_settled(lookout.now()) && self.uplink.borrow().is_some())
    }

    /// Whether that relay took a link of the robot's session.
    async fn join(&self, node: &Node, robot: RobotId, own: Option<&Relay>) -> bool {
        let Foundation { me, lookout, account, .. } = &self.foundation;
        let own = own.filter(|_| robot == *me).map(|own| own.place(lookout));
        let Some(place) = own.clone().or_else(|| lookout.next(robot)) else { return false };
        // A client has one link.
        let before = *self.uplink.borrow();
        if let Some((id, _)) = before {
            node.leave(id).await;
        }
        account.count("relays_dialled");
        let Place { id, locators } = &place;
        let stands = node.dial(*id, locators).await;
        if own.is_none() {
            lookout.dialled(robot, &place, stands);
        }
        stands
    }

    async fn found(&self, node: &Node, state: &mut State) {
        let Foundation { account, inbox, keys, .. } = &self.foundation;
        state.founded = state.founded.wrapping_add(1).max(1);
        match self.foundation.found(state.founded).await {
            Ok(relay) => {
                account.count("relays_founded");
                tracing::info!("runs the relay {} of a cell", relay.id());
                // At once: whoever ends this while it waits for something ends a relay that is known.
                let session = relay.node().session().clone();
                node.relays_by(Some(relay.node().clone()));
                state.relay = Some(relay);
                // The roster may have changed while it began.
                node.look_through();
                if let Err(error) = inbox.ways.begin(&session, keys).await {
                    account.error(&error);
                }
            }
            Err(error) => account.error(&format!("no relay could be founded, and none was found: {error}")),
        }
    }

    /// Ends the relay, if the robot runs one.
    pub async fn close(&self) {
        close(&mut self.state.lock().await.relay).await;
    }
}

/// Ends a relay. It is there until it has ended: who stops waiting for that can begin it once more.
async fn close(relay: &mut Option<Relay>) {
    if let Some(relay) = relay {
        relay.close().await;
    }
    *relay = None;
}
