//! What an emulated swarm saw and what it decided, for minds in Python to see and to decide as well.

use std::sync::{Arc, Mutex};

use gestalt_lab::emulation::{Emulation, Observer, Scenario, StatisticalObserver, Trace, View};
use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Observation, Vocabulary};
use serde_json::{Value, json};

/// Robots whose mistakes last, and are much alike: what they decide is not always what is shown. A third of all messages is lost.
const SCENARIO: &str = r#"{
    robots: [{ name: "robot", count: 20, view: { fps: 5, signal: 1.2, persistence: 0.8, likeness: 0.7 } }],
    topology: "full", link: { latency: "5ms", jitter: "10ms", loss: 0.3 },
    classes: 6, rounds: 8,
}"#;

/// What each robot saw of each showing, as probabilities.
type Seen = Arc<Mutex<Vec<Vec<Vec<f64>>>>>;

/// Eyes that write down what they see.
struct Noted {
    eyes: StatisticalObserver,
    seen: Seen,
}

impl Observer for Noted {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        self.eyes.classifier()
    }

    fn period(&self) -> f64 {
        self.eyes.period()
    }

    fn share(&mut self, alike: u64) {
        self.eyes.share(alike);
    }

    fn show(&mut self, shown: ClassId, rng: &mut dyn rand::Rng) {
        self.seen.lock().expect("nobody panics").push(Vec::new());
        self.eyes.show(shown, rng);
    }

    fn frame(&mut self, rng: &mut dyn rand::Rng) -> Option<Observation> {
        let observation = self.eyes.frame(rng)?;
        let classifier = self.eyes.classifier().expect("they see");
        let probabilities = classifier.probabilities(&observation.features).expect("scores of all classes");
        self.seen.lock().expect("nobody panics").last_mut().expect("something is shown").push(probabilities);
        Some(observation)
    }
}

/// Two runs that differ in their seed alone.
pub fn swarms() -> Vec<Value> {
    [1, 2].map(swarm).to_vec()
}

fn swarm(seed: u64) -> Value {
    let scenario: Scenario = json5::from_str(SCENARIO).expect("a scenario");
    let robots = scenario.swarm_size();
    let labels: Vec<String> = (0..scenario.classes).map(|class| format!("gesture {class}")).collect();
    let vocabulary = Vocabulary::new(labels.clone()).expect("different labels");
    let view: View = scenario.robots[0].view.expect("robots that see");
    let seen: Vec<Seen> = (0..robots).map(|_| Seen::default()).collect();
    let eyes = |seen: &Seen| -> Box<dyn Observer> {
        Box::new(Noted { eyes: StatisticalObserver::new(view, vocabulary.clone()), seen: seen.clone() })
    };
    let mut trace = Vec::new();
    let observers = seen.iter().map(eyes).collect();
    let emulation = Emulation::new(&scenario, seed, observers, None, Trace::to(&mut trace)).expect("a run");
    emulation.finish().1.expect("a vector takes all");
    let mut showings: Vec<Value> = Vec::new();
    for line in trace.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
        let line: Value = serde_json::from_slice(line).expect("JSON Lines");
        match (line["what"].as_str(), showings.last_mut()) {
            (Some("shown"), _) => {
                let n = showings.len();
                let looks: Vec<Vec<Vec<f64>>> =
                    seen.iter().map(|seen| seen.lock().expect("nobody panics")[n].clone()).collect();
                showings.push(json!({
                    "shown": line["class"], "opener": line["opener"], "looks": looks, "held": vec![Value::Null; robots],
                }));
            }
            (Some("hold"), Some(showing)) => {
                let robot = line["robot"].as_u64().expect("a number") as usize;
                showing["held"][robot - 1] = line["decision"]["class"].clone();
            }
            _ => {}
        }
    }
    assert_eq!(showings.len(), scenario.rounds as usize, "a line for each");
    json!({"seed": seed, "labels": labels, "period": 1.0 / view.fps, "showings": showings})
}
