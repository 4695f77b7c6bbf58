//! Frames in a sealed swarm: of the robot that is filmed, and new; whatever a member makes up, records and repeats.

use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use gestalt_link::{Bearer, FrameGate, LinkConfig, Robot, RobotConfig};
use gestalt_peer::stream::{Sender, SenderConfig};
use gestalt_protocol::{FrameHeader, FrameTaken, Keys, RobotId, Topic};
use gestalt_tests::{Hands, by_tls, credentials, key, seal, sealed, sender_config, unique, with_eve};
use gestalt_trust::{FrameSigner, Membership, frame};
use serde_json::json;
use zenoh::sample::{Locality, Sample};

use crate::stream::wait_for;
use crate::wall::stranger;

const FILMED: RobotId = RobotId(3);
const PATIENCE: Duration = Duration::from_secs(30);

/// One who looks at all cameras.
struct Looking {
    robot: Robot,
    seen: Arc<Mutex<Vec<(RobotId, FrameHeader)>>>,
    _gate: Arc<OnceLock<FrameGate>>,
}

impl Looking {
    async fn start(members: &Membership, listen: &[String]) -> Self {
        let config = sealed(0, members, &[]);
        let listen = if listen.is_empty() { config.link.listen } else { listen.to_vec() };
        let config = RobotConfig { link: LinkConfig { listen, ..config.link }, ..config };
        let robot = Robot::start(config).await.unwrap();
        let (gate, seen) = (Arc::new(OnceLock::<FrameGate>::new()), Arc::<Mutex<Vec<_>>>::default());
        let (of_gate, of_seen) = (gate.clone(), seen.clone());
        let opened = robot
            .receive_frames(None, move |frame| {
                let FrameHeader { nonce, sequence, .. } = frame.header;
                of_seen.lock().unwrap().push((frame.robot, frame.header));
                if let Some(gate) = of_gate.get() {
                    gate.taken(frame.robot, &FrameTaken { nonce, sequence, round: None });
                }
            })
            .await
            .unwrap();
        assert!(gate.set(opened).is_ok());
        Self { robot, seen, _gate: gate }
    }

    fn frames(&self) -> usize {
        self.seen.lock().unwrap().len()
    }

    /// Waits until so many more frames were let in.
    async fn more(&self, frames: usize) {
        let wanted = self.frames() + frames;
        wait_for("frames", || (self.frames() >= wanted).then_some(())).await;
    }

    /// Waits until that many of a cause were refused.
    async fn refused(&self, cause: &str, times: u64) {
        let counter = format!("refused_frame_{cause}");
        let refused = || (self.counted(&counter) >= times).then_some(());
        wait_for(&counter, refused).await;
    }

    fn counted(&self, counter: &str) -> u64 {
        self.robot.status().counters.get(counter).copied().unwrap_or_default()
    }

    /// All that was let in is the filmed robot's, in the order that it was filmed in, from one start of its program after the other.
    fn saw_the_true_ones_alone(&self, nonces: usize) {
        let seen = self.seen.lock().unwrap();
        assert!(seen.iter().all(|(robot, _)| *robot == FILMED), "{seen:?}");
        let places: Vec<_> = seen.iter().map(|(_, header)| (header.nonce, header.sequence)).collect();
        let starts: Vec<_> = places.chunk_by(|a, b| a.0 == b.0).collect();
        assert_eq!(starts.len(), nonces, "{places:?}");
        assert!(starts.iter().all(|start| start.is_sorted_by(|a, b| a.1 < b.1)), "{places:?}");
    }
}

fn filming(members: &Membership, link: LinkConfig, hands: &Hands) -> tokio::task::JoinHandle<()> {
    let orders =
        json!({"id": FILMED, "swarm": members.swarm, "link": {}, "stream": {"images": hands.images()}});
    let (config, feed) = sender_config(&orders);
    let signer = FrameSigner::new(FILMED, Arc::new(key(FILMED.0)), seal(FILMED.0, members).roster);
    let sender = Sender::start(SenderConfig { link, signer: Some(signer), ..config }, feed).unwrap();
    tokio::spawn(async move { sender.run(|_| {}).await.unwrap() })
}

pub async fn frames_are_their_robots_own_and_new_whatever_a_member_makes_of_them() {
    let hands = Hands::new(2);
    let members = with_eve(&unique("filmed"), 5);
    let looking = Looking::start(&members, &[]).await;
    let locators = by_tls(looking.robot.locators());

    // A member that records whatever it can hear, and says it again.
    let tls = credentials(&members, Bearer::Robot(RobotId(2)), key(2)).tls();
    let session = zenoh::open(stranger("client", &locators[0], Some(&tls))).await.unwrap();
    let keys = Keys::new(&members.swarm).unwrap();
    let recorded = Arc::<Mutex<Vec<Sample>>>::default();
    let of_recorded = recorded.clone();
    let _heard = session
        .declare_subscriber(keys.key(&Topic::Frame(FILMED)))
        .allowed_origin(Locality::Remote)
        .callback(move |sample| of_recorded.lock().unwrap().push(sample))
        .await
        .unwrap();

    let holder = credentials(&members, Bearer::Robot(FILMED), key(FILMED.0));
    let link = LinkConfig { connect: locators.clone(), credentials: Some(holder), ..LinkConfig::default() };
    let camera = filming(&members, link.clone(), &hands);
    looking.more(5).await;

    let put = async |robot: RobotId, picture: Vec<u8>, attachment: Vec<u8>| {
        session.put(keys.key(&Topic::Frame(robot)), picture).attachment(attachment).await.unwrap();
    };
    let say_again = async |as_of: RobotId| {
        let recorded = recorded.lock().unwrap().clone();
        for sample in &recorded {
            let attachment = sample.attachment().unwrap().to_bytes().into_owned();
            put(as_of, sample.payload().to_bytes().into_owned(), attachment).await;
        }
        recorded.len() as u64
    };
    let newest = recorded.lock().unwrap().last().cloned().unwrap();
    let attachment = newest.attachment().unwrap().to_bytes();
    let (header, proof) = FrameHeader::decode_proven(&attachment).unwrap();
    let header = FrameHeader { sequence: header.sequence + 1000, ..header };
    let challenges = proof.unwrap().challenges;
    assert!(!challenges.is_empty(), "the camera answers who looks at it");
    let swarm = seal(2, &members).roster.swarm_id();
    let forged = frame::sign(&key(2), &swarm, FILMED, &header, challenges, b"another hand");
    for _ in 0..10 {
        put(FILMED, b"another hand".to_vec(), header.encode()).await;
        put(FILMED, b"another hand".to_vec(), header.encode_proven(&forged)).await;
        put(RobotId(9), b"another hand".to_vec(), header.encode_proven(&forged)).await;
    }
    looking.refused("unsigned", 10).await;
    looking.refused("forged", 10).await;
    looking.refused("stranger", 10).await;
    let times = say_again(FILMED).await;
    // The first was sent before the camera knew what it is asked.
    looking.refused("repeated", times - 1).await;
    // Robot 4's camera does not show what robot 3's does.
    let before = looking.counted("refused_frame_unasked");
    let times = say_again(RobotId(4)).await;
    looking.refused("unasked", before + times).await;
    looking.more(5).await;

    // Its program starts again: what the one before filmed counts no more, though it was never seen here.
    camera.abort();
    let _ = camera.await;
    let camera = filming(&members, link.clone(), &hands);
    looking.more(5).await;
    let before = looking.counted("refused_frame_unasked");
    say_again(FILMED).await;
    looking.refused("unasked", before + 5).await;
    looking.more(5).await;
    looking.saw_the_true_ones_alone(2);

    // And who looks starts again, and has forgotten all.
    camera.abort();
    let _ = camera.await;
    looking.robot.stop().await;
    let looking = Looking::start(&members, &locators).await;
    let began = Instant::now();
    while session.info().transports().await.next().is_none() {
        assert!(began.elapsed() < PATIENCE, "the member is not linked again");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    tokio::time::sleep(Duration::from_secs(1)).await;
    let times = say_again(FILMED).await;
    looking.refused("unasked", times).await;
    assert_eq!(looking.frames(), 0, "what was recorded is not believed after a start either");
    let camera = filming(&members, link, &hands);
    looking.more(5).await;
    looking.saw_the_true_ones_alone(1);
    camera.abort();
    session.close().await.unwrap();
    looking.robot.stop().await;
}
