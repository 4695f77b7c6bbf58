//! What a learner begins with, as the head for few showings knows it.

use crate::scatter::Covariance;

/// So many showings of a gesture the samples of it that a learner began with are worth together, however many they are, once much was shown here. They
/// are of other people, before other cameras: what was shown here tells better where a gesture lies, and is soon more than a few.
///
/// Support vectors of the shipped model, each a showing of its own, were a hundred and more for each gesture, which thirty showings on the spot could not
/// move: see `docs/results.md`.
const WORTH: f64 = 3.0;

/// Samples that are no showings of here, by class.
#[derive(Debug, Default)]
pub(super) struct Start(Vec<OfClass>);

#[derive(Debug)]
struct OfClass {
    count: usize,
    /// How they scatter about their mean: the sum of squares.
    squares: Vec<f64>,
}

impl Start {
    /// Of these samples, by class, in a space of that width.
    pub fn of(samples: &[(usize, &[f32])], width: usize) -> Self {
        let classes = samples.iter().map(|(class, _)| class + 1).max().unwrap_or(0);
        let of_class = |class: usize| {
            let of_class = samples.iter().filter(|(of, _)| *of == class).map(|(_, vector)| *vector);
            let count = of_class.clone().count();
            let mut mean = vec![0.0; width];
            for vector in of_class.clone() {
                mean.iter_mut().zip(vector).for_each(|(sum, x)| *sum += f64::from(*x) / count as f64);
            }
            let mut scatter = Covariance::of_nothing(width);
            of_class.for_each(|vector| scatter.add(1.0, vector, &mean));
            OfClass { count, squares: scatter.into_sums() }
        };
        Self((0..classes).map(of_class).collect())
    }

    /// How many there are of a class.
    pub fn count(&self, class: usize) -> usize {
        self.0.get(class).map_or(0, |of_class| of_class.count)
    }

    /// What each of a class weighs once so much was shown here: as much as a showing where nothing was, and less with each.
    pub fn weight(&self, class: usize, shown: usize) -> f64 {
        let count = self.count(class).max(1) as f64;
        let worth = f64::max(WORTH, count / (1.0 + shown as f64).powi(2));
        f64::min(worth / count, 1.0)
    }

    /// Counts how they scatter, once so much was shown here.
    pub fn add_to(&self, covariance: &mut Covariance, shown: usize) {
        for (class, of_class) in self.0.iter().enumerate() {
            let weight = self.weight(class, shown);
            covariance.add_squares(of_class.squares.iter().map(|square| weight * square));
            covariance.free((weight * of_class.count as f64 - 1.0).max(0.0));
        }
    }
}
