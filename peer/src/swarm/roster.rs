//! Which robots a swarm is made of: `footbot:6,parrot:2`.

use std::str::FromStr;

use thiserror::Error;

use crate::config::CameraChoice;

/// The most robots one machine is asked to run.
const MAX_MEMBERS: usize = 1000;

/// A text that is not a roster.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum RosterError {
    /// A part that is not `KIND:COUNT`.
    #[error("'{0}': write KIND:COUNT, such as footbot:6")]
    Part(String),
    /// A kind of robot that does not exist.
    #[error("'{0}' is not a camera model: use footbot, parrot or laptop")]
    Kind(String),
    /// No robots, or more than a machine can run.
    #[error("{0} robots: a swarm on one machine has 1 to {MAX_MEMBERS}")]
    Size(usize),
}

/// The robots of a swarm, by kind of camera, in the order of their ids from 1.
#[derive(Clone, Debug)]
pub struct Roster {
    kinds: Vec<CameraChoice>,
}

impl Roster {
    /// The camera of each robot.
    #[must_use]
    pub fn cameras(&self) -> &[CameraChoice] {
        &self.kinds
    }
}

impl FromStr for Roster {
    type Err = RosterError;

    fn from_str(text: &str) -> Result<Self, RosterError> {
        let mut kinds = Vec::new();
        for part in text.split(',') {
            let (kind, count) = part.split_once(':').ok_or_else(|| RosterError::Part(part.to_owned()))?;
            let count: usize = count.parse().map_err(|_| RosterError::Part(part.to_owned()))?;
            let robots = kinds.len().saturating_add(count);
            if robots > MAX_MEMBERS {
                return Err(RosterError::Size(robots));
            }
            let camera = CameraChoice::named(kind).ok_or_else(|| RosterError::Kind(kind.to_owned()))?;
            kinds.extend(std::iter::repeat_n(camera, count));
        }
        if kinds.is_empty() { Err(RosterError::Size(0)) } else { Ok(Self { kinds }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_counted_by_kind() {
        let roster: Roster = "footbot:2,parrot:1".parse().unwrap();
        let kinds: Vec<_> = roster.cameras().iter().map(CameraChoice::name).collect();
        assert_eq!(kinds, ["footbot", "footbot", "parrot"]);
    }

    #[test]
    fn a_bad_roster_names_the_part_and_what_to_write() {
        for (text, named) in [
            ("footbot", "KIND:COUNT"),
            ("footbot:x", "footbot:x"),
            ("drone:1", "drone"),
            ("footbot:0", "1 to 1000"),
            ("footbot:999999999", "1 to 1000"),
            ("", "KIND:COUNT"),
        ] {
            let error = text.parse::<Roster>().unwrap_err().to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
    }
}
