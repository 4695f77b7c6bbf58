//! How a robot is linked to others, as the user says it and as Zenoh takes it.

use std::time::Duration;

use gestalt_protocol::{Keys, RobotId};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::LinkError;
use super::identity::{relay_id, zenoh_id};
use super::reach;
use super::tls::{self, Credentials};

/// Where a robot listens that was told nothing else, see [`LinkConfig::listen`].
const AUTO: &str = "auto";

/// How many signs of life each end of a silent link gives in a lease.
const KEEP_ALIVES: u32 = 4;

/// The same where links are TLS: each costs a record of 22 bytes besides, and one fewer pays for all of them.
const SEALED_KEEP_ALIVES: u32 = 3;

/// How a robot is linked to others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkConfig {
    /// Zenoh endpoints to listen on, such as `tls/0.0.0.0:7447`; port 0 takes a free one. `auto`, the default: for an open robot a free
    /// TCP port of this computer alone; for a sealed one a free port with TLS, and one for clients on this computer.
    pub listen: Vec<String>,
    /// Zenoh endpoints of other robots to link to, tried for ever. Name a link at one of its two ends only:
    /// linked from both ends, Zenoh may stop receiving.
    pub connect: Vec<String>,
    /// Finds other robots by multicast and links to some of them; `None`: explicit endpoints only.
    pub scouting: Option<Scouting>,
    /// The number of links to robots that scouting builds up to, at least 2. Explicit endpoints and clients are
    /// not counted.
    pub max_links: usize,
    /// For swarms of more than a hundred: robots form cells by themselves, see [`Cells`]. The same at all robots; needs `scouting`.
    pub cells: Option<Cells>,
    /// How long a link may be silent before it counts as lost, and how long an attempt to make one may take. A
    /// silently lost relay is routed around after about this time; where a hundred robots share a busy processor,
    /// a short lease loses links that are merely slow.
    #[serde(with = "humantime_serde")]
    pub lease: Duration,
    /// Lets an open robot listen beyond its own computer and its own link-local network: whoever reaches it there is believed.
    pub insecure: bool,
    /// What this session shows to be let in where links are TLS; a robot has those of its seal.
    #[serde(skip)]
    pub credentials: Option<Credentials>,
    /// For trials of what a swarm withstands: the part of all received messages that is dropped unread. Range
    /// `0.0..1.0`; 0 in the field.
    pub loss: f64,
    /// Anything Zenoh's own configuration offers, verbatim; it has the last word, except for `id` and what seals a swarm.
    pub zenoh: serde_json::Map<String, Value>,
}

/// Where robots find each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scouting {
    /// The multicast group and port.
    pub address: String,
    /// The network interface, or `auto`.
    pub interface: String,
}

impl Default for Scouting {
    fn default() -> Self {
        Self { address: "224.0.0.224:7446".to_owned(), interface: "auto".to_owned() }
    }
}

/// Cells, into which robots of a large swarm come together by themselves: one of each runs a relay, a Zenoh router, to which the others hang
/// as clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cells {
    /// For how many robots a relay has room beside the one that runs it. Range 1 to 50.
    pub size: usize,
}

impl Cells {
    /// The largest `size`. A sealed robot has no more than 64 links of others, and some of them are relays.
    pub const MAX_SIZE: usize = 50;
}

impl Default for Cells {
    fn default() -> Self {
        Self { size: 32 }
    }
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self {
            listen: vec![AUTO.to_owned()],
            connect: Vec::new(),
            scouting: None,
            max_links: 4,
            cells: None,
            lease: Duration::from_secs(1),
            insecure: false,
            credentials: None,
            loss: 0.0,
            zenoh: serde_json::Map::new(),
        }
    }
}

impl LinkConfig {
    /// Whether a robot could be linked like this, an open one or one of a sealed swarm.
    ///
    /// # Errors
    /// [`LinkError::Config`] names the key and the mend.
    pub fn check(&self, robot: RobotId, sealed: bool) -> Result<(), LinkError> {
        self.of_robot(robot, "gestalt", 0, sealed).map(drop)
    }

    /// Zenoh's configuration for that robot.
    ///
    /// The values ahead of the user's own are those a swarm was measured to need: sessions in router mode relay
    /// for each other (peers do not); a lease of one second routes around a silently lost relay in about that
    /// time; an attempt to connect into a cut link gives up as fast, so that a healed one is found.
    pub(super) fn to_zenoh(
        &self,
        robot: RobotId,
        swarm: &str,
        nonce: u64,
    ) -> Result<zenoh::Config, LinkError> {
        self.of_robot(robot, swarm, nonce, self.credentials.is_some())
    }

    /// Zenoh's configuration for the `count`th relay that such a robot runs.
    pub(super) fn relay(
        &self,
        robot: RobotId,
        swarm: &str,
        nonce: u64,
        count: u16,
    ) -> Result<zenoh::Config, LinkError> {
        let sealed = self.credentials.is_some();
        let wall = self.wall(swarm)?;
        self.routing(&relay_id(robot, swarm, nonce, count), wall, sealed)
    }

    fn of_robot(
        &self,
        robot: RobotId,
        swarm: &str,
        nonce: u64,
        sealed: bool,
    ) -> Result<zenoh::Config, LinkError> {
        if self.max_links < 2 {
            return Err(LinkError::Config {
                key: "max_links".to_owned(),
                cause: format!("{} links connect no swarm: take 2 or more", self.max_links),
            });
        }
        if !(0.0..1.0).contains(&self.loss) {
            return Err(LinkError::Config {
                key: "loss".to_owned(),
                cause: format!("{} is no part below 1: take 0 but for trials", self.loss),
            });
        }
        let (id, wall) = (zenoh_id(robot, swarm, nonce), self.wall(swarm)?);
        let Some(cells) = self.cells else { return self.routing(&id, wall, sealed) };
        if !(1..=Cells::MAX_SIZE).contains(&cells.size) {
            return Err(LinkError::Config {
                key: "cells.size".to_owned(),
                cause: format!("{} is not from 1 to {}", cells.size, Cells::MAX_SIZE),
            });
        }
        if self.scouting.is_none() {
            return Err(LinkError::Config {
                key: "cells".to_owned(),
                cause: "relays are found by scouting, which is off: switch it on, or name endpoints to connect to and no cells".to_owned(),
            });
        }
        // A relay must be possible too, before one is needed.
        self.routing(&id, wall.clone(), sealed)?;
        self.member(&id, wall)
    }

    fn wall(&self, swarm: &str) -> Result<Value, LinkError> {
        let keys = Keys::new(swarm)?;
        Ok(self.credentials.as_ref().map(|credentials| tls::robot(credentials, &keys)).unwrap_or_default())
    }

    /// A session that relays.
    fn routing(&self, id: &str, wall: Value, sealed: bool) -> Result<zenoh::Config, LinkError> {
        let listen = self.listening(sealed);
        let config = self.with_defaults(
            wall,
            &serde_json::json!({
                "id": id,
                "mode": "router",
                "listen/endpoints": listen,
                // Words of instructors have the time that their clients give them; nothing else needs one.
                "timestamping/enabled": false,
                "connect/timeout_ms": -1,
                "connect/exit_on_failure": false,
                "scouting/delay": 0,
            }),
        )?;
        if sealed {
            reach::check_sealed(&config)?;
        } else {
            reach::check_open(&config, self.insecure)?;
        }
        Ok(config)
    }

    /// The session of a robot in a cell: a client of a relay, to be dialled for, and itself what clients on this computer attach to.
    fn member(&self, id: &str, mut wall: Value) -> Result<zenoh::Config, LinkError> {
        let own = serde_json::json!({
            "mode": "client",
            "listen/endpoints": [tls::bounded("tcp/127.0.0.1:0")],
            "connect/endpoints": [],
            "gateway": { "south": [{ "filters": [{ "modes": ["client"] }] }] },
            // Its keeper calls; the session itself answers nobody.
            "scouting/multicast/enabled": false,
        });
        match (&mut wall, own) {
            (Value::Object(wall), Value::Object(own)) => wall.extend(own),
            (wall, own) => *wall = own,
        }
        self.with_defaults(
            wall,
            &serde_json::json!({ "id": id, "timestamping/enabled": false, "scouting/delay": 0 }),
        )
    }

    /// The endpoints that an open robot listens on, or one of a sealed swarm.
    #[must_use]
    pub fn listening(&self, sealed: bool) -> Vec<String> {
        let auto: &[&str] = if sealed { &["tls/0.0.0.0:0", "tcp/127.0.0.1:0"] } else { &["tcp/127.0.0.1:0"] };
        let said = self.listen.iter().flat_map(|endpoint| match endpoint.as_str() {
            AUTO => auto.to_vec(),
            endpoint => vec![endpoint],
        });
        said.map(tls::bounded).collect()
    }

    /// Zenoh's configuration for a client: it attaches to one robot and gives up after a few seconds without.
    pub(super) fn client(&self) -> Result<zenoh::Config, LinkError> {
        let wall = self.credentials.as_ref().map(tls::client).unwrap_or_default();
        let config = self.with_defaults(
            wall,
            &serde_json::json!({
                "mode": "client",
                "listen/endpoints": [],
                "timestamping/enabled": true,
                "connect/timeout_ms": 5000,
            }),
        )?;
        if self.credentials.is_some() {
            reach::check_client(&config)?;
        }
        Ok(config)
    }

    /// Zenoh's configuration for a session that stands for a whole swarm: clients attach to it as to a robot.
    pub(super) fn stage(&self, id: &str) -> Result<zenoh::Config, LinkError> {
        let config = self.with_defaults(
            Value::Null,
            &serde_json::json!({
                "id": id,
                "mode": "router",
                "listen/endpoints": self.listening(false),
                "timestamping/enabled": false,
                "connect/timeout_ms": -1,
                "connect/exit_on_failure": false,
                "scouting/delay": 0,
            }),
        )?;
        reach::check_open(&config, self.insecure)?;
        Ok(config)
    }

    fn with_defaults(&self, wall: Value, first: &Value) -> Result<zenoh::Config, LinkError> {
        let mut config = zenoh::Config::default();
        let lease = u64::try_from(self.lease.as_millis()).unwrap_or(u64::MAX);
        let scouting = self.scouting.clone().unwrap_or_default();
        let keep_alives = if self.credentials.is_some() { SEALED_KEEP_ALIVES } else { KEEP_ALIVES };
        let rest = serde_json::json!({
            "connect/endpoints": self.connect,
            "connect/retry": { "period_init_ms": 200, "period_max_ms": 500, "period_increase_factor": 2 },
            "scouting/multicast/enabled": self.scouting.is_some(),
            "scouting/multicast/address": scouting.address,
            "scouting/multicast/interface": scouting.interface,
            "scouting/multicast/autoconnect": { "router": [], "peer": [], "client": ["router"] },
            "scouting/gossip/autoconnect": { "router": [], "peer": [], "client": [] },
            "adminspace/enabled": false,
            "transport/unicast/open_timeout": lease,
            "transport/unicast/accept_timeout": lease,
            "transport/unicast/max_links": 1,
            "transport/link/tx/lease": lease,
            "transport/link/tx/keep_alive": keep_alives,
        });
        for (path, value) in [first, &rest].into_iter().filter_map(Value::as_object).flatten() {
            reach::check_named(path, value)?;
            config
                .insert_json5(path, &value.to_string())
                .map_err(|error| LinkError::config(path, &*error))?;
        }
        for (key, value) in &self.zenoh {
            if key == "id" {
                return Err(LinkError::Config {
                    key: "zenoh.id".to_owned(),
                    cause: "the Zenoh id names the robot and its swarm; leave it out and set the robot's id"
                        .to_owned(),
                });
            }
            merge(&mut config, key, value)?;
        }
        // Nobody opens a sealed robot a little: to open it, take its key away.
        for (path, value) in wall.as_object().into_iter().flatten() {
            config
                .insert_json5(path, &value.to_string())
                .map_err(|error| LinkError::config(path, &*error))?;
        }
        Ok(config)
    }
}

/// Sets what `value` mentions and leaves its siblings as they are.
fn merge(config: &mut zenoh::Config, path: &str, value: &Value) -> Result<(), LinkError> {
    reach::check_named(path, value)?;
    let Value::Object(children) = value else {
        return config
            .insert_json5(path, &value.to_string())
            .map_err(|error| LinkError::config(path, &*error));
    };
    if children.is_empty() {
        // Nothing to set, but a key to be one of Zenoh's.
        return config.get_json(path).map(drop).map_err(|error| LinkError::config(path, &*error));
    }
    let one_by_one =
        children.iter().try_for_each(|(key, child)| merge(config, &format!("{path}/{key}"), child));
    // Some objects, such as values by mode, can only be set as a whole.
    one_by_one.or_else(|error| config.insert_json5(path, &value.to_string()).map_err(|_| error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(zenoh: Value) -> Result<zenoh::Config, LinkError> {
        let zenoh = zenoh.as_object().unwrap().clone();
        LinkConfig { zenoh, ..LinkConfig::default() }.to_zenoh(RobotId(7), "demo", 1)
    }

    #[test]
    fn the_users_own_value_stands_beside_ours() {
        let config = with(serde_json::json!({"transport": {"link": {"tx": {"lease": 2500}}}})).unwrap();
        assert_eq!(config.get_json("transport/link/tx/lease").unwrap(), "2500");
        assert_eq!(config.get_json("transport/link/tx/keep_alive").unwrap(), "4");
        assert_eq!(config.get_json("mode").unwrap(), "\"router\"");
    }

    #[test]
    fn values_by_mode_are_taken_whole() {
        let config = with(serde_json::json!({
            "mode": "client",
            "connect": {"endpoints": {"client": ["tcp/127.0.0.1:1"]}}
        }))
        .unwrap();
        assert_eq!(config.get_json("mode").unwrap(), "\"client\"");
        assert!(config.get_json("connect/endpoints").unwrap().contains("tcp/127.0.0.1:1"));
    }

    #[test]
    fn a_robot_of_a_cell_is_a_client_and_its_relay_has_what_the_user_says() {
        let zenoh = serde_json::json!({"listen": {"endpoints": ["tcp/127.0.0.1:7447"]}});
        let cells = LinkConfig {
            cells: Some(Cells::default()),
            scouting: Some(Scouting::default()),
            zenoh: zenoh.as_object().unwrap().clone(),
            ..LinkConfig::default()
        };
        let (member, relay) = (cells.to_zenoh(RobotId(7), "demo", 1), cells.relay(RobotId(7), "demo", 1, 1));
        let said =
            |config: &Result<zenoh::Config, LinkError>, key| config.as_ref().unwrap().get_json(key).unwrap();
        assert_eq!([said(&member, "mode"), said(&relay, "mode")], ["\"client\"", "\"router\""]);
        assert!(said(&relay, "listen/endpoints").contains("127.0.0.1:7447"));
        assert!(said(&member, "listen/endpoints").contains("127.0.0.1:0"));
        assert_ne!(said(&member, "id"), said(&relay, "id"));

        let refused = |link: LinkConfig| link.to_zenoh(RobotId(7), "demo", 1).unwrap_err().to_string();
        assert!(refused(LinkConfig { scouting: None, ..cells.clone() }).contains("scouting"));
        for size in [0, Cells::MAX_SIZE + 1] {
            assert!(
                refused(LinkConfig { cells: Some(Cells { size }), ..cells.clone() }).contains("cells.size")
            );
        }
    }

    #[test]
    fn what_seals_a_swarm_cannot_be_taken_back() {
        use gestalt_trust::{Identity, Membership};

        use crate::tls::{Bearer, Certificate};

        let key = |number| std::sync::Arc::new(Identity::from_bytes(&[number; 32]));
        let robots = [(RobotId(7), key(7).public_key())].into();
        let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
        let roster = members.sign(&key(1)).unwrap();
        let holder = Bearer::Robot(RobotId(7));
        let certificate = Certificate::issue(&key(1), "demo", holder.clone(), &key(7).public_key()).unwrap();
        let credentials = Credentials::new(&roster, holder, key(7), certificate).unwrap();
        let zenoh = serde_json::json!({
            "access_control": {"enabled": false, "default_permission": "allow"},
            "transport": {"link": {"tls": {"enable_mtls": false}, "protocols": ["tcp"], "tx": {"lease": 2500}}},
        });
        let link = LinkConfig {
            credentials: Some(credentials),
            zenoh: zenoh.as_object().unwrap().clone(),
            ..LinkConfig::default()
        };
        let config = link.to_zenoh(RobotId(7), "demo", 1).unwrap();
        let said = |key| config.get_json(key).unwrap();
        assert_eq!(
            (said("access_control/enabled"), said("transport/link/tx/lease")),
            ("true".into(), "2500".into())
        );
        assert_eq!(
            (said("transport/link/tls/enable_mtls"), said("access_control/default_permission")),
            ("true".into(), "\"deny\"".into())
        );
        assert!(said("listen/endpoints").contains("tls/0.0.0.0:0#tls_handshake_timeout_ms=2000"));
        assert_eq!(said("transport/link/tx/keep_alive"), "3");
        // Whoever prints the configuration prints no key.
        let secret = "MC4CAQAwBQYDK2VwBCIEIAcHBwc";
        assert!(!config.to_string().contains(secret) && !format!("{link:?}").contains(secret));
    }

    #[test]
    fn an_unknown_key_is_named() {
        let error = with(serde_json::json!({"transport": {"lnik": {"tx": 1}}})).unwrap_err();
        assert!(error.to_string().contains("zenoh.transport.lnik"), "{error}");
    }

    #[test]
    fn the_zenoh_id_is_the_robots_own_business() {
        let error = with(serde_json::json!({"id": "abc"})).unwrap_err();
        assert!(error.to_string().contains("zenoh.id"), "{error}");
    }
}
