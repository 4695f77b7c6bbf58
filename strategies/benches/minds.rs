//! What a mind's work costs in swarms of any size: `cargo bench -p gestalt-strategies --bench minds`.
//!
//! Of a hundred robots all vote, of more a committee of 72: what is timed is the work at one input, and a whole round of all minds.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use divan::{Bencher, black_box};
use gestalt_protocol::{ClassId, Envelope, Message, RobotId, RoundId, Stamp, Vote};
use gestalt_strategies::{
    Classify, ClassifyError, Input, Life, Mind, MindConfig, Observation, Output, Vocabulary,
};

const SIZES: [u32; 4] = [10, 100, 1_000, 10_000];
const ROUND: RoundId = RoundId { counter: 1, opener: RobotId(1), life: 0 };

fn main() {
    divan::main();
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Takes its features for the probabilities.
#[derive(Debug)]
struct Verbatim(Vocabulary);

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(features.iter().map(|p| f64::from(*p)).collect())
    }
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new(["0", "1", "2", "3", "4", "5"]).expect("six different labels")
}

/// A mind of robot `me` among so many, whose decisions take that α.
fn one_of(me: u32, robots: &BTreeSet<RobotId>, classifier: &Arc<Verbatim>, alpha: f64) -> Mind {
    let config = MindConfig { alpha: Some(alpha), ..MindConfig::default() };
    let mut mind = Mind::new(RobotId(me), Life { boot: 1, nonce: me }, config).expect("it is valid");
    mind.handle(ms(0), Input::Learned(classifier.clone()));
    mind.handle(ms(0), Input::Alive(Arc::new(robots.clone())));
    mind
}

fn swarm(robots: u32) -> BTreeSet<RobotId> {
    (1..=robots).map(RobotId).collect()
}

/// The vote of a robot for some gesture, its n-th.
fn vote(robot: u32, sequence: u32) -> Input {
    let evidence = (0..6).map(|class| if class == robot % 6 { 2.5 } else { -0.5 }).collect();
    let vocabulary = vocabulary().id();
    let vote = Vote { round: ROUND, vocabulary, evidence, looks: 1.0, unknown: None, named: vec![] };
    let stamp = Stamp { boot: 1, sequence };
    Input::Received(Envelope { author: RobotId(robot), stamp, message: Message::Vote(vote), signature: None })
}

/// One vote after the other of a round that nobody is sure of; of the first of them nothing is ever heard.
fn hear(bencher: Bencher, size: u32, all: bool) {
    let (robots, classifier) = (swarm(size), Arc::new(Verbatim(vocabulary())));
    let drawn = MindConfig::default().draw(ROUND.counter, &robots);
    let voters: Vec<u32> = drawn.as_ref().unwrap_or(&robots).iter().map(|robot| robot.0).collect();
    let me = voters[0];
    let mut mind = one_of(me, &robots, &classifier, 1e-12);
    let heard = &voters[if all { 1 } else { 2 }..];
    let mut sequence = 0;
    for robot in heard {
        mind.handle(ms(1), vote(*robot, sequence));
    }
    mind.handle(
        ms(2),
        Input::Observed(Observation { features: vec![0.5, 0.1, 0.1, 0.1, 0.1, 0.1], quality: 1.0 }),
    );
    mind.handle(ms(300), Input::Tick);
    let mut turn = heard.iter().cycle();
    bencher.bench_local(|| {
        sequence += 1;
        let robot = turn.next().expect("there are some");
        black_box(mind.handle(ms(301), vote(*robot, sequence)))
    });
}

/// A vote, while others are waited for.
#[divan::bench(args = SIZES, max_time = 2)]
fn vote_while_others_are_waited_for(bencher: Bencher, size: u32) {
    hear(bencher, size, false);
}

/// A vote that may decide: all were heard, and they are added up anew.
#[divan::bench(args = SIZES, max_time = 2)]
fn vote_that_may_decide(bencher: Bencher, size: u32) {
    hear(bencher, size, true);
}

/// A whole round: one robot opens it, those who are asked look once, and all come to hold the gesture.
#[divan::bench(args = [10, 100, 1_000], sample_count = 3, sample_size = 1)]
fn round_of_minds(bencher: Bencher, size: u32) {
    let (robots, classifier) = (swarm(size), Arc::new(Verbatim(vocabulary())));
    let minds = || (1..=size).map(|me| one_of(me, &robots, &classifier, 0.05)).collect::<Vec<_>>();
    bencher.with_inputs(minds).bench_local_values(|mut minds| {
        let mut on_the_way: Vec<Envelope> = Vec::new();
        let said = |outputs: Vec<Output>, on_the_way: &mut Vec<Envelope>| {
            on_the_way.extend(outputs.into_iter().filter_map(|output| match output {
                Output::Broadcast(envelope) => Some(envelope),
                _ => None,
            }));
        };
        said(minds[0].handle(ms(0), Input::Open), &mut on_the_way);
        for step in 1..60 {
            let now = ms(10 * step);
            for envelope in std::mem::take(&mut on_the_way) {
                for mind in minds.iter_mut().filter(|mind| mind.me() != envelope.author) {
                    said(mind.handle(now, Input::Received(envelope.clone())), &mut on_the_way);
                }
            }
            for mind in minds.iter_mut().filter(|mind| mind.votes()) {
                if step == 5 {
                    let features = vec![0.02, 0.02, 0.9, 0.02, 0.02, 0.02];
                    said(
                        mind.handle(now, Input::Observed(Observation { features, quality: 1.0 })),
                        &mut on_the_way,
                    );
                }
                if mind.next_wake().is_some_and(|wake| wake <= now) {
                    said(mind.handle(now, Input::Tick), &mut on_the_way);
                }
            }
        }
        let decided = |mind: &Mind| mind.held().and_then(|held| held.class) == Some(ClassId(2));
        assert!(minds.iter().all(decided), "all hold what was shown");
        minds
    });
}
