//! What is certified of a majority of groups of authors.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{
    Certified, Classifier, Components, FeatureSpace, LearnError, Learner, LearnerOptions, ScalingMethod,
};
use proptest::prelude::*;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: u32 = 3;
const GROUPS: usize = 7;

fn space() -> Arc<FeatureSpace> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows: Vec<[f32; 2]> = (0..60).map(|_| [rng.random(), rng.random()]).collect();
    let rows = rows.iter().map(<[f32; 2]>::as_slice);
    Arc::new(FeatureSpace::fit("plane", rows, ScalingMethod::PerComponent, Components::Count(2), &mut rng))
}

fn learner(groups: usize) -> Learner {
    learner_of(CLASSES, groups)
}

fn learner_of(classes: u32, groups: usize) -> Learner {
    let vocabulary = Vocabulary::new((0..classes).map(|class| class.to_string())).unwrap();
    Learner::new(space(), vocabulary, LearnerOptions { groups, ..Default::default() }).unwrap()
}

/// A sample that lies where its class does, with much noise.
fn honest(rng: &mut ChaCha8Rng) -> (u32, [f32; 2]) {
    let class = rng.random_range(0..CLASSES);
    let angle = class as f32 * std::f32::consts::TAU / CLASSES as f32;
    let mut noise = || rng.random_range(-1.2_f32..1.2);
    (class, [angle.cos() + noise(), angle.sin() + noise()])
}

/// Every group says what it saw, but for those that say whatever they like.
fn taught(seed: u64, lying: &[usize], lies: u64) -> Arc<Classifier> {
    let (mut rng, mut of_lies) = (ChaCha8Rng::seed_from_u64(seed), ChaCha8Rng::seed_from_u64(lies));
    let mut learner = learner(GROUPS);
    for key in 0..4 {
        let (class, vector) = honest(&mut rng);
        learner.insert_of(None, key, ClassId(class), vector.into(), key).unwrap();
    }
    for key in 10..80 {
        let group = key as usize % GROUPS;
        let (mut class, mut vector) = honest(&mut rng);
        if lying.contains(&group) {
            class = of_lies.random_range(0..CLASSES);
            vector = [of_lies.random_range(-3.0..3.0), of_lies.random_range(-3.0..3.0)];
        }
        learner.insert_of(Some(group), key, ClassId(class), vector.into(), key).unwrap();
    }
    learner.learn().unwrap()
}

fn views() -> impl Iterator<Item = [f32; 2]> {
    (-6..=6).flat_map(|x| (-6..=6).map(move |y| [x as f32 / 3.0, y as f32 / 3.0]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_is_certified_against_so_many_liars_stands_whatever_they_say(
        seed in any::<u64>(), lies in any::<u64>(),
        lying in proptest::sample::subsequence((0..GROUPS).collect::<Vec<_>>(), 1..=3),
    ) {
        let (honestly, misled) = (taught(seed, &[], 0), taught(seed, &lying, lies));
        for view in views() {
            let before: Certified = honestly.certified(&view).unwrap();
            let after = misled.certified(&view).unwrap();
            for certain in [before, after].into_iter().filter(|said| said.tolerates >= lying.len()) {
                prop_assert_eq!((before.class, after.class), (certain.class, certain.class), "at {:?}", view);
            }
            let p = misled.probabilities_in_space(&view).unwrap();
            let likeliest = p.iter().copied().fold(0.0, f64::max);
            prop_assert_eq!(p[after.class.index()], likeliest, "what most say is the likeliest");
            prop_assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn unanimous_groups_stand_against_less_than_half_of_them_and_no_more() {
    let taught = |lying: usize| {
        let mut learner = learner(GROUPS);
        for (key, group) in (0..GROUPS).flat_map(|group| [group; 4]).enumerate() {
            let (class, at) = if key % 2 == 0 { (0, -1.0) } else { (1, 1.0) };
            let class = if group < lying { 1 - class } else { class };
            let vector = [at + key as f32 * 1e-3, 0.0].into();
            learner.insert_of(Some(group), key as u64, ClassId(class), vector, key as u64).unwrap();
        }
        learner.learn().unwrap().certified(&[-1.0, 0.0]).unwrap()
    };
    // Of equals the first is said: in its favour, and nobody else's.
    assert_eq!(taught(0), Certified { class: ClassId(0), votes: 7, tolerates: 3 });
    assert_eq!(taught(1), Certified { class: ClassId(0), votes: 6, tolerates: 2 });
    assert_eq!(taught(3), Certified { class: ClassId(0), votes: 4, tolerates: 0 });
    assert_eq!(taught(4), Certified { class: ClassId(1), votes: 4, tolerates: 0 });
    assert_eq!(taught(7), Certified { class: ClassId(1), votes: 7, tolerates: 3 });
}

#[test]
fn a_gesture_that_none_has_met_yet_can_be_taught_by_those_that_lie() {
    let said = |lying: usize| {
        let mut learner = learner_of(6, 4);
        for (key, group) in (0..4_usize).flat_map(|group| [group; 4]).enumerate() {
            let (class, at) = if key % 2 == 0 { (4, -1.0) } else { (5, 1.0) };
            let class = if group < lying && class == 4 { 0 } else { class };
            let vector = [at + key as f32 * 1e-3, 0.0].into();
            learner.insert_of(Some(group), key as u64, ClassId(class), vector, key as u64).unwrap();
        }
        learner.learn().unwrap().certified(&[-1.0, 0.0]).unwrap()
    };
    assert_eq!(said(0), Certified { class: ClassId(4), votes: 4, tolerates: 1 });
    assert_eq!((said(1).class, said(2).class), (ClassId(4), ClassId(0)), "of equals the first is said");
}

#[test]
fn a_sample_changes_its_class_its_group_and_goes_for_all_groups_that_have_it() {
    let mut learner = learner(2);
    let at = |x: f32| Arc::from([x, 0.0]);
    for key in 0..12 {
        let (class, side) = if key % 2 == 0 { (0, -1.0) } else { (1, 1.0) };
        learner.insert_of(None, key, ClassId(class), at(side + key as f32 * 0.01), key).unwrap();
    }
    let said = |learner: &mut Learner, x: f32| learner.learn().unwrap().certified(&[x, 0.0]).unwrap();
    assert_eq!(said(&mut learner, -1.0), Certified { class: ClassId(0), votes: 2, tolerates: 1 });
    for key in 0..12 {
        assert_eq!(learner.relabel(key, ClassId((key as u32 + 1) % 2)), Ok(true));
    }
    assert_eq!(said(&mut learner, -1.0).class, ClassId(1));
    assert_eq!(learner.relabel(12, ClassId(0)), Ok(false));

    learner.insert_of(Some(0), 12, ClassId(2), at(9.0), 12).unwrap();
    learner.insert_of(Some(3), 12, ClassId(2), at(9.0), 12).unwrap();
    assert_eq!(learner.len(), 13, "it is of the second group now, and of no other");
    assert!(learner.remove(12) && !learner.remove(12));
    assert_eq!(learner.len(), 12);
}

#[test]
fn groups_know_gestures_that_were_named_meanwhile() {
    let mut learner = learner(3);
    let named = ClassId::named(&"ana".parse().unwrap(), "circle");
    for (key, class, x) in [(1, ClassId(0), -1.0), (2, named, 1.0)] {
        learner.insert_of(None, key, class, [x, 0.0].into(), key).unwrap();
    }
    let classifier = learner.learn().unwrap();
    assert_eq!(classifier.vocabulary().named(), [named]);
    assert_eq!(
        classifier.certified(&[1.0, 0.0]).unwrap(),
        Certified { class: named, votes: 3, tolerates: 1 }
    );
    assert_eq!(classifier.probabilities_in_space(&[1.0, 0.0]).unwrap().len(), CLASSES as usize + 1);
    learner.remove(2);
    assert!(learner.learn().unwrap().vocabulary().named().is_empty());
}

#[test]
fn a_gesture_that_no_group_was_taught_is_exactly_as_likely_as_unknown_and_never_what_most_say() {
    for taught in 0..=3 {
        let mut learner = learner_of(6, 5);
        for key in 0..60 * u64::from(taught) {
            let class = (key / 5) as u32 % taught;
            let angle = class as f32 * std::f32::consts::TAU / 3.0;
            let vector = [angle.cos() + key as f32 * 1e-3, angle.sin()].into();
            learner.insert_of(Some(key as usize % 5), key, ClassId(class), vector, key / 5).unwrap();
        }
        let classifier = learner.learn().unwrap();
        for view in views().chain([[30.0, -40.0]]) {
            let judged = classifier.judge(&view).unwrap();
            let unknown = judged.unknown.unwrap_or(1.0 / 6.0);
            for untaught in &judged.probabilities[taught as usize..] {
                assert_eq!(untaught.to_bits(), unknown.to_bits(), "{taught} taught, at {view:?}: {judged:?}");
            }
            assert!((judged.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{judged:?}");
            let coordinates = classifier.space().project(&view).unwrap();
            let said = classifier.certified(&coordinates).unwrap();
            assert!(said.class.0 < taught.max(1), "{taught} taught, at {view:?}: {said:?}");
        }
        // Far from all that was taught none of it is likelier than what was not.
        if taught >= 2 {
            let far = classifier.judge(&[30.0, -40.0]).unwrap();
            let unknown = far.unknown.unwrap();
            assert!(far.probabilities.iter().all(|p| *p <= unknown), "{taught} taught: {far:?}");
            let near = classifier.probabilities_in_space(&[1.0, 0.0]).unwrap();
            assert!(near[0] > 2.0 * near[5], "{taught} taught: {near:?}");
        }
    }
}

#[test]
fn one_that_learned_from_all_together_certifies_nothing() {
    let mut learner = learner(0);
    learner.insert_of(Some(4), 1, ClassId(0), [0.0, 0.0].into(), 1).unwrap();
    let classifier = learner.learn().unwrap();
    assert_eq!(classifier.certified(&[0.0, 0.0]), None);
    let of_groups = self::learner(2).learn().unwrap();
    assert_eq!(of_groups.certified(&[0.0]), None, "coordinates of another space");
    let options = LearnerOptions { groups: 1, ..Default::default() };
    assert!(matches!(options.validate(), Err(LearnError::Option(_))));
}
