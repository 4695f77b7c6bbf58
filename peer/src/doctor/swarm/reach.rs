//! Whether the robots of a swarm hear each other.

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::RobotId;

use super::{Answer, NOBODY_ANSWERS, SwarmFacts, robots, short};
use crate::doctor::Finding;

pub(super) fn findings(facts: &SwarmFacts) -> Vec<Finding> {
    let mut found: Vec<Finding> = facts.unreached.iter().map(endpoint).collect();
    found.push(swarm(facts));
    found.extend(mute(facts));
    found.extend(parts(facts));
    found.extend(twins(facts));
    found.extend(missing(facts));
    found
}

fn endpoint((endpoint, cause): &(String, String)) -> Finding {
    Finding::failure(
        "endpoint",
        format!("{endpoint}: {cause}"),
        "a robot that connects there is not linked to the swarm by it",
        "start the robot there, with -l and this address; see that no firewall is between: nc -vz ADDRESS PORT",
    )
}

fn swarm(facts: &SwarmFacts) -> Finding {
    let ids: BTreeSet<RobotId> = facts.answers().map(|answer| answer.status.robot).collect();
    let name = &facts.name;
    if ids.is_empty() {
        return Finding::warning(
            "swarm",
            format!("no robot of the swarm \"{name}\" answers"),
            "nothing can be said of the swarm",
            NOBODY_ANSWERS,
        );
    }
    Finding::fine(
        "swarm",
        format!("\"{name}\": {} answer{}", robots(&ids), if ids.len() == 1 { "s" } else { "" }),
    )
}

/// Robots that others take for alive, and that do not answer.
fn mute(facts: &SwarmFacts) -> Option<Finding> {
    let there: BTreeSet<RobotId> = facts.answers().map(|answer| answer.status.robot).collect();
    let alive = facts.answers().flat_map(|answer| answer.status.alive.iter().copied());
    let mute: BTreeSet<RobotId> = alive.filter(|robot| !there.contains(robot)).collect();
    (!mute.is_empty()).then(|| {
        Finding::warning(
            "mute",
            format!(
                "{} {} as alive, and no answer comes",
                robots(&mute),
                if mute.len() == 1 { "counts" } else { "count" }
            ),
            "rounds wait for them; what they say and decide is not known here",
            "look at them: gestalt watch --robots; restart what hangs",
        )
    })
}

/// Who answers, and who is heard by whom.
fn parts(facts: &SwarmFacts) -> Vec<Finding> {
    const WHY: &str = "each part decides for itself, and what is taught to one is not known to the other";
    const FIX: &str = "link them: -e tcp/ADDRESS:PORT of a robot of the other part, on one robot; see that no firewall is between; in a sealed swarm see that all go by its newest roster (gestalt trust tell)";
    let mut found = Vec::new();
    let mut parts: Vec<BTreeSet<RobotId>> =
        facts.parts.iter().filter(|part| !part.is_empty()).map(|part| ids(part)).collect();
    parts.sort_by_key(|part| (std::cmp::Reverse(part.len()), part.first().copied()));
    if parts.len() > 1 {
        let shown: Vec<String> = parts.iter().map(robots).collect();
        found.push(Finding::failure(
            "parts",
            format!("they do not hear each other: {}", shown.join(" | ")),
            WHY,
            FIX,
        ));
    }
    for part in &facts.parts {
        let all = ids(part);
        // By those whom a robot does not hear: a cut leaves many who miss the same.
        let mut deaf: BTreeMap<BTreeSet<RobotId>, BTreeSet<RobotId>> = BTreeMap::new();
        for answer in part {
            let alive: BTreeSet<RobotId> = answer.status.alive.iter().copied().collect();
            let missed: BTreeSet<RobotId> = all.difference(&alive).copied().collect();
            if !missed.is_empty() {
                deaf.entry(missed).or_default().insert(answer.status.robot);
            }
        }
        found.extend(deaf.iter().map(|(missed, who)| {
            let does = if who.len() == 1 { "does" } else { "do" };
            Finding::failure("parts", format!("{} {does} not hear {}", robots(who), robots(missed)), WHY, FIX)
        }));
    }
    if !facts.silent.is_empty() {
        found.push(Finding::failure(
            "parts",
            format!("{} can be heard by multicast, and the others do not reach", robots(&facts.silent)),
            WHY,
            "let them connect to each other: open the TCP ports that they listen on, or -l tls/0.0.0.0:7447 and open that one; an open robot (without trust.keys) is reached from its own computer alone",
        ));
    }
    if !facts.unasked.is_empty() {
        found.push(Finding::warning(
            "parts",
            format!(
                "{} can be heard by multicast, are in no part that answered, and were not asked",
                robots(&facts.unasked)
            ),
            WHY,
            "gestalt doctor -e ENDPOINT     with where one of them listens",
        ));
    }
    if found.is_empty() && facts.answers().count() > 1 {
        found.push(Finding::fine("parts", "all hear each other"));
    }
    found
}

fn ids(part: &[Answer]) -> BTreeSet<RobotId> {
    part.iter().map(|answer| answer.status.robot).collect()
}

/// Two robots of one id.
fn twins(facts: &SwarmFacts) -> Vec<Finding> {
    const WHY: &str = "the votes of both count as those of one, and replace each other";
    let mut sessions: BTreeMap<RobotId, BTreeSet<(&str, u32, &str)>> = BTreeMap::new();
    let mut counted = BTreeSet::new();
    for Answer { status, .. } in facts.answers() {
        // One of an older release does not say its session; its start tells it as well, or nearly.
        let told = if status.session.is_empty() { (status.name.as_str(), status.boot) } else { ("", 0) };
        sessions.entry(status.robot).or_default().insert((&status.session, told.1, told.0));
        if status.counters.get("twin").is_some_and(|count| *count > 0) {
            counted.insert(status.robot);
        }
    }
    let mut found: Vec<Finding> = sessions
        .iter()
        .filter(|(_, sessions)| sessions.len() > 1)
        .map(|(id, sessions)| {
            let names: BTreeSet<&str> = facts.answers().filter(|it| it.status.robot == *id).map(|it| it.status.name.as_str()).collect();
            let names: Vec<String> = names.iter().map(|name| format!("\"{}\"", short(name))).take(4).collect();
            Finding::failure(
                "twin",
                format!("{} robots have the id {id}: {}", sessions.len(), names.join(", ")),
                WHY,
                "robot: {id: N}     with a number of its own in the configuration of one of them (or --id N), and restart it",
            )
        })
        .collect();
    counted.retain(|id| sessions.get(id).is_some_and(|sessions| sessions.len() == 1));
    if !counted.is_empty() {
        found.push(Finding::warning(
            "twin",
            format!("{} met another robot of the same id since the start", robots(&counted)),
            WHY,
            "if it may come back, give it an id of its own: --id N; the count begins anew with a restart",
        ));
    }
    if let Some(mine) = &facts.mine
        && !facts.running
        && sessions.contains_key(&mine.robot)
    {
        found.push(Finding::warning(
            "twin",
            format!("robot {} answers in the swarm already", mine.robot),
            "if it is not the one that this configuration is of, there would be two robots of one id",
            "robot: {id: N}     with a number that nobody has (or --id N)",
        ));
    }
    found
}

/// Members of a sealed swarm that do not answer.
fn missing(facts: &SwarmFacts) -> Option<Finding> {
    let there: BTreeSet<RobotId> = facts.answers().map(|answer| answer.status.robot).collect();
    let missing: BTreeSet<RobotId> = facts.roster.as_ref()?.robots.difference(&there).copied().collect();
    (!missing.is_empty() && !there.is_empty()).then(|| {
        Finding::warning(
            "members",
            format!("on the roster, and not there: {}", robots(&missing)),
            "they do not vote; with quorum \"majority\" those that are there decide",
            "start them; or take them off the roster, if they are gone for good",
        )
    })
}
