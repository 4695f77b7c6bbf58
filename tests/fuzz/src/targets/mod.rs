//! What is fuzzed.

mod envelope;
mod frame;
mod inbox;
mod json;
mod key;
mod mind;
mod proof;
mod roster;

pub use self::mind::contradicts;

use std::fmt;
use std::str::FromStr;

use gestalt_protocol::{Keys, RobotId, Topic};
use rand::{Rng, RngExt};

use crate::values;

/// One way for bytes to come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Messages between robots.
    Envelope,
    /// What clients write and read.
    Json,
    /// Who belongs to the swarm.
    Roster,
    /// A decision with the votes that it rests on.
    Proof,
    /// Keys and names.
    Key,
    /// What travels beside a picture.
    Frame,
    /// Whatever arrives at a robot, under its key.
    Inbox,
    /// Three honest minds, and one who means them ill.
    Mind,
    /// The same, of whom no more is asked than that no round has two final gestures.
    Finals,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Envelope,
        Self::Json,
        Self::Roster,
        Self::Proof,
        Self::Key,
        Self::Frame,
        Self::Inbox,
        Self::Mind,
        Self::Finals,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Envelope => "envelope",
            Self::Json => "json",
            Self::Roster => "roster",
            Self::Proof => "proof",
            Self::Key => "key",
            Self::Frame => "frame",
            Self::Inbox => "inbox",
            Self::Mind => "mind",
            Self::Finals => "finals",
        }
    }

    /// The target whose corpus it is tried on.
    #[must_use]
    pub fn corpus(self) -> Self {
        if self == Self::Finals { Self::Mind } else { self }
    }

    /// Tries one input.
    ///
    /// # Panics
    /// If a property that the target stands for does not hold.
    pub fn run(self, bytes: &[u8]) {
        match self {
            Self::Envelope => envelope::run(bytes),
            Self::Json => json::run(bytes),
            Self::Roster => roster::run(bytes),
            Self::Proof => proof::run(bytes),
            Self::Key => key::run(bytes),
            Self::Frame => frame::run(bytes),
            Self::Inbox => inbox::run(bytes),
            Self::Mind => mind::run(bytes),
            Self::Finals => mind::finals(bytes),
        }
    }

    /// An input that has the form of what is expected, to begin with.
    pub fn seed(self, rng: &mut impl Rng) -> Vec<u8> {
        match self {
            Self::Envelope => values::envelope(rng).encode(),
            Self::Json => json_seed(rng),
            Self::Roster => roster::seed(rng),
            Self::Proof => proof::seed(rng),
            Self::Key => key_seed(rng),
            Self::Frame => values::beside_a_frame(rng),
            Self::Inbox => inbox::seed(rng),
            Self::Mind | Self::Finals => mind::seed(rng),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|target| target.name() == text);
        known.ok_or_else(|| {
            format!("'{text}' is no target: take one of {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}

fn json_seed(rng: &mut impl Rng) -> Vec<u8> {
    let json = match rng.random_range(0..5) {
        0 => serde_json::to_vec(&values::instruction(rng)),
        1 => serde_json::to_vec(&values::answer(rng)),
        2 => serde_json::to_vec(&values::announcement(rng)),
        3 => serde_json::to_vec(&values::status(rng)),
        _ => serde_json::to_vec(&values::decision(rng)),
    };
    json.expect("it is JSON")
}

fn key_seed(rng: &mut impl Rng) -> Vec<u8> {
    let keys = Keys::new("demo").expect("a name");
    let robot: RobotId = values::robot(rng);
    let text = match rng.random_range(0..8) {
        0 => keys.key(&Topic::Vote(robot)),
        1 => keys.key(&Topic::Decision),
        2 => keys.key(&Topic::Feedback(values::instructor(rng))),
        3 => keys.key(&Topic::Taken(robot)),
        4 => values::round(rng).to_string(),
        5 => values::signature(rng).to_string(),
        6 => robot.to_string(),
        _ => keys.every_robot("frame"),
    };
    text.into_bytes()
}
