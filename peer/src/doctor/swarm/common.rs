//! What all robots of a swarm must have in common.

use std::collections::{BTreeMap, BTreeSet};

use gestalt_link::rounds_in_words;
use gestalt_protocol::{PROTOCOL_VERSION, Status};
use gestalt_strategies::MindConfig;

use super::{SwarmFacts, short};
use crate::doctor::Finding;

/// Parameters of rounds that belong to a camera, so that robots may differ in them.
const OWN: [&str; 2] = ["decorrelation", "discount_repeats"];

/// How many values of something are shown.
const SHOWN: usize = 4;

pub(super) fn findings(facts: &SwarmFacts) -> Vec<Finding> {
    let mut found = vec![versions(facts), sealed(facts), vocabularies(facts), spaces(facts)];
    found.extend(rounds(facts));
    found.extend(quorum(facts));
    found.extend(rosters(facts));
    found
}

/// Who says which value of something, the most frequent first; those that have none are left out.
fn values<T: Ord>(facts: &SwarmFacts, of: impl Fn(&Status) -> Option<T>) -> Vec<(T, BTreeSet<String>)> {
    let mut groups: BTreeMap<T, BTreeSet<String>> = BTreeMap::new();
    for (who, status) in facts.voices() {
        if let Some(value) = of(status) {
            groups.entry(value).or_default().insert(who);
        }
    }
    let mut groups: Vec<_> = groups.into_iter().collect();
    // Stable: of two that are equally frequent, the smaller.
    groups.sort_by_key(|(_, who)| std::cmp::Reverse(who.len()));
    groups
}

/// `robot 1, robot 2: "majority"; robot 7: 3`.
fn shown<T>(groups: &[(T, BTreeSet<String>)], word: impl Fn(&T) -> String) -> String {
    let one = |(value, who): &(T, BTreeSet<String>)| format!("{}: {}", some(who), word(value));
    let more = if groups.len() > SHOWN { "; …" } else { "" };
    groups.iter().take(SHOWN).map(one).collect::<Vec<_>>().join("; ") + more
}

fn some(who: &BTreeSet<String>) -> String {
    let more = if who.len() > SHOWN { format!(" and {} more", who.len() - SHOWN) } else { String::new() };
    who.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ") + &more
}

/// All but the most frequent value's.
fn others<T>(groups: &[(T, BTreeSet<String>)]) -> String {
    some(&groups.iter().skip(1).flat_map(|(_, who)| who.iter().cloned()).collect())
}

fn versions(facts: &SwarmFacts) -> Finding {
    let groups = values(facts, |status| Some(status.protocol));
    match groups.as_slice() {
        [(PROTOCOL_VERSION, _)] => {
            Finding::fine("release", format!("all speak version {PROTOCOL_VERSION} of the wire"))
        }
        _ => Finding::failure(
            "release",
            format!(
                "not all speak this program's version of the wire ({PROTOCOL_VERSION}): {}",
                shown(&groups, |version| if *version == 0 {
                    "an older one".to_owned()
                } else {
                    version.to_string()
                })
            ),
            "robots refuse what another version says, and do not hear its votes",
            "install one release on all robots: cargo install --path peer; gestalt --version says which one it is",
        ),
    }
}

fn sealed(facts: &SwarmFacts) -> Finding {
    let groups = values(facts, |status| Some(status.sealed));
    let word = |sealed: &bool| if *sealed { "sealed" } else { "open" }.to_owned();
    match groups.as_slice() {
        [(sealed, _)] => Finding::fine("seal", format!("all are {}", word(sealed))),
        _ => Finding::failure(
            "seal",
            format!("some robots are sealed and others are not: {}", shown(&groups, word)),
            "sealed robots refuse the votes of those that do not sign them",
            format!(
                "trust: {{keys: \"keys\"}}     in the configuration of those that are open; gestalt trust enrol --local --swarm {} --robots ID keys makes the keys",
                facts.name
            ),
        ),
    }
}

/// Whether all of a sealed swarm go by its newest roster.
fn rosters(facts: &SwarmFacts) -> Option<Finding> {
    let groups = values(facts, |status| status.counters.get("roster_epoch").copied());
    let held = facts.roster.as_ref().map(|roster| roster.epoch);
    let newest = groups.iter().map(|(epoch, _)| *epoch).chain(held).max()?;
    let behind = groups.iter().filter(|(epoch, _)| *epoch < newest).flat_map(|(_, who)| who.iter().cloned());
    let behind: BTreeSet<String> = behind.collect();
    if !behind.is_empty() {
        return Some(Finding::warning(
            "roster",
            format!("an older roster than that of epoch {newest} is gone by at {}", some(&behind)),
            "whoever was enrolled since is refused there, and whoever was expelled is still believed",
            "gestalt trust tell, where the swarm's authority key is",
        ));
    }
    let stale = held.filter(|held| *held < newest)?;
    Some(Finding::warning(
        "roster",
        format!("the roster here is of epoch {stale}, and the swarm goes by that of epoch {newest}"),
        "a robot or a client that goes by it refuses whoever was enrolled since",
        "take the newest roster.json from where the swarm's authority key is",
    ))
}

fn vocabularies(facts: &SwarmFacts) -> Finding {
    let said = |status: &Status| (!status.vocabulary.is_empty()).then(|| status.vocabulary.clone());
    let groups = values(facts, said);
    let word = |labels: &Vec<String>| {
        let more = if labels.len() > 8 { ", …" } else { "" };
        format!(
            "{} gestures ({}{more})",
            labels.len(),
            labels.iter().take(8).map(|label| short(label)).collect::<Vec<_>>().join(", ")
        )
    };
    match groups.as_slice() {
        [] => Finding::fine("vocabulary", "no robot has a classifier yet"),
        [(labels, _)] => Finding::fine("vocabulary", word(labels)),
        _ => Finding::failure(
            "vocabulary",
            format!("robots tell different gestures apart: {}", shown(&groups, word)),
            "votes in another vocabulary, or in another order of its gestures, are not counted",
            format!(
                "model: {{file: \"hands.gestalt\"}}     one and the same file for all robots; those to change: {}",
                others(&groups)
            ),
        ),
    }
}

fn spaces(facts: &SwarmFacts) -> Finding {
    let groups = values(facts, |status| status.learning.as_ref().map(|learning| short(&learning.space)));
    match groups.as_slice() {
        [] => Finding::fine("features", "no robot learns"),
        [(space, _)] => Finding::fine("features", format!("all that learn share the feature space {space}")),
        _ => Finding::failure(
            "features",
            format!("robots learn in different feature spaces: {}", shown(&groups, Clone::clone)),
            "samples of another feature space are refused: such robots do not learn from each other",
            format!(
                "model: {{file: \"hands.gestalt\"}}     one and the same file for all robots that learn; those to change: {}",
                others(&groups)
            ),
        ),
    }
}

/// A value for each parameter in which robots differ.
fn rounds(facts: &SwarmFacts) -> Vec<Finding> {
    // Those that this release knows: others are another release's, or made up.
    let known = rounds_in_words(&MindConfig::default());
    let mut found = Vec::new();
    for key in known.keys().filter(|key| !OWN.contains(&key.as_str())) {
        // As text: numbers have no order of their own.
        let groups = values(facts, |status| Some(short(&status.rounds.get(key)?.to_string())));
        let [(usual, _), _, ..] = groups.as_slice() else { continue };
        found.push(Finding::failure(
            "rounds",
            format!("robots differ in rounds.{key}: {}", shown(&groups, Clone::clone)),
            "robots that decide by different rules refuse each other's decisions, or wait for each other in vain",
            format!("rounds: {{{key}: {usual}}}     in the configuration of {}, and restart", others(&groups)),
        ));
    }
    if found.is_empty() {
        found.push(Finding::fine("rounds", "all decide by the same rules"));
    }
    found
}

/// A quorum that cannot be reached.
fn quorum(facts: &SwarmFacts) -> Option<Finding> {
    let robots = facts.answers().map(|answer| answer.status.robot).collect::<BTreeSet<_>>().len();
    let needed = facts.answers().filter_map(|answer| answer.status.rounds.get("quorum")?.as_u64()).max()?;
    (needed > robots as u64).then(|| {
        Finding::warning(
            "quorum",
            format!("rounds.quorum is {needed}, and {robots} robots answer"),
            "every round ends undecided until more robots are there",
            "start the others; or rounds: {quorum: \"majority\"} at all robots",
        )
    })
}
