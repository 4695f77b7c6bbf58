//! A fusion centre among robots with computers of their own: one ballot, whatever becomes of streams and centre.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_tests::{Hands, Namespaces, Process, unique};
use serde_json::{Value, json};

const PORT: u16 = 7447;
const FINGERS: u8 = 3;

/// Far above what any of this takes: who is not there by then is stuck.
const PATIENCE: Duration = Duration::from_secs(30);

/// Foot-bots 0 and 1, then the centre, then Parrots 3 and 4 which stream to it: 0 – 1 – centre – 3, 4.
const LINKS: [(u32, u32); 4] = [(0, 1), (1, 2), (3, 2), (4, 2)];
const CENTRE: usize = 2;
const ALL: [u64; 4] = [0, 1, 3, 4];

struct Mixed {
    robots: Vec<Process>,
    namespaces: Namespaces,
    hands: Hands,
    swarm: String,
    fuse: &'static str,
}

impl Mixed {
    fn new(fuse: &'static str) -> Self {
        let namespaces = Namespaces::new(5, &LINKS);
        let hands = Hands::new(FINGERS);
        let mut mixed = Self { robots: Vec::new(), namespaces, hands, swarm: unique("mixed"), fuse };
        for node in 0..5 {
            let robot = mixed.process(node);
            mixed.robots.push(robot);
        }
        mixed
    }

    fn process(&self, node: u32) -> Process {
        let link = json!({
            "listen": if node < 3 { vec![format!("tcp/0.0.0.0:{PORT}")] } else { vec![] },
            "connect": self.namespaces.to_dial(node, PORT),
            "insecure": true,
        });
        let mut orders = json!({"id": node, "swarm": self.swarm, "link": link, "quorum": 1});
        match node {
            0 => (orders["sees"], orders["p"]) = (json!(FINGERS), json!(0.9)),
            // It is not sure, and mistaken.
            1 => (orders["sees"], orders["p"]) = (json!(FINGERS + 1), json!(0.3)),
            2 => orders["serve"] = json!({"model": self.hands.model(), "fuse": self.fuse, "workers": 1}),
            _ => orders["stream"] = json!({"images": self.hands.images()}),
        }
        let binary = Path::new(env!("CARGO_BIN_EXE_test-robot"));
        Process::start(binary, Some(&self.namespaces.name(node)), &orders)
    }

    /// Opens rounds at Foot-bot 0 until both Foot-bots hold a decision that rests on the votes of all of `voters`. Says how
    /// long that took and how many rounds; every one of them must have been decided, and rightly.
    fn decide_by(&mut self, voters: &[u64]) -> (Duration, usize) {
        let began = Instant::now();
        for rounds in 1.. {
            let before = self.robots[0].told().len();
            self.robots[0].order("open");
            let round = self.robots[0].wait(PATIENCE, |told| {
                let held = |t: &&Value| t["event"] == "closed";
                told[before..].iter().find(held).and_then(|t| t["round"].as_u64())
            });
            let round = round.expect("the round ends");
            let decision = self.agreed(round);
            assert_eq!(decision["class"], json!(FINGERS), "{decision}");
            let votes = decision["certificate"]["votes"].as_array().expect("votes");
            if votes.iter().map(|vote| &vote["robot"]).eq(voters) {
                return (began.elapsed(), rounds);
            }
            assert!(began.elapsed() < PATIENCE, "after {rounds} rounds: {decision}; wanted {voters:?}");
        }
        unreachable!("rounds go on")
    }

    /// The decision of a round that both Foot-bots hold, once it is one and the same.
    fn agreed(&self, round: u64) -> Value {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let held = [0, 1].map(|node| self.robots[node].decision(round, Duration::ZERO));
            if let [Some(one), Some(other)] = &held
                && one == other
            {
                return one.clone();
            }
            assert!(Instant::now() < deadline, "round {round}: {held:#?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// What the centre says of the robots it serves: their camera's state, by id.
    fn served(&mut self) -> Vec<(u64, String)> {
        let before = self.robots[CENTRE].told().len();
        self.robots[CENTRE].order("status");
        let served = self.robots[CENTRE].wait(PATIENCE, |told| {
            told[before..].iter().find(|t| t["event"] == "status").map(|t| t["served"].clone())
        });
        let of = |status: &Value| {
            Some((status["robot"].as_u64()?, status["camera"]["state"].as_str()?.to_owned()))
        };
        served.expect("a status").as_array().expect("a list").iter().filter_map(of).collect()
    }

    fn wait_served(&mut self, wanted: &[(u64, &str)]) {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let served = self.served();
            if served.iter().map(|(id, state)| (*id, state.as_str())).eq(wanted.iter().copied()) {
                return;
            }
            assert!(Instant::now() < deadline, "{served:?}; wanted {wanted:?}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

fn one_ballot(fuse: &'static str) {
    let mut mixed = Mixed::new(fuse);
    let (took, rounds) = mixed.decide_by(&ALL);
    eprintln!("{fuse}: the votes of all four in one certificate after {rounds} rounds, {took:?}");
    // Who streams hears the decision too.
    for parrot in [3, 4] {
        let heard = mixed.robots[parrot].wait(PATIENCE, |told| {
            told.iter().rfind(|t| t["event"] == "announced").map(|t| t["class"].clone())
        });
        assert_eq!(heard, Some(json!(FINGERS)), "Parrot {parrot}");
    }
}

pub fn foot_bots_and_parrots_of_a_centre_that_decides_are_one_ballot() {
    one_ballot("central");
}

pub fn foot_bots_and_parrots_of_a_centre_in_which_they_gossip_are_one_ballot() {
    one_ballot("swarm");
}

fn cut_and_killed(fuse: &'static str) {
    let mut mixed = Mixed::new(fuse);
    mixed.decide_by(&ALL);
    mixed.wait_served(&[(3, "live"), (4, "live")]);

    mixed.namespaces.cut((4, 2));
    let cut = Instant::now();
    mixed.wait_served(&[(3, "live"), (4, "frozen")]);
    let (took, rounds) = mixed.decide_by(&[0, 1, 3]);
    eprintln!("{fuse}: without the one cut off after {rounds} rounds, {took:?}");
    std::thread::sleep(Duration::from_secs(5).saturating_sub(cut.elapsed()));
    mixed.namespaces.heal((4, 2));
    let (took, rounds) = mixed.decide_by(&ALL);
    eprintln!("{fuse}: a stream cut for 5 s is back in the ballot after {took:?}, {rounds} rounds");

    mixed.robots[CENTRE].kill();
    let (took, rounds) = mixed.decide_by(&[0, 1]);
    eprintln!("{fuse}: without the killed centre after {took:?}, {rounds} rounds");
    mixed.robots[CENTRE] = mixed.process(2);
    let (took, rounds) = mixed.decide_by(&ALL);
    eprintln!("{fuse}: a centre killed and started again serves all after {took:?}, {rounds} rounds");
}

pub fn a_stream_cut_and_a_centre_killed_come_back_to_a_centre_that_decides() {
    cut_and_killed("central");
}

pub fn a_stream_cut_and_a_centre_killed_come_back_to_robots_that_gossip() {
    cut_and_killed("swarm");
}
