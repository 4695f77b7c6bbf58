//! Minds that know each other by bytes alone.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_mind::{MindError, OutgoingMessage, PortableMind, Settings};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn settings(robot: u32, more: &str) -> Settings {
    let json = format!(r#"{{"robot": {robot}, "boot": 1, "seed": 5{more}}}"#);
    Settings::parse(json.as_bytes()).unwrap()
}

const GESTURES: &str = r#", "vocabulary": ["left", "right", "stop"]"#;

/// `robots` minds that all hear each other, but for the part `loss` of all messages. Each round lasts six seconds of
/// virtual time. Gives what each holds at the end of each, and all that was said.
fn run(robots: u32, rounds: u64, loss: f64, seed: u64) -> (Vec<Vec<Option<u64>>>, Vec<OutgoingMessage>) {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut minds: Vec<_> =
        (1..=robots).map(|robot| PortableMind::new(settings(robot, GESTURES)).unwrap()).collect();
    let all: Vec<u32> = (1..=robots).collect();
    for (robot, mind) in (1..).zip(&mut minds) {
        mind.set_alive(Duration::ZERO, &all).unwrap();
        let others: Vec<u32> = all.iter().copied().filter(|other| *other != robot).collect();
        mind.set_neighbours(Duration::ZERO, &others).unwrap();
    }
    let (mut held, mut said) = (Vec::new(), Vec::new());
    let mut air: VecDeque<OutgoingMessage> = VecDeque::new();
    for round in 0..rounds {
        for ms in (0..6000).step_by(10) {
            let now = Duration::from_millis(1000 + round * 6000 + ms);
            if ms == 0 {
                minds[round as usize % robots as usize].open(now);
            }
            for message in std::mem::take(&mut air) {
                for (robot, mind) in (1..).zip(&mut minds) {
                    let meant = message.to.is_none_or(|to| to.0 == robot);
                    let own = message.key.contains(&format!("/robot/{robot}/")) && message.to.is_none();
                    if meant && !own && !chance.random_bool(loss) {
                        mind.received(now, &message.key, &message.payload).unwrap();
                    }
                }
            }
            for mind in &mut minds {
                if mind.is_open() && ms % 100 == 0 {
                    let mut seen = [0.2, 0.2, 0.2];
                    seen[(round % 3) as usize] = 0.6;
                    mind.observe(now, &seen, 1.0).unwrap();
                }
                if mind.next_wake().is_some_and(|due| due <= now) {
                    mind.tick(now);
                }
                while let Some(message) = mind.next_message() {
                    said.push(message.clone());
                    air.push_back(message);
                }
            }
        }
        let class = |mind: &PortableMind| {
            let decision: serde_json::Value = serde_json::from_str(&mind.decision()?).unwrap();
            decision["class"].as_u64()
        };
        held.push(minds.iter().map(class).collect());
    }
    (held, said)
}

#[test]
fn ten_minds_that_lose_a_third_of_all_messages_hold_the_right_decision_in_every_round() {
    let (held, _) = run(10, 6, 0.3, 1);
    for (round, held) in held.iter().enumerate() {
        assert_eq!(*held, vec![Some(round as u64 % 3); 10], "round {round}");
    }
}

#[test]
fn the_same_seed_gives_the_same_messages_byte_for_byte() {
    let (_, once) = run(3, 2, 0.3, 7);
    let (_, twice) = run(3, 2, 0.3, 7);
    assert!(once.len() > 20 && once == twice);
    let (_, other) = run(3, 2, 0.3, 8);
    assert!(once != other);
}

#[test]
fn what_is_no_observation_is_refused_by_its_reason_and_changes_nothing() {
    let mut mind = PortableMind::new(settings(1, GESTURES)).unwrap();
    let now = Duration::from_millis(5);
    mind.open(now);
    for (seen, quality, named) in [
        (&[0.5, 0.5][..], 1.0, "2 values"),
        (&[0.5, 0.5, f32::NAN], 1.0, "value 2 is NaN"),
        (&[0.5, 0.6, -0.1], 1.0, "value 2"),
        (&[0.5, 0.5, 0.5], 1.0, "1.5"),
        (&[0.0, 0.0, 0.0], 1.0, "sum to 0"),
        (&[0.2, 0.2, 0.6], 1.5, "quality"),
        (&[0.2, 0.2, 0.6], f32::NAN, "quality"),
    ] {
        let error = mind.observe(now, seen, quality).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
    let mut blank = PortableMind::new(settings(1, "")).unwrap();
    assert_eq!(blank.observe(now, &[0.5, 0.5], 1.0), Err(MindError::Sightless));
    let mut pupil = PortableMind::new(settings(1, &format!(r#"{GESTURES}, "learning": {{}}"#))).unwrap();
    assert_eq!(pupil.observe(now, &[0.2, 0.2, 0.6], 1.0), Err(MindError::Spaceless));
}

#[test]
fn what_comes_under_a_key_that_it_does_not_belong_to_is_refused() {
    let mut author = PortableMind::new(settings(2, GESTURES)).unwrap();
    author.open(Duration::ZERO);
    author.tick(Duration::from_secs(1));
    let vote = author.next_message().unwrap();
    assert_eq!((vote.key.as_str(), vote.json), ("gestalt/gestalt/robot/2/vote", false));
    let mut mind = PortableMind::new(settings(1, GESTURES)).unwrap();
    let now = Duration::from_secs(1);
    let mut receive = |key: &str| mind.received(now, key, &vote.payload);
    for key in
        ["gestalt/gestalt/robot/3/vote", "gestalt/gestalt/robot/2/sample", "gestalt/gestalt/robot/1/repair"]
    {
        assert!(matches!(receive(key), Err(MindError::Mismatch(_))), "{key}");
    }
    for key in ["gestalt/other/robot/2/vote", "gestalt/gestalt/robot/2/status", "", "gestalt/gestalt/robot/2"]
    {
        assert!(matches!(receive(key), Err(MindError::Key(_))), "{key}");
    }
    assert!(matches!(receive("gestalt/gestalt/decision"), Err(MindError::Message { .. })));
    assert_eq!(receive(&vote.key), Ok(()));
    assert_eq!(mind.received_envelope(now, &vote.payload), Ok(()));
    assert!(mind.is_open(), "it has heard of the round");
    for length in 0..vote.payload.len() {
        assert!(mind.received_envelope(now, &vote.payload[..length]).is_err());
    }
}

#[test]
fn a_mind_learns_what_it_is_told_and_judges_by_it() {
    const MODEL: &[u8] = include_bytes!("../../../peer/vision/models/rendered.gestalt");
    let mut mind = PortableMind::new(settings(1, r#", "learning": {"spacing": "0s"}"#)).unwrap();
    mind.load_model(Duration::ZERO, MODEL).unwrap();
    let features = gestalt_mind::ModelFile::decode(MODEL).unwrap().classifier.space().features();
    mind.open(Duration::from_secs(1));
    for n in 0..8_u64 {
        let seen: Vec<f32> = (0..features).map(|i| ((i as u64 * 7 + n) % 11) as f32 / 11.0).collect();
        mind.observe(Duration::from_millis(1000 + 600 * n), &seen, 1.0).unwrap();
    }
    let status: serde_json::Value = serde_json::from_str(&mind.status()).unwrap();
    let word = serde_json::json!({"say": "was", "round": status["round"], "class": 2});
    mind.instructed(Duration::from_secs(7), "ada", 1, word.to_string().as_bytes()).unwrap();
    assert!(mind.wants_training());
    assert_eq!(mind.train(Duration::from_secs(8)), Ok(true));
    assert_eq!(mind.train(Duration::from_secs(8)), Ok(false));
    let messages: Vec<_> = std::iter::from_fn(|| mind.next_message()).collect();
    assert!(messages.iter().any(|message| message.key.ends_with("robot/1/sample")));
    assert_eq!(mind.load_model(Duration::from_secs(9), MODEL), Err(MindError::TooLate));
    mind.tick(Duration::from_secs(10));
    let answered = std::iter::from_fn(|| mind.next_message()).chain(messages);
    assert!(answered.into_iter().any(|message| message.key.ends_with("instructor/ada/answer")));
}

/// Two minds that hear each other at once, for three seconds in which they look.
fn look(minds: &mut [PortableMind; 2], start: u64) {
    minds[0].open(Duration::from_millis(start));
    for now in (start..start + 3000).step_by(50).map(Duration::from_millis) {
        for here in 0..2 {
            if minds[here].is_open() {
                minds[here].observe(now, &[0.2, 0.2, 0.6], 1.0).unwrap();
            }
            minds[here].tick(now);
            while let Some(message) = minds[here].next_message() {
                minds[1 - here].received(now, &message.key, &message.payload).unwrap();
            }
        }
    }
}

fn decided(mind: &PortableMind) -> serde_json::Value {
    serde_json::from_str(&mind.decision().expect("a decision")).unwrap()
}

#[test]
fn a_robot_that_starts_again_is_heard_under_its_next_boot() {
    let start = |robot: u32, boot: u32, now: Duration| {
        let json = format!(r#"{{"robot": {robot}, "boot": {boot}, "seed": 5{GESTURES}}}"#);
        let mut mind = PortableMind::new(Settings::parse(json.as_bytes()).unwrap()).unwrap();
        mind.set_alive(now, &[1, 2]).unwrap();
        mind.set_neighbours(now, &[3 - robot]).unwrap();
        mind
    };
    let mut minds = [start(1, 1, Duration::ZERO), start(2, 1, Duration::ZERO)];
    look(&mut minds, 0);
    let before = decided(&minds[0]);
    minds[1] = start(2, 2, Duration::from_secs(10));
    look(&mut minds, 10_000);
    let (one, two) = (decided(&minds[0]), decided(&minds[1]));
    assert_ne!(one["round"], before["round"]);
    assert_eq!((&one["round"], &one["class"]), (&two["round"], &two["class"]));
    let counted = |decision: &serde_json::Value| decision["certificate"]["votes"][1]["stamp"]["boot"].clone();
    assert_eq!((counted(&before), counted(&one)), (1.into(), 2.into()));
}

#[test]
fn a_clock_that_runs_back_or_to_its_end_breaks_nothing() {
    let mut mind = PortableMind::new(settings(1, GESTURES)).unwrap();
    for now in [5_000_000_000, 0, u64::MAX, 7, u64::MAX - 1].map(Duration::from_nanos) {
        mind.open(now);
        mind.observe(now, &[0.2, 0.2, 0.6], 1.0).unwrap();
        mind.tick(now);
    }
    assert!(mind.next_wake().is_none_or(|due| due >= Duration::from_nanos(u64::MAX)));
}

#[test]
fn no_robot_has_the_number_that_means_all() {
    assert!(matches!(PortableMind::new(settings(u32::MAX, GESTURES)), Err(MindError::Nobody(_))));
    let mut mind = PortableMind::new(settings(1, GESTURES)).unwrap();
    for tell in [PortableMind::set_alive, PortableMind::set_neighbours] {
        let refused = tell(&mut mind, Duration::ZERO, &[2, u32::MAX]);
        assert!(matches!(refused, Err(MindError::Nobody(_))), "{refused:?}");
    }
}
