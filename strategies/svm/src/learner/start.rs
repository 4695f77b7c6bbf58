//! What a learner begins with, as the head for few showings knows it.

use crate::scatter::Covariance;

/// So many showings of a gesture the samples of it that a learner began with are worth together, however many they are, once all its gestures were shown
/// here. They are of other people, before other cameras: what was shown here tells better where a gesture lies, and is soon more than a few.
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

    /// How often the gesture of it was shown here that was shown least, given the showings of each.
    ///
    /// All go by that one: a gesture that was shown would lie where it lies here, one that was not where it lay elsewhere, and the first would be taken
    /// for the second. Who is told no more than that it is right is never told of what it takes for another, and would lose it for good.
    pub fn shown(&self, showings: impl Fn(usize) -> usize) -> usize {
        let known = (0..self.0.len()).filter(|class| self.count(*class) > 0);
        known.map(showings).min().unwrap_or(0)
    }

    /// What each of a class weighs once so much of all was shown here: as much as a showing where nothing was. Together they weigh whole showings.
    pub fn weight(&self, class: usize, shown: usize) -> f64 {
        let count = self.count(class).max(1) as f64;
        let worth = f64::max(WORTH, (count / (1.0 + shown as f64).powi(4)).round());
        f64::min(worth / count, 1.0)
    }

    /// Counts how they scatter about where they lie themselves: how far that is from where gestures lie here is no scatter of showings.
    pub fn add_to(&self, covariance: &mut Covariance, shown: usize) {
        for (class, of_class) in self.0.iter().enumerate() {
            let weight = self.weight(class, shown);
            covariance.add_squares(of_class.squares.iter().map(|square| weight * square));
            covariance.free(weight * of_class.count.saturating_sub(1) as f64);
        }
    }

    /// Whether any class weighs otherwise than it did.
    pub fn differs(&self, before: usize, now: usize) -> bool {
        (0..self.0.len()).any(|class| (self.weight(class, before) - self.weight(class, now)).abs() > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(counts: &[usize]) -> Start {
        let vectors: Vec<[f32; 2]> = (0..120).map(|n| [(n % 7) as f32, (n % 5) as f32]).collect();
        let of_class = |(class, count): (usize, &usize)| {
            vectors.iter().take(*count).map(move |vector| (class, vector.as_slice())).collect::<Vec<_>>()
        };
        let samples: Vec<(usize, &[f32])> = counts.iter().enumerate().flat_map(of_class).collect();
        Start::of(&samples, 2)
    }

    #[test]
    fn the_more_was_shown_here_the_less_a_start_weighs_down_to_three_showings() {
        let start = start(&[0, 1, 3, 120]);
        let mut before = 120.0;
        for shown in 0..12 {
            assert_eq!([1, 2].map(|class| start.weight(class, shown)), [1.0, 1.0], "few are showings");
            let worth = 120.0 * start.weight(3, shown);
            assert!(worth <= before && (worth - worth.round()).abs() < 1e-9, "{worth} after {before}");
            before = worth;
        }
        assert!((before - 3.0).abs() < 1e-9, "{before}");
    }

    #[test]
    fn it_keeps_its_weight_until_all_its_gestures_were_shown() {
        let start = start(&[120, 0, 120, 120]);
        let shown = |showings: [usize; 5]| start.shown(|class| showings[class]);
        assert_eq!(shown([0; 5]), 0);
        assert_eq!(shown([40, 0, 40, 0, 0]), 0, "3 was never shown here");
        assert_eq!(shown([40, 7, 0, 0, 9]), 0, "what it does not know does not count");
        assert_eq!(shown([4, 0, 2, 9, 0]), 2);
    }

    #[test]
    fn where_nothing_was_shown_it_scatters_as_showings_do_and_later_as_many_as_it_is_worth() {
        let start = start(&[0, 1, 60, 120]);
        let scatter = |shown| {
            let mut covariance = Covariance::of_nothing(2);
            start.add_to(&mut covariance, shown);
            (covariance.freedom(), covariance.into_sums()[0])
        };
        let (freedom, all) = scatter(0);
        assert_eq!(freedom, 59.0 + 119.0);
        let (fewer, some) = scatter(30);
        assert!(fewer < 6.0 && (some / fewer / (all / freedom) - 1.0).abs() < 0.05, "{some} of {fewer}");
    }
}
