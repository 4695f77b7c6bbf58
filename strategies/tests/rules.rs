//! What the rules of selection and forgetting pick.

mod operations;
mod plain;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use gestalt_protocol::{ClassId, RobotId};
use gestalt_strategies::{
    Classify, ClassifyError, Forgetting, ForgettingRule, HeldSample, HeldSamples, SampleReceipt, Selection,
    SelectionRule, SetChange, TrainingSet, Vocabulary,
};
use operations::{ME, Operation, Store, as_is, generator, id, operations, round, rules, run, set};
use plain::{PlainForgetting, PlainSelection};
use proptest::prelude::*;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn the_rules_pick_what_their_formulas_say(
        operations in operations(120), capacity in 1..40_usize, rules in rules(), seed: u64
    ) {
        let plain = || {
            TrainingSet::new(ME, capacity, Box::new(PlainSelection(rules.0)), Box::new(PlainForgetting::new(rules.1)))
        };
        let (mut fast, mut plainly) = (set(capacity, rules.0, rules.1), plain());
        let (mut rng, mut same_rng) = (generator(seed), generator(seed));
        let mut store = Store::default();
        for operation in &operations {
            if let Operation::Restart = operation {
                (fast, plainly) = (set(capacity, rules.0, rules.1), plain());
                store.restore_into(&mut fast);
                store.restore_into(&mut plainly);
            }
            let (changes, _) = run(&mut fast, operation, &mut rng);
            prop_assert_eq!(&changes, &run(&mut plainly, operation, &mut same_rng).0);
            store.apply(&fast, &changes);
        }
        prop_assert_eq!(rng, same_rng);
    }
}

/// Own samples of one class at these places of a line, then common ones.
fn line(set: &mut TrainingSet, personal: &[f32], common: &[f32]) {
    let mut rng = generator(1);
    for place in personal {
        set.keep(ClassId(0), round(1), vec![*place], &mut rng);
    }
    for (number, place) in (1..).zip(common) {
        set.receive(id(9, number), ClassId(0), round(1), vec![*place], &mut rng);
    }
}

#[test]
fn on_a_line_the_choices_can_be_read_off() {
    use SelectionRule::{Herding, KCenter, Margin, Novelty, Representativity};
    // The mean of the personal ones is 3.
    let personal = [-1.0, 0.0, 2.5, 4.5, 9.0];
    for (rule, common, expected) in [
        (Representativity, &[][..], &[2.5, 4.5, 0.0][..]),
        (Representativity, &[2.0, 10.0], &[2.5, 4.5]),
        // Without common knowledge the most representative, then the farthest from it and from what followed.
        (Novelty, &[], &[2.5, 9.0, -1.0]),
        (KCenter, &[], &[2.5, 9.0, -1.0]),
        (Novelty, &[8.0, 2.0], &[-1.0, 4.5]),
        // The second is nearest to 2 · 3 − 2.5, the third to 3 · 3 − 7.
        (Herding, &[8.0], &[2.5, 4.5, 0.0]),
        // The judge's classes lie at −1 and 1; the third is as far from both.
        (Margin, &[], &[0.0]),
    ] {
        let mut set = set(100, rule, ForgettingRule::Fifo);
        line(&mut set, &personal, common);
        let judge = Line(Vocabulary::new(["left", "right"]).unwrap());
        let changes = set.share(expected.len(), Some(&judge), &as_is, &mut generator(2));
        let picked: Vec<f32> = changes
            .iter()
            .map(|change| match change {
                SetChange::Shared(key, _) => set.get(*key).unwrap().vector[0],
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(picked, expected, "{rule} beside {common:?}");
    }
}

/// The farther right, the surer of the right; undecided at 0.
#[derive(Debug)]
struct Line(Vocabulary);

impl Classify for Line {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let right = 1.0 / (1.0 + f64::from(-features[0]).exp());
        Ok(vec![1.0 - right, right])
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        self.probabilities(coordinates).ok()
    }
}

#[test]
fn on_a_line_what_goes_can_be_read_off() {
    use ForgettingRule::{Fifo, Herding, Redundancy, Representativity};
    for (rule, expected) in [
        (Fifo, &[0.0][..]),
        (Redundancy, &[4.0, 4.5]),
        // The mean is 3.7.
        (Representativity, &[10.0]),
        // Without 4 the mean of the others stays nearest to what it was.
        (Herding, &[4.0]),
    ] {
        let mut gone = BTreeSet::new();
        for seed in 0..20 {
            let mut set = set(4, SelectionRule::Random, rule);
            line(&mut set, &[0.0, 4.0, 10.0], &[4.5]);
            let changes = set.keep(ClassId(0), round(2), vec![-1.0], &mut generator(seed));
            let [_, SetChange::Removed(victim)] = &changes[..] else { panic!("{changes:?}") };
            gone.insert(victim.vector[0].to_string());
        }
        let expected: BTreeSet<String> = expected.iter().map(f32::to_string).collect();
        assert_eq!(gone, expected, "{rule}");
    }
}

#[test]
fn fast_and_plain_pick_the_same_among_many() {
    let runs = SelectionRule::ALL
        .map(|rule| (rule, ForgettingRule::Random))
        .into_iter()
        .chain(ForgettingRule::ALL.map(|rule| (SelectionRule::Random, rule)));
    for rules in runs {
        let changes = |mut set: TrainingSet| {
            let mut rng = generator(3);
            let mut changes = Vec::new();
            for number in 1..=700 {
                let vector = |rng: &mut ChaCha8Rng| (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
                let class = ClassId(number % 2);
                let (own, other) = (vector(&mut rng), vector(&mut rng));
                changes.extend(set.keep(class, round(number), own, &mut rng));
                match set.receive(id(1, number), class, round(number), other, &mut rng) {
                    SampleReceipt::New(more) => changes.extend(more),
                    other => panic!("a new sample is new: {other:?}"),
                }
                if number.is_multiple_of(50) {
                    changes.extend(set.share(3, None, &as_is, &mut rng));
                }
            }
            changes
        };
        let plain: (Box<dyn Selection>, Box<dyn Forgetting>) =
            (Box::new(PlainSelection(rules.0)), Box::new(PlainForgetting::new(rules.1)));
        let found = changes(set(1380, rules.0, rules.1));
        assert!(found == changes(TrainingSet::new(ME, 1380, plain.0, plain.1)), "{rules:?}");
        assert_eq!(found.iter().filter(|change| matches!(change, SetChange::Shared(..))).count(), 42);
    }
}

/// A rule that notes how long what it keeps is when it is written down.
#[derive(Debug)]
struct Weighed<T>(T, Arc<AtomicUsize>);

impl<T: std::fmt::Debug> Weighed<T> {
    fn weigh(&self) {
        self.1.store(format!("{:?}", self.0).len(), Ordering::Relaxed);
    }
}

impl Forgetting for Weighed<Box<dyn Forgetting>> {
    fn inserted(&mut self, sample: &HeldSample) {
        self.0.inserted(sample);
    }

    fn removed(&mut self, sample: &HeldSample) {
        self.0.removed(sample);
        self.weigh();
    }

    fn forgotten(&mut self, sample: &HeldSample) {
        self.0.forgotten(sample);
        self.weigh();
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        self.0.victim(samples, rng)
    }
}

impl Selection for Weighed<Box<dyn Selection>> {
    fn inserted(&mut self, sample: &HeldSample) {
        self.0.inserted(sample);
    }

    fn removed(&mut self, sample: &HeldSample) {
        self.0.removed(sample);
        self.weigh();
    }

    fn select(
        &mut self,
        samples: &HeldSamples,
        classifier: Option<&dyn Classify>,
        rng: &mut dyn Rng,
    ) -> Option<u64> {
        self.0.select(samples, classifier, rng)
    }
}

#[test]
fn of_classes_of_which_no_sample_is_left_nothing_is_kept() {
    let runs = SelectionRule::ALL.map(|rule| (rule, ForgettingRule::Fifo)).into_iter();
    for (selection, forgetting) in runs.chain(ForgettingRule::ALL.map(|rule| (SelectionRule::Random, rule))) {
        let [selects, forgets] = [(); 2].map(|()| Arc::<AtomicUsize>::default());
        let rules: (Box<dyn Selection>, Box<dyn Forgetting>) = (
            Box::new(Weighed(selection.build(), selects.clone())),
            Box::new(Weighed(forgetting.build(), forgets.clone())),
        );
        let mut set = TrainingSet::new(ME, 12, rules.0, rules.1);
        let mut rng = generator(5);
        let weight = || selects.load(Ordering::Relaxed) + forgets.load(Ordering::Relaxed);
        let mut early = 0;
        for number in 1..=2000 {
            // Somebody makes up a class for every three samples; one is shown here.
            let class = ClassId((1 << 30) + number / 3);
            set.receive(id(1, number), class, round(number), vec![1.0], &mut rng);
            set.keep(class, round(number), vec![2.0], &mut rng);
            if number.is_multiple_of(10) {
                set.share(1, None, &as_is, &mut rng);
            }
            if number == 200 {
                early = weight();
            }
        }
        assert!(weight() < early + early / 2 + 200, "{selection} {forgetting}: {early} became {}", weight());
    }
}

/// How often each of the samples of a stream is held at its end, as a part of the runs.
fn survival(rule: ForgettingRule, capacity: usize, stream: &[u8], runs: u64) -> Vec<f64> {
    let mut held = vec![0.0; stream.len()];
    for seed in 0..runs {
        let mut rng = generator(seed);
        let mut set = set(capacity, SelectionRule::Random, rule);
        for (i, class) in stream.iter().enumerate() {
            set.keep(ClassId((*class).into()), round(1), vec![i as f32], &mut rng);
        }
        for sample in set.iter() {
            held[sample.vector[0] as usize] += 1.0 / runs as f64;
        }
    }
    held
}

#[test]
fn a_reservoir_holds_every_sample_of_the_stream_with_the_same_probability() {
    let stream = [0; 40];
    let held = survival(ForgettingRule::Reservoir, 10, &stream, 4000);
    // The standard deviation of a part of 4,000 runs is .007.
    assert!(held.iter().all(|part| (part - 0.25).abs() < 0.035), "{held:?}");
}

#[test]
fn a_class_balanced_reservoir_keeps_small_classes_whole_and_samples_large_ones_evenly() {
    // Class 1 comes 4 times among 60 of class 0.
    let stream: Vec<u8> = (0..64).map(|i| u8::from(i % 16 == 15)).collect();
    let held = survival(ForgettingRule::ClassBalancedReservoir, 12, &stream, 4000);
    for (part, class) in held.iter().zip(&stream) {
        let expected = if *class == 1 { 1.0 } else { 8.0 / 60.0 };
        assert!((part - expected).abs() < 0.035, "{held:?}");
    }
}

/// The oldest goes; notes which samples count as never come, and which were forgotten.
#[derive(Debug)]
struct Noting(Arc<Mutex<Vec<(&'static str, u64)>>>);

impl Forgetting for Noting {
    fn removed(&mut self, sample: &HeldSample) {
        self.0.lock().unwrap().push(("removed", sample.key));
    }

    fn forgotten(&mut self, sample: &HeldSample) {
        self.0.lock().unwrap().push(("forgotten", sample.key));
    }

    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        samples.iter().next().map(|sample| sample.key)
    }
}

#[test]
fn a_rule_is_told_what_was_forgotten_in_place_of_its_victim_and_what_counts_as_never_come() {
    let (noted, rng) = (Arc::<Mutex<Vec<_>>>::default(), &mut generator(1));
    let rule = Box::new(Noting(noted.clone()));
    let mut set = TrainingSet::new(ME, 10, SelectionRule::Random.build(), rule);
    set.meet(Arc::new((0..10).map(RobotId).collect()));
    let class = ClassId(0);
    for counter in 1..=3 {
        set.keep(class, round(counter), vec![0.0], rng);
    }
    for author in 1..=8 {
        set.receive(id(author, 1), class, round(9), vec![0.0], rng);
    }
    set.retract(round(1));
    for number in 2..=8 {
        set.receive(id(8, number), class, round(9), vec![0.0], rng);
    }
    // Five of its own stay, so others' went for the first; and of one author there are five at most.
    let (forgotten, removed) = (|key| ("forgotten", key), |key| ("removed", key));
    let expected = [forgotten(4), removed(1), forgotten(5), forgotten(6), forgotten(7)];
    assert_eq!(*noted.lock().unwrap(), [&expected[..], &[11, 12, 13].map(removed)].concat());
}
