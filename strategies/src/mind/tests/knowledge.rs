//! What all know together, whatever is lost or restarted.

use super::*;
use crate::lessons::LessonReceipt;

#[test]
fn what_half_of_a_line_learned_is_known_at_its_end_in_less_than_a_busy_period_a_robot() {
    let mut swarm = Swarm::new(8, config(8, 1.0), 31);
    for class in 0..4 {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    let all: BTreeSet<RobotId> = swarm.minds.iter().map(Mind::me).collect();
    for i in 4..8 {
        swarm.disks[i].clear();
        swarm.minds[i] = swarm.waken(i);
        swarm.input(i, Input::Learned(Arc::new(ByFirst)));
        swarm.input(i, Input::Alive(Arc::new(all.clone())));
    }
    let mut meet = |i: usize, beside: &[u32]| {
        swarm.input(i, Input::Neighbours(beside.iter().copied().map(RobotId).collect()));
    };
    for (i, beside) in [&[2][..], &[1, 3], &[2, 4], &[3], &[6], &[5, 7], &[6, 8], &[7]].iter().enumerate() {
        meet(i, beside);
    }
    swarm.pass(Duration::from_secs(7));
    assert_eq!(swarm.common().len(), 2, "the last four have met nobody who knows anything");
    swarm.input(3, Input::Neighbours([RobotId(3), RobotId(5)].into()));
    swarm.input(4, Input::Neighbours([RobotId(4), RobotId(6)].into()));
    let began = swarm.now;
    while swarm.common().len() > 1 {
        swarm.pass(Duration::from_millis(50));
        assert!(swarm.now < began + Duration::from_secs(20), "{:?}", swarm.common());
    }
    // To four robots that had lost all, at a busy pace of half a second.
    let took = swarm.now - began;
    assert!(took < Duration::from_millis(1000), "{took:?}");
    swarm.check_rest();
}

#[test]
fn whatever_is_lost_all_end_with_the_same_common_knowledge() {
    let mut swarm = Swarm::new(6, config(3, 0.5), 3);
    swarm.loss = 0.5;
    for class in 0..8 {
        let round = swarm.show(class % CLASSES);
        swarm.was(round, class % CLASSES);
    }
    swarm.loss = 0.0;
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.common().len(), 1, "all the same");
    let held: BTreeSet<SampleId> =
        swarm.minds[0].training_set().unwrap().common().filter_map(|s| s.id).collect();
    assert_eq!(held.len(), swarm.said.len(), "all that was shared");
    swarm.check();
}

#[test]
fn a_restarted_robot_has_all_and_shares_nothing_twice() {
    let mut swarm = Swarm::new(3, config(3, 0.5), 4);
    for class in 0..4 {
        let round = swarm.show(class);
        swarm.was(round, class);
        let before = swarm.sizes(1);
        swarm.restart(1);
        assert_eq!(swarm.sizes(1), before);
    }
    swarm.pass(Duration::from_secs(10));
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), swarm.said.len(), "no number twice");
    let vectors: Vec<_> = swarm.said.iter().map(|sample| &sample.vector).collect();
    assert!((1..vectors.len()).all(|i| !vectors[..i].contains(&vectors[i])), "no sample twice");
    assert_eq!(swarm.common().len(), 1);
    swarm.check();
}

/// That every sample has the class that somebody gave its round.
fn check_labels(swarm: &Swarm, told: &BTreeMap<RoundId, ClassId>) {
    for mind in &swarm.minds {
        for sample in mind.training_set().unwrap().iter() {
            assert_eq!(told.get(&sample.round), Some(&sample.class), "of round {}", sample.round);
        }
    }
}

#[test]
fn what_was_said_in_another_life_labels_nothing_whoever_forgot_what_and_whatever_clocks_show() {
    let mut swarm = Swarm::new(3, config(2, 1.0), 11);
    let mut copies = vec![swarm.disks.clone()];
    let mut told = BTreeMap::new();
    let mut shown = BTreeSet::new();
    for life in 0..100 {
        // Other gestures in another order than before, and not all of them are named.
        for showing in 0..2 {
            let class = (life * 5 + life / 6 + 3 * showing) as u32 % CLASSES;
            let round = swarm.show(class);
            assert!(shown.insert(round), "round {round} is another showing's name");
            check_labels(&swarm, &told);
            let before: Vec<_> = swarm.minds.iter().map(|mind| mind.training_set().unwrap().len()).collect();
            if (life + showing) % 3 > 0 {
                told.insert(round, ClassId(class));
                swarm.was(round, class);
                check_labels(&swarm, &told);
                let after = swarm.minds.iter().map(|mind| mind.training_set().unwrap().len());
                assert!(
                    after.zip(before).all(|(after, before)| after > before),
                    "all learned of round {round}"
                );
            }
        }
        copies.push(swarm.disks.clone());
        let old = |swarm: &mut Swarm| copies[swarm.rng.random_range(0..copies.len())].clone();
        match life % 20 {
            3 => swarm.disks[life / 20 % 3].clear(),
            7 => swarm.disks.iter_mut().for_each(BTreeMap::clear),
            11 => swarm.disks[life / 20 % 3] = old(&mut swarm)[life / 20 % 3].clone(),
            // Each from another day.
            15 => (0..3).for_each(|i| swarm.disks[i] = old(&mut swarm)[i].clone()),
            _ => {}
        }
        // Clocks an hour ahead, an hour behind, and at 1970, where the number of a start is drawn.
        let drawn = swarm.rng.random_range(1..1 << 24);
        let right = swarm.started;
        swarm.boot =
            [None, Some(right + 3600), Some(right.saturating_sub(3600).max(1)), Some(drawn)][life / 2 % 4];
        swarm.restart_all();
        check_labels(&swarm, &told);
    }
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), swarm.said.len(), "no number twice");
}

#[test]
fn rounds_are_counted_on_after_all_were_off() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 12);
    let first = swarm.show(1);
    swarm.was(first, 1);
    swarm.restart_all();
    assert_eq!(swarm.show(2).counter, first.counter + 1);
}

/// A swarm whose first three robots open at once, before they hear of each other. Gives the name that the last of them gave the round, and the one that it
/// has since they merged.
fn merged(n: usize, seed: u64) -> (Swarm, RoundId, RoundId) {
    let mut swarm = Swarm::new(n, config(3, 1.0), seed);
    swarm.loss = 1.0;
    (0..3).for_each(|i| swarm.input(i, Input::Open));
    swarm.loss = 0.0;
    let alias = swarm.minds[2].round().unwrap();
    swarm.pass(Duration::from_millis(1200));
    let round = swarm.minds[2].round().unwrap();
    assert_eq!((round.opener, alias.opener), (RobotId(1), RobotId(3)), "they merged");
    (swarm, alias, round)
}

impl Swarm {
    /// The first three robots see something.
    fn look(&mut self) {
        for i in 0..3 {
            let mut features = vec![0.1; 8];
            features[0] += 4.0;
            self.input(i, Input::Observed(Observation { features, quality: 1.0 }));
        }
        self.pass(Duration::from_millis(450));
    }

    fn count(&self, class: u32) -> Vec<usize> {
        let of = |mind: &Mind| mind.training_set().unwrap().class_count(ClassId(class));
        self.minds.iter().map(of).collect()
    }
}

#[test]
fn what_is_said_of_a_round_holds_for_all_its_names() {
    let (mut swarm, alias, round) = merged(3, 13);
    // The word comes before they have seen it often enough, and under one name; its correction comes under another.
    swarm.look();
    swarm.was(alias, 4);
    (0..3).for_each(|_| swarm.look());
    let learned = swarm.count(4);
    assert!(learned.iter().all(|n| *n > 3), "what was seen after the word is labelled too: {learned:?}");
    let at = swarm.was(round, 5);
    assert_eq!(swarm.outcome(at), Outcome::Learned, "of what is held under the other name");
    assert_eq!(swarm.count(4), [0; 3]);
    assert!(swarm.count(5).iter().all(|n| *n > 3));
}

#[test]
fn a_word_that_counts_far_under_one_name_of_a_round_is_corrected_under_another() {
    let (mut swarm, alias, round) = merged(3, 13);
    (0..3).for_each(|_| swarm.look());
    let forged = Lesson {
        round: alias,
        instructor: "eve".parse().unwrap(),
        count: u64::MAX / 2,
        at: 1,
        word: Word::Was(ClassId(5)),
        said: None,
    };
    for i in 0..3 {
        let learning = swarm.minds[i].learning.as_mut().unwrap();
        assert_eq!(learning.hear(&forged), LessonReceipt::New);
    }
    let at = swarm.was(round, 4);
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    assert_eq!(swarm.count(5), [0; 3]);
    assert!(swarm.count(4).iter().all(|n| *n > 0));
}

#[test]
fn a_correction_reaches_what_was_seen_after_the_word_also_where_other_names_of_its_round_are_not_known() {
    for by_alias in [true, false] {
        let (mut swarm, alias, round) = merged(4, 19);
        let spoken_of = if by_alias { alias } else { round };
        swarm.look();
        // While they look still.
        let instruction = Instruction::Was { round: spoken_of, class: Gesture::Class(ClassId(4)) };
        for i in 0..4 {
            let (by, instruction) = ("ada".parse().unwrap(), instruction.clone());
            swarm.input(i, Input::Instructed(Instructed { by, at: 1, instruction, said: None }));
        }
        assert_eq!(swarm.count(4), [3; 4]);
        (0..3).for_each(|_| swarm.look());
        swarm.pass(Duration::from_secs(3));
        let before = swarm.count(4);
        assert!(before[..3].iter().all(|n| *n > 3), "what was seen after the word is labelled: {before:?}");
        // One that starts again, and one that comes now.
        swarm.restart(0);
        swarm.restart_empty(3);
        swarm.pass(Duration::from_secs(10));
        assert_eq!(swarm.count(4)[..3], before[..3]);
        for (class, corrected) in [(5, 4), (3, 5)] {
            swarm.was(spoken_of, class);
            swarm.pass(Duration::from_secs(10));
            let all = swarm.count(class);
            assert_eq!(swarm.count(corrected), [0; 4], "{all:?}");
            assert_eq!(all[0], 9, "all that this one held when it started again");
            swarm.restart_all();
            assert_eq!(swarm.count(class), all);
        }
        swarm.check();
    }
}

#[test]
fn a_robot_that_lost_its_disk_gets_its_own_samples_back_and_goes_on_counting() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 5);
    let round = swarm.show(1);
    swarm.was(round, 1);
    swarm.disks[1].clear();
    swarm.restart(1);
    swarm.pass(Duration::from_secs(6));
    assert_eq!(swarm.sizes(1), [0, 3, 6], "its own are shared ones again");
    let round = swarm.show(2);
    swarm.was(round, 2);
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), swarm.said.len(), "no number twice");
    assert_eq!(swarm.common().len(), 1);
}

/// Shows a gesture to one robot, which nobody hears, and tells it what it was.
fn teach_alone(swarm: &mut Swarm, i: usize, class: u32) {
    swarm.loss = 1.0;
    swarm.input(i, Input::Open);
    let round = swarm.minds[i].round().unwrap();
    for _ in 0..swarm.config.keep {
        let features = (0..8).map(|_| swarm.rng.random::<f32>()).collect();
        swarm.input(i, Input::Observed(Observation { features, quality: 1.0 }));
        swarm.now += swarm.config.spacing;
    }
    let instruction = Instruction::Was { round, class: Gesture::Class(ClassId(class)) };
    let at = swarm.now.as_millis() as u64;
    swarm.input(i, Input::Instructed(Instructed { by: "ada".parse().unwrap(), at, instruction, said: None }));
    swarm.loss = 0.0;
}

#[test]
fn a_robot_that_lost_its_disk_and_is_taught_before_it_meets_another_repeats_no_number() {
    let mut swarm = Swarm::new(3, config(3, 1.0), 14);
    let round = swarm.show(1);
    swarm.was(round, 1);
    assert_eq!(swarm.said.len(), 9);
    swarm.disks[1].clear();
    swarm.loss = 1.0;
    swarm.restart(1);
    teach_alone(&mut swarm, 1, 2);
    assert_eq!(swarm.said.len(), 12, "it shares at once: there is nothing to wait for");
    swarm.pass(Duration::from_secs(20));
    let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
    assert_eq!(ids.len(), 12, "no number twice");
    assert_eq!(swarm.sizes(1), [0, 6, 6], "what it had shared has come back beside what it shares now");
    assert_eq!(swarm.common().len(), 1);
    for mind in &swarm.minds {
        assert_eq!(mind.training_set().unwrap().class_count(ClassId(2)), 3, "all have what was taught anew");
    }
}

#[test]
fn a_robot_that_is_alone_from_the_first_shares_and_whoever_comes_is_given_it() {
    let mut swarm = Swarm::new(2, config(3, 1.0), 15);
    teach_alone(&mut swarm, 0, 4);
    assert_eq!((swarm.sizes(0), swarm.sizes(1)), ([0, 3, 0], [0, 0, 0]));
    swarm.pass(Duration::from_secs(10));
    assert_eq!(swarm.sizes(1), [0, 0, 3]);
}

#[test]
fn a_robot_numbers_from_1_in_each_life() {
    let mut swarm = Swarm::new(1, config(2, 1.0), 16);
    let first = swarm.show(1);
    swarm.was(first, 1);
    swarm.restart(0);
    let second = swarm.show(2);
    swarm.was(second, 2);
    let numbers: Vec<u32> = swarm.said.iter().map(|sample| sample.id.number).collect();
    assert_eq!(numbers, [1, 2, 1, 2]);
    assert_ne!(swarm.said[0].id.life, swarm.said[2].id.life);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Disks are lost, and older copies of them put back; clocks run back to what they showed at any time before.
    #[test]
    fn no_number_is_given_twice_whatever_became_of_disks_and_clocks(
        seed in any::<u64>(),
        lives in prop::collection::vec((0..3_usize, 0..4_u8, any::<prop::sample::Index>()), 1..12),
    ) {
        let mut swarm = Swarm::new(3, config(2, 1.0), seed);
        let mut copies = vec![swarm.disks.clone()];
        for (class, (who, fate, which)) in (0..CLASSES).cycle().zip(lives) {
            // Alone: nobody tells it what it had shared.
            teach_alone(&mut swarm, who, class);
            copies.push(swarm.disks.clone());
            match fate {
                0 => swarm.disks[who].clear(),
                1 => swarm.disks[who] = which.get(&copies)[who].clone(),
                _ => {}
            }
            let now = swarm.now;
            swarm.boot = (fate > 1).then(|| which.index(10) as u32 + 1);
            swarm.loss = 1.0;
            swarm.restart(who);
            swarm.now = now;
            teach_alone(&mut swarm, who, class);
        }
        swarm.pass(Duration::from_secs(60));
        let mut ids: BTreeMap<SampleId, &Vector> = BTreeMap::new();
        for sample in &swarm.said {
            prop_assert!(ids.insert(sample.id, &sample.vector).is_none(), "{} twice", sample.id);
        }
        // Nobody holds another sample under a name than its author gave it.
        for mind in &swarm.minds {
            for sample in mind.training_set().unwrap().common() {
                let id = sample.id.unwrap();
                prop_assert_eq!(Some(&&Vector::F32(sample.vector.to_vec())), ids.get(&id), "{}", id);
            }
        }
    }

    #[test]
    fn under_loss_restarts_and_contradictions_all_end_the_same(
        seed in any::<u64>(),
        events in prop::collection::vec((0..5_u8, 0..4_usize, 0..CLASSES), 1..10),
    ) {
        let mut swarm = Swarm::new(4, LearningConfig { aside: 1000, ..config(2, 0.5) }, seed);
        let mut rounds = vec![swarm.show(0)];
        for (what, who, class) in events {
            swarm.loss = 0.3;
            let round = rounds[who % rounds.len()];
            match what {
                0 => rounds.push(swarm.show(class)),
                1 => swarm.restart(who),
                2 => {
                    swarm.say("ada", Instruction::Retract { round });
                }
                3 => {
                    swarm.say("bob", Instruction::Wrong { round, of: Gesture::Class(ClassId(class)) });
                }
                _ => {
                    swarm.was(round, class);
                }
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(16));
        prop_assert_eq!(swarm.common().len(), 1);
        let digests: Vec<_> = swarm.minds.iter().map(|mind| mind.learning.as_ref().unwrap().digest_under(7)).collect();
        prop_assert!(digests.iter().all(|digest| *digest == digests[0]), "{:?}", digests);
        let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
        prop_assert_eq!(ids.len(), swarm.said.len());
        swarm.check();
    }
}

#[test]
fn what_is_passed_on_is_what_its_author_said() {
    let mut swarm = Swarm::new(3, LearningConfig { precision: Precision::I8, ..config(2, 1.0) }, 18);
    let round = swarm.show(1);
    swarm.was(round, 1);
    // The class is corrected, taken back and given again; a restarted robot sends more exactly; the author is gone.
    swarm.was(round, 4);
    swarm.say("ada", Instruction::Retract { round });
    swarm.was(round, 2);
    swarm.config.precision = Precision::F32;
    swarm.restart(1);
    let learning = swarm.minds[1].learning.as_ref().unwrap();
    let batches = learning.lacking(|_| true, 1 << 20).flat_map(|told| told.batches);
    let told: Vec<SharedSample> = batches.flat_map(|batch| batch.samples.samples).collect();
    assert_eq!(told.len(), 6);
    for sample in told {
        assert!(swarm.said.contains(&sample), "{sample:?}");
    }
    assert_eq!(swarm.minds[1].training_set().unwrap().class_count(ClassId(2)), 6);
}
