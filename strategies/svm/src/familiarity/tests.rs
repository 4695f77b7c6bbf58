use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::head::{Head, Shown, margin_of};

const WIDTH: usize = 12;

/// Roughly normal.
fn normal(rng: &mut impl Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// A world of gestures: where each lies, and showings of them, each seen by some robots.
struct World(Vec<Vec<f64>>);

impl World {
    fn new(classes: usize, rng: &mut impl Rng) -> Self {
        Self((0..classes).map(|_| (0..WIDTH).map(|_| 0.9 * normal(rng)).collect()).collect())
    }

    fn showing(&self, class: usize, views: usize, rng: &mut impl Rng) -> Vec<Vec<f32>> {
        let shown: Vec<f64> = self.0[class].iter().map(|x| x + 0.45 * normal(rng)).collect();
        (0..views).map(|_| shown.iter().map(|x| (x + 0.25 * normal(rng)) as f32).collect()).collect()
    }

    fn taught(&self, classes: usize, showings: usize, rng: &mut impl Rng) -> Option<Familiarity> {
        Some(Familiarity::of(&self.scatter(classes, showings, rng)?, None))
    }

    fn scatter(&self, classes: usize, showings: usize, rng: &mut impl Rng) -> Option<Scatter> {
        let mut seen: Vec<(usize, u64, Vec<f32>)> = Vec::new();
        for showing in 0..showings {
            for class in 0..classes {
                let views = self.showing(class, 6, rng);
                let name = (showing * classes + class) as u64;
                seen.extend(views.into_iter().map(|view| (class, name, view)));
            }
        }
        let shown: Vec<Shown<'_>> = seen
            .iter()
            .map(|(class, showing, vector)| Shown { class: *class, showing: *showing, vector })
            .collect();
        Scatter::of(&shown, &[1.0; WIDTH])
    }
}

/// How often a view of an unknown gesture scores higher than one of a known one.
fn auroc(known: &[f64], unknown: &[f64]) -> f64 {
    let wins: f64 = unknown
        .iter()
        .flat_map(|u| {
            known.iter().map(move |k| {
                if u > k {
                    1.0
                } else if u < k {
                    0.0
                } else {
                    0.5
                }
            })
        })
        .sum();
    wins / (known.len() * unknown.len()) as f64
}

#[test]
fn what_was_never_taught_is_told_from_what_was_and_the_ratio_means_what_it_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut known, mut unknown) = (Vec::new(), Vec::new());
    for _ in 0..12 {
        let world = World::new(8, &mut rng);
        let taught = world.taught(5, 6, &mut rng).unwrap();
        for _ in 0..20 {
            for class in 0..8 {
                let ratio = taught.judge(&world.showing(class, 1, &mut rng)[0], None).any;
                if class < 5 { known.push(ratio) } else { unknown.push(ratio) }
            }
        }
    }
    let auroc = auroc(&known, &unknown);
    assert!(auroc > 0.9, "{auroc}");
    // Of known and unknown ones, as many of each, that it says are unknown with p, p are.
    let p = |ratio: &f64| 1.0 / (1.0 + (-ratio).exp());
    let (of_known, of_unknown) = (known.iter().map(p), unknown.iter().map(p));
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / n as f64;
    let said =
        (mean(&mut of_known.clone(), known.len()) + mean(&mut of_unknown.clone(), unknown.len())) / 2.0;
    assert!((said - 0.5).abs() < 0.08, "{said}");
}

#[test]
fn what_lies_between_gestures_makes_no_taught_one_look_like_another() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    // Five of eight gestures were taught: the logarithms of taught and of untaught ones, by what is unknown at all and by another gesture.
    let mut means = [[0.0; 2]; 2];
    for _ in 0..12 {
        let world = World::new(8, &mut rng);
        let scatter = world.scatter(5, 3, &mut rng).unwrap();
        let plain = scatter.discriminant(5).sharpened(1.0);
        let familiarity = Familiarity::of(&scatter, Some((&plain, &scatter.logs_left_out(&plain))));
        for class in 0..8 {
            let view = world.showing(class, 1, &mut rng).remove(0);
            let Unfamiliar { any, gesture } = familiarity.judge(&view, margin_of(&plain.logs(&view)));
            let (of, count) = if class < 5 { (0, 60.0) } else { (1, 36.0) };
            means[of][0] += any / count;
            means[of][1] += gesture / count;
        }
    }
    let [taught, untaught] = means;
    assert!(taught[1] < taught[0] - 0.3 && taught[1] < -0.5 && untaught[1] > 0.5, "{means:?}");
}

#[test]
fn who_knows_little_says_little() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let world = World::new(4, &mut rng);
    let of = |classes, showings, rng: &mut ChaCha8Rng| {
        let taught = world.taught(classes, showings, rng).unwrap();
        let ratios = (0..40).map(|n| taught.judge(&world.showing(n % 4, 1, rng)[0], None).any);
        ratios.fold((0.0_f64, 0.0_f64), |(low, high), ratio| (low.min(ratio), high.max(ratio)))
    };
    let most = 2.0_f64.ln() + 1e-12;
    let (low, high) = of(1, 1, &mut rng);
    assert!(
        low >= 0.0 && high <= most,
        "one showing of one gesture knows nothing for certain: {low}..{high}"
    );
    let (low, high) = of(2, 1, &mut rng);
    assert!(low >= -(3.0_f64.ln()) && high <= most, "no gesture was shown twice: {low}..{high}");
    let (low, high) = of(3, 10, &mut rng);
    assert!(low < -1.0 && high > 1.0, "{low}..{high}");
}

#[test]
fn samples_of_one_showing_count_once() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let world = World::new(3, &mut rng);
    let views: Vec<Vec<Vec<f32>>> = (0..3).map(|class| world.showing(class, 1, &mut rng)).collect();
    let shown = |copies: usize| {
        let samples: Vec<Shown<'_>> = (0..3)
            .flat_map(|class| {
                std::iter::repeat_n(Shown { class, showing: class as u64, vector: &views[class][0] }, copies)
            })
            .collect();
        Familiarity::learn(&samples, &[1.0; WIDTH]).unwrap()
    };
    let (one, ten) = (shown(1), shown(10));
    let view = &world.showing(1, 1, &mut rng)[0];
    assert!((one.judge(view, None).any - ten.judge(view, None).any).abs() < 1e-4);
}

#[test]
fn nothing_to_learn_from_is_nothing_and_a_wide_space_is_no_trouble() {
    assert_eq!(Familiarity::learn(&[], &[1.0; WIDTH]), None);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let wide: Vec<Vec<f32>> = (0..6).map(|_| (0..300).map(|_| normal(&mut rng) as f32).collect()).collect();
    let shown: Vec<Shown<'_>> = wide
        .iter()
        .enumerate()
        .map(|(n, vector)| Shown { class: n % 2, showing: n as u64, vector })
        .collect();
    let taught = Familiarity::learn(&shown, &[1.0; 300]).unwrap();
    assert!(taught.check(2, 300) && taught.judge(&wide[0], None).any.is_finite());
    let flat = Familiarity::learn(&shown, &[0.0; 300]).unwrap();
    assert!(flat.check(2, 300) && flat.judge(&wide[0], None).any.is_finite());
}
