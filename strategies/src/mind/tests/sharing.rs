//! How much is shared, and held.

use gestalt_protocol::Signature;
use gestalt_rounds::Sign;

use super::*;
use crate::forgetting::{Forgetting, ForgettingRule};
use crate::sample::HeldSamples;
use crate::selection::Selection;
use crate::training_set::TrainingSet;

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

/// Signs anything.
#[derive(Debug)]
struct Scribe;

impl Sign for Scribe {
    fn sign(&self, _: &[u8]) -> Signature {
        Signature::from_bytes([7; Signature::LENGTH])
    }
}

#[test]
fn bytes_bound_what_a_round_shares_signed_or_not_and_whatever_it_is_called() {
    for (bytes, signs, is_named) in
        (150..200).step_by(7).flat_map(|bytes| [(bytes, false, true), (bytes, true, false)])
    {
        let config = LearningConfig { share_bytes: Some(bytes), ..config(8, 1.0) };
        let mut swarm = Swarm::new(1, config, 10);
        if signs {
            swarm.minds[0] = swarm.waken(0).signed_by(Arc::new(Scribe));
            swarm.introduce(0);
        }
        let round = swarm.show(1);
        let label = if is_named { "circle" } else { "1" };
        swarm.say("ada", Instruction::New { label: label.to_owned(), round: Some(round) });
        let learning = swarm.minds[0].learning.as_ref().unwrap();
        let own: Vec<HeldBatch> = learning.lacking(|_| true, 1 << 20).flat_map(|told| told.batches).collect();
        let length: usize = own.iter().map(|batch| Envelope::from(batch.clone()).encode().len()).sum();
        assert!((bytes as usize - 48..=bytes as usize).contains(&length), "{length} of {bytes} bytes");
        let are_so = own.iter().all(|batch| batch.signature.is_some() == signs);
        assert!(
            are_so && own[0].samples.samples[0].class.is_named() == is_named,
            "or this test is of no use"
        );
    }
}

#[test]
fn what_is_too_little_for_one_sample_is_refused_and_what_is_said_to_be_enough_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let rows: Vec<Vec<f32>> = (0..90).map(|_| (0..80).map(|_| rng.random::<f32>()).collect()).collect();
    let all = rows.iter().map(Vec::as_slice);
    let (method, keep) = (ScalingMethod::PerComponent, Components::Count(80));
    let space = Arc::new(FeatureSpace::fit("wide", all, method, keep, &mut rng));
    for (precision, signs) in Precision::ALL.into_iter().flat_map(|it| [(it, false), (it, true)]) {
        let waken = |share_bytes, share_fraction| {
            let share_bytes = Some(share_bytes);
            let config =
                LearningConfig { precision, share_bytes, share_fraction, ..LearningConfig::default() };
            let setup = LearningSetup {
                config,
                space: space.clone(),
                vocabulary: vocabulary(),
                rng: Box::new(ChaCha8Rng::seed_from_u64(1)),
                memory: None,
                rules: OwnRules::default(),
            };
            let life = Life { boot: 1, nonce: u32::MAX };
            let mind = Mind::new(RobotId(u32::MAX - 1), life, RoundsConfig::default()).unwrap();
            let mind = if signs { mind.signed_by(Arc::new(Scribe)) } else { mind };
            mind.learning(setup)
        };
        let Err(LearningError::ShareBytes { least, .. }) = waken(128, 1.0) else { panic!("{precision:?}") };
        let enough = least as u32;
        let refused = waken(enough - 1, 1.0).map(|_| ()).unwrap_err();
        assert_eq!(refused, LearningError::ShareBytes { given: enough - 1, least });
        assert!(waken(128, 0.0).is_ok(), "nothing is to be shared");
        let mut mind = waken(enough, 1.0).unwrap();
        let now = Duration::from_secs(1);
        mind.handle(now, Input::Learned(Arc::new(ByFirst)));
        mind.handle(now, Input::Open);
        mind.handle(now, Input::Observed(Observation { features: rows[0].clone(), quality: 1.0 }));
        let (round, class) = (mind.round().unwrap(), Gesture::Class(ClassId(1)));
        let instruction = Instruction::Was { round, class };
        let told = Instructed { by: "ada".parse().unwrap(), at: 1, instruction, said: None };
        let out = mind.handle(now, Input::Instructed(told));
        let lengths = out.iter().filter_map(|out| match out {
            Output::Broadcast(said) if kind(&said.message) == "samples" => Some(said.encode().len()),
            _ => None,
        });
        let lengths: Vec<usize> = lengths.collect();
        assert!(lengths.len() == 1 && lengths[0] <= least, "{precision:?}: {lengths:?} of {least}");
    }
}

#[test]
fn what_one_round_may_share_it_shares_once_however_many_words_come_in_it() {
    for (samples, bytes) in [(Some(2), None), (None, Some(128))] {
        let config = LearningConfig { share_samples: samples, share_bytes: bytes, ..config(8, 1.0) };
        let mut swarm = Swarm::new(2, config, 11);
        let rounds = [swarm.show(1), swarm.show(2)];
        swarm.was(rounds[0], 1);
        let once = swarm.sizes(0)[1];
        assert!((1..8).contains(&once), "{once}");
        swarm.was(rounds[1], 2);
        assert_eq!(swarm.sizes(0)[1], once);
        let round = swarm.show(3);
        swarm.was(round, 3);
        assert_eq!(swarm.sizes(0)[1], 2 * once, "the next has its own");
    }
}

#[test]
fn names_without_robots_take_nothing_of_what_a_swarm_shares_once_a_round_has_passed() {
    let mut swarm = Swarm::new(3, LearningConfig { share_per_round: Some(12), ..config(4, 1.0) }, 12);
    for i in 0..3 {
        swarm.input(i, Input::Alive(Arc::new((1..=40).map(RobotId).collect())));
    }
    let robots = |swarm: &Swarm| {
        let sets = swarm.minds.iter().filter_map(Mind::training_set);
        sets.map(TrainingSet::robots).collect::<Vec<_>>()
    };
    assert_eq!(robots(&swarm), vec![40; 3]);
    // Of forty three decide nothing: the first round lasts until its deadline.
    swarm.show(1);
    swarm.show(1);
    let round = swarm.show(2);
    assert_eq!(robots(&swarm), vec![3; 3]);
    swarm.was(round, 2);
    assert_eq!(swarm.sizes(0), [0, 4, 8]);
    let vote = Vote {
        round,
        vocabulary: VocabularyId::NONE,
        evidence: vec![],
        looks: 0.0,
        unknown: None,
        named: vec![],
    };
    let stamp = Stamp { boot: 1, sequence: 1 };
    let said = Envelope { author: RobotId(40), stamp, message: Message::Vote(vote), signature: None };
    swarm.input(0, Input::Received(said));
    assert_eq!(robots(&swarm), [4, 3, 3], "one of them speaks");
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
fn a_robot_that_starts_with_less_room_holds_and_remembers_no_more_than_that() {
    for rule in ForgettingRule::ALL {
        let mut swarm = Swarm::new(2, LearningConfig { forgetting: rule, ..config(4, 0.5) }, 18);
        for class in 0..CLASSES {
            let round = swarm.show(class);
            swarm.was(round, class);
        }
        let round = swarm.show(3);
        swarm.say("ada", Instruction::Wrong { round, of: Gesture::Class(ClassId(3)) });
        let held = |swarm: &Swarm| {
            let [held, aside] = [2, 5].map(|kind| swarm.disks[0].keys().filter(|key| key[0] == kind).count());
            let known = (swarm.sizes(0).iter().sum::<usize>(), swarm.minds[0].learned().unwrap().aside);
            assert_eq!((held, aside), known, "{rule}: the disk holds the same");
            known
        };
        assert_eq!(held(&swarm), (36, 4));
        swarm.config = LearningConfig { capacity: 7, aside: 3, ..swarm.config.clone() };
        swarm.restart(0);
        assert_eq!(held(&swarm), (7, 3), "{rule}");
        swarm.check();
        swarm.config = LearningConfig { aside: 0, ..swarm.config.clone() };
        swarm.restart(0);
        assert_eq!(held(&swarm), (7, 0), "{rule}");
        swarm.check();
    }
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
