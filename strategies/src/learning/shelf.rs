//! What robots of one process hold alike, held once.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use gestalt_protocol::{HeldBatch, HeldVote, RobotId, RoundId, SampleId, Stamp};
use gestalt_rounds::Testimony;
use smallvec::SmallVec;

use super::weighed::Weighed;
use crate::lessons::Verdict;

/// How many things a board holds at least before it is looked through for those that nobody holds any more.
const FEW: usize = 1024;

/// How many different things of one name are held once: robots that heard a round's votes in another order may have decided on others of them.
const VERSIONS: usize = 16;

/// Where robots that live in one process put what all of them hold: shared samples, the batches they came in, votes, what those of a round came to and say. Each still takes in
/// what it hears by itself, and what one of them is told otherwise than the others stays its own: only what is equal is held once. So what a robot does is
/// the same with a shelf and without; a thousand that hold the same thousand samples hold them once.
///
/// A robot gets it with [`Mind::with_shelf`](crate::Mind::with_shelf).
#[derive(Debug, Default)]
pub struct Shelf {
    vectors: Mutex<Board<SampleId, [f32]>>,
    batches: Mutex<Board<SampleId, HeldBatch>>,
    votes: Mutex<Board<(RobotId, Stamp), HeldVote>>,
    testimonies: Mutex<Board<RoundId, Testimony>>,
    weighed: Mutex<Board<RoundId, Weighed>>,
}

impl Shelf {
    pub(super) fn vector(&self, of: SampleId, vector: Vec<f32>) -> Arc<[f32]> {
        put(&self.vectors, of, vector)
    }

    pub(super) fn batch(&self, first: SampleId, batch: HeldBatch) -> Arc<HeldBatch> {
        put(&self.batches, first, batch)
    }

    pub(super) fn vote(&self, vote: HeldVote) -> Arc<HeldVote> {
        put(&self.votes, (vote.robot, vote.stamp), vote)
    }

    pub(super) fn testimony(&self, of: RoundId, testimony: Testimony) -> Arc<Testimony> {
        put(&self.testimonies, of, testimony)
    }

    /// What these votes say where it was about that; worked out unless somebody holds it.
    pub(super) fn weighed(
        &self,
        round: RoundId,
        testimony: &Arc<Testimony>,
        verdict: Verdict,
    ) -> Option<Arc<Weighed>> {
        let held = lock(&self.weighed).find(&round, |held| held.is_of(testimony, &verdict));
        if held.is_some() {
            return held;
        }
        let weighed = Arc::new(Weighed::new(testimony.clone(), verdict)?);
        lock(&self.weighed).put(round, &weighed);
        Some(weighed)
    }
}

/// What is held somewhere, by name.
#[derive(Debug)]
struct Board<K, T: ?Sized> {
    held: BTreeMap<K, SmallVec<[Weak<T>; 1]>>,
    /// At how many it is looked through again.
    full: usize,
}

impl<K, T: ?Sized> Default for Board<K, T> {
    fn default() -> Self {
        Self { held: BTreeMap::new(), full: FEW }
    }
}

impl<K: Ord, T: ?Sized> Board<K, T> {
    fn find(&self, name: &K, is_it: impl Fn(&T) -> bool) -> Option<Arc<T>> {
        self.held.get(name)?.iter().filter_map(Weak::upgrade).find(|held| is_it(held))
    }

    fn put(&mut self, name: K, value: &Arc<T>) {
        let versions = self.held.entry(name).or_default();
        versions.retain(|held| held.strong_count() > 0);
        if versions.len() == VERSIONS {
            versions.remove(0);
        }
        versions.push(Arc::downgrade(value));
        if self.held.len() >= self.full {
            self.held.retain(|_, versions| versions.iter().any(|held| held.strong_count() > 0));
            self.full = FEW.max(2 * self.held.len());
        }
    }
}

/// What is on it is held by others: a thread that ended half-way leaves nothing wrong behind.
fn lock<T>(board: &Mutex<T>) -> MutexGuard<'_, T> {
    board.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The one that is held already, if it is the same; else this one, for whoever comes next with the same.
fn put<K: Ord, T: PartialEq + ?Sized, V: Borrow<T> + Into<Arc<T>>>(
    board: &Mutex<Board<K, T>>,
    name: K,
    value: V,
) -> Arc<T> {
    let mut board = lock(board);
    if let Some(held) = board.find(&name, |held| *held == *value.borrow()) {
        return held;
    }
    let value = value.into();
    board.put(name, &value);
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u32) -> SampleId {
        SampleId { author: RobotId(1), life: 5, number }
    }

    #[test]
    fn what_is_equal_is_held_once_and_what_differs_is_not_mixed_up() {
        let shelf = Shelf::default();
        let first = shelf.vector(id(1), vec![1.0, 2.0]);
        assert!(Arc::ptr_eq(&first, &shelf.vector(id(1), vec![1.0, 2.0])));
        // A poisoner that says another thing under the same name.
        let other = shelf.vector(id(1), vec![1.0, 3.0]);
        assert_eq!((&*first, &*other), (&[1.0, 2.0][..], &[1.0, 3.0][..]));
        let again = [vec![1.0, 2.0], vec![1.0, 3.0]].map(|vector| shelf.vector(id(1), vector));
        assert!(
            Arc::ptr_eq(&first, &again[0]) && Arc::ptr_eq(&other, &again[1]),
            "each of both is held once"
        );
        assert!(!Arc::ptr_eq(&first, &shelf.vector(id(2), vec![1.0, 2.0])), "of another name");
    }

    #[test]
    fn what_nobody_holds_is_let_go() {
        let shelf = Shelf::default();
        let kept = shelf.vector(id(1), vec![0.5]);
        (2..100_000).for_each(|number| drop(shelf.vector(id(number), vec![0.5])));
        assert!(shelf.vectors.lock().unwrap().held.len() <= 2 * FEW);
        assert!(Arc::ptr_eq(&kept, &shelf.vector(id(1), vec![0.5])));
    }
}
