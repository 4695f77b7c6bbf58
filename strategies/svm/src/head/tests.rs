use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::familiarity::Scatter;
use crate::scatter::PRIOR_SHOWINGS;

const WIDTH: usize = 5;
const SPREAD: [f32; WIDTH] = [1.0, 0.7, 0.2, 1.3, 0.0];

/// Roughly normal.
fn normal(rng: &mut impl Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// What may happen to samples.
#[derive(Clone, Debug)]
enum Change {
    Insert {
        key: u8,
        class: usize,
        showing: u64,
        vector: [f32; WIDTH],
    },
    Remove(u8),
    Relabel(u8, usize),
    /// Somebody reads the sums.
    Settle,
}

fn change() -> impl Strategy<Value = Change> {
    let vector = prop::array::uniform5(prop_oneof![9 => -3.0_f32..3.0, 1 => -1e6_f32..1e6]);
    let insert = (0..24_u8, 0..4_usize, 0..6_u64, vector);
    prop_oneof![
        6 => insert.prop_map(|(key, class, showing, vector)| Change::Insert { key, class, showing, vector }),
        2 => (0..24_u8).prop_map(Change::Remove),
        1 => (0..24_u8, 0..4_usize).prop_map(|(key, class)| Change::Relabel(key, class)),
        1 => Just(Change::Settle),
    ]
}

type Held = BTreeMap<u8, (usize, u64, [f32; WIDTH])>;

fn sums<'a>(held: impl Iterator<Item = (&'a u8, &'a (usize, u64, [f32; WIDTH]))>) -> Sums<u8> {
    let mut sums = Sums::new(&SPREAD);
    held.for_each(|(key, (class, showing, vector))| sums.insert(*key, *class, *showing, vector));
    sums.settle();
    sums
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn sums_are_those_of_what_is_there_to_the_last_bit_whatever_came_and_went_in_whatever_order(
        changes in prop::collection::vec(change(), 0..60),
        seed in any::<u64>(),
    ) {
        let (mut taught, mut held) = (Sums::new(&SPREAD), Held::new());
        for change in changes {
            match change {
                Change::Insert { key, class, showing, vector } => {
                    taught.insert(key, class, showing, &vector);
                    held.insert(key, (class, showing, vector));
                }
                Change::Remove(key) => prop_assert_eq!(taught.remove(key), held.remove(&key).is_some()),
                Change::Relabel(key, to) => {
                    let place = held.get_mut(&key);
                    prop_assert_eq!(taught.relabel(key, to), place.is_some());
                    if let Some((class, ..)) = place { *class = to; }
                }
                Change::Settle => taught.settle(),
            }
        }
        taught.settle();
        prop_assert_eq!(&taught, &sums(held.iter()), "as if it alone had come");
        prop_assert_eq!(&taught, &sums(held.iter().rev()), "in another order");
        // Two robots that each know a part, and tell each other.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (one, other): (Held, Held) = held.clone().into_iter().partition(|_| rng.random());
        let mut merged = [sums(one.iter()), sums(other.iter())];
        for (sums, part) in merged.iter_mut().zip([&other, &one]) {
            part.iter().for_each(|(key, (class, showing, vector))| sums.insert(*key, *class, *showing, vector));
            sums.settle();
        }
        prop_assert_eq!(&merged[0], &merged[1]);
        prop_assert_eq!(&merged[0], &taught);
        // And takes it all back.
        held.keys().for_each(|key| assert!(taught.remove(*key)));
        prop_assert_eq!(taught, Sums::new(&SPREAD));
    }
}

/// Showings of classes, of up to three samples each.
fn shown(classes: usize, showings: usize, rng: &mut impl Rng) -> Vec<(usize, u64, [f32; WIDTH])> {
    let centers: Vec<[f64; WIDTH]> =
        (0..classes).map(|_| std::array::from_fn(|x| f64::from(SPREAD[x]) * normal(rng))).collect();
    let mut all = Vec::new();
    for showing in 0..showings * classes {
        let class = showing % classes;
        let at: [f64; WIDTH] =
            std::array::from_fn(|x| centers[class][x] + 0.3 * f64::from(SPREAD[x]) * normal(rng));
        for _ in 0..rng.random_range(1..4) {
            let view = std::array::from_fn(|x| (at[x] + 0.1 * f64::from(SPREAD[x]) * normal(rng)) as f32);
            all.push((class, showing as u64, view));
        }
    }
    all
}

fn of(all: &[(usize, u64, [f32; WIDTH])]) -> Sums<usize> {
    let mut sums = Sums::new(&SPREAD);
    for (key, (class, showing, vector)) in all.iter().enumerate() {
        sums.insert(key, *class, *showing, vector);
    }
    sums.settle();
    sums
}

#[test]
fn the_covariance_of_sums_is_that_of_the_samples() {
    let all = shown(3, 8, &mut ChaCha8Rng::seed_from_u64(1));
    let sums = of(&all);
    let from_sums = sums.covariance(&sums.clouds()).whitening();
    let views: Vec<Shown<'_>> = all
        .iter()
        .map(|(class, showing, vector)| Shown { class: *class, showing: *showing, vector })
        .collect();
    let from_samples = Scatter::of(&views, &SPREAD).unwrap();
    for (a, b) in from_sums.iter().zip(&from_samples.whitening) {
        assert!((a - b).abs() < 1e-3 * b.abs().max(1.0), "{a} for {b}");
    }
    for (cloud, class) in sums.clouds().iter().zip(&from_samples.classes) {
        let mean: Vec<f32> = cloud.mean.iter().map(|x| *x as f32).collect();
        let white = crate::scatter::whiten(&from_samples.whitening, &mean);
        assert_eq!(cloud.showings as usize, class.showings.len());
        assert!(
            white.iter().zip(&class.mean).all(|(a, b)| (a - b).abs() < 1e-2),
            "{white:?} {:?}",
            class.mean
        );
    }
}

/// The discriminant by whole matrices: means scatter as Φ, views about them as the identity, in whitened coordinates.
fn by_matrices(means: &[DVector<f64>], showings: &[f64], x: &DVector<f64>) -> Vec<f64> {
    let (count, width) = (means.len() as f64, x.len());
    let center = means.iter().sum::<DVector<f64>>() / count;
    let scatter: DMatrix<f64> = means.iter().map(|m| (m - &center) * (m - &center).transpose()).sum();
    let chance = showings.iter().map(|n| 1.0 / n).sum::<f64>() / count;
    let isotropic = (4.0 * 0.3 - (count - 1.0) * chance) / (4.0 + count - 1.0);
    let mut eigen =
        (scatter / (4.0 + count - 1.0) + DMatrix::identity(width, width) * isotropic).symmetric_eigen();
    eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(1e-3));
    let between = eigen.recompose();
    let freedom = PRIOR_SHOWINGS + showings.iter().map(|n| n - 1.0).sum::<f64>();
    let log = |(mean, n): (&DVector<f64>, &f64)| {
        let identity = DMatrix::identity(width, width);
        // The mean given n showings: gain Φ·(Φ + I/n)⁻¹, what is left Φ − gain·Φ.
        let gain = &between * (&between + &identity / *n).try_inverse().unwrap();
        let expected = &center + &gain * (mean - &center);
        let next = identity + &between - &gain * &between;
        let away = x - expected;
        let squared = (away.transpose() * next.clone().try_inverse().unwrap() * &away)[0];
        -0.5 * ((freedom + width as f64) * (1.0 + squared / freedom).ln() + next.determinant().ln())
    };
    means.iter().zip(showings).map(log).collect()
}

#[test]
fn the_discriminant_is_the_one_of_whole_matrices() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for showings in [[1_u32, 1, 1], [1, 9, 30], [4, 4, 4]] {
        let means: Vec<f32> = (0..3 * WIDTH).map(|_| 2.0 * normal(&mut rng) as f32).collect();
        let mut unit = vec![0.0; WIDTH * (WIDTH + 1) / 2];
        (0..WIDTH).for_each(|k| unit[k * (k + 1) / 2 + k] = 1.0);
        let discriminant = Discriminant::of(&unit, &means, &showings, &[0, 2, 3], 5);
        let of_class = |mean: &[f32]| DVector::from_iterator(WIDTH, mean.iter().map(|x| f64::from(*x)));
        let means: Vec<DVector<f64>> = means.chunks_exact(WIDTH).map(of_class).collect();
        for _ in 0..20 {
            let x: Vec<f32> = (0..WIDTH).map(|_| 2.0 * normal(&mut rng) as f32).collect();
            let expected = by_matrices(&means, &showings.map(f64::from), &of_class(&x));
            let logs = discriminant.logs(&x);
            assert_eq!([logs[1], logs[4]], [f64::NEG_INFINITY; 2], "never met");
            for (found, expected) in [0, 2, 3].map(|class| logs[class]).iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-4, "{found} for {expected}");
            }
        }
    }
}

#[test]
fn probabilities_sum_to_one_and_classes_never_met_have_none() {
    let all = shown(3, 4, &mut ChaCha8Rng::seed_from_u64(3));
    let views: Vec<Shown<'_>> = all
        .iter()
        .map(|(class, showing, vector)| Shown { class: *class + 1, showing: *showing, vector })
        .collect();
    let familiarity = crate::familiarity::Familiarity::learn(&views, &SPREAD).unwrap();
    let discriminant = familiarity.discriminant(&[1, 2, 3], 4);
    for (class, _, vector) in &all {
        let p = discriminant.probabilities(vector);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12 && p[0] == 0.0, "{p:?}");
        assert!(p[class + 1] > 0.2, "{p:?} for {class}");
    }
}

#[test]
fn sharpness_follows_what_was_left_out() {
    // Logarithms that promise nine to one; they keep it, or only two to one.
    let logs = [9.0_f64.ln(), 0.0];
    let fitted =
        |right: usize| sharpness((0..300).map(|n| (usize::from(n % 300 >= right), 1.0, logs.as_slice())));
    let (kept, broken) = (fitted(270), fitted(200));
    assert!((0.8..1.05).contains(&kept), "{kept}");
    assert!((0.25..0.45).contains(&broken), "{broken}: ln 2 / ln 9 is .32");
    assert!((sharpness(std::iter::empty()) - 0.4).abs() < 0.01, "as believed before");
}
