//! Real robots on a ring learn what a client teaches them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use gestalt_link::{Client, LinkConfig, RobotConfig};
use gestalt_protocol::{
    ClassId, Envelope, FeatureSpaceId, Gesture, Instruction, InstructorId, Keys, MAX_SAMPLES, Message,
    Outcome, RobotId, RoundId, SampleId, Samples, SharedSample, Stamp, Status, Topic, Vector,
};
use gestalt_tests::{Watched, agreed, config, learning, short_rounds, space, start, start_learning, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use zenoh::qos::CongestionControl;

use crate::trouble::attach;

const PATIENCE: Duration = Duration::from_secs(30);

/// Robots that learn, a client, and what is in front of all cameras.
pub(crate) struct School {
    swarm: String,
    pub robots: Vec<Watched>,
    pub client: Client,
    shown: Arc<AtomicU8>,
    pub ada: InstructorId,
}

impl School {
    /// Robots on a ring, numbered from 0; each keeps `keep` observations of a round and shares the part `fraction`.
    async fn on_a_ring(robots: u32, keep: usize, fraction: f64) -> Self {
        Self::linked(robots, keep, fraction, true).await
    }

    /// The same, linked in a line where the ring is not closed.
    pub async fn linked(robots: u32, keep: usize, fraction: f64, closed: bool) -> Self {
        let swarm = unique("school");
        let shown = Arc::new(AtomicU8::new(0));
        let mut ring: Vec<Watched> = Vec::new();
        for id in 0..robots {
            let mut connect: Vec<String> = Vec::new();
            connect.extend(ring.last().map(|before| before.robot.locators()[0].clone()));
            if closed && id > 1 && id + 1 == robots {
                connect.push(ring[0].robot.locators()[0].clone());
            }
            let config = RobotConfig {
                mind: short_rounds(),
                learning: Some(learning(keep, fraction, None)),
                ..config(id, &swarm, &connect)
            };
            ring.push(start_learning(config, shown.clone()).await);
        }
        for robot in &ring {
            assert!(robot.sees_alive(robots as usize - 1, PATIENCE).await, "all know all");
        }
        let link = LinkConfig { connect: ring[0].robot.locators().to_vec(), ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        Self { swarm, robots: ring, client, shown, ada: "ada".parse().unwrap() }
    }

    /// Shows a gesture for a round and says what it was.
    pub async fn lesson(&mut self, class: u8) -> RoundId {
        let round = self.show(class).await;
        let was = Instruction::Was { round, class: Gesture::Class(ClassId(class.into())) };
        let answer = self.client.teach(&self.ada, &was, PATIENCE).await.unwrap().expect("an answer");
        assert_eq!(answer.outcome, Outcome::Learned);
        round
    }

    /// Shows a gesture for a round.
    pub async fn show(&mut self, class: u8) -> RoundId {
        self.shown.store(class, Ordering::Relaxed);
        let before = self.robots[0].robot.status().round.map_or(0, |round| round.counter);
        self.client.instruct(&self.ada, &Instruction::Open).await.unwrap();
        let decision = agreed(&mut self.robots, before + 1, PATIENCE).await;
        // A robot that decided early looks on until it has what it keeps, and no request counts so soon.
        tokio::time::sleep(Duration::from_millis(500)).await;
        decision.round
    }

    /// The status of every robot.
    fn statuses(&self) -> Vec<Status> {
        self.robots.iter().map(|robot| robot.robot.status()).collect()
    }

    /// Waits until what all robots have learned is as `pick` says.
    pub async fn all(&self, pick: impl Fn(&gestalt_protocol::LearningStatus) -> bool) -> bool {
        let deadline = tokio::time::Instant::now() + PATIENCE;
        loop {
            let learned = |status: &Status| status.learning.as_ref().is_some_and(&pick);
            if self.statuses().iter().all(learned) {
                return true;
            }
            if tokio::time::Instant::now() > deadline {
                return false;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    pub async fn end(self) {
        self.client.close().await;
        for robot in self.robots {
            robot.stop().await;
        }
    }
}

fn sizes(status: &Status) -> [usize; 3] {
    let learning = status.learning.as_ref().expect("it learns");
    [&learning.personal, &learning.shared, &learning.external].map(|classes| classes.iter().sum())
}

pub async fn ten_robots_on_a_ring_hold_what_the_source_says_and_tell_the_gestures_apart() {
    let mut school = School::on_a_ring(10, 5, 0.2).await;
    for class in 0..6 {
        school.lesson(class).await;
    }
    let full = |learning: &gestalt_protocol::LearningStatus| learning.external.iter().sum::<usize>() == 54;
    assert!(school.all(full).await, "{:?}", school.statuses().iter().map(sizes).collect::<Vec<_>>());
    for status in school.statuses() {
        assert_eq!(sizes(&status), [24, 6, 54], "robot {}: 84 samples", status.robot);
    }
    let common: Vec<_> = school.statuses().into_iter().map(|s| s.learning.unwrap().common).collect();
    assert!(common.iter().all(|digest| *digest == common[0]), "{common:?}");
    // Of a gesture that was shown once nobody is sure yet.
    for class in (0..6).chain(0..6) {
        school.lesson(class).await;
    }
    for class in [3, 1] {
        school.show(class).await;
        let decision = school.robots[4].robot.status().round;
        assert!(decision.is_some());
        let last = school.client.last_decision(Duration::from_secs(2)).await.unwrap().unwrap();
        assert_eq!(last.decision.class, Some(ClassId(class.into())), "what was learned is recognised");
    }
    school.end().await;
}

pub async fn the_size_follows_the_formula_over_real_links() {
    for (robots, fraction) in [(5, 0.1), (5, 1.0)] {
        let mut school = School::on_a_ring(robots, 5, fraction).await;
        for class in 0..6 {
            school.lesson(class).await;
        }
        let own = 6.0 * 5.0;
        let expected = (own + fraction * own * f64::from(robots - 1)).round() as usize;
        let total = |learning: &gestalt_protocol::LearningStatus| {
            [&learning.personal, &learning.shared, &learning.external].into_iter().flatten().sum::<usize>()
        };
        assert!(
            school.all(|learning| total(learning) == expected).await,
            "{robots} robots, B = {fraction}: {expected} expected, {:?}",
            school.statuses().iter().map(sizes).collect::<Vec<_>>()
        );
        school.end().await;
    }
}

pub async fn a_correction_and_an_undo_reach_every_robot() {
    let mut school = School::on_a_ring(4, 3, 1.0).await;
    let round = school.lesson(2).await;
    let counts = |class: usize, n: usize| {
        move |learning: &gestalt_protocol::LearningStatus| {
            learning.personal[class] + learning.shared[class] + learning.external[class] == n
        }
    };
    assert!(school.all(counts(2, 12)).await);
    let was = Instruction::Was { round, class: Gesture::Label("4".to_owned()) };
    let answer = school.client.teach(&school.ada, &was, PATIENCE).await.unwrap().unwrap();
    assert_eq!((answer.outcome, answer.class), (Outcome::Learned, Some(ClassId(4))));
    assert!(school.all(counts(4, 12)).await && school.all(counts(2, 0)).await, "relabelled everywhere");
    let again = school.client.teach(&school.ada, &was, PATIENCE).await.unwrap().unwrap();
    assert_eq!(again.outcome, Outcome::Known);
    let undo = Instruction::Retract { round };
    school.client.teach(&school.ada, &undo, PATIENCE).await.unwrap().unwrap();
    assert!(school.all(counts(4, 0)).await, "taken back everywhere");
    let unknown = RoundId { counter: 999, ..round };
    let right = Instruction::Right { round: unknown, of: Gesture::Class(ClassId(1)) };
    let answer = school.client.teach(&school.ada, &right, PATIENCE).await.unwrap().unwrap();
    assert_eq!(answer.outcome, Outcome::UnknownRound, "never lost in silence");
    school.end().await;
}

pub async fn forged_samples_are_refused_counted_and_named_and_nothing_is_trained_on_them() {
    let school = School::on_a_ring(2, 3, 1.0).await;
    let forger = attach(school.robots[0].robot.locators()).await;
    let keys = Keys::new(&school.swarm).unwrap();
    let author = RobotId(9);
    let sample = |author, number, class, vector| SharedSample {
        id: SampleId { author, life: 0, number },
        class: ClassId(class),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector,
    };
    let sound = Vector::F32(vec![0.5; 8]);
    let own = space().id();
    let forged = [
        ("refused_sample_impossible", own, sample(author, 1, 1, Vector::F32(vec![f32::NAN; 8]))),
        ("refused_sample_impossible", own, sample(author, 1, 1, Vector::F32(vec![f32::INFINITY; 8]))),
        ("refused_sample_impossible", own, sample(author, 1, 200, sound.clone())),
        ("refused_sample_with_bad_vector", own, sample(author, 1, 1, Vector::I8(vec![1; 7]))),
        ("refused_sample_with_bad_vector", own, sample(author, 1, 1, Vector::I8(vec![1; 9]))),
        ("refused_sample_of_unknown_class", own, sample(author, 1, 6, sound.clone())),
        ("refused_sample_of_other_space", FeatureSpaceId(5), sample(author, 1, 1, sound.clone())),
        ("refused_sample_number", own, sample(author, u32::MAX, 1, sound.clone())),
        ("refused_sample_author", own, sample(RobotId(8), 1, 1, sound.clone())),
    ];
    for (_, space, sample) in &forged {
        let message = Message::Samples(Samples { space: *space, samples: vec![sample.clone()] });
        let stamp = Stamp { boot: 1, sequence: 1 };
        forger
            .put(
                keys.key(&Topic::Sample(author)),
                Envelope { author, stamp, message, signature: None }.encode(),
            )
            .await
            .unwrap();
    }
    let refused = |status: &Status| {
        let of =
            |(counter, ..): &(&str, FeatureSpaceId, SharedSample)| status.counters.get(*counter).copied();
        forged.iter().all(|forged| of(forged).is_some())
            && status
                .counters
                .iter()
                .filter(|(name, _)| name.starts_with("refused_sample"))
                .map(|(_, n)| n)
                .sum::<u64>()
                >= forged.len() as u64
    };
    let deadline = tokio::time::Instant::now() + PATIENCE;
    while !school.statuses().iter().all(refused) && tokio::time::Instant::now() < deadline {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    for status in school.statuses() {
        for (counter, ..) in &forged {
            let expected = forged.iter().filter(|(other, ..)| other == counter).count() as u64;
            assert_eq!(status.counters.get(*counter), Some(&expected), "{counter}: {:?}", status.counters);
        }
        assert_eq!(sizes(&status), [0, 0, 0]);
        assert_eq!(status.learning.unwrap().trainings, 0, "nothing is trained on them");
    }
    forger.close().await.unwrap();
    school.end().await;
}

/// Samples go on arriving from before the round until after the decision, so there is always something to train on.
pub async fn a_robot_votes_and_decides_while_it_trains() {
    const SAMPLES: u32 = 8000;
    let swarm = unique("busy");
    let mut apprenticeship = learning(3, 1.0, None);
    apprenticeship.config.capacity = 2 * SAMPLES as usize;
    let busy = RobotConfig { mind: short_rounds(), learning: Some(apprenticeship), ..config(0, &swarm, &[]) };
    let mut busy = start_learning(busy, Arc::new(AtomicU8::new(4))).await;
    let sees = RobotConfig { mind: short_rounds(), ..config(1, &swarm, busy.robot.locators()) };
    let sees = start(sees, Some(ClassId(4))).await;
    assert!(busy.sees_alive(1, PATIENCE).await && sees.sees_alive(1, PATIENCE).await);
    // Samples with labels by chance: the hardest there are to tell apart.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut sample = |number| SharedSample {
        id: SampleId { author: RobotId(9), life: 0, number },
        class: ClassId(rng.next_u32() % 6),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector: Vector::I8((0..8).map(|_| (rng.next_u32() % 200) as i8).collect()),
    };
    let all: Vec<SharedSample> = (1..=SAMPLES).map(&mut sample).collect();
    let author = RobotId(9);
    let keys = Keys::new(&swarm).unwrap();
    let giver = attach(busy.robot.locators()).await;
    let put = async |sequence: u32, batch: &[SharedSample]| {
        let message = Message::Samples(Samples { space: space().id(), samples: batch.to_vec() });
        let stamp = Stamp { boot: 1, sequence };
        let batch = Envelope { author, stamp, message, signature: None }.encode();
        // All of it arrives.
        let put = giver.put(keys.key(&Topic::Sample(author)), batch);
        put.congestion_control(CongestionControl::Block).await.unwrap();
    };
    let learned = |robot: &Watched| robot.robot.status().learning.expect("it learns");
    let held = |robot: &Watched| learned(robot).external.iter().sum::<usize>();
    let mut batches = (1..).zip(all.chunks(MAX_SAMPLES));
    for (sequence, batch) in batches.by_ref().take(30) {
        put(sequence, batch).await;
    }
    let deadline = tokio::time::Instant::now() + PATIENCE;
    while held(&busy) < 30 * MAX_SAMPLES {
        assert!(tokio::time::Instant::now() < deadline, "the samples arrive");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let (opened, before, held_before) = (tokio::time::Instant::now(), learned(&busy).trainings, held(&busy));
    busy.robot.open_round();
    let feeding = async {
        for (sequence, batch) in batches {
            put(sequence, batch).await;
            tokio::time::sleep(Duration::from_millis(30)).await;
        }
        std::future::pending().await
    };
    let decision = tokio::select! {
        decision = busy.decision(1, PATIENCE) => decision.expect("a decision"),
        () = feeding => unreachable!("it never ends"),
    };
    let (after, held_after) = (opened.elapsed(), held(&busy));
    assert_eq!(decision.class, Some(ClassId(4)));
    assert!(held_after > held_before, "samples came in the midst of the round");
    while learned(&busy).trainings == before {
        assert!(tokio::time::Instant::now() < deadline, "it trains on them");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    eprintln!("decided after {after:?}, while training on {held_before} to {held_after} samples");
    giver.close().await.unwrap();
    sees.stop().await;
    busy.stop().await;
}
