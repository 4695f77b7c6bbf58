//! Sealed swarms: keys, members, robots with a certificate.

use std::sync::Arc;

use gestalt_link::{Bearer, Certificate, Credentials, LinkConfig, RobotConfig, Seal};
use gestalt_protocol::RobotId;
use gestalt_trust::{Channels, Identity, Instructor, Membership, Role, Roles};

use crate::config;

/// The number of the authority's key.
const AUTHORITY: u32 = 1000;

/// The key of robot `id`; any other number is somebody's too, 1000 is the authority's.
#[must_use]
pub fn key(id: u32) -> Identity {
    let mut secret = [7; 32];
    secret[..4].copy_from_slice(&id.to_le_bytes());
    Identity::from_bytes(&secret)
}

/// The members `robots` of a swarm, and eve, who may listen and nothing else. Whoever is local may teach.
#[must_use]
pub fn with_eve(swarm: &str, robots: u32) -> Membership {
    let robots = (0..robots).map(|id| (RobotId(id), key(id).public_key())).collect();
    let eve = Instructor { key: key(666).public_key(), roles: Roles::NONE };
    Membership {
        swarm: swarm.to_owned(),
        epoch: 1,
        robots,
        instructors: [("eve".parse().expect("a name"), eve)].into(),
        local: Roles::up_to(Role::Teach),
        ..Membership::default()
    }
}

/// The endpoints at which a sealed robot is dialled.
#[must_use]
pub fn by_tls(locators: &[String]) -> Vec<String> {
    locators.iter().filter(|locator| locator.starts_with("tls/")).cloned().collect()
}

/// The seal of a member.
///
/// # Panics
/// When it is none.
#[must_use]
pub fn seal(id: u32, members: &Membership) -> Seal {
    let roster = members.clone().sign(&key(AUTHORITY)).expect("a roster");
    Seal::issue(&key(AUTHORITY), roster, RobotId(id), Arc::new(key(id))).expect("a certificate")
}

/// What shows robot `to` that member `from` tells it that.
///
/// # Panics
/// When one of them is none.
#[must_use]
pub fn tag(from: u32, to: u32, members: &Membership, message: &[u8]) -> Vec<u8> {
    let roster = members.clone().sign(&key(AUTHORITY)).expect("a roster");
    let mut channels = Channels::new(RobotId(from), Arc::new(key(from)), roster.swarm_id());
    channels.tag(&roster, RobotId(to), message).expect("two members").to_vec()
}

/// A member on the loopback interface that dials `connect`.
///
/// # Panics
/// When it is no member.
#[must_use]
pub fn sealed(id: u32, members: &Membership, connect: &[String]) -> RobotConfig {
    let plain = config(id, &members.swarm, &by_tls(connect));
    let listen = ["tls/127.0.0.1:0", "tcp/127.0.0.1:0"].map(str::to_owned).to_vec();
    RobotConfig { seal: Some(seal(id, members)), link: LinkConfig { listen, ..plain.link }, ..plain }
}

/// What whoever has that key shows to a member.
///
/// # Panics
/// When the key is not the holder's on the roster.
#[must_use]
pub fn credentials(members: &Membership, holder: Bearer, identity: Identity) -> Credentials {
    let roster = members.clone().sign(&key(AUTHORITY)).expect("a roster");
    let public = identity.public_key();
    let certificate =
        Certificate::issue(&key(AUTHORITY), &members.swarm, holder.clone(), &public).expect("a certificate");
    Credentials::new(&roster, holder, Arc::new(identity), certificate).expect("its own certificate")
}
