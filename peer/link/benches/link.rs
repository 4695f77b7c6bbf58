//! From a vote to the decision at a neighbour, in an open swarm and in a sealed one, beside a raw Zenoh put of the same size on the
//! same kinds of link: that over TLS is what no sealed swarm can be faster than.
//!
//! Two votes are timed: one that opens a round, in which the neighbour says a vote of its own before it decides; and one that completes a
//! round that is open, in which the neighbour has said its own.
//!
//! Each sample of the one is followed by a sample of the others, so that all see the same machine.

use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use gestalt_link::{
    Bearer, Certificate, Credentials, Event, LinkConfig, Robot, RobotConfig, Seal, fresh_nonce,
};
use gestalt_protocol::{Envelope, Keys, Message, RobotId, RoundId, Stamp, Topic, VocabularyId, Vote};
use gestalt_strategies::MindConfig;
use gestalt_trust::{Identity, Instructor, Membership, Roles, Roster, statement};
use serde_json::Value;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

const SAMPLES: u32 = 300;

/// A robot that decides on the votes of another, which are put by hand.
struct Neighbour {
    robot: Robot,
    _voter: Session,
    votes: Publisher<'static>,
    holds: mpsc::Receiver<Instant>,
}

impl Neighbour {
    async fn start(swarm: &str, seal: Option<Seal>, of_voter: Option<Value>) -> Self {
        let listen = if seal.is_some() { "tls/127.0.0.1:0" } else { "tcp/127.0.0.1:0" };
        let robot = Robot::start(RobotConfig {
            id: RobotId(1),
            name: "bench".to_owned(),
            boot: 1,
            swarm: swarm.to_owned(),
            // One round after the other, as fast as they come.
            mind: MindConfig { refractory: Duration::ZERO, ..MindConfig::default() },
            fusion: None,
            link: LinkConfig { listen: vec![listen.to_owned()], ..LinkConfig::default() },
            vocabulary: None,
            learning: None,
            nonce: fresh_nonce(),
            seal,
        })
        .await
        .expect("the robot starts");
        let voter = session(&[], robot.locators(), of_voter).await;
        let (held, holds) = mpsc::channel();
        let mut events = robot.events();
        std::thread::spawn(move || {
            while let Ok(event) = events.blocking_recv() {
                let now = Instant::now();
                if matches!(event, Event::Held(_)) && held.send(now).is_err() {
                    break;
                }
            }
        });
        let vote_key = Keys::new(swarm).expect("a swarm's name").key(&Topic::Vote(RobotId(0)));
        let votes = publisher(&voter, vote_key).await;
        Self { robot, _voter: voter, votes, holds }
    }

    /// How long after this vote it decides.
    fn decides(&self, vote: Vec<u8>) -> Duration {
        let began = put(&self.votes, vote);
        let held = self.holds.recv_timeout(Duration::from_secs(5));
        let held = held.unwrap_or_else(|_| panic!("the robot does not decide: {:#?}", self.robot.status()));
        std::thread::sleep(Duration::from_millis(10));
        held - began
    }

    /// Lets it take part in a round.
    fn hears(&self, vote: Vec<u8>) {
        put(&self.votes, vote);
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Two sessions that know nothing of robots.
struct Raw {
    votes: Publisher<'static>,
    _sessions: [Session; 2],
    arrivals: mpsc::Receiver<Instant>,
}

impl Raw {
    async fn start(of_receiver: Option<Value>, of_sender: Option<Value>) -> Self {
        let listen = if of_receiver.is_some() { "tls/127.0.0.1:0" } else { "tcp/127.0.0.1:0" };
        let receiver = session(&[listen.to_owned()], &[], of_receiver).await;
        let locators = receiver.info().locators().await;
        let locators: Vec<String> = locators.iter().map(ToString::to_string).collect();
        let sender = session(&[], &locators, of_sender).await;
        let (arrived, arrivals) = mpsc::channel();
        receiver
            .declare_subscriber("raw/vote")
            .callback(move |_| {
                let _ = arrived.send(Instant::now());
            })
            .background()
            .await
            .expect("a subscriber");
        let votes = publisher(&sender, "raw/vote".to_owned()).await;
        Self { votes, _sessions: [sender, receiver], arrivals }
    }

    fn arrives(&self, vote: Vec<u8>) -> Duration {
        let began = put(&self.votes, vote);
        let arrived = self.arrivals.recv_timeout(Duration::from_secs(5)).expect("the put arrives");
        std::thread::sleep(Duration::from_millis(10));
        arrived - began
    }
}

#[tokio::main]
async fn main() {
    let key = |robot: u8| Identity::from_bytes(&[robot + 1; 32]);
    let robots = (0..2).map(|robot| (RobotId(robot.into()), key(robot).public_key())).collect();
    let voter = || Bearer::Client("voter".parse().expect("a name"));
    let instructors =
        [("voter".parse().expect("a name"), Instructor { key: key(50).public_key(), roles: Roles::NONE })]
            .into();
    let members =
        Membership { swarm: "sealed".to_owned(), epoch: 1, robots, instructors, ..Membership::default() };
    let roster: Roster = members.sign(&key(100)).expect("a roster");
    let seal = Seal::issue(&key(100), roster.clone(), RobotId(1), Arc::new(key(1))).expect("a certificate");
    let certificate =
        Certificate::issue(&key(100), "sealed", voter(), &key(50).public_key()).expect("a certificate");
    let of_voter = Credentials::new(&roster, voter(), Arc::new(key(50)), certificate).expect("its own").tls();
    let of_robot = seal.credentials(RobotId(1)).expect("its own").tls();
    let open = Neighbour::start("open", None, None).await;
    let sealed = Neighbour::start("sealed", Some(seal), Some(of_voter.clone())).await;
    let raw = Raw::start(None, None).await;
    let raw_tls = Raw::start(Some(of_robot), Some(of_voter)).await;
    tokio::time::sleep(Duration::from_secs(1)).await;

    let signed = |vote: Envelope| {
        let signature = Some(statement::sign(&key(0), &roster.swarm_id(), &vote.statement()));
        Envelope { signature, ..vote }.encode()
    };
    let mut times: [Vec<Duration>; 6] = Default::default();
    for sample in 1..=SAMPLES {
        let [opens, begins, completes] = votes(sample);
        let first = [raw.arrives(opens.encode()), raw_tls.arrives(signed(opens.clone()))];
        let opening = [open.decides(opens.encode()), sealed.decides(signed(opens))];
        open.hears(begins.encode());
        let completing_open = open.decides(completes.encode());
        sealed.hears(signed(begins));
        let completing = [completing_open, sealed.decides(signed(completes))];
        for (times, time) in times.iter_mut().zip(first.into_iter().chain(opening).chain(completing)) {
            times.push(time);
        }
    }
    let [raw, raw_tls, opens, opens_sealed, completes, completes_sealed] =
        times.map(|mut times| median(&mut times));
    let ratio = |time: Duration, to: Duration| time.as_secs_f64() / to.as_secs_f64();
    println!("raw Zenoh put -> callback   median {raw:?} of {SAMPLES}, over TLS {raw_tls:?}");
    println!(
        "vote that opens a round     median {opens:?}, sealed {opens_sealed:?}: {:.2} x",
        ratio(opens_sealed, opens)
    );
    println!(
        "vote that completes a round median {completes:?}, sealed {completes_sealed:?}: {:.2} x",
        ratio(completes_sealed, completes)
    );
    println!("ratio to raw {:.2} (promised: at most 2)", ratio(opens, raw));
    open.robot.stop().await;
    sealed.robot.stop().await;
}

async fn session(listen: &[String], connect: &[String], tls: Option<Value>) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        // Who listens to nobody is a client: robots hang up one that would relay for others.
        ("mode", serde_json::json!(if listen.is_empty() { "client" } else { "router" })),
        ("listen/endpoints", serde_json::json!(listen)),
        ("connect/endpoints", serde_json::json!(connect)),
        ("scouting/multicast/enabled", serde_json::json!(false)),
        ("timestamping/enabled", serde_json::json!(false)),
    ] {
        config.insert_json5(key, &value.to_string()).expect("a key of Zenoh's");
    }
    if let Some(tls) = tls {
        config.insert_json5("transport/link/tls", &tls.to_string()).expect("credentials");
    }
    zenoh::open(config).await.expect("a session")
}

/// Over six classes: a vote that suffices, in a round of its own; the word that another round is open, and a vote that suffices in that.
fn votes(sample: u32) -> [Envelope; 3] {
    let vote = |round: u32, sequence: u32, looks: f32, evidence: &[f32]| {
        let vote = Vote {
            round: RoundId { counter: round, opener: RobotId(0), life: 0 },
            vocabulary: VocabularyId(1),
            evidence: evidence.to_vec(),
            looks,
            unknown: None,
            named: vec![],
        };
        let stamp = Stamp { boot: 1, sequence };
        Envelope { author: RobotId(0), stamp, message: Message::Vote(vote), signature: None }
    };
    let suffices = [6.0, -1.2, -1.2, -1.2, -1.2, -1.2];
    let (round, sequence) = (2 * sample, 3 * sample);
    [
        vote(round, sequence, 3.0, &suffices),
        vote(round + 1, sequence + 1, 0.0, &[]),
        vote(round + 1, sequence + 2, 3.0, &suffices),
    ]
}

/// One as robots declare it for their votes.
async fn publisher(session: &Session, key: String) -> Publisher<'static> {
    let declared = session.declare_publisher(key).priority(Priority::DataHigh);
    declared.congestion_control(CongestionControl::Drop).express(true).await.expect("a publisher")
}

fn put(votes: &Publisher<'_>, bytes: Vec<u8>) -> Instant {
    let began = Instant::now();
    votes.put(bytes).wait().expect("the session sends");
    began
}

fn median(times: &mut [Duration]) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}
