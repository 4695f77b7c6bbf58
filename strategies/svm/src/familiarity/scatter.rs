//! Where classes lie, and how far their showings scatter about them.

use std::collections::BTreeMap;

use super::{Score, Shown};

/// In wider spaces coordinates are taken to vary independently: a covariance costs the cube of the width.
const WIDEST: usize = 128;

/// What is believed of the scatter within a class before any is known: it is that part of the variance of the space, and weighs as much as so many
/// showings. Measured on drawn and real hands, see `docs/results.md`.
const PRIOR_PART: f64 = 0.35;
const PRIOR_SHOWINGS: f64 = 10.0;

/// The mean of a showing, and its samples.
type Showing<'a> = (Vec<f64>, Vec<&'a [f32]>);

/// What views score, with what each weighs.
type Scores = Vec<(Score, f64)>;

/// A class.
#[derive(Debug)]
pub(super) struct OfClass {
    /// The mean of its showings, whitened.
    pub mean: Vec<f64>,
    /// The mean of each showing, whitened.
    pub showings: Vec<Vec<f64>>,
}

/// All classes with a sample.
#[derive(Debug)]
pub(super) struct Scatter {
    pub width: usize,
    pub whitening: Vec<f32>,
    pub classes: Vec<OfClass>,
    /// Each sample whitened, with its class and its showing, and what it weighs.
    samples: Vec<(usize, usize, f64, Vec<f64>)>,
}

impl Scatter {
    pub fn of(samples: &[Shown<'_>], spread: &[f32]) -> Option<Self> {
        let width = spread.len();
        let mut showings: BTreeMap<(usize, u64), Vec<&[f32]>> = BTreeMap::new();
        for sample in samples.iter().filter(|sample| sample.vector.len() == width) {
            showings.entry((sample.class, sample.showing)).or_default().push(sample.vector);
        }
        let mut by_class: BTreeMap<usize, Vec<Showing<'_>>> = BTreeMap::new();
        for ((class, _), vectors) in showings {
            by_class.entry(class).or_default().push((mean(&vectors, width), vectors));
        }
        if by_class.is_empty() || width == 0 {
            return None;
        }
        let mut covariance = Covariance::new(spread);
        for showings in by_class.values() {
            let center = center(showings.iter().map(|(mean, _)| mean.as_slice()), width);
            covariance.free(showings.len().saturating_sub(1) as f64);
            for (_, vectors) in showings {
                let weight = 1.0 / vectors.len() as f64;
                vectors.iter().for_each(|vector| covariance.add(weight, vector, &center));
            }
        }
        let whitening = covariance.whitening();
        let mut whitened = Vec::new();
        let classes = by_class.into_values().enumerate().map(|(class, showings)| {
            let mut means = Vec::with_capacity(showings.len());
            for (showing, (_, vectors)) in showings.into_iter().enumerate() {
                let weight = 1.0 / vectors.len() as f64;
                let white: Vec<Vec<f64>> = vectors.iter().map(|vector| whiten(&whitening, vector)).collect();
                means.push(center(white.iter().map(Vec::as_slice), width));
                whitened.extend(white.into_iter().map(|white| (class, showing, weight, white)));
            }
            OfClass { mean: center(means.iter().map(Vec::as_slice), width), showings: means }
        });
        let classes = classes.collect();
        Some(Self { width, whitening, classes, samples: whitened })
    }

    /// What views of known gestures score, each without its showing, and views of unknown ones, each without its class; with what each weighs.
    pub fn left_out(&self) -> (Scores, Scores) {
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        for (class, showing, weight, white) in &self.samples {
            let to = |(k, of_class): (usize, &OfClass)| {
                let n = of_class.showings.len() as f64;
                if k != *class {
                    return Some((k, a_coordinate(squared(&of_class.mean, white), self.width, n)));
                }
                // Without its own showing.
                let own = &of_class.showings[*showing];
                let rest = |(mean, own): (&f64, &f64)| (mean * n - own) / (n - 1.0);
                let mean: Vec<f64> = of_class.mean.iter().zip(own).map(rest).collect();
                (n > 1.0).then(|| (k, a_coordinate(squared(&mean, white), self.width, n - 1.0)))
            };
            let distances: Vec<(usize, f64)> = self.classes.iter().enumerate().filter_map(to).collect();
            let others = distances.iter().filter(|(k, _)| k != class).map(|(_, distance)| *distance);
            unknown.extend(Score::of(others).map(|score| (score, *weight)));
            if distances.len() == self.classes.len() {
                known.extend(Score::of(distances.iter().map(|(_, d)| *d)).map(|score| (score, *weight)));
            }
        }
        (known, unknown)
    }
}

/// A squared distance to the mean of so many showings, a coordinate, in units of what is expected of a view of that class.
pub(super) fn a_coordinate(squared: f64, width: usize, showings: f64) -> f64 {
    squared / (width as f64 * (1.0 + 1.0 / showings))
}

/// How many numbers the whitening of a space of that width has.
pub(super) fn entries(width: usize) -> usize {
    if width > WIDEST { width } else { width * (width + 1) / 2 }
}

/// A vector in coordinates in which the shared covariance is that of independent ones.
pub(super) fn whiten(whitening: &[f32], vector: &[f32]) -> Vec<f64> {
    if vector.len() > WIDEST {
        return vector.iter().zip(whitening).map(|(x, w)| f64::from(*x) * f64::from(*w)).collect();
    }
    let mut rest = whitening;
    (1..=vector.len())
        .map(|length| {
            let (row, after) = rest.split_at(length.min(rest.len()));
            rest = after;
            row.iter().zip(vector).map(|(w, x)| f64::from(*w) * f64::from(*x)).sum()
        })
        .collect()
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn mean(vectors: &[&[f32]], width: usize) -> Vec<f64> {
    let mut sum = vec![0.0; width];
    for vector in vectors {
        sum.iter_mut().zip(*vector).for_each(|(sum, x)| *sum += f64::from(*x));
    }
    sum.iter_mut().for_each(|sum| *sum /= vectors.len() as f64);
    sum
}

fn center<'a>(points: impl Iterator<Item = &'a [f64]>, width: usize) -> Vec<f64> {
    let mut sum = vec![0.0; width];
    let mut count = 0.0;
    for point in points {
        sum.iter_mut().zip(point).for_each(|(sum, x)| *sum += x);
        count += 1.0;
    }
    sum.iter_mut().for_each(|sum| *sum /= f64::max(count, 1.0));
    sum
}

/// The covariance about the classes, shrunk towards what is believed of it: the more, the less is known.
struct Covariance {
    width: usize,
    diagonal: bool,
    /// The lower triangle, row by row, or the diagonal.
    sums: Vec<f64>,
    freedom: f64,
}

impl Covariance {
    fn new(spread: &[f32]) -> Self {
        let width = spread.len();
        let diagonal = width > WIDEST;
        let greatest = spread.iter().copied().fold(0.0_f32, f32::max);
        // A coordinate in which nothing ever varied says nothing, not everything.
        let least = f64::from(greatest) * 1e-3 + 1e-9;
        let variance = |x: &f32| PRIOR_SHOWINGS * PRIOR_PART * f64::from(*x).max(least).powi(2);
        let mut sums = vec![0.0; entries(width)];
        for (k, x) in spread.iter().enumerate() {
            sums[if diagonal { k } else { k * (k + 1) / 2 + k }] = variance(x);
        }
        Self { width, diagonal, sums, freedom: PRIOR_SHOWINGS }
    }

    fn free(&mut self, degrees: f64) {
        self.freedom += degrees;
    }

    fn add(&mut self, weight: f64, vector: &[f32], center: &[f64]) {
        let away: Vec<f64> = vector.iter().zip(center).map(|(x, c)| f64::from(*x) - c).collect();
        if self.diagonal {
            self.sums.iter_mut().zip(&away).for_each(|(sum, a)| *sum += weight * a * a);
            return;
        }
        let mut place = 0;
        for (k, a) in away.iter().enumerate() {
            let a = weight * a;
            let row = &mut self.sums[place..=place + k];
            row.iter_mut().zip(&away).for_each(|(sum, b)| *sum += a * b);
            place += k + 1;
        }
    }

    /// The inverse of its Cholesky factor, packed.
    fn whitening(mut self) -> Vec<f32> {
        let freedom = self.freedom;
        self.sums.iter_mut().for_each(|sum| *sum /= freedom);
        if self.diagonal {
            return self.sums.iter().map(|variance| (1.0 / variance.sqrt()) as f32).collect();
        }
        let at = |row: usize, column: usize| row * (row + 1) / 2 + column;
        let mut factor = self.sums;
        for j in 0..self.width {
            for k in 0..=j {
                let dot: f64 = (0..k).map(|i| factor[at(j, i)] * factor[at(k, i)]).sum();
                let left = factor[at(j, k)] - dot;
                // The prior makes it positive definite; rounding may not.
                factor[at(j, k)] = if j == k { left.max(1e-18).sqrt() } else { left / factor[at(k, k)] };
            }
        }
        let mut inverse = vec![0.0; factor.len()];
        for column in 0..self.width {
            inverse[at(column, column)] = 1.0 / factor[at(column, column)];
            for row in column + 1..self.width {
                let dot: f64 = (column..row).map(|i| factor[at(row, i)] * inverse[at(i, column)]).sum();
                inverse[at(row, column)] = -dot / factor[at(row, row)];
            }
        }
        inverse.into_iter().map(|x| x as f32).collect()
    }
}
