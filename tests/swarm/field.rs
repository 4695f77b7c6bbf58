//! A field of robots: one process each, in a network namespace of its own.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_strategies::{MindConfig, Quorum};
use gestalt_tests::{Namespaces, Process, unique};
use serde_json::{Value, json};

const PORT: u16 = 7447;

/// Robots 0, 1, 2 … in the namespaces of the same numbers.
pub struct Field {
    /// The processes. Dropped, and so killed, before their namespaces.
    pub robots: Vec<Process>,
    /// Where they live.
    pub namespaces: Namespaces,
    swarm: String,
    sees: Vec<Sees>,
    quorum: Quorum,
    /// The rounds of robots that learn.
    learns: Option<MindConfig>,
}

/// The class that a robot sees, and how sure of it it is; `None` for one that cannot see.
pub type Sees = Option<(u8, f64)>;

impl Field {
    /// Starts a robot in each of `nodes` namespaces and waits until all know of all. They decide by that
    /// quorum.
    pub fn new(nodes: u32, links: &[(u32, u32)], quorum: Quorum, sees: impl Fn(u32) -> Sees) -> Self {
        Self::start(links, (0..nodes).map(sees).collect(), quorum, None)
    }

    /// The same of robots that learn what they are shown and told, with such rounds.
    pub fn learning(nodes: u32, links: &[(u32, u32)], rounds: &MindConfig) -> Self {
        Self::start(links, vec![Some((0, 1.0)); nodes as usize], rounds.quorum, Some(rounds.clone()))
    }

    fn start(links: &[(u32, u32)], sees: Vec<Sees>, quorum: Quorum, learns: Option<MindConfig>) -> Self {
        let nodes = u32::try_from(sees.len()).expect("a few robots");
        let namespaces = Namespaces::new(nodes, links);
        let mut field = Self { robots: Vec::new(), namespaces, swarm: unique("field"), sees, quorum, learns };
        for node in 0..nodes {
            let robot = field.process(node);
            field.robots.push(robot);
        }
        field.wait_for_all(Duration::from_secs(30));
        field
    }

    fn process(&self, node: u32) -> Process {
        let sees = self.sees[node as usize];
        let orders = json!({
            "id": node,
            "swarm": self.swarm,
            "sees": sees.map(|(class, _)| class),
            "p": sees.map(|(_, p)| p),
            "quorum": self.quorum,
            "rounds": self.learns,
            "learn": self.learns.as_ref().map(|_| json!({"keep": 10, "share": 0.5})),
            "link": {
                "listen": [format!("tcp/0.0.0.0:{PORT}")],
                "insecure": true,
                "connect": self.namespaces.to_dial(node, PORT),
            },
        });
        let binary = Path::new(env!("CARGO_BIN_EXE_test-robot"));
        Process::start(binary, Some(&self.namespaces.name(node)), &orders)
    }

    /// What is in front of all cameras from now on.
    pub fn show(&mut self, class: u32) {
        self.robots.iter_mut().for_each(|robot| robot.order(&format!("shown {class}")));
    }

    /// Waits until every robot knows all others to be alive.
    pub fn wait_for_all(&self, patience: Duration) {
        if let Err(missing) = self.all_known(patience) {
            panic!("{missing}");
        }
    }

    /// The same, or who does not by then.
    pub fn all_known(&self, patience: Duration) -> Result<(), String> {
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
            complete.ok_or_else(|| format!("robot {node} does not know all: {:?}", known()))?;
        }
        Ok(())
    }

    /// The decision of a round that robots hold, as soon as it is over for all of them and all hold the same gesture, or none. It is that
    /// of the first, as the program prints it: a greater one for the same gesture goes its way from neighbour to neighbour.
    pub fn agreed(&self, round: u64, robots: &[usize], patience: Duration) -> Value {
        let deadline = Instant::now() + patience;
        loop {
            let held: Vec<Option<Value>> =
                robots.iter().map(|i| self.robots[*i].decision(round, Duration::ZERO)).collect();
            if let Some(Some(decision)) = held.first()
                && held
                    .iter()
                    .all(|other| other.as_ref().is_some_and(|other| other["class"] == decision["class"]))
            {
                return decision.clone();
            }
            assert!(Instant::now() < deadline, "round {round} of robots {robots:?}: {held:#?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
