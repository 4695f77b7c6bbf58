//! A field of robots: one process each, in a network namespace of its own.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_tests::{Namespaces, Process, unique};
use serde_json::json;

const PORT: u16 = 7447;

/// Robots 0, 1, 2 … in the namespaces of the same numbers.
pub struct Field {
    /// The processes. Dropped, and so killed, before their namespaces.
    pub robots: Vec<Process>,
    /// Where they live.
    pub namespaces: Namespaces,
    swarm: String,
    sees: Vec<Option<u8>>,
    p: f64,
    quorum: u32,
}

impl Field {
    /// Starts a robot in each of `nodes` namespaces and waits until all know of all.
    pub fn new(nodes: u32, links: &[(u32, u32)], sees: impl Fn(u32) -> Option<u8>) -> Self {
        Self::with(nodes, links, sees, 0.9, 1)
    }

    /// The same with robots that see a class with probability `p`, and decide when `quorum` of them have voted.
    pub fn with(
        nodes: u32,
        links: &[(u32, u32)],
        sees: impl Fn(u32) -> Option<u8>,
        p: f64,
        quorum: u32,
    ) -> Self {
        let namespaces = Namespaces::new(nodes, links);
        let sees = (0..nodes).map(sees).collect();
        let mut field = Self { robots: Vec::new(), namespaces, swarm: unique("field"), sees, p, quorum };
        for node in 0..nodes {
            let robot = field.process(node);
            field.robots.push(robot);
        }
        field.wait_for_all(Duration::from_secs(15));
        field
    }

    fn process(&self, node: u32) -> Process {
        let orders = json!({
            "id": node,
            "swarm": self.swarm,
            "sees": self.sees[node as usize],
            "p": self.p,
            "quorum": self.quorum,
            "link": {
                "listen": [format!("tcp/0.0.0.0:{PORT}")],
                "connect": self.namespaces.to_dial(node, PORT),
            },
        });
        let binary = Path::new(env!("CARGO_BIN_EXE_test-robot"));
        Process::start(binary, Some(&self.namespaces.name(node)), &orders)
    }

    /// Waits until every robot knows all others to be alive.
    pub fn wait_for_all(&self, patience: Duration) {
        let others = self.robots.len() - 1;
        let deadline = Instant::now() + patience;
        for (node, robot) in self.robots.iter().enumerate() {
            let left = deadline.saturating_duration_since(Instant::now());
            let complete = robot.wait(left, |told| {
                let alive = told.iter().rev().find(|told| told["event"] == "alive")?;
                let known = alive["robots"].as_array()?.iter().filter(|id| **id != json!(node)).count();
                (known == others).then_some(())
            });
            let known = || robot.told().into_iter().rfind(|told| told["event"] == "alive");
            assert!(complete.is_some(), "robot {node} does not know all: {:?}", known());
        }
    }

    /// What each robot holds as the outcome of a round, as soon as all hold the same, or when the time is up:
    /// `None` for a robot that holds nothing or is still in the midst of it.
    pub fn decisions(&self, round: u64, patience: Duration) -> Vec<Option<Option<u64>>> {
        let deadline = Instant::now() + patience;
        loop {
            let held: Vec<_> = self
                .robots
                .iter()
                .map(|robot| robot.decision(round, Duration::ZERO).map(|(class, _)| class))
                .collect();
            let agreed = held.iter().all(|class| class.is_some() && *class == held[0]);
            if agreed || Instant::now() > deadline {
                return held;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
