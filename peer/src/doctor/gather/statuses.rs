//! Asks the robots of a swarm how they are, at every place where they might be.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_link::{Client, LinkConfig, hear};
use gestalt_protocol::{Camera, RobotId, Status};
use serde_json::json;
use tokio::task::{JoinSet, spawn_blocking};

use super::network::{at_home, endpoints, unreachable};
use super::since_1970;
use crate::config::Config;
use crate::doctor::robot::PortFacts;
use crate::doctor::swarm::{Answer, SwarmFacts};

/// How long a link, an answer, and a call by multicast may take.
const LINK: Duration = Duration::from_secs(2);
const ANSWER: Duration = Duration::from_secs(1);
const CALL: Duration = Duration::from_millis(700);

/// For how long is watched what is refused.
const WATCH: Duration = Duration::from_secs(1);

/// At how many robots that were heard, and are not among those that answer, it is asked again.
const DOORS: usize = 3;

/// What was found at one place.
struct Reply {
    /// The robot that was linked to.
    at: Option<RobotId>,
    answers: Vec<Answer>,
}

/// Where the robot that is described is reached, if it runs on this machine: it answers at its own port. And what it says of its camera.
pub(super) async fn home(config: &Config, ports: &[PortFacts]) -> Option<(String, Option<Camera>)> {
    for port in ports.iter().filter(|port| port.taken.is_some()) {
        let endpoint = at_home(&port.endpoint);
        let Ok(client) = attach(config, std::slice::from_ref(&endpoint)).await else { continue };
        let at = client.attached().await.filter(|at| *at == config.robot.id);
        let statuses =
            if at.is_some() { client.statuses(ANSWER).await.unwrap_or_default() } else { Vec::new() };
        client.close().await;
        if let Some(at) = at {
            let own = statuses.into_iter().find(|status| status.robot == at);
            return Some((endpoint, own.map(|status| status.camera)));
        }
    }
    None
}

/// Asks at all endpoints that are named, at the robot's own, and at robots that are heard by multicast.
pub(super) async fn ask_around(config: &Config, home: Option<String>) -> SwarmFacts {
    let mut facts = SwarmFacts { name: config.swarm.0.clone(), ..SwarmFacts::default() };
    let mut asking = JoinSet::new();
    let mut asked: BTreeSet<String> = endpoints(config, "connect").into_iter().chain(home).collect();
    for endpoint in asked.clone() {
        let config = config.clone();
        asking.spawn(async move {
            let reply = ask(&config, std::slice::from_ref(&endpoint)).await;
            (endpoint, reply)
        });
    }
    // Of a call that cannot be made the multicast check says why.
    let heard = hear(&config.swarm.0, &config.link(), CALL).await.unwrap_or_default();
    while let Some(done) = asking.join_next().await {
        // What panicked is still among those asked.
        let Ok((endpoint, reply)) = done else { continue };
        asked.remove(&endpoint);
        let cause = match reply {
            Ok(reply) if !reply.answers.is_empty() => {
                join(&mut facts.parts, reply.answers);
                continue;
            }
            Ok(Reply { at: Some(robot), .. }) => format!("robot {robot} is there, and does not answer"),
            Ok(Reply { at: None, .. }) => {
                format!("a Zenoh session is there, and no robot of the swarm \"{}\"", config.swarm.0)
            }
            Err(error) => {
                let tried = endpoint.clone();
                spawn_blocking(move || unreachable(&tried)).await.unwrap_or_default().unwrap_or(error)
            }
        };
        facts.unreached.push((endpoint, cause));
    }
    let panicked = "asking there panicked, which is a bug: RUST_BACKTRACE=1 shows where";
    facts.unreached.extend(asked.into_iter().map(|endpoint| (endpoint, panicked.to_owned())));
    facts.unreached.sort();
    (facts.silent, facts.unasked) = ask_heard(config, &heard, &mut facts.parts).await;
    facts
}

/// Asks some of those that were heard and are in no part yet; of those that are in none then, gives who was asked and who was not.
async fn ask_heard(
    config: &Config,
    heard: &BTreeMap<RobotId, Vec<String>>,
    parts: &mut Vec<Vec<Answer>>,
) -> (BTreeSet<RobotId>, BTreeSet<RobotId>) {
    let unknown = |parts: &[Vec<Answer>]| -> BTreeSet<RobotId> {
        let known: BTreeSet<RobotId> = parts.iter().flatten().map(|answer| answer.status.robot).collect();
        heard.keys().filter(|robot| !known.contains(robot)).copied().collect()
    };
    let mut asked = BTreeSet::new();
    for _ in 0..DOORS {
        let Some(robot) = unknown(parts).into_iter().find(|robot| !asked.contains(robot)) else { break };
        asked.insert(robot);
        if let Ok(reply) = ask(config, &heard[&robot]).await
            && reply.answers.iter().any(|answer| answer.status.robot == robot)
        {
            join(parts, reply.answers);
        }
    }
    unknown(parts).into_iter().partition(|robot| asked.contains(robot))
}

/// Asks all robots twice through the one at an endpoint.
async fn ask(config: &Config, endpoints: &[String]) -> Result<Reply, String> {
    let client = attach(config, endpoints).await?;
    let asked = async {
        let before = client.statuses(ANSWER).await?;
        tokio::time::sleep(WATCH).await;
        let from = since_1970();
        let after = client.statuses(ANSWER).await?;
        Ok(compare(before, after, (from, since_1970())))
    };
    let answers = asked.await.map_err(|error: gestalt_link::LinkError| error.to_string());
    let at = client.attached().await;
    client.close().await;
    Ok(Reply { at, answers: answers? })
}

async fn attach(config: &Config, endpoints: &[String]) -> Result<Client, String> {
    let mut zenoh = config.zenoh.clone();
    for robots_own in ["listen", "mode", "scouting"] {
        zenoh.remove(robots_own);
    }
    let patience = u64::try_from(LINK.as_millis()).unwrap_or(u64::MAX);
    zenoh.insert("connect".to_owned(), json!({"endpoints": endpoints, "timeout_ms": patience}));
    config.trust.client_swarm(Some(&config.swarm.0)).map_err(|error| error.to_string())?;
    // What else is wrong with its keys is found where they are looked at.
    let credentials = config.trust.credentials(config.robot.id).ok().flatten();
    let link = LinkConfig { zenoh, credentials, ..LinkConfig::default() };
    let opened = tokio::time::timeout(LINK + ANSWER, Client::open(&config.swarm.0, &link)).await;
    opened
        .map_err(|_| "it does not answer as a Zenoh session does".to_owned())?
        .map_err(|error| error.to_string())
}

/// What each robot said last, and by how much its counters have grown.
fn compare(before: Vec<Status>, after: Vec<Status>, asked: (Duration, Duration)) -> Vec<Answer> {
    let grown = |status: &Status| {
        let earlier = before
            .iter()
            .find(|it| it.robot == status.robot && it.session == status.session && it.boot == status.boot);
        let Some(earlier) = earlier else { return BTreeMap::new() };
        let by = |(name, count): (&String, &u64)| {
            let grown = count.saturating_sub(earlier.counters.get(name).copied().unwrap_or_default());
            (grown > 0).then(|| (name.clone(), grown))
        };
        status.counters.iter().filter_map(by).collect()
    };
    after.into_iter().map(|status| Answer { grown: grown(&status), asked, status }).collect()
}

/// Adds what was heard at one place: to the part that has some of it, which may join two, or as a part of its own.
fn join(parts: &mut Vec<Vec<Answer>>, answers: Vec<Answer>) {
    let name = |answer: &Answer| (answer.status.robot, answer.status.session.clone(), answer.status.boot);
    let mut joined = answers;
    let heard: BTreeSet<_> = joined.iter().map(name).collect();
    let mut apart = Vec::new();
    for part in parts.drain(..) {
        if part.iter().any(|answer| heard.contains(&name(answer))) {
            let known: BTreeSet<_> = joined.iter().map(name).collect();
            joined.extend(part.into_iter().filter(|answer| !known.contains(&name(answer))));
        } else {
            apart.push(part);
        }
    }
    *parts = apart;
    if !joined.is_empty() {
        parts.push(joined);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(id: u32, session: &str) -> Answer {
        let status = Status { session: session.to_owned(), ..Status::new(RobotId(id), String::new(), 1) };
        Answer { status, asked: Default::default(), grown: BTreeMap::new() }
    }

    fn shape(parts: &[Vec<Answer>]) -> Vec<BTreeSet<(u32, String)>> {
        let mut shape: Vec<BTreeSet<_>> = parts
            .iter()
            .map(|part| part.iter().map(|it| (it.status.robot.0, it.status.session.clone())).collect())
            .collect();
        shape.sort();
        shape
    }

    #[test]
    fn whatever_order_places_are_asked_in_the_parts_are_the_same() {
        let heard = [
            vec![said(1, "a"), said(2, "b")],
            vec![said(2, "b"), said(3, "c")],
            vec![said(4, "d")],
            vec![said(4, "e")],
        ];
        let mut seen = BTreeSet::new();
        for order in [[0, 1, 2, 3], [3, 1, 2, 0], [2, 0, 3, 1]] {
            let mut parts = Vec::new();
            for place in order {
                join(&mut parts, heard[place].clone());
            }
            seen.insert(shape(&parts));
        }
        assert_eq!(seen.len(), 1);
        // Two robots of one id that do not hear each other are two parts.
        assert_eq!(seen.first().unwrap().iter().map(BTreeSet::len).collect::<Vec<_>>(), [3, 1, 1]);
    }

    #[test]
    fn only_what_has_grown_in_the_same_life_has_grown() {
        let status = |boot, refused| Status {
            counters: BTreeMap::from([("refused_x".to_owned(), refused), ("same".to_owned(), 1)]),
            ..Status::new(RobotId(1), String::new(), boot)
        };
        let grown = |before, after| compare(vec![before], vec![after], Default::default())[0].grown.clone();
        assert_eq!(grown(status(1, 2), status(1, 7)), BTreeMap::from([("refused_x".to_owned(), 5)]));
        assert!(grown(status(1, 2), status(2, 7)).is_empty());
    }
}
