//! Rounds that nobody opens but the robots themselves, by what they see move.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_link::Event;
use gestalt_peer::config::{
    CameraChoice, CameraSection, Config, ModelSection, MotionConfig, RenderedSection, Schedule, SourceSection,
};
use gestalt_peer::swarm::Members;
use gestalt_protocol::{CameraState, ClassId, RobotId, Status};
use gestalt_tests::{model, unique};
use gestalt_vision::human::Human;
use gestalt_vision::pose::Pose;
use serde_json::json;

const SCHEDULE: Schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };
const SEED: u64 = 5;

fn clock() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap()
}

fn config(id: u32, swarm: &str) -> Config {
    let mut config = Config::default();
    config.robot.id = RobotId(id);
    config.swarm.0 = swarm.to_owned();
    let bearing_deg = f64::from(id) * 12.0 - 30.0;
    let pose = Pose { bearing_deg, elevation_deg: 0.0, distance_m: 0.9 };
    config.camera = CameraSection {
        model: if id % 2 == 1 { CameraChoice::Footbot } else { CameraChoice::Parrot },
        source: SourceSection::Rendered(RenderedSection {
            pose,
            seed: SEED,
            schedule: Some(SCHEDULE),
            ..RenderedSection::default()
        }),
        motion: MotionConfig::watching(),
        ..CameraSection::default()
    };
    config.model = ModelSection::Rendered;
    config.links.scouting.enabled = false;
    config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
    config
}

/// What was decided in one round: when each robot heard of it, and what each holds.
#[derive(Default)]
struct Heard {
    /// When a robot first took part, and who opened it.
    opened: Option<(Duration, RobotId)>,
    held: BTreeMap<u32, Option<ClassId>>,
}

pub async fn gestures_start_rounds_and_all_robots_decide_them_alike() {
    const SHOWINGS: u64 = 6;
    let swarm = unique("motion");
    let configs: Vec<Config> = (1..=4).map(|id| config(id, &swarm)).collect();
    let model = model();
    // The human goes on all the while: the robots wake up while nobody is there.
    let (_, into) = SCHEDULE.divide(clock());
    tokio::time::sleep(SCHEDULE.period - into).await;
    let (members, _) = Members::here(&configs, &[(0, 1), (1, 2), (2, 3)], &model, |_| ()).await.unwrap();
    let rounds: Arc<Mutex<BTreeMap<u32, Heard>>> = Arc::default();
    for (body, id) in members.bodies().iter().zip(1_u32..) {
        let (mut events, rounds) = (body.robot().events(), rounds.clone());
        tokio::spawn(async move {
            while let Ok(event) = events.recv().await {
                let mut rounds = rounds.lock().unwrap();
                match event {
                    Event::Opened(round) => {
                        let round_heard = rounds.entry(round.counter).or_default();
                        round_heard.opened.get_or_insert_with(|| (clock(), round.opener));
                    }
                    Event::Held(decision) => {
                        rounds.entry(decision.round.counter).or_default().held.insert(id, decision.class);
                    }
                    _ => {}
                }
            }
        });
    }
    let (first, _) = SCHEDULE.divide(clock());
    // Until the last hand has left.
    let end = SCHEDULE.period * u32::try_from(first + SHOWINGS).unwrap();
    tokio::time::sleep(end.saturating_sub(clock()) + Duration::from_millis(500)).await;
    let statuses: Vec<Status> = members.bodies().iter().map(|body| body.robot().status()).collect();
    members.stop().await;

    let human = Human::new(SEED);
    let mut by_showing: BTreeMap<u64, Vec<(u32, Option<u8>)>> = BTreeMap::new();
    let rounds = rounds.lock().unwrap();
    let mut right = 0;
    for (counter, heard) in rounds.iter() {
        let (opened, by) = heard.opened.expect("a round that a robot takes part in");
        let shown = human.last_shown(opened, &SCHEDULE);
        let (showing, into) = SCHEDULE.divide(opened);
        eprintln!(
            "round {counter} by {by}: showing {} after {into:?}, shown {shown:?}, held {:?}",
            showing - first,
            heard.held
        );
        assert_eq!(heard.held.len(), 4, "round {counter}: all robots hold a decision");
        let decided = heard.held[&1];
        assert!(heard.held.values().all(|held| *held == decided), "round {counter}: {:?}", heard.held);
        right += u64::from(decided == shown.map(|fingers| ClassId(fingers.into())));
        by_showing.entry(showing - first).or_default().push((*counter, shown));
    }
    eprintln!("{right} of {} rounds right", rounds.len());
    for showing in 0..SHOWINGS {
        assert_eq!(by_showing.get(&showing).map_or(0, Vec::len), 1, "showing {showing}: {by_showing:?}");
    }
    assert!(right + 2 >= SHOWINGS, "{right} of {SHOWINGS} right");
    for status in statuses {
        let frames = |what: &str| status.counters.get(what).copied().unwrap_or_default();
        let (hands, none) = (frames("frames_with_a_hand"), frames("frames_without_a_hand"));
        eprintln!("{:?}, {hands} frames with a hand and {none} without", status.camera);
        let motion = status.camera.motion.expect("motion is watched");
        assert_eq!(status.camera.state, CameraState::Live);
        assert!(status.camera.fps > 1.0 && motion.delay_ms >= 400.0);
        assert!(status.camera.opinion.is_some());
        // A busy machine draws fewer frames than the camera has, which is reported, and is no error of the robot's.
        let of_robot = status.errors.iter().find(|error| !error.what.contains("frames per second"));
        assert!(hands > 0 && of_robot.is_none(), "{:?}", status.errors);
    }
}
