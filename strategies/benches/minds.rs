//! What a mind's work costs in swarms of any size: `cargo bench -p gestalt-strategies --bench minds`.
//!
//! Of a hundred robots all vote, of more a committee of 72: what is timed is the work at one input, and a whole round of all minds. And what one message of
//! names costs a robot that holds a thousand samples.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use divan::{Bencher, black_box};
use gestalt_protocol::{
    ClassId, Envelope, Fate, InstructorId, Message, Naming, Namings, RobotId, RoundId, SampleId, Samples,
    SharedSample, Stamp, Vector, Vote,
};
use gestalt_strategies::{
    Classify, ClassifyError, Components, FeatureSpace, Input, LearningConfig, LearningSetup, Life, Mind,
    MindConfig, Observation, Output, OwnRules, ScalingMethod, Vocabulary,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

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

/// So many words, by which each gesture is the same as the next, at a robot that holds a thousand samples of them.
#[divan::bench(args = [1, 16, 64, 256], max_time = 2)]
fn names_in_one_message(bencher: Bencher, words: usize) {
    let (rows, seed) = ([[0.0, 1.0], [1.0, 0.0], [0.5, 0.2]], ChaCha8Rng::seed_from_u64);
    let features = rows.iter().map(|row| row.as_slice());
    let space =
        FeatureSpace::fit("bench", features, ScalingMethod::Common, Components::Count(1), &mut seed(1));
    let space = Arc::new(space);
    let by: InstructorId = "ana".parse().expect("a name");
    let gesture = |n: usize| ClassId::named(&by, &n.to_string());
    let from = |message, sequence| {
        let stamp = Stamp { boot: 1, sequence };
        Input::Received(Envelope { author: RobotId(2), stamp, message, signature: None })
    };
    let taught = || {
        let setup = LearningSetup {
            config: LearningConfig::default(),
            space: space.clone(),
            vocabulary: vocabulary(),
            rng: Box::new(seed(2)),
            memory: None,
            rules: OwnRules::default(),
        };
        let mind = Mind::new(RobotId(1), Life { boot: 1, nonce: 1 }, MindConfig::default());
        let mut mind = mind.expect("it is valid").learning(setup).expect("it can learn");
        for number in 1..=1000 {
            let id = SampleId { author: RobotId(2), life: 1, number };
            let (class, vector) =
                (gesture(number as usize % words), Vector::F32(vec![number as f32 / 1000.0]));
            let round = RoundId { life: number, ..ROUND };
            let samples = vec![SharedSample { id, class, round, vector }];
            mind.handle(ms(1), from(Message::Samples(Samples { space: space.id(), samples }), number));
        }
        let held = mind.training_set().map(|set| set.len());
        assert_eq!(held, Some(1000), "a full set");
        mind
    };
    let word = |n: usize| {
        let fate = if n + 1 == words { Fate::InUse } else { Fate::Same(gesture(n + 1)) };
        Naming {
            by: by.clone(),
            label: n.to_string(),
            count: 1,
            at: 1,
            said_by: by.clone(),
            fate,
            said: None,
        }
    };
    let message = Message::Namings(Namings { namings: (0..words).map(word).collect() });
    let minds = || (taught(), from(message.clone(), 1001));
    bencher.with_inputs(minds).bench_local_values(|(mut mind, message)| (mind.handle(ms(2), message), mind));
}
