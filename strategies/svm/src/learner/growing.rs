//! Gestures that a learner meets while it learns.

use gestalt_protocol::ClassId;

use super::pair::Pair;
use super::samples::Place;
use super::{LearnError, Learner};
use crate::machine::pairs;

impl Learner {
    /// The place of a gesture. One that was named and has none yet gets that of one that has no samples any more, or another; nothing else changes by it.
    pub(super) fn place_for(&mut self, class: ClassId) -> Result<usize, LearnError> {
        if let Some(place) = self.vocabulary.place(class) {
            return Ok(place);
        }
        let unused = self.vocabulary.named().iter().enumerate().find(|(beyond, _)| {
            let place = self.vocabulary.labels().len() + beyond;
            self.samples.of(place).is_empty()
        });
        if let Some((_, unused)) = unused.filter(|_| class.is_named()) {
            let unused = *unused;
            self.vocabulary.rename(unused, class);
        } else {
            if !self.vocabulary.meet(class) {
                return Err(LearnError::Class(class));
            }
            self.samples.add_class();
            self.touched.push(false);
            self.folds.push(Vec::new());
            let mut known = std::mem::take(&mut self.pairs).into_iter().peekable();
            let all = pairs(self.vocabulary.classes()).map(|(i, j)| [i, j]);
            let pair = |classes| match known.next_if(|pair| pair.classes == classes) {
                Some(known) => known,
                None => self.fresh(classes),
            };
            self.pairs = all.map(pair).collect();
        }
        self.vocabulary.place(class).ok_or(LearnError::Class(class))
    }

    /// A pair that knows the samples of its classes.
    fn fresh(&self, classes: [usize; 2]) -> Pair {
        let mut pair = Pair::new(classes);
        for class in classes {
            for position in 0..self.samples.of(class).len() {
                pair.insert(&self.samples, Place { class, position });
            }
        }
        pair
    }
}
