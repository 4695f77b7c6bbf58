//! A discriminant by itself, kept up to date as samples come and go.

use super::{Discriminant, Sums};
use crate::feature_space::FeatureSpace;
use crate::scatter::whiten;

/// The sums that a [`Discriminant`] follows from. Whatever came and went, in whatever order, they are those of the samples that are there, to the last
/// bit; so are those of two swarms whose samples come together, and of one that takes samples back.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscriminantSums {
    sums: Sums<u64>,
    classes: usize,
}

impl DiscriminantSums {
    /// Of no samples, of so many classes.
    #[must_use]
    pub fn new(space: &FeatureSpace, classes: usize) -> Self {
        Self { sums: Sums::new(space.spread()), classes }
    }

    /// Takes in a sample of a showing: coordinates in the space. One of that key is replaced.
    pub fn insert(&mut self, key: u64, class: usize, showing: u64, vector: &[f32]) {
        self.sums.insert(key, class, showing, vector);
        self.sums.settle();
    }

    /// Takes out a sample; whether it was there.
    pub fn remove(&mut self, key: u64) -> bool {
        let was_there = self.sums.remove(key);
        self.sums.settle();
        was_there
    }

    /// Gives a sample another class; whether it was there.
    pub fn relabel(&mut self, key: u64, class: usize) -> bool {
        let was_there = self.sums.relabel(key, class);
        self.sums.settle();
        was_there
    }

    /// The discriminant of what is there; `None` of nothing.
    #[must_use]
    pub fn discriminant(&self) -> Option<Discriminant> {
        let clouds = self.sums.clouds();
        let whitening = self.sums.covariance(&clouds).whitening();
        let white = clouds.iter().flat_map(|cloud| {
            let mean: Vec<f32> = cloud.mean.iter().map(|x| *x as f32).collect();
            whiten(&whitening, &mean).into_iter().map(|x| x as f32)
        });
        let white: Vec<f32> = white.collect();
        let showings: Vec<u32> = clouds.iter().map(|cloud| cloud.showings).collect();
        let met: Vec<usize> = clouds.iter().map(|cloud| cloud.class).collect();
        (!clouds.is_empty()).then(|| Discriminant::of(&whitening, &white, &showings, &met, self.classes))
    }
}
