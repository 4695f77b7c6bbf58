//! What a certificate says of who holds it.

use std::fmt;
use std::str::FromStr;

use gestalt_protocol::hex::{self, Hex};
use gestalt_protocol::{InstructorId, RobotId};
use gestalt_trust::{PublicKey, SwarmId};

/// Who holds a certificate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Bearer {
    /// A robot.
    Robot(RobotId),
    /// A client with a key: an instructor, or a program that listens.
    Client(InstructorId),
    /// Whoever may change the roster.
    Authority,
}

impl fmt::Display for Bearer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot(robot) => write!(f, "robot {robot}"),
            Self::Client(name) => write!(f, "client {name}"),
            Self::Authority => f.write_str("the authority"),
        }
    }
}

/// The common name of a certificate: `gestalt:<swarm>:robot:7:<key>`, `gestalt:<swarm>:client:desk:<key>` or
/// `gestalt:<swarm>:authority::<key>`, with the first 8 bytes of the swarm's id and the first 16 of the key in hexadecimal digits. No public
/// authority signs a name like that.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    swarm: [u8; 8],
    /// Who holds it.
    pub holder: Bearer,
    key: [u8; 16],
}

impl Name {
    /// The name of that holder of that key in that swarm.
    #[must_use]
    pub fn new(swarm: &SwarmId, holder: Bearer, key: &PublicKey) -> Self {
        Self { swarm: first(swarm.as_bytes()), holder, key: first(key.as_bytes()) }
    }

    /// Whether it is of that swarm.
    #[must_use]
    pub fn is_of(&self, swarm: &SwarmId) -> bool {
        self.swarm == first(swarm.as_bytes())
    }

    /// Whether that is the holder's key.
    #[must_use]
    pub fn has_key(&self, key: &PublicKey) -> bool {
        self.key == first(key.as_bytes())
    }
}

fn first<const N: usize>(bytes: &[u8; 32]) -> [u8; N] {
    std::array::from_fn(|at| bytes[at])
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "gestalt:{}:", Hex(&self.swarm))?;
        match &self.holder {
            Bearer::Robot(robot) => write!(f, "robot:{robot}")?,
            Bearer::Client(name) => write!(f, "client:{name}")?,
            Bearer::Authority => f.write_str("authority:")?,
        }
        write!(f, ":{}", Hex(&self.key))
    }
}

/// A common name of another form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoName;

impl FromStr for Name {
    type Err = NoName;

    fn from_str(text: &str) -> Result<Self, NoName> {
        let parts: Vec<&str> = text.splitn(6, ':').collect();
        let ["gestalt", swarm, kind, who, key] = parts[..] else { return Err(NoName) };
        let holder = match kind {
            "robot" => Bearer::Robot(who.parse().map_err(|_| NoName)?),
            "client" => Bearer::Client(who.parse().map_err(|_| NoName)?),
            "authority" if who.is_empty() => Bearer::Authority,
            _ => return Err(NoName),
        };
        let swarm = hex::parse(swarm).map_err(|_| NoName)?;
        let key = hex::parse(key).map_err(|_| NoName)?;
        Ok(Self { swarm, holder, key })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_one_spelling() {
        let (authority, key) = (PublicKey::from_bytes([7; 32]), PublicKey::from_bytes([9; 32]));
        let swarm = SwarmId::new(&authority, "demo");
        for holder in [Bearer::Robot(RobotId(7)), Bearer::Client("desk".parse().unwrap()), Bearer::Authority]
        {
            let name = Name::new(&swarm, holder, &key);
            assert_eq!(name.to_string().parse(), Ok(name.clone()));
            assert!(name.is_of(&swarm) && name.has_key(&key) && !name.has_key(&authority));
            assert!(!name.is_of(&SwarmId::new(&authority, "other")));
        }
        let name = Name::new(&swarm, Bearer::Robot(RobotId(7)), &key).to_string();
        assert_eq!(name, "gestalt:676f09d996cb0899:robot:7:09090909090909090909090909090909");
        for bad in [
            "",
            "robot1.example.org",
            &name[1..],
            &name.replace(":7:", ":07:"),
            &name.replace("robot", "robots"),
            &(name.clone() + ":"),
            &(name.clone() + "0"),
            &name.replace("676f", "676F"),
        ] {
            assert_eq!(bad.parse::<Name>(), Err(NoName), "{bad}");
        }
    }
}
