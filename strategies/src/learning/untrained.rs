//! What a learner has not followed yet: each sample once, as it is now, however often it changed meanwhile.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_svm::{LearnError, Learner};

use super::changes::TrainingChange;

/// What a learner has not followed yet. It trains when it can, and changes may come for days before that: what waits here is bounded by the samples that
/// there are, and those that the learner had last.
#[derive(Clone, Debug, Default)]
pub struct Untrained {
    /// All samples there are to train on, so that training can begin anew,
    all: BTreeMap<u64, Sample>,
    /// those of them that changed since the last time, or went,
    changed: BTreeSet<u64>,
    /// and those that the learner was given, and is to be told of when they go.
    given: BTreeSet<u64>,
    anew: bool,
}

/// What a sample shows, where it lies, of which showing it is, and of which group of authors.
#[derive(Clone, Debug, PartialEq)]
struct Sample {
    class: ClassId,
    vector: Arc<[f32]>,
    showing: u64,
    group: Option<usize>,
}

/// What a learner is to follow now.
#[derive(Clone, Debug, Default)]
pub struct ToTrain {
    anew: bool,
    /// Each sample as it is; `None` for one that is gone.
    samples: Vec<(u64, Option<Sample>)>,
}

impl Untrained {
    /// Takes in a change of the samples.
    pub fn add(&mut self, change: TrainingChange) {
        let key = match change {
            TrainingChange::Insert { key, class, vector, showing, group } => {
                self.all.insert(key, Sample { class, vector, showing, group });
                key
            }
            TrainingChange::Remove(key) => {
                self.all.remove(&key);
                key
            }
            TrainingChange::Relabel { key, class } => {
                if let Some(sample) = self.all.get_mut(&key) {
                    sample.class = class;
                }
                key
            }
        };
        // What came and went meanwhile is no learner's business.
        if self.all.contains_key(&key) || self.given.contains(&key) {
            self.changed.insert(key);
        } else {
            self.changed.remove(&key);
        }
    }

    /// Whether there is nothing to follow.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.changed.is_empty()
    }

    /// What there is to follow, for the learner that is given all of it.
    pub fn take(&mut self) -> ToTrain {
        let mut samples = Vec::with_capacity(self.changed.len());
        for key in std::mem::take(&mut self.changed) {
            let sample = self.all.get(&key).cloned();
            match sample {
                Some(_) => self.given.insert(key),
                None => self.given.remove(&key),
            };
            samples.push((key, sample));
        }
        ToTrain { anew: std::mem::take(&mut self.anew), samples }
    }

    /// All samples are to be followed, by another learner that knows none.
    pub fn begin_anew(&mut self) {
        self.anew = true;
        self.given.clear();
        self.changed = self.all.keys().copied().collect();
    }

    /// There are no samples any more, and another learner.
    pub fn forget(&mut self) {
        self.all.clear();
        self.begin_anew();
    }
}

impl ToTrain {
    /// Whether another learner is to follow it, that knows none of what was before.
    #[must_use]
    pub fn is_anew(&self) -> bool {
        self.anew
    }

    /// Whether there is nothing to follow.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Makes a learner follow it; `failed` is told of each sample that cannot be trained on, of which it then knows nothing.
    ///
    /// Where there are as many gestures as can be told apart, a new one takes the place of one that has no samples any more: so what goes does so first, and
    /// what finds no place leaves its own, maybe to another, and is tried once more.
    pub fn teach(&self, learner: &mut Learner, mut failed: impl FnMut(LearnError)) {
        for (key, _) in self.samples.iter().filter(|(_, sample)| sample.is_none()) {
            learner.remove(*key);
        }
        let there = self.samples.iter().filter_map(|(key, sample)| Some((*key, sample.as_ref()?)));
        let homeless: Vec<_> = there.filter(|(key, sample)| follow(learner, *key, sample).is_err()).collect();
        for (key, _) in &homeless {
            learner.remove(*key);
        }
        for (key, sample) in homeless {
            if let Err(error) = follow(learner, key, sample) {
                failed(error);
            }
        }
    }
}

/// Makes a learner take one sample as it is now.
fn follow(learner: &mut Learner, key: u64, sample: &Sample) -> Result<(), LearnError> {
    let Sample { class, vector, showing, group } = sample;
    // A sample that only changed its class keeps its place, which spares its row of the kernel.
    learner.relabel(key, *class)?;
    learner.insert_of(*group, key, *class, vector.clone(), *showing)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::MAX_CLASSES;
    use gestalt_rounds::{Classify, Vocabulary};
    use gestalt_svm::{Components, FeatureSpace, LearnerOptions, ScalingMethod};
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// What there may be at a time.
    const KEYS: u64 = 6;

    #[derive(Clone, Debug)]
    enum Step {
        Change(TrainingChange),
        Train,
        BeginAnew,
        Forget,
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let insert = (0..KEYS, 0..3_u32, 0..3_u8, 0..2_u64, prop::option::of(0..2_usize));
        let insert = insert.prop_map(|(key, class, at, showing, group)| TrainingChange::Insert {
            key,
            class: ClassId(class),
            vector: [f32::from(at)].into(),
            showing,
            group,
        });
        let relabel = (0..KEYS, 0..3_u32)
            .prop_map(|(key, class)| TrainingChange::Relabel { key, class: ClassId(class) });
        let change = prop_oneof![4 => insert, 2 => relabel, 3 => (0..KEYS).prop_map(TrainingChange::Remove)];
        let step = prop_oneof![
            20 => change.prop_map(Step::Change),
            3 => Just(Step::Train),
            1 => Just(Step::BeginAnew),
            1 => Just(Step::Forget),
        ];
        prop::collection::vec(step, 0..80)
    }

    type Known = BTreeMap<u64, Sample>;

    /// A learner that follows each change as it comes.
    fn follow_at_once(known: &mut Known, change: &TrainingChange) {
        match change.clone() {
            TrainingChange::Insert { key, class, vector, showing, group } => {
                known.insert(key, Sample { class, vector, showing, group });
            }
            TrainingChange::Remove(key) => drop(known.remove(&key)),
            TrainingChange::Relabel { key, class } => {
                if let Some(sample) = known.get_mut(&key) {
                    sample.class = class;
                }
            }
        }
    }

    /// One that follows what has gathered. Who is told that something goes had it.
    fn follow_later(known: &mut Known, to_train: ToTrain) {
        if to_train.anew {
            known.clear();
        }
        for (key, sample) in to_train.samples {
            match sample {
                Some(sample) => drop(known.insert(key, sample)),
                None => assert!(known.remove(&key).is_some(), "it never had {key}"),
            }
        }
    }

    proptest! {
        #[test]
        fn whenever_it_trains_a_learner_knows_what_it_would_by_each_change_and_no_more_waits_than_there_is(
            steps in steps()
        ) {
            let (mut at_once, mut later, mut untrained) = (Known::new(), Known::new(), Untrained::default());
            for step in steps.into_iter().chain([Step::Train]) {
                match step {
                    Step::Change(change) => {
                        follow_at_once(&mut at_once, &change);
                        untrained.add(change);
                    }
                    Step::Train => {
                        follow_later(&mut later, untrained.take());
                        prop_assert_eq!(&later, &at_once);
                        prop_assert!(untrained.is_empty());
                    }
                    Step::BeginAnew => untrained.begin_anew(),
                    Step::Forget => {
                        at_once.clear();
                        untrained.forget();
                    }
                }
                prop_assert!(untrained.changed.len() <= at_once.len() + later.len());
            }
        }
    }

    #[test]
    fn what_comes_and_goes_for_days_while_nobody_trains_leaves_nothing() {
        let mut untrained = Untrained::default();
        let vector: Arc<[f32]> = [0.5].into();
        for key in 0..10_000 {
            let (class, vector) = (ClassId(0), vector.clone());
            untrained.add(TrainingChange::Insert { key, class, vector, showing: key, group: None });
            untrained.add(TrainingChange::Relabel { key, class: ClassId(1) });
            untrained.add(TrainingChange::Remove(key));
        }
        assert!(untrained.is_empty());
        assert_eq!(Arc::strong_count(&vector), 1, "nothing keeps what was forgotten");
    }

    /// Somewhere, for a sample of that gesture.
    fn somewhere(class: u32, rng: &mut ChaCha8Rng) -> Vec<f32> {
        (0..4).map(|k| rng.random::<f32>() + if k == class { 1.5 } else { 0.0 }).collect()
    }

    #[test]
    fn who_trains_once_after_many_changes_judges_as_one_that_trains_at_each() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let rows: Vec<Vec<f32>> = (0..60).map(|n| somewhere(n % 3, &mut rng)).collect();
        let rows = rows.iter().map(Vec::as_slice);
        let (scaled, all) = (ScalingMethod::PerComponent, Components::Count(4));
        let space = Arc::new(FeatureSpace::fit("test", rows, scaled, all, &mut rng));
        let vocabulary = Vocabulary::new(["left", "right", "stop"]).unwrap();
        let options = LearnerOptions { staleness: 0.0, ..LearnerOptions::default() };
        let learner = || Learner::new(space.clone(), vocabulary.clone(), options.clone()).unwrap();
        let (mut at_once, mut later, mut untrained) = (learner(), learner(), Untrained::default());
        let mut last = None;
        for n in 0..240_u64 {
            let (key, class) = (rng.random_range(0..36), rng.random_range(0..3));
            let change = match n % 4 {
                0 => TrainingChange::Remove(key),
                // What it shows lies elsewhere, mostly.
                1 if n % 3 == 0 => TrainingChange::Relabel { key, class: ClassId(class) },
                _ => {
                    let vector = space.project(&somewhere(class, &mut rng)).unwrap().into();
                    TrainingChange::Insert { key, class: ClassId(class), vector, showing: n, group: None }
                }
            };
            change.apply_to(&mut at_once).unwrap();
            last = Some(at_once.learn().unwrap());
            untrained.add(change);
            if n == 70 {
                untrained.take().teach(&mut later, |error| panic!("{error}"));
                later.learn().unwrap();
            }
        }
        untrained.take().teach(&mut later, |error| panic!("{error}"));
        assert_eq!(later.len(), at_once.len());
        let (last, late) = (last.unwrap(), later.learn().unwrap());
        for n in 0..60 {
            let seen = somewhere(n % 3, &mut rng);
            let [last, late] = [&last, &late].map(|by| by.probabilities(&seen).unwrap());
            for (a, b) in last.iter().zip(&late) {
                assert!((a - b).abs() < 0.02, "{last:?} is not {late:?}");
            }
        }
    }

    /// Two samples of each of as many gestures as can be told apart, the first two of which are of the list.
    fn all_there_can_be() -> (Learner, Vec<(u64, Option<Sample>)>) {
        let rows = [[0.0_f32, 0.0], [1.0, 1.0], [0.5, 0.9]];
        let rows = rows.iter().map(<[f32; 2]>::as_slice);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let space =
            FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(2), &mut rng);
        let vocabulary = Vocabulary::new(["left", "right"]).unwrap();
        let learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap();
        let classes = (0..MAX_CLASSES).map(|n| if n < 2 { ClassId(n as u32) } else { named(n) });
        let samples = (10..).zip(classes.flat_map(|class| [class; 2]));
        (learner, samples.map(|(key, class)| (key, shows(class, key))).collect())
    }

    fn named(n: usize) -> ClassId {
        ClassId::named(&"ana".parse().unwrap(), &n.to_string())
    }

    fn shows(class: ClassId, key: u64) -> Option<Sample> {
        Some(Sample { class, vector: [key as f32 / 100.0, 0.5].into(), showing: key, group: None })
    }

    fn failures(learner: &mut Learner, samples: &[(u64, Option<Sample>)]) -> Vec<LearnError> {
        let mut failed = Vec::new();
        ToTrain { anew: false, samples: samples.to_vec() }.teach(learner, |error| failed.push(error));
        failed
    }

    fn of(learner: &mut Learner, class: ClassId) -> u32 {
        let classifier = learner.learn().unwrap();
        classifier.vocabulary().place(class).map_or(0, |place| classifier.learned()[place])
    }

    #[test]
    fn a_new_gesture_takes_the_place_of_one_that_goes_in_whatever_order_their_samples_come() {
        let (mut learner, samples) = all_there_can_be();
        assert!(failures(&mut learner, &samples).is_empty());
        let full = LearnError::Class(named(100));
        assert_eq!(failures(&mut learner, &[(1, shows(named(100), 1))]), vec![full]);
        // One is retired, and another restored whose samples have the smaller keys.
        let last = samples.len() - 1;
        let gone = [(samples[last - 1].0, None), (samples[last].0, None)];
        let restored = [(1, shows(named(100), 1)), (2, shows(named(100), 2))];
        let failed = failures(&mut learner, &[restored.as_slice(), &gone].concat());
        assert_eq!((failed, of(&mut learner, named(100))), (vec![], 2));
        // All samples of one turn out to be of another.
        let corrected = [(1, shows(named(101), 1)), (2, shows(named(101), 2))];
        let failed = failures(&mut learner, &corrected);
        let found = [100, 101].map(|n| of(&mut learner, named(n)));
        assert_eq!((failed, found), (vec![], [0, 2]));
        // What finds no place is trained on no more.
        let failed = failures(&mut learner, &[(1, shows(named(102), 1))]);
        assert_eq!((failed.len(), of(&mut learner, named(101)), learner.len()), (1, 1, 2 * MAX_CLASSES - 1));
    }
}
