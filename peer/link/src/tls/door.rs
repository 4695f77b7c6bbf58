//! Who is let in: asked at every link that comes, and at all of them when the roster changes.

use std::sync::{Mutex, PoisonError};

use gestalt_protocol::RobotId;
use gestalt_trust::Roster;
use thiserror::Error;

use super::name::{Bearer, Name};
use super::seat::Seat;

/// Whoever is at the other end of a link, as the transport knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Visitor {
    /// The common name of its certificate; `None` for one without.
    pub name: Option<String>,
    /// The robot that its Zenoh id names.
    pub robot: Option<RobotId>,
    /// Whether it is a client, through which nothing is relayed.
    pub is_client: bool,
    /// Whether it is on this computer, and came without TLS.
    pub is_local: bool,
}

/// Why a link is ended again.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(crate) enum Stranger {
    #[error(
        "a link without a certificate: only clients on this computer may do without; to link robots, enrol them (gestalt trust enrol) and name \
         tls/ endpoints"
    )]
    Plain,
    #[error("a link with a certificate that is none of this swarm's: '{0}'")]
    OtherSwarm(String),
    #[error(
        "a link of {0}, which is not on the roster here with this key: it was expelled or has a new key, or was enrolled since: take the newest \
         roster.json (gestalt trust tell, where the authority's key is, gives it to robots)"
    )]
    NotEnrolled(Bearer),
    #[error("a link of {0} that says it is another one: give each robot its own key, and an id of its own")]
    Pretender(Bearer),
    #[error("a link of {0} that would relay for others: open Zenoh in client mode")]
    NoClient(Bearer),
    #[error("a link of {0}, which is no robot: dial one that is")]
    NoRobot(Seat),
    #[error(
        "one link more of {0} than there is room for, {of_holder} of each and {of_kind} of all of its kind: end some of its programs if it has {of_holder}, \
         or else some of the others of that kind",
        of_holder = .0.bounds().of_holder,
        of_kind = .0.bounds().of_kind
    )]
    TooMany(Seat),
}

impl Stranger {
    /// One word, as it stands in counters (`refused_link_plain`).
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::OtherSwarm(_) => "other_swarm",
            Self::NotEnrolled(_) => "not_enrolled",
            Self::Pretender(_) => "pretender",
            Self::NoClient(_) => "no_client",
            Self::NoRobot(_) => "no_robot",
            Self::TooMany(_) => "too_many",
        }
    }
}

/// The door of one robot of a sealed swarm.
#[derive(Debug)]
pub(crate) struct Door(Mutex<Roster>);

impl Door {
    pub fn new(roster: Roster) -> Self {
        Self(Mutex::new(roster))
    }

    /// Goes by that roster from now on.
    pub fn follow(&self, roster: Roster) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = roster;
    }

    /// Whether that robot is on the roster.
    pub fn knows(&self, robot: RobotId) -> bool {
        let roster = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        roster.members().robots.contains_key(&robot)
    }

    /// Whether to let it in, and as whom.
    pub fn admit(&self, visitor: &Visitor) -> Result<Seat, Stranger> {
        let Some(text) = &visitor.name else {
            // Zenoh links one of a name: who takes a robot's would keep that out.
            return if visitor.is_local && visitor.is_client && visitor.robot.is_none() {
                Ok(Seat::Local)
            } else {
                Err(Stranger::Plain)
            };
        };
        let roster = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let other = || Stranger::OtherSwarm(text.chars().take(80).collect());
        let name: Name = text.parse().map_err(|_| other())?;
        if !name.is_of(&roster.swarm_id()) {
            return Err(other());
        }
        let members = roster.members();
        let key = match &name.holder {
            Bearer::Robot(robot) => members.robots.get(robot).copied(),
            Bearer::Client(client) => members.instructors.get(client).map(|it| it.key),
            Bearer::Authority => Some(roster.authority()),
        };
        if !key.is_some_and(|key| name.has_key(&key)) {
            return Err(Stranger::NotEnrolled(name.holder));
        }
        match (name.holder, visitor.robot) {
            (Bearer::Robot(robot), Some(said)) if robot == said => Ok(Seat::Robot(robot)),
            (holder, Some(_)) => Err(Stranger::Pretender(holder)),
            // Whatever else has a certificate listens, speaks or streams: a robot's program, an instructor's.
            (holder, None) if !visitor.is_client => Err(Stranger::NoClient(holder)),
            (Bearer::Authority, None) => Ok(Seat::Authority),
            (holder, None) => Ok(Seat::Client(holder)),
        }
    }
}

impl Door {
    /// Whether a client may speak to the one that it has dialled: a robot, or whoever is at the endpoint of this computer that was named.
    pub fn recognise(&self, dialled: &Visitor) -> Result<Seat, Stranger> {
        if dialled.name.is_none() && dialled.is_local {
            return Ok(Seat::Local);
        }
        match self.admit(dialled)? {
            robot @ Seat::Robot(_) => Ok(robot),
            other => Err(Stranger::NoRobot(other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_trust::{Identity, Instructor, Membership, Roles};

    use super::*;

    fn key(number: u8) -> Identity {
        Identity::from_bytes(&[number; 32])
    }

    fn roster(epoch: u64, robots: &[(u32, u8)]) -> Roster {
        let robots = robots.iter().map(|(id, number)| (RobotId(*id), key(*number).public_key())).collect();
        let desk = Instructor { key: key(90).public_key(), roles: Roles::NONE };
        let instructors = [("desk".parse().unwrap(), desk)].into();
        let members =
            Membership { swarm: "demo".to_owned(), epoch, robots, instructors, ..Membership::default() };
        members.sign(&key(100)).unwrap()
    }

    fn visitor(holder: Bearer, number: u8, robot: Option<u32>) -> Visitor {
        let name = Name::new(&roster(1, &[]).swarm_id(), holder, &key(number).public_key());
        Visitor { name: Some(name.to_string()), robot: robot.map(RobotId), is_client: false, is_local: false }
    }

    #[test]
    fn members_are_let_in_and_nobody_else() {
        let door = Door::new(roster(1, &[(1, 1), (7, 7)]));
        let robot = |id| Bearer::Robot(RobotId(id));
        let desk = || Bearer::Client("desk".parse().unwrap());
        let client_of = |holder, number| Visitor { is_client: true, ..visitor(holder, number, None) };
        assert_eq!(door.admit(&visitor(robot(7), 7, Some(7))), Ok(Seat::Robot(RobotId(7))));
        assert_eq!(door.admit(&client_of(desk(), 90)), Ok(Seat::Client(desk())));
        assert_eq!(door.admit(&client_of(Bearer::Authority, 100)), Ok(Seat::Authority));
        let client = |is_local| Visitor { name: None, robot: None, is_client: true, is_local };
        assert_eq!(door.admit(&client(true)), Ok(Seat::Local));
        assert_eq!(door.admit(&client(false)), Err(Stranger::Plain));
        assert_eq!(door.admit(&Visitor { is_client: false, ..client(true) }), Err(Stranger::Plain));
        assert_eq!(door.admit(&Visitor { robot: Some(RobotId(7)), ..client(true) }), Err(Stranger::Plain));

        let refused = |visitor: Visitor| door.admit(&visitor).unwrap_err().name();
        assert_eq!(refused(visitor(robot(8), 8, Some(8))), "not_enrolled");
        assert_eq!(refused(visitor(robot(7), 8, Some(7))), "not_enrolled");
        assert_eq!(refused(visitor(Bearer::Authority, 7, None)), "not_enrolled");
        assert_eq!(refused(visitor(Bearer::Client("eve".parse().unwrap()), 90, None)), "not_enrolled");
        assert_eq!(refused(visitor(robot(7), 7, Some(1))), "pretender");
        assert_eq!(refused(visitor(desk(), 90, Some(1))), "pretender");
        // Nobody relays but robots in their own name.
        assert_eq!(refused(visitor(robot(7), 7, None)), "no_client");
        assert_eq!(refused(visitor(desk(), 90, None)), "no_client");
        assert_eq!(refused(visitor(Bearer::Authority, 100, None)), "no_client");
        let listens = client_of(robot(7), 7);
        assert_eq!(door.admit(&listens), Ok(Seat::Client(robot(7))));
        let of_the_web = Visitor { name: Some("robot1.example.org".to_owned()), ..listens };
        assert_eq!(refused(of_the_web), "other_swarm");
        let other = roster(1, &[]).members().clone();
        let other = Membership { swarm: "other".to_owned(), ..other }.sign(&key(100)).unwrap().swarm_id();
        let name = Name::new(&other, robot(7), &key(7).public_key()).to_string();
        assert_eq!(refused(Visitor { name: Some(name), ..visitor(robot(7), 7, Some(7)) }), "other_swarm");
    }

    #[test]
    fn a_client_speaks_to_robots_alone_or_to_whom_it_named_here() {
        let door = Door::new(roster(1, &[(1, 1), (7, 7)]));
        let robot = |id| Bearer::Robot(RobotId(id));
        assert_eq!(door.recognise(&visitor(robot(7), 7, Some(7))), Ok(Seat::Robot(RobotId(7))));
        let here = Visitor { name: None, robot: None, is_client: false, is_local: true };
        assert_eq!(door.recognise(&here), Ok(Seat::Local));
        let refused = |visitor: Visitor| door.recognise(&visitor).unwrap_err().name();
        assert_eq!(refused(Visitor { is_local: false, ..here }), "plain");
        assert_eq!(refused(visitor(robot(7), 8, Some(7))), "not_enrolled");
        let desk = visitor(Bearer::Client("desk".parse().unwrap()), 90, None);
        assert_eq!(refused(desk.clone()), "no_client");
        assert_eq!(refused(Visitor { is_client: true, ..desk }), "no_robot");
        let authority = visitor(Bearer::Authority, 100, None);
        assert_eq!(refused(Visitor { is_client: true, ..authority }), "no_robot");
    }

    #[test]
    fn who_is_one_too_many_is_told_both_bounds() {
        let told = |holder| Stranger::TooMany(Seat::Client(holder)).to_string();
        let camera = told(Bearer::Robot(RobotId(7)));
        assert!(
            camera.contains("a program of robot 7") && camera.contains("8 of each and 320 of all"),
            "{camera}"
        );
        assert!(told(Bearer::Client("desk".parse().unwrap())).contains("8 of each and 64 of all"));
    }

    #[test]
    fn who_is_on_the_roster_no_more_is_not_let_in_and_who_has_a_new_key_is_with_that() {
        let door = Door::new(roster(1, &[(1, 1), (7, 7)]));
        door.follow(roster(2, &[(1, 1)]));
        let robot = || Bearer::Robot(RobotId(7));
        assert_eq!(door.admit(&visitor(robot(), 7, Some(7))).unwrap_err(), Stranger::NotEnrolled(robot()));
        door.follow(roster(3, &[(1, 1), (7, 77)]));
        assert!(door.admit(&visitor(robot(), 7, Some(7))).is_err());
        assert_eq!(door.admit(&visitor(robot(), 77, Some(7))), Ok(Seat::Robot(RobotId(7))));
    }
}
