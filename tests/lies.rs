//! A member of a sealed swarm that lies, as a process: it hears which round is open, and does what it is told.

use std::time::Duration;

use gestalt_link::{Bearer, LinkConfig};
use gestalt_protocol::{
    ClassId, Envelope, Keys, Message, RobotId, RoundId, SampleId, Samples, SharedSample, Stamp, Topic,
    Vector, Vote,
};
use gestalt_strategies::Classify;
use gestalt_tests::{Fixed, credentials, gesture, key, space, with_eve};
use gestalt_trust::{Identity, SwarmId, statement};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};
use tokio::sync::mpsc;
use zenoh::Session;
use zenoh::qos::CongestionControl;

const CLASSES: u32 = 6;

/// How often it acts.
const TURN: Duration = Duration::from_millis(100);

/// Votes at each turn, of one that floods: many times what a robot may say.
const FLOOD: u32 = 20;

/// How it lies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lie {
    /// Two votes under one stamp.
    Equivocate,
    /// Two hundred votes a second, each truly signed.
    Flood,
    /// Samples of another gesture than was shown, in the rounds that are taught.
    Poison,
}

struct Liar {
    me: RobotId,
    identity: Identity,
    swarm: SwarmId,
    keys: Keys,
    session: Session,
    boot: u32,
    sequence: u32,
    sample: u32,
    rng: ChaCha8Rng,
}

impl Liar {
    fn envelope(&self, sequence: u32, message: Message) -> Envelope {
        let stamp = Stamp { boot: self.boot, sequence };
        let said = Envelope { author: self.me, stamp, message, signature: None };
        let signature = statement::sign(&self.identity, &self.swarm, &said.statement());
        Envelope { signature: Some(signature), ..said }
    }

    fn next(&mut self) -> u32 {
        self.sequence += 1;
        self.sequence
    }

    async fn put(&self, topic: &Topic, said: &Envelope) {
        let put = self.session.put(self.keys.key(topic), said.encode());
        // A link that is made anew loses it.
        let _ = put.congestion_control(CongestionControl::Drop).await;
    }

    async fn vote(&self, round: RoundId, sequence: u32, class: u32) {
        let mut evidence = vec![-1.0; CLASSES as usize];
        evidence[class as usize] = 5.0;
        let vocabulary = Fixed::default().vocabulary().id();
        let vote = Vote { round, vocabulary, evidence, looks: 4.0, unknown: None, named: vec![] };
        self.put(&Topic::Vote(self.me), &self.envelope(sequence, Message::Vote(vote))).await;
    }

    /// Lies about a round in which that class is shown.
    async fn lie(&mut self, lie: Lie, round: RoundId, shown: u32) {
        let other = (shown + 1) % CLASSES;
        match lie {
            Lie::Equivocate => {
                let sequence = self.next();
                self.vote(round, sequence, other).await;
                self.vote(round, sequence, (shown + 2) % CLASSES).await;
            }
            Lie::Flood => {
                for _ in 0..FLOOD {
                    let sequence = self.next();
                    self.vote(round, sequence, other).await;
                }
            }
            Lie::Poison => {
                self.sample += 1;
                let features = gesture(ClassId(other), &mut self.rng).features;
                let vector = Vector::F32(space().project(&features).expect("a gesture of that space"));
                let id = SampleId { author: self.me, life: self.boot, number: self.sample };
                let samples = vec![SharedSample { id, class: ClassId(shown), round, vector }];
                let sequence = self.next();
                let said =
                    self.envelope(sequence, Message::Samples(Samples { space: space().id(), samples }));
                self.put(&Topic::Sample(self.me), &said).await;
                let sequence = self.next();
                self.vote(round, sequence, other).await;
            }
        }
    }
}

/// Runs the liar until it is told to end. Orders: `shown 3` as for every robot, and `equivocate`, `flood` or `poison`.
pub async fn run(orders: &Value, mut stdin: mpsc::Receiver<String>) {
    let number = |name: &str| orders[name].as_u64().and_then(|n| u32::try_from(n).ok()).expect("a number");
    let (id, members) = (number("id"), number("members"));
    let swarm = orders["swarm"].as_str().expect("\"swarm\": a name");
    let link: LinkConfig = serde_json::from_value(orders["link"].clone()).expect("\"link\": a LinkConfig");
    let members = with_eve(swarm, members);
    let credentials = credentials(&members, Bearer::Robot(RobotId(id)), key(id));
    // As robots name their sessions: nonce, swarm, robot.
    let name = format!(
        "{:016x}{:08x}{id:08x}",
        u64::from(std::process::id()) | 1 << 63,
        crc32fast::hash(swarm.as_bytes())
    );
    let mut zenoh = zenoh::Config::default();
    for (key, value) in [
        ("id", json!(name)),
        ("mode", json!("router")),
        ("connect/endpoints", json!(link.connect)),
        ("connect/timeout_ms", json!(-1)),
        ("connect/exit_on_failure", json!(false)),
        ("listen/endpoints", json!([])),
        ("scouting/multicast/enabled", json!(false)),
        ("transport/link/tls", credentials.tls()),
    ] {
        zenoh.insert_json5(key, &value.to_string()).expect("a key of Zenoh's configuration");
    }
    let keys = Keys::new(swarm).expect("a name of a swarm");
    let session = zenoh::open(zenoh).await.expect("a session");
    let votes = session.declare_subscriber(keys.every_robot("vote")).await.expect("it hears votes");
    let _alive =
        session.liveliness().declare_token(keys.key(&Topic::Alive(RobotId(id)))).await.expect("a token");
    let roster = members.sign(&key(1000)).expect("a roster");
    let mut liar = Liar {
        me: RobotId(id),
        identity: key(id),
        swarm: roster.swarm_id(),
        keys,
        session,
        boot: 1,
        sequence: 0,
        sample: 0,
        rng: ChaCha8Rng::seed_from_u64(id.into()),
    };
    println!("{}", json!({"event": "started", "robot": id}));
    let (mut lie, mut shown, mut open) = (Lie::Poison, 0, None::<RoundId>);
    let mut turns = tokio::time::interval(TURN);
    turns.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            vote = votes.recv_async() => {
                let Ok(sample) = vote else { break };
                if let Ok(Envelope { author, message: Message::Vote(vote), .. }) = Envelope::decode(&sample.payload().to_bytes())
                    && author != liar.me
                {
                    open = open.max(Some(vote.round));
                }
            }
            _ = turns.tick() => {
                if let Some(round) = open {
                    liar.lie(lie, round, shown).await;
                }
            }
            line = stdin.recv() => match line.as_deref() {
                Some("equivocate") => lie = Lie::Equivocate,
                Some("flood") => lie = Lie::Flood,
                Some("poison") => lie = Lie::Poison,
                Some(order) if order.starts_with("shown ") => {
                    shown = order["shown ".len()..].parse().expect("a class");
                }
                _ => break,
            },
        }
    }
    let _ = liar.session.close().await;
}
