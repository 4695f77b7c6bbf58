//! Zenoh ids that say which robot a session belongs to, so that neighbours can be told apart.
//!
//! Sixteen bytes, little-endian: robot id (4), checksum of the swarm's name (4), a number that differs at every
//! start (8, its highest bit set: Zenoh wants no leading zeros).

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

use gestalt_protocol::RobotId;
use gestalt_strategies::Life;
use zenoh::session::ZenohId;

const HIGHEST: u64 = 1 << 63;

/// A number that no earlier start had, from the operating system's entropy: the standard library draws the keys of its
/// hash maps there. It need not be secret, so that serves without a crate for it.
#[must_use]
pub fn fresh_nonce() -> u64 {
    RandomState::new().build_hasher().finish()
}

/// The life of a robot that starts with that boot number and that nonce.
pub(super) fn life(boot: u32, nonce: u64) -> Life {
    Life { boot, nonce: (nonce >> 32 ^ nonce) as u32 }
}

/// The checksum that stands for a swarm's name in a Zenoh id.
pub(super) fn swarm_checksum(swarm: &str) -> u32 {
    crc32fast::hash(swarm.as_bytes())
}

/// The Zenoh id of a robot's session, in the hexadecimal that a Zenoh configuration takes.
pub(super) fn zenoh_id(robot: RobotId, swarm: &str, nonce: u64) -> String {
    format!("{:016x}{:08x}{:08x}", nonce | HIGHEST, swarm_checksum(swarm), robot.0)
}

/// The Zenoh id of the `count`th relay that a robot runs in that life; `count` is not 0.
pub(super) fn relay_id(robot: RobotId, swarm: &str, nonce: u64, count: u16) -> String {
    zenoh_id(robot, swarm, nonce ^ u64::from(count))
}

/// The Zenoh id of a session that speaks for a whole swarm and is no robot: clients attach to it, and no robot dials it.
pub(super) fn stage_id(swarm: &str, nonce: u64) -> String {
    format!("{:016x}{:08x}{:08x}", (nonce & !HIGHEST) | HIGHEST >> 1, swarm_checksum(swarm), 0)
}

/// Whether clients of that swarm may attach to a session with that Zenoh id.
pub(super) fn serves(id: ZenohId, swarm: u32) -> bool {
    word(id, 4) == swarm
}

/// Whether a Zenoh id of a robot is that of its session, or of one of its relays, in the life with that nonce.
pub(super) fn is_of_life(id: ZenohId, nonce: u64) -> bool {
    let bytes = id.to_le_bytes();
    let said = u64::from_le_bytes(std::array::from_fn(|i| bytes[8 + i]));
    said >> 16 == (nonce | HIGHEST) >> 16
}

/// Whether a Zenoh id is that of a robot's session in the swarm of the robot with the session `own`, and not of the same life as that.
pub(super) fn is_of_another(id: ZenohId, own: ZenohId) -> bool {
    let nonce = u64::from(word(own, 12)) << 32 | u64::from(word(own, 8));
    robot_of(id, word(own, 4)).is_some_and(|robot| robot.0 != word(own, 0) || !is_of_life(id, nonce))
}

/// The robot behind a Zenoh id; `None` for clients, routers of other kinds and other swarms.
pub(super) fn robot_of(id: ZenohId, swarm: u32) -> Option<RobotId> {
    (word(id, 4) == swarm && word(id, 12) >> 31 == 1).then(|| RobotId(word(id, 0)))
}

fn word(id: ZenohId, at: usize) -> u32 {
    let bytes = id.to_le_bytes();
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_recognised_by_its_own_swarm_alone() {
        for robot in [0, 7, u32::MAX] {
            let id: ZenohId = zenoh_id(RobotId(robot), "demo", 0).parse().unwrap();
            assert_eq!(robot_of(id, swarm_checksum("demo")), Some(RobotId(robot)));
            assert_eq!(robot_of(id, swarm_checksum("other")), None);
        }
    }

    #[test]
    fn what_speaks_for_a_swarm_serves_its_clients_and_is_no_robot() {
        for nonce in [0, fresh_nonce(), u64::MAX] {
            let id: ZenohId = stage_id("demo", nonce).parse().unwrap();
            assert_eq!(robot_of(id, swarm_checksum("demo")), None);
            assert_eq!(
                [swarm_checksum("demo"), swarm_checksum("other")].map(|it| serves(id, it)),
                [true, false]
            );
        }
        let robot: ZenohId = zenoh_id(RobotId(7), "demo", 0).parse().unwrap();
        assert!(serves(robot, swarm_checksum("demo")));
    }

    #[test]
    fn a_robots_relays_are_known_for_its_own_in_one_life_alone() {
        let nonce = fresh_nonce();
        for count in [1, 2, u16::MAX] {
            let relay: ZenohId = relay_id(RobotId(7), "demo", nonce, count).parse().unwrap();
            assert_eq!(robot_of(relay, swarm_checksum("demo")), Some(RobotId(7)));
            assert_ne!(relay.to_string(), zenoh_id(RobotId(7), "demo", nonce));
            assert!(is_of_life(relay, nonce) && !is_of_life(relay, nonce ^ 1 << 40));
        }
    }

    #[test]
    fn another_life_and_another_robot_of_the_same_swarm_are_told_from_ones_own() {
        let nonce = fresh_nonce();
        let id = |robot, swarm, nonce| zenoh_id(RobotId(robot), swarm, nonce).parse::<ZenohId>().unwrap();
        let own = id(7, "demo", nonce);
        let relay = relay_id(RobotId(7), "demo", nonce, 1).parse().unwrap();
        assert!(![own, relay, id(7, "other", !nonce)].into_iter().any(|id| is_of_another(id, own)));
        assert!(
            [id(7, "demo", nonce ^ 1 << 40), id(8, "demo", nonce)]
                .into_iter()
                .all(|id| is_of_another(id, own))
        );
    }

    #[test]
    fn two_starts_have_two_ids() {
        assert_ne!(zenoh_id(RobotId(1), "demo", fresh_nonce()), zenoh_id(RobotId(1), "demo", fresh_nonce()));
    }
}
