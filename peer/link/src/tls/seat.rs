//! How many links there may be of whom, so that nobody leaves no room for others.

use std::fmt;
use std::mem::discriminant;

use gestalt_protocol::RobotId;

use super::name::Bearer;

/// Whose a link is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Seat {
    /// A robot's own session, or a relay that it runs.
    Robot(RobotId),
    /// A client with a certificate: an instructor, or a robot's program that only listens, or streams what its camera sees.
    Client(Bearer),
    /// A client on this computer without one. Nothing tells them apart.
    Local,
    /// Whoever may change the roster, of whom robots must hear whatever others do.
    Authority,
}

/// The most links of robots' programs: of as many cameras as a fusion centre serves, and of a quarter more, whose links broke silently and are not
/// missed yet, or that are no cameras.
const PROGRAMS: usize = 256 + 64;

/// How many links there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bounds {
    /// Of one holder.
    pub of_holder: usize,
    /// Of all of that kind.
    pub of_kind: usize,
}

impl Seat {
    /// The most links of its holder, and of its kind. No kind takes the room of another, and all together are fewer than Zenoh's own
    /// bound, below which it refuses silently and without a look at who it is.
    pub const fn bounds(&self) -> Bounds {
        let (of_holder, of_kind) = match self {
            // One, and in cells a relay beside it; before a link that broke silently is missed, the same once more.
            Self::Robot(_) => (4, 64),
            // Apart from people's, so that a centre full of cameras can still be watched and taught.
            Self::Client(Bearer::Robot(_)) => (8, PROGRAMS),
            Self::Client(_) => (8, 64),
            Self::Local => (32, 32),
            Self::Authority => (4, 4),
        };
        Bounds { of_holder, of_kind }
    }

    /// Whether they share the room of one kind.
    fn is_of_kind(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Client(one), Self::Client(other)) => discriminant(one) == discriminant(other),
            _ => discriminant(self) == discriminant(other),
        }
    }

    /// Whether there is room beside those that are there.
    pub fn is_free<'a>(&self, others: impl Iterator<Item = &'a Self>) -> bool {
        let (mut holders, mut kinds) = (0, 0);
        for other in others {
            holders += usize::from(other == self);
            kinds += usize::from(self.is_of_kind(other));
        }
        let Bounds { of_holder, of_kind } = self.bounds();
        holders < of_holder && kinds < of_kind
    }
}

impl fmt::Display for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot(robot) => write!(f, "robot {robot}"),
            Self::Client(Bearer::Robot(robot)) => write!(f, "a program of robot {robot}"),
            Self::Client(holder) => holder.fmt(f),
            Self::Local => f.write_str("a program on this computer without a certificate"),
            Self::Authority => f.write_str("the authority"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::{MAX_SESSIONS, PENDING};
    use super::*;

    /// How many of those that come find room, one after the other.
    fn seated(coming: impl Iterator<Item = Seat>) -> Vec<Seat> {
        let mut seated = Vec::new();
        for seat in coming {
            if seat.is_free(seated.iter()) {
                seated.push(seat);
            }
        }
        seated
    }

    #[test]
    fn nobody_takes_the_room_of_others() {
        let client = |name: &str| Seat::Client(Bearer::Client(name.parse().unwrap()));
        let of_robot = |id| Seat::Client(Bearer::Robot(RobotId(id)));
        let greedy = [client("eve"), Seat::Robot(RobotId(7)), of_robot(7), Seat::Local, Seat::Authority];
        let mut taken = seated((0..1000).flat_map(|_| greedy.clone()));
        let of = |seat: &Seat| taken.iter().filter(|taken| *taken == seat).count();
        assert_eq!(greedy.each_ref().map(of), [8, 4, 8, 32, 4]);
        for other in [client("ada"), Seat::Robot(RobotId(8)), of_robot(8)] {
            assert!(other.is_free(taken.iter()), "{other}");
        }
        // However many get together.
        taken.extend((100..200).map(|id| client(&format!("eve-{id}"))));
        assert!(!client("ada").is_free(taken.iter()) && Seat::Robot(RobotId(8)).is_free(taken.iter()));
    }

    #[test]
    fn a_centre_has_room_for_all_its_cameras_and_for_people() {
        let of_robot = |id| Seat::Client(Bearer::Robot(RobotId(id)));
        let client = |name: &str| Seat::Client(Bearer::Client(name.parse().unwrap()));
        let mut taken = seated((1..=256).map(of_robot));
        assert_eq!(taken.len(), 256);
        taken.extend((0..64).map(|person| client(&format!("person-{}", person / 8))));
        assert!(
            of_robot(1).is_free(taken.iter()),
            "a camera that comes back before its broken link is missed"
        );
        taken.extend(seated((300..700).map(of_robot)));
        assert!(!of_robot(7).is_free(taken.iter()));
        // Neither keeps out the other.
        let people: Vec<Seat> = taken.iter().filter(|seat| !seat.is_of_kind(&of_robot(1))).cloned().collect();
        assert!(of_robot(7).is_free(people.iter()) && !client("ada").is_free(people.iter()));
        let cameras: Vec<Seat> = taken.iter().filter(|seat| seat.is_of_kind(&of_robot(1))).cloned().collect();
        assert!(client("ada").is_free(cameras.iter()));
    }

    #[test]
    fn zenoh_has_room_for_all_of_them() {
        let crowd = (0..1000).flat_map(|id| {
            let (robot, name) = (RobotId(id), format!("client-{id}"));
            let clients = [Bearer::Robot(robot), Bearer::Client(name.parse().unwrap())].map(Seat::Client);
            [Seat::Robot(robot), Seat::Local, Seat::Authority].into_iter().chain(clients)
        });
        let seated = seated(crowd);
        assert_eq!(seated.len(), 64 + PROGRAMS + 64 + 32 + 4);
        assert!(seated.len() + 2 * PENDING <= MAX_SESSIONS);
    }
}
