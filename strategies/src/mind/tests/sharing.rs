//! How much is shared, and held.

use super::*;
use crate::forgetting::Forgetting;
use crate::sample::HeldSamples;
use crate::selection::Selection;

#[test]
fn ten_robots_hold_what_the_source_says() {
    let mut swarm = Swarm::new(10, config(5, 0.2), 1);
    for class in 0..CLASSES {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    for i in 0..10 {
        assert_eq!(swarm.sizes(i), [24, 6, 54], "robot {}", i + 1);
    }
    assert_eq!(swarm.common().len(), 1);
    swarm.check();
}

#[test]
fn the_size_follows_the_formula() {
    for (n, fraction) in [(5, 0.0), (5, 0.1), (5, 0.5), (5, 1.0), (20, 0.1)] {
        let mut swarm = Swarm::new(n, config(5, fraction), 2);
        for class in 0..CLASSES {
            let round = swarm.show(class);
            swarm.was(round, class);
        }
        let own = f64::from(CLASSES) * 5.0;
        let expected = own + fraction * own * (n as f64 - 1.0);
        for i in 0..n {
            assert_eq!(swarm.sizes(i).iter().sum::<usize>() as f64, expected, "{n} robots, B = {fraction}");
        }
    }
}

#[test]
fn what_is_taken_back_and_said_again_is_not_newly_acquired() {
    let mut swarm = Swarm::new(2, config(5, 0.2), 12);
    let round = swarm.show(1);
    // What was open until it was said is.
    swarm.say("ada", Instruction::Wrong { round, of: Gesture::Class(ClassId(2)) });
    swarm.pass(Duration::from_secs(1));
    swarm.was(round, 1);
    swarm.pass(Duration::from_secs(1));
    for class in 0..10 {
        assert_eq!(swarm.sizes(0), [4, 1, 1]);
        swarm.say("ada", Instruction::Retract { round });
        swarm.pass(Duration::from_secs(1));
        assert_eq!(swarm.sizes(0), [0, 0, 0]);
        swarm.was(round, class % CLASSES);
        swarm.pass(Duration::from_secs(1));
    }
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.pass(Duration::from_secs(1));
    assert_eq!(swarm.sizes(0), [8, 2, 2], "nor is anything owed");
    swarm.check();
}

#[test]
fn bytes_bound_what_a_round_shares() {
    let mut swarm = Swarm::new(2, LearningConfig { share_bytes: Some(128), ..config(8, 1.0) }, 10);
    let round = swarm.show(1);
    swarm.was(round, 1);
    for mind in &swarm.minds {
        let learning = mind.learning.as_ref().unwrap();
        let own: Vec<HeldBatch> =
            learning.lacking(|id| id.author == mind.me(), 1 << 20).flat_map(|told| told.batches).collect();
        let length = Envelope::from(own[0].clone()).encode().len();
        assert_eq!(own.len(), 1);
        assert!((80..=128).contains(&length), "{length} bytes");
    }
}

#[test]
fn a_swarm_keeps_to_its_budget_of_a_round_and_a_small_one_notices_nothing_of_it() {
    let shared = |budget| {
        let mut swarm = Swarm::new(10, LearningConfig { share_per_round: budget, ..config(5, 1.0) }, 3);
        let mut of_rounds = Vec::new();
        for class in 0..CLASSES {
            let before: usize = (0..10).map(|i| swarm.sizes(i)[1]).sum();
            let round = swarm.show(class);
            swarm.was(round, class);
            of_rounds.push((0..10).map(|i| swarm.sizes(i)[1]).sum::<usize>() - before);
        }
        swarm.check();
        of_rounds
    };
    assert_eq!(shared(None), [50; 6]);
    assert_eq!(shared(Some(50)), [50; 6]);
    assert_eq!(shared(Some(20)), [20; 6], "two of each");
    assert_eq!(shared(Some(0)), [0; 6]);
    // Four of the robots have their turn, about; and not always the same number of them.
    let by_lot = shared(Some(4));
    assert!((10..=40).contains(&by_lot.iter().sum::<usize>()), "{by_lot:?}");
    assert!(by_lot.iter().any(|of_round| *of_round != by_lot[0]), "{by_lot:?}");
}

/// Shares what was seen last, and nothing of class 3.
#[derive(Debug)]
struct Newest;

impl Selection for Newest {
    fn select(
        &mut self,
        samples: &HeldSamples,
        _: Option<&dyn Classify>,
        _: &mut dyn rand::Rng,
    ) -> Option<u64> {
        let classes = samples.classes().filter(|class| *class != ClassId(3));
        classes.filter_map(|class| samples.part_keys(SetPart::Personal, class).last().copied()).max()
    }
}

/// Keeps what came first, and the newest.
#[derive(Debug)]
struct FirstImpression;

impl Forgetting for FirstImpression {
    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn rand::Rng) -> Option<u64> {
        samples.iter().rev().nth(1).map(|sample| sample.key)
    }
}

#[test]
fn rules_of_ones_own_choose_what_is_shared_and_what_goes() {
    let rules = OwnRules::default().selection(|| Box::new(Newest)).forgetting(|| Box::new(FirstImpression));
    let config = LearningConfig { capacity: 4, ..config(3, 0.5) };
    let mut swarm = Swarm::with_rules(2, config, rules, 17);
    for class in [3, 1, 2] {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    assert!(!swarm.said.is_empty() && swarm.said.iter().all(|sample| sample.class != ClassId(3)));
    for mind in &swarm.minds {
        let set = mind.training_set().unwrap();
        assert_eq!((set.len(), set.class_count(ClassId(3))), (4, 3), "what came first is kept");
    }
    swarm.check();
}

#[test]
fn what_waits_for_a_disk_that_fails_is_bounded() {
    let swarm = &mut Swarm::new(1, config(1, 1.0), 19);
    let mind = &mut swarm.minds[0];
    let mut shared = 0;
    for second in 1..300 {
        // Nobody says what was remembered.
        let now = Duration::from_secs(10 * second);
        mind.handle(now, Input::Open);
        let features = (0..8).map(|i| (second * i % 17) as f32 * 0.05).collect();
        mind.handle(now, Input::Observed(Observation { features, quality: 1.0 }));
        let round = mind.round().unwrap();
        let instruction = Instruction::Was { round, class: Gesture::Class(ClassId(1)) };
        let told = Instructed { by: "ada".parse().unwrap(), at: second, instruction, said: None };
        let out = mind.handle(now, Input::Instructed(told));
        shared += out
            .iter()
            .filter(|out| matches!(out, Output::Broadcast(e) if kind(&e.message) == "samples"))
            .count();
        mind.handle(now + Duration::from_secs(8), Input::Tick);
    }
    assert_eq!(shared, 0, "nothing is sent that a kill would forget");
    let set = mind.training_set().unwrap();
    let [personal, sent] = [SetPart::Personal, SetPart::Shared].map(|part| set.total(part));
    assert!(sent == 64 && personal > 50, "{personal} wait as personal, {sent} for the disk");
}
