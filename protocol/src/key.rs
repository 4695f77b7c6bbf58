//! Where things are said: the key expressions of a swarm.

use thiserror::Error;

use crate::id::{InstructorId, RobotId};

/// A swarm name that could not stand in a key expression.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no swarm name: 1 to 64 of the characters A-Z a-z 0-9 _ -")]
pub struct SwarmNameError(String);

/// Builds and parses the keys of one swarm, all under `gestalt/<swarm>/`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keys {
    prefix: String,
}

/// What a key is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Topic {
    /// `robot/<id>/vote`: the robot's latest vote, a postcard [`Envelope`](crate::Envelope).
    Vote(RobotId),
    /// `robot/<id>/sample`: samples the robot shares, a postcard [`Envelope`](crate::Envelope).
    Sample(RobotId),
    /// `robot/<id>/repair`: what neighbours tell that robot alone, a postcard [`Envelope`](crate::Envelope).
    Repair(RobotId),
    /// `robot/<id>/decision`: which decision that robot holds, JSON.
    RobotDecision(RobotId),
    /// `robot/<id>/status`: a queryable, JSON [`Status`](crate::Status).
    Status(RobotId),
    /// `robot/<id>/alive`: a liveliness token.
    Alive(RobotId),
    /// `robot/<id>/frame`: what the robot's camera sees, a picture with a [`FrameHeader`](crate::FrameHeader) attached.
    Frame(RobotId),
    /// `robot/<id>/taken`: who looks for the robot took a frame, a [`FrameTaken`](crate::FrameTaken).
    Taken(RobotId),
    /// `decision`: the swarm's decision, one message each, JSON; also a queryable for the last one.
    Decision,
    /// `question`: what the swarm asks its instructor, a [`Question`](crate::Question), JSON.
    Question,
    /// `evidence`: in a sealed swarm, proof that a member said two things; see `gestalt-trust`.
    Evidence,
    /// `roster`: in a sealed swarm, its newest members, for all who hear it; see `gestalt-trust`.
    Roster,
    /// `robot/<id>/roster`: the same, from a neighbour to that robot alone.
    RosterFor(RobotId),
    /// `instructor/<id>/feedback`: an [`Instruction`](crate::Instruction), JSON. In a sealed swarm, to the robot on whose computer it is said.
    Feedback(InstructorId),
    /// `instructor/<id>/word`: in a sealed swarm, an [`Instruction`](crate::Instruction), JSON, signed in its attachment; see `gestalt-trust`.
    Word(InstructorId),
    /// `instructor/<id>/answer`: the swarm's [`Answer`](crate::Answer) to it, JSON.
    Answer(InstructorId),
}

impl Keys {
    /// The keys of the swarm of that name.
    ///
    /// # Errors
    /// [`SwarmNameError`] for a name that is empty, longer than 64 bytes, or has other characters than
    /// `A-Z a-z 0-9 _ -`.
    pub fn new(swarm: &str) -> Result<Self, SwarmNameError> {
        let fits = (1..=64).contains(&swarm.len())
            && swarm.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        if fits {
            Ok(Self { prefix: format!("gestalt/{swarm}/") })
        } else {
            Err(SwarmNameError(swarm.chars().take(80).collect()))
        }
    }

    /// The swarm's name.
    #[must_use]
    pub fn swarm(&self) -> &str {
        self.prefix.strip_prefix("gestalt/").and_then(|it| it.strip_suffix('/')).unwrap_or_default()
    }

    /// The key of a topic.
    #[must_use]
    pub fn key(&self, topic: &Topic) -> String {
        let prefix = &self.prefix;
        match topic {
            Topic::Vote(id) => format!("{prefix}robot/{id}/vote"),
            Topic::Sample(id) => format!("{prefix}robot/{id}/sample"),
            Topic::Repair(id) => format!("{prefix}robot/{id}/repair"),
            Topic::RobotDecision(id) => format!("{prefix}robot/{id}/decision"),
            Topic::Status(id) => format!("{prefix}robot/{id}/status"),
            Topic::Alive(id) => format!("{prefix}robot/{id}/alive"),
            Topic::Frame(id) => format!("{prefix}robot/{id}/frame"),
            Topic::Taken(id) => format!("{prefix}robot/{id}/taken"),
            Topic::Decision => format!("{prefix}decision"),
            Topic::Question => format!("{prefix}question"),
            Topic::Evidence => format!("{prefix}evidence"),
            Topic::Roster => format!("{prefix}roster"),
            Topic::RosterFor(id) => format!("{prefix}robot/{id}/roster"),
            Topic::Word(id) => format!("{prefix}instructor/{id}/word"),
            Topic::Feedback(id) => format!("{prefix}instructor/{id}/feedback"),
            Topic::Answer(id) => format!("{prefix}instructor/{id}/answer"),
        }
    }

    /// The key expression for one kind of thing from every robot: `robot/*/<what>`.
    #[must_use]
    pub fn every_robot(&self, what: &str) -> String {
        format!("{}robot/*/{what}", self.prefix)
    }

    /// The key expression for one kind of thing of every instructor: `instructor/*/<what>`.
    #[must_use]
    pub fn every_instructor(&self, what: &str) -> String {
        format!("{}instructor/*/{what}", self.prefix)
    }

    /// What a key is about; `None` for a key of another swarm or of no known form.
    #[must_use]
    pub fn parse(&self, key: &str) -> Option<Topic> {
        let mut chunks = key.strip_prefix(&self.prefix)?.split('/');
        let topic = match (chunks.next()?, chunks.next(), chunks.next()) {
            ("decision", None, None) => Topic::Decision,
            ("question", None, None) => Topic::Question,
            ("evidence", None, None) => Topic::Evidence,
            ("roster", None, None) => Topic::Roster,
            ("robot", Some(id), Some(what)) => {
                let id = id.parse().ok()?;
                match what {
                    "vote" => Topic::Vote(id),
                    "sample" => Topic::Sample(id),
                    "repair" => Topic::Repair(id),
                    "decision" => Topic::RobotDecision(id),
                    "status" => Topic::Status(id),
                    "alive" => Topic::Alive(id),
                    "frame" => Topic::Frame(id),
                    "taken" => Topic::Taken(id),
                    "roster" => Topic::RosterFor(id),
                    _ => return None,
                }
            }
            ("instructor", Some(id), Some("feedback")) => Topic::Feedback(id.parse().ok()?),
            ("instructor", Some(id), Some("word")) => Topic::Word(id.parse().ok()?),
            ("instructor", Some(id), Some("answer")) => Topic::Answer(id.parse().ok()?),
            _ => return None,
        };
        chunks.next().is_none().then_some(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_know_their_swarm_whatever_its_name() {
        for name in ["demo", "gestalt", "gestalt-2"] {
            assert_eq!(Keys::new(name).unwrap().swarm(), name);
        }
    }

    #[test]
    fn every_topic_comes_back_from_its_key() {
        let keys = Keys::new("demo").unwrap();
        let topics = [
            Topic::Vote(RobotId(1)),
            Topic::Sample(RobotId(1)),
            Topic::Repair(RobotId(2)),
            Topic::RobotDecision(RobotId(3)),
            Topic::Status(RobotId(4)),
            Topic::Alive(RobotId(u32::MAX)),
            Topic::Frame(RobotId(5)),
            Topic::Taken(RobotId(6)),
            Topic::Decision,
            Topic::Question,
            Topic::Evidence,
            Topic::Roster,
            Topic::RosterFor(RobotId(7)),
            Topic::Feedback("ada".parse().unwrap()),
            Topic::Word("ada".parse().unwrap()),
            Topic::Answer("ada".parse().unwrap()),
        ];
        for topic in topics {
            assert_eq!(keys.parse(&keys.key(&topic)), Some(topic));
        }
    }

    #[test]
    fn keys_of_others_are_not_ours() {
        let keys = Keys::new("demo").unwrap();
        for key in [
            "gestalt/other/decision",
            "gestalt/demo",
            "gestalt/demo/",
            "gestalt/demo/decision/x",
            "gestalt/demo/robot/1/vote/x",
            "gestalt/demo/robot/01/vote",
            "gestalt/demo/robot/*/vote",
            "gestalt/demo/robot/1/frames",
        ] {
            assert_eq!(keys.parse(key), None, "{key}");
        }
    }

    #[test]
    fn a_swarm_name_is_one_key_chunk() {
        for bad in ["", "a/b", "a*", "$", &"x".repeat(65)] {
            assert!(Keys::new(bad).is_err(), "{bad}");
        }
    }
}
