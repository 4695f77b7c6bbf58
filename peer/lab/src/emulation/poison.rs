//! What robots share that want others to learn wrongly: a strategy, and the sample that it makes of a true one.

use gestalt_protocol::{ClassId, RoundId};
use gestalt_strategies::sample::{HeldSample, HeldSamples, draw};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// A poisoner takes part as every robot does, looks, learns and votes in earnest, but shares other samples than it saw. It knows
/// all that was ever shared, and speaks of rounds that were taught alone: what an instructor said of a round is the label of
/// all samples of it, so a false label is a vector told of a round in which another gesture was shown.
///
/// The first seven after `silent` are listed in the literature on poisoned training; the others were made up to try a defence on
/// what it was not made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Poison {
    /// Shares nothing: what the harm of the others is measured against.
    Silent,
    /// Any label but the true one.
    RandomLabel,
    /// One and the same label, whatever was seen.
    FixedLabel,
    /// The label of the next gesture.
    PairFlip,
    /// The right label, on vectors just beyond half-way to the nearest sample of another gesture.
    NearBoundary,
    /// One vector again and again, under the label of the next gesture, four times as often as an honest robot shares.
    Duplicates,
    /// The right label, on vectors shifted by most of the way between the centres of this gesture and the next.
    ShiftedCentre,
    /// In earnest for the first ten showings; then the label of the next gesture.
    SlowPoison,
    /// What honest robots shared, vector by vector, under the label of the next gesture.
    Copycat,
    /// The label of the next gesture on one sample of three, the truth on the others.
    Sparing,
    /// All liars together against one gesture: its vectors, under the label of the next.
    Siege,
    /// The label of the next gesture, on eight times as many samples as an honest robot shares.
    Flood,
    /// Vectors beside those that honest robots shared last, hardly apart from them, under the label of whichever other gesture
    /// lies nearest.
    Shadow,
}

impl Poison {
    /// All strategies but silence.
    pub const ALL: [Self; 12] = [
        Self::RandomLabel,
        Self::FixedLabel,
        Self::PairFlip,
        Self::NearBoundary,
        Self::Duplicates,
        Self::ShiftedCentre,
        Self::SlowPoison,
        Self::Copycat,
        Self::Sparing,
        Self::Siege,
        Self::Flood,
        Self::Shadow,
    ];

    /// How many samples it shares for each that an honest robot would.
    #[must_use]
    pub fn rate(self) -> u32 {
        match self {
            Self::Duplicates => 4,
            Self::Flood => 8,
            _ => 1,
        }
    }

    /// What becomes of a true sample: the vector, and the gesture that it is to be taken for; `None` where it stays true.
    /// `known` is all that the poisoner holds, `showings` how many gestures were shown so far.
    #[must_use]
    pub fn of(
        self,
        truth: &HeldSample,
        known: &HeldSamples,
        (classes, showings): (usize, u32),
        rng: &mut dyn Rng,
    ) -> Option<(Vec<f32>, ClassId)> {
        let next = |class: ClassId| ClassId(((class.index() + 1) % classes) as u32);
        let own = || truth.vector.to_vec();
        match self {
            Self::Silent => None,
            Self::RandomLabel => {
                let step = rng.random_range(1..classes as u64) as usize;
                Some((own(), ClassId(((truth.class.index() + step) % classes) as u32)))
            }
            Self::FixedLabel => Some((own(), ClassId(0))),
            Self::PairFlip | Self::Flood => Some((own(), next(truth.class))),
            Self::SlowPoison => (showings > 10).then(|| (own(), next(truth.class))),
            Self::Sparing => {
                let lies = rng.random_range(0..3_u64) == 0;
                lies.then(|| (own(), next(truth.class)))
            }
            Self::NearBoundary => {
                let others = known.iter().filter(|sample| sample.class != truth.class);
                let nearest = others
                    .min_by(|a, b| apart(a, truth).total_cmp(&apart(b, truth)).then(a.key.cmp(&b.key)))?;
                Some((between(&truth.vector, &nearest.vector, 0.55), truth.class))
            }
            Self::Duplicates => {
                let first = known.iter().next().unwrap_or(truth);
                Some((first.vector.to_vec(), next(first.class)))
            }
            Self::ShiftedCentre => {
                let [here, there] = [truth.class, next(truth.class)].map(|class| centre(known, class));
                let shift = |((x, here), there): ((&f32, f32), f32)| x + 0.8 * (there - here);
                let shifted = truth.vector.iter().zip(here?).zip(there?).map(shift);
                Some((shifted.collect(), truth.class))
            }
            Self::Copycat => {
                let of_others: Vec<u64> = known.common().map(|sample| sample.key).collect();
                let copied = known.get(draw(&of_others, rng)?)?;
                Some((copied.vector.to_vec(), next(copied.class)))
            }
            Self::Siege => {
                let besieged: Vec<u64> = known.class_keys(ClassId(0)).to_vec();
                let sample = known.get(draw(&besieged, rng)?)?;
                Some((sample.vector.to_vec(), next(ClassId(0))))
            }
            Self::Shadow => {
                let mut newest: Vec<u64> = known.common().map(|sample| sample.key).collect();
                newest.drain(..newest.len().saturating_sub(30));
                let shadowed = known.get(draw(&newest, rng)?)?;
                let others = known.iter().filter(|sample| sample.class != shadowed.class);
                let nearest = others.min_by(|a, b| {
                    apart(a, shadowed).total_cmp(&apart(b, shadowed)).then(a.key.cmp(&b.key))
                })?;
                Some((between(&shadowed.vector, &nearest.vector, 0.1), nearest.class))
            }
        }
    }
}

/// A taught round in which that gesture was shown, the newest one that the poisoner knows of.
#[must_use]
pub(super) fn round_of(known: &HeldSamples, class: ClassId) -> Option<RoundId> {
    known.with_keys(known.class_keys(class)).map(|sample| sample.round).max_by_key(|round| round.counter)
}

fn apart(a: &HeldSample, b: &HeldSample) -> f32 {
    a.vector.iter().zip(&*b.vector).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn between(from: &[f32], to: &[f32], part: f32) -> Vec<f32> {
    from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect()
}

fn centre(known: &HeldSamples, class: ClassId) -> Option<Vec<f32>> {
    let mut samples = known.with_keys(known.class_keys(class));
    let mut sum = samples.next()?.vector.to_vec();
    let mut count = 1.0;
    for sample in samples {
        sum.iter_mut().zip(&*sample.vector).for_each(|(sum, x)| *sum += x);
        count += 1.0;
    }
    sum.iter_mut().for_each(|sum| *sum /= count);
    Some(sum)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use gestalt_strategies::SetPart;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::emulation::Scenario;
    use crate::emulation::tests::{emulation, learning};
    use crate::shape::NetworkShape;

    const CLASSES: usize = 6;

    type Lie = (Vec<f32>, ClassId);

    fn next(class: ClassId) -> ClassId {
        ClassId((class.0 + 1) % CLASSES as u32)
    }

    /// Looks at what a robot of an honest swarm holds after six gestures.
    fn knowing(look: impl FnOnce(&HeldSamples)) {
        let scenario = learning(4, 1.0, NetworkShape::Full);
        let mut emulation = emulation(&scenario, 1);
        while emulation.show_next() {}
        look(emulation.training_set(0).unwrap());
    }

    /// What each strategy makes of each of its own samples, eight times over.
    fn made(poison: Poison, known: &HeldSamples, showings: u32) -> Vec<(HeldSample, Option<Lie>)> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let own = || known.iter().filter(|sample| sample.part == SetPart::Shared);
        let truths: Vec<&HeldSample> = (0..8).flat_map(|_| own()).collect();
        assert!(truths.len() > 100);
        let of = |truth: &HeldSample, rng: &mut ChaCha8Rng| poison.of(truth, known, (CLASSES, showings), rng);
        truths.into_iter().map(|truth| (truth.clone(), of(truth, &mut rng))).collect()
    }

    #[test]
    fn labels_are_falsified_as_the_name_says() {
        knowing(labels_are_falsified);
    }

    fn labels_are_falsified(known: &HeldSamples) {
        let lies = |poison| {
            let made = made(poison, known, 18).into_iter();
            made.map(|(truth, lie)| (truth, lie.expect("it lies always"))).collect::<Vec<_>>()
        };
        assert!(made(Poison::Silent, known, 18).iter().all(|(_, lie)| lie.is_none()));
        for (poison, label) in [
            (Poison::FixedLabel, (|_| ClassId(0)) as fn(ClassId) -> ClassId),
            (Poison::PairFlip, next),
            (Poison::Flood, next),
            (Poison::SlowPoison, next),
        ] {
            for (truth, (vector, class)) in lies(poison) {
                assert_eq!((&*vector, class), (&*truth.vector, label(truth.class)), "{poison:?}");
            }
        }
        assert!(
            made(Poison::SlowPoison, known, 10).iter().all(|(_, lie)| lie.is_none()),
            "in earnest at first"
        );
        let random = lies(Poison::RandomLabel);
        assert!(
            random.iter().all(|(truth, (vector, class))| *class != truth.class && **vector == *truth.vector)
        );
        let of_the_first = random.iter().filter(|(truth, _)| truth.class == ClassId(0));
        assert_eq!(of_the_first.map(|(_, (_, class))| class).collect::<BTreeSet<_>>().len(), CLASSES - 1);
        let sparing = made(Poison::Sparing, known, 18);
        let part = sparing.iter().filter(|(_, lie)| lie.is_some()).count() as f64 / sparing.len() as f64;
        assert!((0.2..0.47).contains(&part), "{part}");
        assert!(
            sparing
                .iter()
                .all(|(truth, lie)| lie.as_ref().is_none_or(|(_, class)| *class == next(truth.class)))
        );
    }

    #[test]
    fn vectors_are_falsified_as_the_name_says() {
        knowing(vectors_are_falsified);
    }

    fn vectors_are_falsified(known: &HeldSamples) {
        let lies = |poison| made(poison, known, 18).into_iter().map(|(truth, lie)| (truth, lie.unwrap()));
        let vectors = |class| known.with_keys(known.class_keys(class)).map(|sample| sample.vector.to_vec());
        let squared = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let nearest = |to: &[f32], of: &dyn Fn(ClassId) -> bool| {
            let of = known.iter().filter(|sample| of(sample.class));
            of.min_by(|a, b| squared(&a.vector, to).total_cmp(&squared(&b.vector, to))).unwrap().clone()
        };
        for (truth, (vector, class)) in lies(Poison::NearBoundary) {
            let other = nearest(&truth.vector, &|class| class != truth.class);
            assert_eq!(class, truth.class);
            assert!(squared(&vector, &other.vector) < squared(&vector, &truth.vector), "beyond half-way");
        }
        for (truth, (vector, class)) in lies(Poison::ShiftedCentre) {
            let (here, there) = (centre(known, class).unwrap(), centre(known, next(class)).unwrap());
            let (moved, whole) = (squared(&vector, &truth.vector).sqrt(), squared(&here, &there).sqrt());
            assert_eq!(class, truth.class);
            assert!((moved / whole - 0.8).abs() < 1e-3, "{moved} of {whole}");
        }
        let duplicates: Vec<_> = lies(Poison::Duplicates).map(|(_, lie)| lie).collect();
        assert!(duplicates.windows(2).all(|pair| pair[0] == pair[1]), "one and the same");
        assert!(!vectors(duplicates[0].1).any(|vector| vector == duplicates[0].0), "under a wrong label");
        let common: Vec<&HeldSample> = known.common().collect();
        let mut copied = BTreeSet::new();
        for (_, (vector, class)) in lies(Poison::Copycat) {
            let of = common.iter().find(|sample| *sample.vector == *vector).expect("what was shared");
            assert_eq!(class, next(of.class));
            copied.insert(of.key);
        }
        assert!(copied.len() > 20, "of many: {}", copied.len());
        for (_, (vector, class)) in lies(Poison::Siege) {
            assert!(class == ClassId(1) && vectors(ClassId(0)).any(|besieged| besieged == vector));
        }
        for (_, (vector, class)) in lies(Poison::Shadow) {
            let beside = nearest(&vector, &|_| true);
            assert_ne!(beside.class, class);
            let other = nearest(&beside.vector, &|class| class != beside.class);
            assert!(
                squared(&vector, &beside.vector) < 0.02 * squared(&other.vector, &beside.vector),
                "hardly apart"
            );
        }
    }

    fn poisoned(poison: Poison) -> Scenario {
        let mut scenario = learning(7, 1.0, NetworkShape::Ring);
        scenario.rounds = 12;
        // Nothing is forgotten: what is forgotten is each robot's own choice.
        scenario.learning.as_mut().unwrap().robots.capacity = 10_000;
        let liars = crate::emulation::Group {
            name: "liar".to_owned(),
            count: 3,
            poison: Some(poison),
            ..scenario.robots[0].clone()
        };
        scenario.robots.push(liars);
        scenario
    }

    /// What robot 0, an honest one, holds of liars at the end; robot 4 holds the same.
    fn of_liars(poison: Poison) -> Vec<HeldSample> {
        let scenario = poisoned(poison);
        let mut emulation = emulation(&scenario, 3);
        while emulation.show_next() {}
        let of = |robot: usize| -> Vec<HeldSample> {
            let held = emulation.training_set(robot).unwrap().iter();
            held.filter(|sample| sample.author().is_some_and(|author| author.0 > 7)).cloned().collect()
        };
        let said = |of: Vec<HeldSample>| {
            let said = of
                .into_iter()
                .map(|s| (s.id, s.class, s.vector.iter().map(|x| x.to_bits()).collect::<Vec<_>>()));
            said.collect::<BTreeSet<_>>()
        };
        assert!(said(of(0)) == said(of(4)), "{poison:?}: what one was told all were told");
        of(0)
    }

    #[test]
    fn liars_tell_all_the_same_and_as_much_as_the_name_says() {
        assert_eq!(of_liars(Poison::Silent).len(), 0);
        let once = of_liars(Poison::PairFlip).len();
        assert!(once >= 3 * 12 * 4, "{once}");
        assert_eq!(of_liars(Poison::Duplicates).len(), 4 * once);
        assert_eq!(of_liars(Poison::Flood).len(), 8 * once);
        let siege = of_liars(Poison::Siege);
        let besieging = siege.iter().filter(|sample| sample.class == ClassId(1)).count();
        assert!(besieging * 10 > siege.len() * 8, "{besieging} of {}", siege.len());
    }

    #[test]
    fn whoever_poisons_where_nobody_learns_is_refused() {
        let scenario = Scenario { learning: None, ..poisoned(Poison::PairFlip) };
        assert!(scenario.validate().unwrap_err().to_string().contains("robots.poison"));
    }
}
