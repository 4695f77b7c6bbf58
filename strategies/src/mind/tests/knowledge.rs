//! What all know together, whatever is lost or restarted.

use super::*;

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

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

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
                    swarm.say("bob", Instruction::Wrong { round });
                }
                _ => {
                    swarm.was(round, class);
                }
            }
        }
        swarm.loss = 0.0;
        swarm.pass(Duration::from_secs(16));
        prop_assert_eq!(swarm.common().len(), 1);
        let digests: Vec<_> = swarm.minds.iter().map(|mind| mind.learning.as_ref().unwrap().digest()).collect();
        prop_assert!(digests.iter().all(|digest| *digest == digests[0]), "{:?}", digests);
        let ids: BTreeSet<SampleId> = swarm.said.iter().map(|sample| sample.id).collect();
        prop_assert_eq!(ids.len(), swarm.said.len());
        swarm.check();
    }
}
