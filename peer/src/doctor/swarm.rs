//! Whether the robots of a swarm fit together: rules over what they say of themselves.

mod common;
mod health;
mod reach;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{RobotId, Status};

use super::finding::Finding;

/// What to do where no robot of a swarm answers.
pub(crate) const NOBODY_ANSWERS: &str =
    "start a robot; or name one that runs: -e tcp/ITS-ADDRESS:7447, and the swarm: --swarm NAME";

/// What was gathered about a swarm.
#[derive(Clone, Debug, Default)]
pub struct SwarmFacts {
    /// Its name.
    pub name: String,
    /// Who answered, in parts that do not hear each other.
    pub parts: Vec<Vec<Answer>>,
    /// Endpoints that were named, where no robot of the swarm answers, and why.
    pub unreached: Vec<(String, String)>,
    /// Robots that answer by multicast, and not when they are asked.
    pub silent: BTreeSet<RobotId>,
    /// Robots that answer by multicast and are in no part: nobody asked them, as enough others were asked.
    pub unasked: BTreeSet<RobotId>,
    /// The roster that is at hand; `None` in an open swarm.
    pub roster: Option<RosterFacts>,
    /// What the robot that is described would say of itself.
    pub mine: Option<Status>,
    /// Whether that very robot is among those that answer.
    pub running: bool,
}

/// What a roster says.
#[derive(Clone, Debug)]
pub struct RosterFacts {
    /// The greatest is the newest.
    pub epoch: u64,
    /// The robots that it names.
    pub robots: BTreeSet<RobotId>,
}

/// What one robot said, and when.
#[derive(Clone, Debug)]
pub struct Answer {
    /// What it said.
    pub status: Status,
    /// Between which times by the clock of who asked, since 1970.
    pub asked: (Duration, Duration),
    /// By how much its counters have grown while it was looked at; none that have not.
    pub grown: BTreeMap<String, u64>,
}

/// What there is to say about a swarm.
#[must_use]
pub fn findings(facts: &SwarmFacts) -> Vec<Finding> {
    let mut found = reach::findings(facts);
    if facts.parts.iter().any(|part| !part.is_empty()) {
        found.extend(common::findings(facts));
        found.extend(health::findings(facts));
    }
    found
}

impl SwarmFacts {
    fn answers(&self) -> impl Iterator<Item = &Answer> {
        self.parts.iter().flatten()
    }

    /// All that say anything: the robots, and the one that is described. Each with its name in a sentence.
    fn voices(&self) -> impl Iterator<Item = (String, &Status)> {
        let robots = self.answers().map(|answer| (format!("robot {}", answer.status.robot), &answer.status));
        robots.chain(self.mine.iter().map(|mine| ("this configuration".to_owned(), mine)))
    }
}

/// Robots in words: `robots 1, 2, 5`, the first dozen of many.
fn robots<'a>(ids: impl IntoIterator<Item = &'a RobotId>) -> String {
    const SHOWN: usize = 12;
    let ids: BTreeSet<&RobotId> = ids.into_iter().collect();
    let shown: Vec<String> = ids.iter().take(SHOWN).map(ToString::to_string).collect();
    let more = if ids.len() > SHOWN { format!(" and {} more", ids.len() - SHOWN) } else { String::new() };
    format!("robot{} {}{more}", if ids.len() == 1 { "" } else { "s" }, shown.join(", "))
}

/// What a robot says, cut where only a liar would go on.
fn short(said: &str) -> String {
    const MOST: usize = 200;
    let mut shown: String = said.chars().take(MOST).collect();
    if shown.len() < said.len() {
        shown.push('…');
    }
    shown
}
