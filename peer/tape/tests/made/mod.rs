//! What a swarm says, for recordings: rounds of real robots, and one of every kind of message.
#![allow(dead_code)]

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, Ask, ClassId, Decision, Envelope, FeatureSpaceId, FrameHeader, FusionRule, Gesture,
    Heeded, ImageEncoding, Instruction, Keys, LearningStatus, Message, Motion, Opinion, Outcome, Question,
    Reported, RobotId, RoundId, SampleId, Samples, SharedSample, Signature, Stamp, Status, Topic, Vector,
};
use gestalt_rounds::{
    Classify, ClassifyError, Input, Life, Observation, Output, Rounds, RoundsConfig, Vocabulary,
};
use gestalt_tape::Passing;

pub const SECOND: u64 = 1_000_000_000;

/// When everything here begins: some day in 2026.
pub const BEGIN: u64 = 1_790_000_000 * SECOND;

pub fn keys() -> Keys {
    Keys::new("demo").unwrap()
}

pub fn said(topic: Topic, payload: Vec<u8>, at: u64) -> Passing {
    Passing { topic, payload, attachment: None, at, published: None }
}

pub fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).unwrap()
}

/// Takes the features for the probabilities; one more of them is for what it was never taught.
#[derive(Debug)]
struct Verbatim(Vocabulary);

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(features.iter().take(self.0.classes()).map(|p| f64::from(*p)).collect())
    }

    fn unknown(&self, features: &[f32]) -> Option<f64> {
        features.get(self.0.classes()).map(|p| f64::from(*p))
    }
}

/// A robot: the gestures that it knows, and what it sees; nothing where it is blind.
#[derive(Clone, Debug)]
pub struct Seer {
    pub knows: Vocabulary,
    pub sees: Option<Vec<f32>>,
}

/// A gesture that ada named.
pub fn named(label: &str) -> ClassId {
    ClassId::named(&"ada".parse().unwrap(), label)
}

/// The list, and these that ada named.
pub fn knowing(labels: &[&str]) -> Vocabulary {
    let mut knows = vocabulary();
    assert!(labels.iter().all(|label| knows.meet(named(label))));
    knows
}

pub fn vocabulary() -> Vocabulary {
    Vocabulary::new(["fist", "one", "palm"]).unwrap()
}

/// What robots that see this say to each other until one of them announces a decision, and for how long: every message as it passes.
/// Robots are numbered from 1; one that sees nothing is blind.
pub fn round(config: &RoundsConfig, sees: &[Option<[f32; 3]>], at: u64) -> Vec<Passing> {
    let robot = |sees: &Option<[f32; 3]>| Seer { knows: vocabulary(), sees: sees.map(Vec::from) };
    round_of(config, &sees.iter().map(robot).collect::<Vec<_>>(), at)
}

/// The same of robots that may know other gestures.
pub fn round_of(config: &RoundsConfig, robots: &[Seer], at: u64) -> Vec<Passing> {
    let all: std::collections::BTreeSet<RobotId> = (1..).map(RobotId).take(robots.len()).collect();
    let mut swarm: Vec<Rounds> = all
        .iter()
        .map(|robot| Rounds::new(*robot, Life { boot: 1, nonce: at as u32 }, config.clone()).unwrap())
        .collect();
    let mut due: Vec<(usize, Input)> = Vec::new();
    for (k, robot) in robots.iter().enumerate() {
        due.push((k, Input::Learned(Arc::new(Verbatim(robot.knows.clone())))));
        due.push((k, Input::Alive(Arc::new(all.clone()))));
        due.push((k, Input::Blind(robot.sees.is_none())));
    }
    let mut passed = Vec::new();
    due.push((0, Input::Open));
    for ms in 1..20_000 {
        if ms == 50 {
            let seeing = robots.iter().enumerate();
            for (k, features) in seeing.filter_map(|(k, robot)| Some((k, robot.sees.clone()?))) {
                let observation = Observation { features, quality: 1.0 };
                due.push((k, Input::Observed(observation)));
            }
        }
        let ticks = (0..robots.len()).map(|k| (k, Input::Tick));
        for (k, input) in std::mem::take(&mut due).into_iter().chain(ticks) {
            let me = RobotId(k as u32 + 1);
            for output in swarm[k].handle(Duration::from_millis(ms), input) {
                let at = at + ms * SECOND / 1000;
                let mut to_all = |input: &dyn Fn() -> Input| {
                    due.extend((0..robots.len()).filter(|other| *other != k).map(|other| (other, input())));
                };
                match output {
                    Output::Broadcast(envelope) => {
                        let topic = match envelope.message {
                            Message::Holding(_) => Topic::RobotDecision(me),
                            _ => Topic::Vote(me),
                        };
                        passed.push(said(topic, envelope.encode(), at));
                        to_all(&|| Input::Received(envelope.clone()));
                    }
                    Output::Announce(announcement) => {
                        passed.push(said(Topic::Decision, json(&announcement), at));
                        return passed;
                    }
                    _ => {}
                }
            }
        }
    }
    panic!("nothing was announced");
}

/// The decisions among what passed.
pub fn decisions(passed: &[Passing]) -> Vec<Decision> {
    let decisions = passed.iter().filter(|passing| passing.topic == Topic::Decision);
    decisions
        .map(|passing| serde_json::from_slice::<Announcement>(&passing.payload).unwrap().decision)
        .collect()
}

/// Three rounds of a palm: clear, mistaken for a fist, and without enough who see. With what the person said of each.
pub fn run() -> Vec<Passing> {
    let config = RoundsConfig { rule: FusionRule::LogPool, ..RoundsConfig::default() };
    let mut passed = vec![said(Topic::Status(RobotId(1)), json(&status()), BEGIN)];
    let sees: [&[Option<[f32; 3]>]; 3] = [
        &[Some([0.1, 0.2, 0.7]), Some([0.2, 0.2, 0.6]), Some([0.3, 0.1, 0.6]), None],
        &[Some([0.9, 0.05, 0.05]), Some([0.8, 0.1, 0.1]), Some([0.2, 0.3, 0.5]), Some([0.7, 0.15, 0.15])],
        &[Some([0.4, 0.3, 0.3]), None, None, None],
    ];
    for (i, sees) in (0..).zip(sees) {
        let at = BEGIN + (1 + 300 * i) * SECOND;
        let round = round(&config, sees, at);
        let name = decisions(&round)[0].round;
        passed.extend(round);
        let was = Instruction::Was { round: name, class: Gesture::Label("palm".to_owned()) };
        passed.push(said(Topic::Feedback("ada".parse().unwrap()), json(&was), at + 8 * SECOND));
    }
    passed
}

pub fn status() -> Status {
    let mut status = Status::new(RobotId(1), "window".to_owned(), 3);
    status.vocabulary = vocabulary().labels().to_vec();
    status
}

/// One of every kind of message, and of every form that it may have.
pub fn one_of_each() -> Vec<Passing> {
    let (robot, at) = (RobotId(7), BEGIN);
    let round = RoundId { counter: 5, opener: robot, life: u32::MAX };
    let stamp = Stamp { boot: 9, sequence: 4 };
    let mut all = run();
    let vectors =
        [Vector::F32(vec![0.1, -1.5]), Vector::F16(vec![0, 60, 1, 128]), Vector::I8(vec![-128, 127])];
    for (number, vector) in (1..).zip(vectors) {
        let id = SampleId { author: robot, life: 3, number };
        let sample = SharedSample { id, class: ClassId(1), round, vector };
        let message = Message::Samples(Samples { space: FeatureSpaceId(5), samples: vec![sample] });
        let signature = Some(Signature::from_bytes([7; 64]));
        let envelope = Envelope { author: robot, stamp, message, signature };
        all.push(said(Topic::Sample(robot), envelope.encode(), at));
    }
    let mut full = status();
    full.camera.motion = Some(Motion { state: Default::default(), delay_ms: 1.5 });
    full.camera.opinion = Some(Opinion { gesture: "fist".to_owned(), probability: 0.25, at_ms: 7 });
    full.learning = Some(LearningStatus {
        personal: vec![1, 2],
        doubted: vec![Heeded { robot: RobotId(3), held: 9, trained: 2 }],
        ..LearningStatus::default()
    });
    full.counters.insert("sent_vote".to_owned(), u64::MAX);
    full.errors.push(Reported { at_ms: 1, what: "no camera".to_owned() });
    full.round = Some(round);
    all.push(said(Topic::Status(robot), json(&full), at));
    let mut own = decisions(&run()).remove(0);
    (own.certificate.rule, own.certificate.pool) = (FusionRule::Other("approval".parse().unwrap()), None);
    let signature = Some(Signature::from_bytes([9; 64]));
    let own = Announcement { decision: own, label: None, announcer: robot, stamp, signature };
    all.push(said(Topic::Decision, json(&own), at));
    for ask in [
        Ask::Between { classes: [ClassId(2), ClassId(0)] },
        Ask::Again { nearest: ClassId(1) },
        Ask::Name { nearest: Some(ClassId(1)) },
        Ask::Name { nearest: None },
    ] {
        let labels = ask.classes().iter().map(ToString::to_string).collect();
        let question =
            Question { round, ask, labels, entropy: 0.5, disagreement: 0.0, robot, stamp, signature };
        all.push(said(Topic::Question, json(&question), at));
    }
    let ada = || "ada".parse().unwrap();
    let (label, class) = (Gesture::Label("fist".to_owned()), Gesture::Class(ClassId(2)));
    let words = [
        Instruction::Open,
        Instruction::Was { round, class: label.clone() },
        Instruction::Was { round, class: class.clone() },
        Instruction::Right { round, of: label },
        Instruction::Wrong { round, of: class },
        Instruction::Retract { round },
    ];
    for word in words {
        all.push(said(Topic::Feedback(ada()), json(&word), at));
        let outcome = Outcome::NothingSeen;
        let answer = Answer {
            robot,
            at: u64::MAX,
            to: word,
            outcome,
            class: Some(ClassId(1)),
            samples: 3,
            looks_like: None,
        };
        all.push(said(Topic::Answer(ada()), json(&answer), at));
    }
    // As people write it.
    all.push(said(Topic::Feedback(ada()), br#"{ "say" : "open" }"#.to_vec(), at));
    all.push(said(Topic::Evidence, vec![1, 2, 3], at));
    all.push(Passing::presence(robot, true, at));
    all.push(Passing::presence(robot, false, at));
    let header = FrameHeader {
        nonce: 1,
        sequence: 2,
        age_us: 3000,
        encoding: ImageEncoding::Jpeg,
        fps: 30.0,
        camera: "parrot".to_owned(),
    };
    let picture = said(Topic::Frame(robot), vec![0xff, 0xd8, 0xff], at);
    all.push(Passing { attachment: Some(header.encode()), ..picture.clone() });
    // What is no message of its key.
    all.push(picture);
    for topic in [
        Topic::Vote(robot),
        Topic::Sample(robot),
        Topic::Decision,
        Topic::Question,
        Topic::Feedback(ada()),
        Topic::Answer(ada()),
    ] {
        all.push(said(topic.clone(), vec![3, 255, 0], at));
        all.push(said(topic, Vec::new(), at));
    }
    all
}
