//! Robots that train on no sample that contradicts what they and the others saw.

use super::*;

const LIAR: RobotId = RobotId(9);

impl Swarm {
    /// A robot that nobody sees in rounds shares what looks like one gesture under the label of a round that showed another.
    fn mislead(&mut self, round: RoundId, class: u32, looks_like: u32, numbers: std::ops::Range<u32>) {
        self.hear_of(LIAR, round, class, looks_like, numbers);
    }

    /// The same of any such robot, whether it is true or not.
    fn hear_of(
        &mut self,
        author: RobotId,
        round: RoundId,
        class: u32,
        looks_like: u32,
        numbers: std::ops::Range<u32>,
    ) {
        let sequence = numbers.start;
        let samples = numbers.map(|number| {
            let mut features: Vec<f32> = (0..8).map(|_| 0.3 + self.rng.random::<f32>() * 0.3).collect();
            features[0] += looks_like as f32;
            let vector = Vector::F32(space().project(&features).unwrap());
            let id = SampleId { author, life: 1, number: number + 1 };
            SharedSample { id, class: ClassId(class), round, vector }
        });
        let message = Message::Samples(Samples { space: space().id(), samples: samples.collect() });
        let stamp = Stamp { boot: 1, sequence };
        for i in 0..self.minds.len() {
            let envelope = Envelope { author, stamp, message: message.clone(), signature: None };
            if self.arrives() {
                self.input(i, Input::Received(envelope));
            }
        }
    }

    /// Of how many of the liar's samples a robot holds, and trains on.
    fn heeded(&self, i: usize) -> Option<(usize, usize)> {
        let heeded = self.minds[i].heeded();
        heeded.iter().find(|of| of.robot == LIAR).map(|of| (of.held, of.trained))
    }
}

fn defended() -> LearningConfig {
    LearningConfig { poison: PoisonDefence::measured(), ..config(3, 1.0) }
}

#[test]
fn who_contradicts_all_others_is_held_and_passed_on_but_not_trained_on() {
    let mut swarm = Swarm::new(4, defended(), 31);
    let mut rounds = Vec::new();
    for class in [1, 4, 1, 4] {
        rounds.push(swarm.show(class));
        swarm.was(rounds[rounds.len() - 1], class);
    }
    swarm.mislead(rounds[0], 1, 4, 0..3);
    swarm.mislead(rounds[1], 4, 1, 3..6);
    swarm.pass(Duration::from_secs(2));
    swarm.restart(1);
    swarm.restart_empty(2);
    swarm.pass(Duration::from_secs(20));
    for i in 0..4 {
        assert_eq!(swarm.heeded(i), Some((6, 0)), "robot {}", i + 1);
        let doubted = swarm.minds[i].learned().unwrap().doubted;
        assert_eq!(doubted.iter().map(|of| of.robot).collect::<Vec<_>>(), [LIAR], "nobody else");
    }
    assert_eq!(swarm.common().len(), 1, "what they know together is the same");
    swarm.check();

    // Where nothing is judged, all is trained on.
    swarm.config.poison = PoisonDefence::default();
    swarm.restart(1);
    assert_eq!(swarm.heeded(1), Some((6, 6)));
    assert!(swarm.minds[1].learned().unwrap().doubted.is_empty());
}

#[test]
fn what_was_left_out_for_its_label_is_trained_on_when_the_label_is_corrected() {
    let mut swarm = Swarm::new(3, defended(), 32);
    for class in [1, 4, 1] {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    // It showed a 4, the instructor says 1 of it, and only the one robot was there.
    let round = RoundId { counter: swarm.minds[0].round().unwrap().counter, opener: LIAR, life: 3 };
    swarm.was(round, 1);
    swarm.mislead(round, 1, 4, 0..3);
    swarm.pass(Duration::from_secs(2));
    assert_eq!(swarm.heeded(0), Some((3, 0)));
    swarm.was(round, 4);
    assert_eq!(swarm.heeded(0), Some((3, 3)));
    swarm.check();
}

#[test]
fn a_lie_older_than_all_that_is_judged_after_a_lesson_stays_left_out_over_a_restart_and_a_correction() {
    let mut swarm = Swarm::new(3, LearningConfig { capacity: 5000, ..defended() }, 33);
    for class in [1, 4, 1, 4] {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    let round = |counter| RoundId { counter, opener: LIAR, life: 3 };
    swarm.mislead(round(1), 1, 4, 0..3);
    for part in 0..44 {
        let (counter, class) = if part % 2 == 0 { (2, 1) } else { (3, 4) };
        swarm.hear_of(RobotId(8), round(counter), class, class, 50 * part..50 * (part + 1));
    }
    assert_eq!(swarm.heeded(0), Some((3, 0)));
    swarm.restart(0);
    assert_eq!(swarm.heeded(0), Some((3, 0)));
    swarm.was(round(1), 2);
    assert_eq!(swarm.heeded(0), Some((3, 0)), "nobody judges it any more");
    swarm.check();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_comes_a_robot_trains_on_what_it_would_if_it_began_anew(
        seed in any::<u64>(), capacity in 4..60_usize, loss in 0.0..0.5_f64,
        events in prop::collection::vec((0..7_u8, 0..4_usize, 0..CLASSES), 1..14),
    ) {
        let mut swarm = Swarm::new(4, LearningConfig { capacity, ..defended() }, seed);
        let mut rounds = vec![swarm.show(0)];
        swarm.was(rounds[0], 0);
        swarm.loss = loss;
        for (place, (what, who, class)) in events.into_iter().enumerate() {
            let round = rounds[who % rounds.len()];
            match what {
                0 => rounds.push(swarm.show(class)),
                1 => swarm.restart(who),
                2 => {
                    swarm.say("ada", Instruction::Retract { round });
                }
                3 => {
                    let label = format!("gesture {}", class % 2);
                    swarm.say("bob", Instruction::New { label, round: Some(round) });
                }
                4 => {
                    let (class, of) = ("gesture 0".to_owned(), Gesture::Class(ClassId(class)));
                    swarm.say("bob", Instruction::Same { class: Gesture::Label(class), of });
                }
                5 => swarm.mislead(round, class, (class + 1) % CLASSES, place as u32 * 8..place as u32 * 8 + 5),
                _ => {
                    swarm.was(round, class);
                }
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(10));
        swarm.check();
    }
}
