//! How far views scatter about what they are of: one covariance that all classes share.

/// In wider spaces coordinates are taken to vary independently: a covariance costs the cube of the width.
const WIDEST: usize = 128;

/// What is believed of the scatter within a class before any is known: it is that part of the variance of the space, and weighs as much as so many
/// showings. Measured on drawn and real hands, see `docs/results.md`.
const PRIOR_PART: f64 = 0.35;
pub(crate) const PRIOR_SHOWINGS: f64 = 10.0;

/// Whether coordinates of a space of that width are taken to vary independently.
pub(crate) fn is_wide(width: usize) -> bool {
    width > WIDEST
}

/// How many numbers the whitening of a space of that width has.
pub(crate) fn entries(width: usize) -> usize {
    if width > WIDEST { width } else { width * (width + 1) / 2 }
}

/// A vector in coordinates in which the shared covariance is that of independent ones.
pub(crate) fn whiten(whitening: &[f32], vector: &[f32]) -> Vec<f64> {
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

/// The mean that rests on this much, without one that weighs so much of it.
pub(crate) fn mean_without<'a>(
    (mean, all): (&'a [f64], f64),
    (own, weight): (&'a [f64], f64),
) -> impl Iterator<Item = f64> + 'a {
    mean.iter().zip(own).map(move |(mean, own)| (mean * all - weight * own) / (all - weight))
}

/// The covariance about the classes, shrunk towards what is believed of it: the more, the less is known.
#[derive(Clone, Debug)]
pub(crate) struct Covariance {
    width: usize,
    diagonal: bool,
    /// The lower triangle, row by row, or the diagonal.
    sums: Vec<f64>,
    freedom: f64,
}

impl Covariance {
    pub fn new(spread: &[f32]) -> Self {
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

    /// Sums of squares alone, without what is believed.
    pub fn of_nothing(width: usize) -> Self {
        Self { width, diagonal: is_wide(width), sums: vec![0.0; entries(width)], freedom: 0.0 }
    }

    /// The sums of squares as they lie here.
    pub fn into_sums(self) -> Vec<f64> {
        self.sums
    }

    #[cfg(test)]
    pub fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Counts degrees of freedom.
    pub fn free(&mut self, degrees: f64) {
        self.freedom += degrees;
    }

    /// Adds sums of squares as they lie here.
    pub fn add_squares(&mut self, squares: impl Iterator<Item = f64>) {
        self.sums.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
    }

    /// Adds the square of how far a vector lies from a centre, times a weight.
    pub fn add(&mut self, weight: f64, vector: &[f32], center: &[f64]) {
        let away: Vec<f64> = vector.iter().zip(center).map(|(x, c)| f64::from(*x) - c).collect();
        self.add_square(weight, &away);
    }

    /// Adds the square of a vector, times a weight.
    pub fn add_square(&mut self, weight: f64, away: &[f64]) {
        if self.diagonal {
            self.sums.iter_mut().zip(away).for_each(|(sum, a)| *sum += weight * a * a);
            return;
        }
        let mut place = 0;
        for (k, a) in away.iter().enumerate() {
            let a = weight * a;
            let row = &mut self.sums[place..=place + k];
            row.iter_mut().zip(away).for_each(|(sum, b)| *sum += a * b);
            place += k + 1;
        }
    }

    /// The inverse of its Cholesky factor, packed.
    pub fn whitening(mut self) -> Vec<f32> {
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
