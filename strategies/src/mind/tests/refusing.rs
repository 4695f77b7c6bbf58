//! What is not taken in.

use super::*;

#[test]
fn a_sample_that_is_none_is_refused_and_counted() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 11);
    let space = space().id();
    let sample = |number, class, vector| SharedSample {
        id: SampleId { author: RobotId(9), life: 5, number },
        class: ClassId(class),
        round: RoundId { counter: 1, opener: RobotId(9), life: 0 },
        vector,
    };
    let sound = Vector::F32(vec![0.5; 4]);
    for (space, sample, refusal) in [
        (FeatureSpaceId(1), sample(1, 1, sound.clone()), Refusal::OtherSpace),
        (space, sample(1, 1, Vector::F32(vec![0.5; 3])), Refusal::BadVector),
        (space, sample(1, 1, Vector::I8(vec![1; 5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F32(vec![0.5, f32::NAN, 0.5, 0.5])), Refusal::BadVector),
        (space, sample(1, 1, Vector::F16(vec![0, 0x7c, 0, 0, 0, 0, 0, 0])), Refusal::BadVector),
        (space, sample(1, CLASSES, sound.clone()), Refusal::UnknownClass),
        (space, sample(u32::MAX, 1, sound.clone()), Refusal::SampleNumber),
    ] {
        let before = swarm.minds[0].refusals().count(refusal);
        let message = Message::Samples(Samples { space, samples: vec![sample] });
        let stamp = Stamp { boot: 1, sequence: 1 };
        swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
        assert_eq!(swarm.minds[0].refusals().count(refusal), before + 1, "{refusal:?}");
        assert_eq!(swarm.sizes(0), [0, 0, 0]);
    }
    let message = Message::Samples(Samples { space, samples: vec![sample(1, 1, sound)] });
    let stamp = Stamp { boot: 1, sequence: 2 };
    swarm.input(0, Input::Received(Envelope { author: RobotId(9), stamp, message }));
    assert_eq!(swarm.sizes(0), [0, 0, 1], "a sound one is taken");
    swarm.check();
}

#[test]
fn a_memory_of_another_robot_or_space_is_refused() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 12);
    let round = swarm.show(1);
    swarm.was(round, 1);
    let records = swarm.disks[0].iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
    let memory = RobotMemory::read(records).unwrap();
    let setup = |space: Arc<FeatureSpace>, vocabulary| LearningSetup {
        config: config(2, 1.0),
        space,
        vocabulary,
        rng: Box::new(ChaCha8Rng::seed_from_u64(1)),
        memory: Some(memory.clone()),
        rules: OwnRules::default(),
    };
    let new = |me, setup| Learning::new(RobotId(me), 1, setup).map(|_| ());
    assert_eq!(new(1, setup(space(), vocabulary())), Ok(()));
    let robot = new(2, setup(space(), vocabulary())).unwrap_err();
    assert!(matches!(robot, LearningError::Memory(MemoryError::Robot { .. })));
    let other = Vocabulary::new(["a", "b", "c", "d", "e", "f"]).unwrap();
    let vocabulary_error = new(1, setup(space(), other)).unwrap_err();
    assert_eq!(vocabulary_error, LearningError::Memory(MemoryError::Vocabulary));
    let rows = [[0.0_f32; 8], [1.0; 8]];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = rows.iter().map(<[f32; 8]>::as_slice);
    let other = FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(1), &mut rng);
    let space_error = new(1, setup(Arc::new(other), vocabulary())).unwrap_err();
    assert!(matches!(space_error, LearningError::Memory(MemoryError::Space { .. })));
}
