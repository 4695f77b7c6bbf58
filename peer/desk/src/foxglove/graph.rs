//! Who is linked to whom, as Foxglove's connection graph, and what is wrong.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::Message;
use gestalt_protocol::{Keys, RobotId, Topic};
use serde_json::{Value, json};
use tokio::sync::watch;

use super::wire::{Level, remove_status, status, text};
use crate::follow::Show;
use crate::view::{SwarmView, View};

/// What stands for this program in the graph.
const WATCH: &str = "watch";

/// Topics and services by name, and who has to do with each.
type Names = BTreeMap<String, BTreeSet<String>>;

/// The robots of a swarm and their links. A link is a robot's votes, which its neighbours hear: `robot/1` publishes them, and
/// `robot/2` subscribes to them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Graph {
    published: Names,
    subscribed: Names,
    services: Names,
}

/// What is wrong, by what it is wrong with.
pub(super) type Problems = BTreeMap<String, String>;

/// All that is shown of a swarm's state. The newest is the only one that counts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Picture {
    pub graph: Graph,
    pub problems: Problems,
}

/// Where the newest picture is.
#[derive(Debug)]
pub(super) struct Easel {
    keys: Keys,
    service: String,
    pictures: watch::Sender<Arc<Picture>>,
}

impl Easel {
    /// Of that swarm, which is taught by that service.
    pub fn new(keys: Keys, service: String) -> Self {
        Self { keys, service, pictures: watch::Sender::default() }
    }

    pub fn pictures(&self) -> watch::Receiver<Arc<Picture>> {
        self.pictures.subscribe()
    }
}

impl Show for Easel {
    fn show(&self, view: &View, now: Duration) {
        let swarm = view.swarm(now);
        let graph = Graph::of(&self.keys, &self.service, &swarm);
        let picture = Picture { graph, problems: problems(&swarm) };
        self.pictures.send_if_modified(|shown| {
            let is_new = **shown != picture;
            if is_new {
                *shown = Arc::new(picture);
            }
            is_new
        });
    }

    fn beat(&self, _: Duration) {}
}

impl Graph {
    fn of(keys: &Keys, service: &str, swarm: &SwarmView) -> Self {
        let topic = |topic: &Topic| format!("/{}", keys.key(topic));
        let name = |robot: RobotId| format!("robot/{robot}");
        let mut graph = Self::default();
        let all: BTreeSet<RobotId> = swarm.robots.iter().map(|robot| robot.id).collect();
        let decision = topic(&Topic::Decision);
        graph.published.insert(decision.clone(), all.iter().copied().map(name).collect());
        graph.subscribed.insert(decision, [WATCH.to_owned()].into());
        graph.services.insert(service.to_owned(), [WATCH.to_owned()].into());
        for robot in &swarm.robots {
            let votes = topic(&Topic::Vote(robot.id));
            graph.published.insert(votes.clone(), [name(robot.id)].into());
            graph.subscribed.entry(votes).or_default();
            // Either end of a link may be the first to say so.
            for other in robot.links.iter().filter(|other| **other != robot.id && all.contains(other)) {
                for (from, to) in [(robot.id, *other), (*other, robot.id)] {
                    graph.subscribed.entry(topic(&Topic::Vote(from))).or_default().insert(name(to));
                }
            }
        }
        graph
    }

    /// What has changed since `before`; `None` when nothing has.
    pub fn since(&self, before: &Self) -> Option<Message> {
        if self == before {
            return None;
        }
        let is_there =
            |topic: &&String| self.published.contains_key(*topic) || self.subscribed.contains_key(*topic);
        let topics: BTreeSet<&String> = before.published.keys().chain(before.subscribed.keys()).collect();
        let removed: Vec<_> = topics.into_iter().filter(|topic| !is_there(topic)).collect();
        let services = before.services.keys();
        let removed_services: Vec<_> = services.filter(|name| !self.services.contains_key(*name)).collect();
        Some(text(&json!({
            "op": "connectionGraphUpdate",
            "publishedTopics": changed(&self.published, &before.published, "publisherIds"),
            "subscribedTopics": changed(&self.subscribed, &before.subscribed, "subscriberIds"),
            "advertisedServices": changed(&self.services, &before.services, "providerIds"),
            "removedTopics": removed,
            "removedServices": removed_services,
        })))
    }

    /// The whole graph, as an update of none.
    pub fn whole(&self) -> Message {
        self.since(&Self::default()).unwrap_or_else(|| {
            text(&json!({
                "op": "connectionGraphUpdate", "publishedTopics": [], "subscribedTopics": [],
                "advertisedServices": [], "removedTopics": [], "removedServices": [],
            }))
        })
    }
}

fn changed(now: &Names, before: &Names, ids: &str) -> Vec<Value> {
    let new = now.iter().filter(|(name, who)| before.get(*name) != Some(*who));
    new.map(|(name, who)| json!({"name": name, ids: who})).collect()
}

fn problems(swarm: &SwarmView) -> Problems {
    let of_robots = swarm.robots.iter().filter_map(|robot| {
        let error = robot.errors.last()?;
        Some((format!("robot/{}", robot.id), format!("robot {}: {}", robot.id, error.what)))
    });
    let of_all = swarm.trouble.clone().map(|trouble| ("swarm".to_owned(), trouble));
    of_robots.chain(of_all).collect()
}

/// What a client is to be told that was told of `before`.
pub(super) fn news(now: &Problems, before: &Problems) -> Vec<Message> {
    let new = now.iter().filter(|(id, words)| before.get(*id) != Some(*words));
    let mut messages: Vec<_> = new.map(|(id, words)| status(Level::Error, words, Some(id))).collect();
    let gone: Vec<_> = before.keys().filter(|id| !now.contains_key(*id)).collect();
    if !gone.is_empty() {
        messages.push(remove_status(&gone));
    }
    messages
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Reported, Status};

    use super::*;
    use crate::view::Input;

    fn json(message: Message) -> Value {
        serde_json::from_str(&message.into_text().unwrap()).unwrap()
    }

    fn seen(view: &mut View, id: u32, links: &[u32]) {
        let mut status = Status::new(RobotId(id), String::new(), 1);
        status.neighbours = links.iter().copied().map(RobotId).collect();
        status.errors = vec![Reported { at_ms: 1, what: "no camera: plug one in".to_owned() }];
        view.hear(Duration::ZERO, Input::Came(RobotId(id)));
        view.hear(Duration::ZERO, Input::Status(Box::new(status)));
    }

    #[test]
    fn a_graph_has_the_links_and_tells_what_has_changed() {
        let easel = Easel::new(Keys::new("s").unwrap(), "/gestalt/s/say".to_owned());
        let mut view = View::default();
        seen(&mut view, 1, &[2, 99]);
        seen(&mut view, 2, &[]);
        easel.show(&view, Duration::ZERO);
        let first = easel.pictures().borrow().clone();
        let whole = json(first.graph.whole());
        let votes = |id: u32, who: Value| json!({"name": format!("/gestalt/s/robot/{id}/vote"), "subscriberIds": who});
        let links = whole["subscribedTopics"].as_array().unwrap();
        assert!(links.contains(&votes(1, json!(["robot/2"]))), "{whole:#}");
        assert!(links.contains(&votes(2, json!(["robot/1"]))), "{whole:#}");
        let decision = json!({"name": "/gestalt/s/decision", "publisherIds": ["robot/1", "robot/2"]});
        assert!(whole["publishedTopics"].as_array().unwrap().contains(&decision), "{whole:#}");
        view.hear(Duration::ZERO, Input::Left(RobotId(2)));
        easel.show(&view, Duration::ZERO);
        let second = easel.pictures().borrow().clone();
        let update = json(second.graph.since(&first.graph).unwrap());
        assert_eq!(update["removedTopics"], json!(["/gestalt/s/robot/2/vote"]));
        assert_eq!(update["subscribedTopics"], json!([votes(1, json!([]))]));
        assert_eq!(update["advertisedServices"], json!([]));
        assert!(second.graph.since(&second.graph).is_none());
        // What was wrong with who left is wrong no more.
        let told: Vec<Value> = news(&second.problems, &first.problems).into_iter().map(json).collect();
        assert_eq!(told, [json!({"op": "removeStatus", "statusIds": ["robot/2"]})]);
        let told: Vec<Value> = news(&first.problems, &Problems::new()).into_iter().map(json).collect();
        let words = "robot 1: no camera: plug one in";
        assert_eq!(told[0], json!({"op": "status", "level": 2, "message": words, "id": "robot/1"}));
    }
}
