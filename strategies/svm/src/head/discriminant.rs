//! Classes that scatter alike, each about a mean that few showings tell.

use nalgebra::DMatrix;

use super::Head;
use crate::scatter::{PRIOR_SHOWINGS, mean_without, whiten};

/// What is believed of how far the means of classes scatter before any is known: that part of the scatter within a class, as firmly as so many classes
/// would tell.
const BETWEEN: f64 = 0.3;
const BETWEEN_CLASSES: f64 = 4.0;
/// The least variance of means in a direction, in units of that within a class.
const LEAST: f64 = 1e-3;

/// Linear discriminants of classes with one shared covariance, each with a mean that is known the better the more often it was shown.
///
/// The mean of a class is itself a sample, of means that scatter between classes: in directions in which classes differ little, that of a young one is
/// taken to be where all are (S. Ioffe, "Probabilistic linear discriminant analysis", ECCV 2006). So a gesture shown once neither draws the views of old
/// ones to itself, nor is it lost. What is left unknown of the covariance makes the tails those of Student's t.
#[derive(Clone, Debug, PartialEq)]
pub struct Discriminant {
    width: usize,
    /// Into coordinates in which classes scatter alike in all directions.
    whitening: Vec<f32>,
    /// The mean of all classes, whitened.
    center: Vec<f64>,
    /// Orthonormal directions in which the means differ, one after the other.
    directions: Vec<f64>,
    /// How far means scatter along each, and in all other directions.
    between: Vec<f64>,
    elsewhere: f64,
    /// What is known of each class; `None` where it was not met.
    classes: Vec<Option<Class>>,
    /// Degrees of freedom of the covariance.
    freedom: f64,
    /// What its logarithms are worth.
    sharpness: f64,
}

/// A class.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Class {
    /// The mean of its showings along the directions, from the centre.
    mean: Vec<f64>,
    showings: f64,
    /// Where the next view is expected along each direction, and how firmly.
    next: Vec<(f64, f64)>,
    /// How firmly it is expected at the centre in all other directions.
    beside: f64,
    /// The sum of the logarithms of the variances of all this.
    logs: f64,
}

/// Where a view lies.
#[derive(Default)]
pub(crate) struct Spot {
    /// Along the directions, from the centre.
    along: Vec<f64>,
    /// The squared distance from the centre in all other directions.
    beside: f64,
}

/// Room for what is found of one view after the other.
#[derive(Default)]
pub(crate) struct Room {
    away: Vec<f64>,
    spot: Spot,
    logs: Vec<f64>,
}

impl Discriminant {
    /// Of whitened means, `width` numbers each, and how many showings each rests on; they are of these classes of so many.
    pub(crate) fn of(
        whitening: &[f32],
        means: &[f32],
        showings: &[u32],
        met: &[usize],
        classes: usize,
    ) -> Self {
        let count = showings.len();
        let width = means.len() / count.max(1);
        let mut center = vec![0.0; width];
        for mean in means.chunks_exact(width.max(1)) {
            center.iter_mut().zip(mean).for_each(|(sum, x)| *sum += f64::from(*x) / count as f64);
        }
        let away: Vec<Vec<f64>> = means
            .chunks_exact(width.max(1))
            .map(|mean| mean.iter().zip(&center).map(|(x, c)| f64::from(*x) - c).collect())
            .collect();
        let others = count.saturating_sub(1) as f64;
        let known = BETWEEN_CLASSES + others;
        // What means of few showings scatter by chance is not how classes differ.
        let chance = showings.iter().map(|n| 1.0 / f64::from(*n)).sum::<f64>() / count.max(1) as f64;
        let elsewhere = (BETWEEN_CLASSES * BETWEEN - others * chance) / known;
        // The means span few directions: their products with each other have the scatter's eigenvalues.
        let products = DMatrix::from_fn(count, count, |j, k| dot(&away[j], &away[k]) / known);
        let eigen = products.symmetric_eigen();
        let (mut directions, mut between) = (Vec::new(), Vec::new());
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            // Means that agree span nothing.
            if *value > 1e-9 {
                let length = (value * known).sqrt();
                let along =
                    |x: usize| away.iter().zip(vector.iter()).map(|(mean, v)| mean[x] * v).sum::<f64>();
                directions.extend((0..width).map(|x| along(x) / length));
                between.push((value + elsewhere).max(LEAST));
            }
        }
        let freedom = PRIOR_SHOWINGS + showings.iter().map(|n| f64::from(*n) - 1.0).sum::<f64>();
        let mut discriminant = Self {
            width,
            whitening: whitening.to_vec(),
            center,
            directions,
            between,
            elsewhere: elsewhere.max(LEAST),
            classes: vec![None; classes],
            freedom,
            sharpness: 1.0,
        };
        for ((away, showings), class) in away.iter().zip(showings).zip(met) {
            let known =
                discriminant.class(along(&discriminant.directions, away).collect(), f64::from(*showings));
            if let Some(place) = discriminant.classes.get_mut(*class) {
                *place = Some(known);
            }
        }
        discriminant
    }

    pub(crate) fn sharpened(mut self, sharpness: f64) -> Self {
        self.sharpness = sharpness;
        self
    }

    pub(crate) fn sharpness(&self) -> f64 {
        self.sharpness
    }

    /// Where a whitened view lies.
    pub(crate) fn spot(&self, white: &[f64]) -> Spot {
        let (mut away, mut spot) = Default::default();
        self.find(white, &mut away, &mut spot);
        spot
    }

    fn find(&self, white: &[f64], away: &mut Vec<f64>, spot: &mut Spot) {
        away.clear();
        away.extend(white.iter().zip(&self.center).map(|(x, c)| x - c));
        spot.along.clear();
        spot.along.extend(along(&self.directions, away));
        spot.beside = (dot(away, away) - dot(&spot.along, &spot.along)).max(0.0);
    }

    /// What is known of a class by the mean of so many showings.
    fn class(&self, mean: Vec<f64>, showings: f64) -> Class {
        // The variance of the next view: within the class, and of its mean.
        let variance = |between: f64| 1.0 + between / (showings * between + 1.0);
        let others = self.width.saturating_sub(self.between.len()) as f64;
        let mut logs = others * variance(self.elsewhere).ln();
        let next = mean.iter().zip(&self.between).map(|(mean, between)| {
            logs += variance(*between).ln();
            (mean * showings * between / (showings * between + 1.0), 1.0 / variance(*between))
        });
        let next = next.collect();
        Class { mean, showings, next, beside: 1.0 / variance(self.elsewhere), logs }
    }

    /// What a class says of a view there.
    fn log(&self, spot: &Spot, class: &Class) -> f64 {
        let away = spot.along.iter().zip(&class.next);
        let squared: f64 = away.map(|(x, (mean, firmness))| (x - mean) * (x - mean) * firmness).sum();
        let squared = squared + spot.beside * class.beside;
        let tails = (self.freedom + self.width as f64) * (squared / self.freedom).ln_1p();
        -0.5 * self.sharpness * (tails + class.logs)
    }

    /// What each class says of a view there.
    pub(crate) fn logs_at(&self, spot: &Spot) -> Vec<f64> {
        self.all_logs(spot).collect()
    }

    fn all_logs(&self, spot: &Spot) -> impl Iterator<Item = f64> {
        let log =
            |class: &Option<Class>| class.as_ref().map_or(f64::NEG_INFINITY, |class| self.log(spot, class));
        self.classes.iter().map(log)
    }

    /// The same of a whitened view.
    pub(crate) fn logs_of<'a>(&self, white: &[f64], room: &'a mut Room) -> &'a [f64] {
        let Room { away, spot, logs } = room;
        self.find(white, away, spot);
        logs.clear();
        logs.extend(self.all_logs(spot));
        logs
    }

    /// What is left of a class without one showing, that has its whitened mean there and weighs so much; `None` where it is the only one.
    pub(crate) fn class_without(&self, class: usize, showing: &[f64], weight: f64) -> Option<Class> {
        let left = self.classes.get(class)?.as_ref().filter(|class| class.showings > weight)?;
        let showing = self.spot(showing);
        let mean = mean_without((&left.mean, left.showings), (&showing.along, weight));
        Some(self.class(mean.collect(), left.showings - weight))
    }

    /// What each class says of a whitened view, with this in place of one of them.
    pub(crate) fn logs_with(
        &self,
        white: &[f64],
        (place, class): (usize, &Class),
        room: &mut Room,
    ) -> Vec<f64> {
        let mut logs = self.logs_of(white, room).to_vec();
        logs[place] = self.log(&room.spot, class);
        logs
    }
}

impl Head for Discriminant {
    fn logs(&self, coordinates: &[f32]) -> Vec<f64> {
        self.logs_at(&self.spot(&whiten(&self.whitening, coordinates)))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A vector along directions.
fn along(directions: &[f64], vector: &[f64]) -> impl Iterator<Item = f64> {
    directions.chunks_exact(vector.len().max(1)).map(|direction| dot(direction, vector))
}
