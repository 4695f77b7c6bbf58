//! Real robots ask what would teach them most, and no more often than they may.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use gestalt_link::{Client, Heard, LinkConfig, News, RobotConfig};
use gestalt_protocol::{
    Answer, Ask, ClassId, Gesture, Instruction, InstructorId, Outcome, Question, RobotId, RoundId,
};
use gestalt_strategies::Observation;
use gestalt_tests::{
    Watched, agreed, between, config, gesture, learning, short_rounds, start_looking, unique,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tokio::time::Instant;

const PATIENCE: Duration = Duration::from_secs(30);

/// The two gestures between which one lies.
const TWO: ClassId = ClassId(2);
const THREE: ClassId = ClassId(3);

/// Stands for what lies between them.
const BETWEEN: u8 = 99;

/// The least time between two questions here.
const APART: Duration = Duration::from_secs(4);

/// What robot `id` sees: a gesture, or what lies between two.
fn seen(id: u32, shown: u8, rng: &mut ChaCha8Rng) -> Observation {
    match shown {
        BETWEEN => between(id, [TWO, THREE], rng),
        class => gesture(ClassId(class.into()), rng),
    }
}

struct School {
    robots: Vec<Watched>,
    client: Client,
    news: News,
    shown: Arc<AtomicU8>,
    ada: InstructorId,
    asked: Vec<(Instant, Question)>,
}

impl School {
    /// Three robots in a line that know all six gestures.
    async fn in_a_line() -> Self {
        let swarm = unique("asking");
        let shown = Arc::new(AtomicU8::new(0));
        let mut line: Vec<Watched> = Vec::new();
        for id in 0..3 {
            let connect: Vec<String> =
                line.last().map(|before| before.robot.locators()[0].clone()).into_iter().collect();
            let mut learning = learning(3, 1.0, None);
            learning.config.questions.apart = APART;
            let config = RobotConfig {
                mind: short_rounds(),
                learning: Some(learning),
                ..config(id, &swarm, &connect)
            };
            let (shown, mut rng) = (shown.clone(), ChaCha8Rng::seed_from_u64(id.into()));
            let frame = move || seen(id, shown.load(Ordering::Relaxed), &mut rng);
            line.push(start_looking(config, frame).await);
        }
        for robot in &line {
            assert!(robot.sees_alive(2, PATIENCE).await);
        }
        let link = LinkConfig { connect: line[2].robot.locators().to_vec(), ..LinkConfig::default() };
        let client = Client::open(&swarm, &link).await.unwrap();
        let news = client.news().await.unwrap();
        let ada = "ada".parse().unwrap();
        let mut school = Self { robots: line, client, news, shown, ada, asked: Vec::new() };
        // Three times each: of a gesture that was shown once nobody is sure, and what they are to disagree about is which it is.
        for class in (0..18).map(|n| n % 6) {
            let round = school.show(class).await;
            let answer =
                school.say(Instruction::Was { round, class: Gesture::Class(ClassId(class.into())) }).await;
            assert_eq!(answer.outcome, Outcome::Learned);
        }
        assert_eq!(school.asked, [], "what is said unasked is not asked for");
        school
    }

    async fn show(&mut self, shown: u8) -> RoundId {
        self.shown.store(shown, Ordering::Relaxed);
        let before = self.robots[0].robot.status().round.map_or(0, |round| round.counter);
        self.client.instruct(&self.ada, &Instruction::Open).await.unwrap();
        let decision = agreed(&mut self.robots, before + 1, PATIENCE).await;
        self.hear(Duration::from_millis(600)).await;
        decision.round
    }

    async fn say(&self, say: Instruction) -> Answer {
        self.client.teach(&self.ada, &say, PATIENCE).await.unwrap().expect("an answer")
    }

    /// Hears what is asked for so long. Nobody asks while a robot has a round open.
    async fn hear(&mut self, time: Duration) {
        let until = Instant::now() + time;
        while let Ok(heard) = tokio::time::timeout_at(until, self.news.next()).await {
            if let Some(Heard::Asked(question)) = heard {
                for robot in &self.robots {
                    assert!(!robot.robot.status().open, "{question:?} while a round is open");
                }
                self.asked.push((Instant::now(), question));
            }
        }
    }
}

pub async fn robots_that_see_different_gestures_ask_once_and_again_no_sooner_than_they_may() {
    let mut school = School::in_a_line().await;
    let round = school.show(BETWEEN).await;
    school.hear(Duration::from_secs(3)).await;
    let [(_, question)] = &school.asked[..] else { panic!("one question: {:?}", school.asked) };
    let question = question.clone();
    assert_eq!((question.round, question.robot), (round, RobotId(0)), "the spokesrobot asks");
    let Ask::Between { mut classes } = question.ask else { panic!("{question:?}") };
    classes.sort();
    assert_eq!(classes, [TWO, THREE], "{question:?}");
    assert!(question.disagreement > 0.1, "{question:?}");

    // Answered with a label that it names; then taken back.
    let class = Gesture::Label(question.labels[0].clone());
    let answer = school.say(Instruction::Was { round, class }).await;
    assert_eq!((answer.outcome, answer.class), (Outcome::Learned, Some(question.ask.classes()[0])));
    assert!(answer.samples > 0, "{answer:?}");
    let answer = school.say(Instruction::Retract { round }).await;
    assert_eq!((answer.outcome, answer.class, answer.samples), (Outcome::Learned, None, 0));

    // Nobody answers any more. Rounds that look alike are worth alike but for noise, and what is worth less than others may wait;
    // where robots disagree it does not wait longer than twice the rounds that must lie between two questions.
    let after = question.round.counter;
    let mut last = after;
    while school.asked.len() < 2 {
        last = school.show(BETWEEN).await.counter;
        school.hear(Duration::from_millis(1500)).await;
        let since = last - school.asked.last().expect("the first").1.round.counter;
        assert!(since <= 6, "it asks again: {:?}", school.asked);
    }
    assert!(last >= after + 3);
    for pair in school.asked.windows(2) {
        let [(at, first), (then, second)] = pair else { unreachable!() };
        assert!(second.round.counter >= first.round.counter + 3, "{:?}", school.asked);
        // What is said travels for a while.
        assert!(*then - *at >= APART - Duration::from_millis(300), "{:?}", school.asked);
    }
    school.client.close().await;
    for robot in school.robots {
        robot.stop().await;
    }
}
