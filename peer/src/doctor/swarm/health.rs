//! How the robots of a swarm are: cameras, memories, clocks, and what they refuse.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{CameraState, RobotId};
use humantime_serde::re::humantime::format_duration;

use super::{Answer, SwarmFacts, robots, short};
use crate::doctor::Finding;

/// How far clocks may be apart: robots take words that bear no time for the same word within so long.
pub(super) const CLOCKS: Duration = Duration::from_secs(2);

/// How many causes of refusals are named.
const CAUSES: usize = 12;

pub(super) fn findings(facts: &SwarmFacts) -> Vec<Finding> {
    let mut found = cameras(facts);
    found.extend(memories(facts));
    found.extend(clocks(facts));
    found.extend(liars(facts));
    found.extend(refusals(facts));
    found
}

fn cameras(facts: &SwarmFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut seeing = BTreeSet::new();
    for Answer { status, .. } in facts.answers() {
        let camera = &status.camera;
        let how = match camera.state {
            CameraState::Frozen => "is frozen",
            CameraState::Failing => "fails",
            CameraState::Ended => "has come to its end",
            CameraState::None | CameraState::Opening => continue,
            CameraState::Live => {
                seeing.insert(status.robot);
                continue;
            }
        };
        let fix = match camera.state {
            CameraState::Ended => "loop: true     in camera.source, to begin again at the end".to_owned(),
            _ => format!("see to its cable and light; on robot {}: gestalt doctor CONFIG", status.robot),
        };
        found.push(Finding::failure(
            "cameras",
            format!(
                "the camera of robot {} ({}) {how}: {}",
                status.robot,
                short(&camera.source),
                short(&camera.trouble)
            ),
            "the robot gives no evidence",
            fix,
        ));
    }
    if found.is_empty() && !seeing.is_empty() {
        found.push(Finding::fine(
            "cameras",
            format!("{} deliver{}", robots(&seeing), if seeing.len() == 1 { "s" } else { "" }),
        ));
    }
    found
}

fn memories(facts: &SwarmFacts) -> Vec<Finding> {
    let failing = facts.answers().filter_map(|Answer { status, .. }| {
        let said = status.learning.as_ref()?.memory.strip_prefix("failing: ")?;
        Some(Finding::failure(
            "memories",
            format!("robot {}: {}", status.robot, short(said)),
            "what it learns is lost when it stops; until then it answers no instructor and shares nothing",
            format!("on robot {}: gestalt doctor CONFIG", status.robot),
        ))
    });
    failing.collect()
}

fn clocks(facts: &SwarmFacts) -> Option<Finding> {
    // How far each clock is ahead of that of who asked, in milliseconds, and how well that is known.
    let ahead = |answer: &Answer| {
        let (from, to) = (answer.asked.0.as_millis() as f64, answer.asked.1.as_millis() as f64);
        let clock = answer.status.clock_ms? as f64;
        Some((clock - (from + to) / 2.0, (to - from).max(0.0) / 2.0, answer.status.robot))
    };
    let mut known: Vec<(f64, f64, RobotId)> = facts.answers().filter_map(ahead).collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (known.first()?, known.last()?);
    let apart = last.0 - first.0;
    if apart <= CLOCKS.as_millis() as f64 + first.1 + last.1 {
        return (known.len() > 1)
            .then(|| Finding::fine("clocks", format!("within {} s of each other", CLOCKS.as_secs())));
    }
    let middle = known[known.len() / 2].0;
    let off = if middle - first.0 > last.0 - middle { first.2 } else { last.2 };
    Some(Finding::failure(
        "clocks",
        format!(
            "the clocks of robots {} and {} are {} apart",
            first.2,
            last.2,
            format_duration(Duration::from_secs((apart / 1000.0) as u64))
        ),
        "a word of an instructor that bears no time is taken for two, and what goes by the clock goes apart",
        format!("sudo timedatectl set-ntp true     on robot {off}, and on the others"),
    ))
}

/// Members that are proven to have lied.
fn liars(facts: &SwarmFacts) -> Vec<Finding> {
    let convicted: BTreeSet<&str> = facts
        .answers()
        .flat_map(|answer| answer.status.counters.iter())
        .filter(|(_, count)| **count > 0)
        .filter_map(|(name, _)| name.strip_prefix("convicted_"))
        .collect();
    convicted
        .into_iter()
        .map(|robot| {
            Finding::failure(
                "liar",
                format!("robot {robot} is proven to have lied"),
                "it said two things under one stamp, or gave a decision that does not follow from its votes; nothing of it counts any more",
                format!("gestalt trust rekey {robot} keys -e ENDPOINT     where authority.key is; then start robot {robot} again"),
            )
        })
        .collect()
}

/// What is being refused now, by cause.
fn refusals(facts: &SwarmFacts) -> Vec<Finding> {
    let mut causes: BTreeMap<&str, (u64, BTreeSet<RobotId>)> = BTreeMap::new();
    for Answer { status, grown, .. } in facts.answers() {
        for (name, count) in grown.iter().filter(|(name, _)| name.starts_with("refused_")) {
            let cause = causes.entry(name).or_default();
            cause.0 = cause.0.saturating_add(*count);
            cause.1.insert(status.robot);
        }
    }
    let more = causes.len().saturating_sub(CAUSES);
    let mut found: Vec<Finding> = causes
        .into_iter()
        .take(CAUSES)
        .map(|(name, (count, who))| {
            let (why, fix) = meaning(name);
            Finding::warning(
                "refusals",
                format!("{name}: {} refused {count} within the last second", robots(&who)),
                why,
                fix,
            )
        })
        .collect();
    if more > 0 {
        found.push(Finding::warning(
            "refusals",
            format!("{more} more causes"),
            "much is refused",
            "gestalt watch --status --json",
        ));
    }
    found
}

/// What a refusal means, and what to do about it.
fn meaning(counter: &str) -> (&'static str, &'static str) {
    const SAME_MODEL: &str = "model: {file: \"hands.gestalt\"}     one and the same file for all robots";
    const WHO: &str = "gestalt watch --status     shows the latest errors of each robot, with the keys; SECURITY.md says what is withstood";
    let has = |words: &[&str]| words.iter().any(|word| counter.contains(word));
    match counter {
        _ if has(&["_version"]) => (
            "another release speaks to this swarm",
            "install one release on all robots; gestalt --version says which one it is",
        ),
        _ if has(&["_stranger", "_unsigned"]) => (
            "somebody who is no member speaks to it",
            "if it is one of yours, enrol it: gestalt trust enrol --local --robots ID keys",
        ),
        _ if has(&["_forged", "_malformed", "_impossible", "_unfounded"]) => {
            ("somebody says what no robot would say", WHO)
        }
        "refused_word_repeated" => (
            "somebody says an instructor's old words again; or that key was last used by a clock that is ahead of its clock of today, and its words are \
             not heeded until that has caught up",
            "let the client write to the folder of its key, where it counts its words (client-NAME.words); or give it a new key: gestalt trust expel \
             NAME, then enrol --client NAME",
        ),
        _ if has(&["_too_often", "_too_fast", "_too_soon"]) => {
            ("somebody says too much; what is beyond the bound is not looked into", WHO)
        }
        _ if has(&["_frame_full"]) => (
            "more cameras come at once than the centre has waiting",
            "nothing, if they are served in the end (robots_served): they are let in one after the other",
        ),
        _ if has(&["_full"]) => (
            "more arrives than the robot takes in",
            "fewer links at each robot: links: {max_links: 3}; or a faster processor",
        ),
        _ if has(&["_twin", "_duplicate_id"]) => (
            "two robots have one id",
            "robot: {id: N}     with a number of its own in the configuration of one",
        ),
        _ if has(&["_other_vocabulary", "_unknown_class"]) => {
            ("votes or samples in another vocabulary come in", SAME_MODEL)
        }
        _ if has(&["_other_space"]) => ("samples of another feature space come in", SAME_MODEL),
        _ => ("what is refused does not count; it stays rare in a swarm in good order", WHO),
    }
}
