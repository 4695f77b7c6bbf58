//! The rules as their formulas read, with every distance computed anew: what the fast ones must agree with.

use std::collections::{BTreeMap, BTreeSet};

use gestalt_protocol::ClassId;
use gestalt_strategies::sample::{HeldSample, HeldSamples, SetPart};
use gestalt_strategies::{Classify, Forgetting, ForgettingRule, Selection, SelectionRule};
use rand::{Rng, RngExt};

/// A selection rule by its formula.
#[derive(Debug)]
pub struct PlainSelection(pub SelectionRule);

/// A forgetting rule by its formula, with what it was told.
#[derive(Debug)]
pub struct PlainForgetting {
    rule: ForgettingRule,
    /// What came and was not retracted, whether it is held or not, in the order it came; signs are +1, or −1 for
    /// what came as something else at first.
    came: Vec<(f64, HeldSample)>,
    full: BTreeSet<ClassId>,
    /// How many are held of each class: of one of which none is, all is forgotten.
    held: BTreeMap<ClassId, usize>,
}

impl PlainForgetting {
    pub fn new(rule: ForgettingRule) -> Self {
        Self { rule, came: Vec::new(), full: BTreeSet::new(), held: BTreeMap::new() }
    }
}

type Class<'a> = Vec<&'a HeldSample>;

impl Selection for PlainSelection {
    fn select(
        &mut self,
        samples: &HeldSamples,
        classifier: Option<&dyn Classify>,
        rng: &mut dyn Rng,
    ) -> Option<u64> {
        if self.0 == SelectionRule::KCenter {
            let personal: Class = samples.iter().filter(|sample| sample.part == SetPart::Personal).collect();
            let common: Class = samples.common().collect();
            return if common.is_empty() {
                let centre = (!personal.is_empty()).then(|| narrow(&mean(&personal)))?;
                first_best(&personal, |x| -distance(&x.vector, &centre))
            } else {
                first_best(&personal, |x| nearest(x, &common))
            };
        }
        let mut personal = BTreeMap::<ClassId, Class>::new();
        for sample in samples.iter().filter(|sample| sample.part == SetPart::Personal) {
            personal.entry(sample.class).or_default().push(sample);
        }
        let personal = draw(&personal.into_values().collect::<Vec<_>>(), rng)?;
        let class = personal[0].class;
        let common: Class = samples.common().filter(|sample| sample.class == class).collect();
        match self.0 {
            SelectionRule::Random => draw(&keys(&personal), rng),
            SelectionRule::Novelty if !common.is_empty() => first_best(&personal, |x| nearest(x, &common)),
            SelectionRule::Novelty | SelectionRule::Representativity | SelectionRule::KCenter => {
                let centre = narrow(&mean(&personal));
                first_best(&personal, |x| -distance(&x.vector, &centre))
            }
            SelectionRule::Herding => {
                let shared: Class =
                    common.iter().filter(|sample| sample.part == SetPart::Shared).copied().collect();
                let own: Class = shared.iter().chain(&personal).copied().collect();
                let (mean, sum) = (mean(&own), sum(&shared, mean(&own).len()));
                let k = shared.len() as f64;
                let wanted: Vec<f64> = mean.iter().zip(sum).map(|(m, s)| (k + 1.0) * m - s).collect();
                first_best(&personal, |x| -distance(&x.vector, &narrow(&wanted)))
            }
            SelectionRule::Margin => match classifier {
                Some(classifier) => first_best(&personal, |x| {
                    let mut p = classifier.probabilities_in_space(&x.vector).unwrap();
                    p.sort_by(|a, b| b.total_cmp(a));
                    p[1] - p[0]
                }),
                None => draw(&keys(&personal), rng),
            },
        }
    }
}

impl Forgetting for PlainForgetting {
    fn inserted(&mut self, sample: &HeldSample) {
        self.came.push((1.0, sample.clone()));
        *self.held.entry(sample.class).or_default() += 1;
    }

    fn removed(&mut self, sample: &HeldSample) {
        self.came.push((-1.0, sample.clone()));
        self.forgotten(sample);
    }

    fn forgotten(&mut self, sample: &HeldSample) {
        let held = self.held.entry(sample.class).or_default();
        *held -= 1;
        if *held == 0 {
            self.came.retain(|(_, came)| came.class != sample.class);
            self.full.remove(&sample.class);
        }
    }

    fn replaced(&mut self, before: &HeldSample, after: &HeldSample) {
        self.inserted(after);
        self.removed(before);
    }

    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        self.pick(samples, rng)
    }
}

impl PlainForgetting {
    fn pick(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let oldest_first: Class = samples.iter().collect();
        match self.rule {
            ForgettingRule::Fifo => return Some(oldest_first[0].key),
            ForgettingRule::Reservoir => {
                let place = rng.random_range(0..samples.arrivals()) as usize;
                return Some(oldest_first[place.min(oldest_first.len() - 1)].key);
            }
            ForgettingRule::ClassBalancedReservoir => return self.class_balanced(oldest_first, rng),
            _ => {}
        }
        let mut classes = BTreeMap::<ClassId, Class>::new();
        for sample in samples.iter() {
            classes.entry(sample.class).or_default().push(sample);
        }
        let most = classes.values().map(Vec::len).max()?;
        let largest: Vec<Class> = classes.into_values().filter(|class| class.len() == most).collect();
        let class = draw(&largest, rng)?;
        match self.rule {
            ForgettingRule::Random => draw(&keys(&class), rng),
            ForgettingRule::Redundancy => match closest_pair(&class) {
                Some((a, b)) => draw(&[a, b], rng),
                None => Some(class[0].key),
            },
            ForgettingRule::Representativity => {
                let centre = narrow(&mean(&class));
                first_best(&class, |x| distance(&x.vector, &centre))
            }
            ForgettingRule::Herding => {
                let dimension = class[0].vector.len();
                let came: Vec<_> = self.came.iter().filter(|(_, x)| x.class == class[0].class).collect();
                let count: f64 = came.iter().map(|(sign, _)| sign).sum();
                let held = sum(&class, dimension);
                let wanted: Vec<f64> = (0..dimension)
                    .map(|j| {
                        let total: f64 = came.iter().map(|(sign, x)| sign * f64::from(x.vector[j])).sum();
                        held[j] - (class.len() as f64 - 1.0) * (total / count)
                    })
                    .collect();
                first_best(&class, |x| -distance(&x.vector, &narrow(&wanted)))
            }
            rule => panic!("{rule} looks at the whole set"),
        }
    }

    fn class_balanced(&mut self, oldest_first: Class, rng: &mut dyn Rng) -> Option<u64> {
        let (newest, others) = oldest_first.split_last()?;
        let of = |class| others.iter().filter(|x| x.class == class).map(|x| x.key).collect::<Vec<_>>();
        let classes: BTreeSet<ClassId> = others.iter().map(|x| x.class).collect();
        let most = classes.iter().map(|class| of(*class).len()).max()?;
        let largest: Vec<ClassId> = classes.into_iter().filter(|class| of(*class).len() == most).collect();
        self.full.extend(&largest);
        let kin = of(newest.class);
        if !self.full.contains(&newest.class) || kin.is_empty() {
            let class = draw(&largest, rng)?;
            return draw(&of(class), rng);
        }
        let came: f64 = self.came.iter().filter(|(_, x)| x.class == newest.class).map(|(sign, _)| sign).sum();
        if rng.random_range(0..came as u64) < kin.len() as u64 { draw(&kin, rng) } else { Some(newest.key) }
    }
}

fn draw<T: Clone>(items: &[T], rng: &mut dyn Rng) -> Option<T> {
    if items.is_empty() {
        None
    } else {
        Some(items[rng.random_range(0..items.len() as u64) as usize].clone())
    }
}

fn keys(samples: &[&HeldSample]) -> Vec<u64> {
    samples.iter().map(|sample| sample.key).collect()
}

/// ‖a − b‖².
fn distance(a: &[f32], b: &[f32]) -> f32 {
    let mut sum = 0.0;
    for j in 0..a.len() {
        sum += (a[j] - b[j]) * (a[j] - b[j]);
    }
    sum
}

fn nearest(x: &HeldSample, others: &[&HeldSample]) -> f32 {
    others.iter().map(|other| distance(&x.vector, &other.vector)).fold(f32::INFINITY, f32::min)
}

fn sum(samples: &[&HeldSample], dimension: usize) -> Vec<f64> {
    (0..dimension).map(|j| samples.iter().map(|sample| f64::from(sample.vector[j])).sum()).collect()
}

fn mean(samples: &[&HeldSample]) -> Vec<f64> {
    let sum = sum(samples, samples[0].vector.len());
    sum.into_iter().map(|sum| sum / samples.len() as f64).collect()
}

fn narrow(vector: &[f64]) -> Vec<f32> {
    vector.iter().map(|x| *x as f32).collect()
}

/// The key of the sample with the greatest value; of equals the smallest.
fn first_best<V: PartialOrd>(samples: &[&HeldSample], value: impl Fn(&HeldSample) -> V) -> Option<u64> {
    let mut best: Option<(V, u64)> = None;
    for sample in samples {
        let value = value(sample);
        if best.as_ref().is_none_or(|(greatest, _)| value > *greatest) {
            best = Some((value, sample.key));
        }
    }
    best.map(|(_, key)| key)
}

/// The pair with the least distance; of equals the one with the smaller keys.
fn closest_pair(samples: &[&HeldSample]) -> Option<(u64, u64)> {
    let mut best: Option<(f32, u64, u64)> = None;
    for (i, a) in samples.iter().enumerate() {
        for b in &samples[i + 1..] {
            let distance = distance(&a.vector, &b.vector);
            if best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, a.key, b.key));
            }
        }
    }
    best.map(|(_, a, b)| (a, b))
}
