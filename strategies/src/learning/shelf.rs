//! What robots of one process hold alike, held once.

use std::borrow::Borrow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use gestalt_protocol::{HeldBatch, HeldVote, RobotId, RoundId, SampleId, Stamp};
use gestalt_rounds::Testimony;

/// By which lists of who is alive are found: how many they are, and the first.
type Alive = (usize, Option<RobotId>);

/// How many things a board holds at least before it is looked through for those that nobody holds any more.
const FEW: usize = 1024;

/// Where robots that live in one process put what all of them hold: shared samples, the batches they came in, votes, and what those of a round came to, who is alive. Each still takes in
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
    alive: Mutex<Board<Alive, BTreeSet<RobotId>>>,
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

    pub(super) fn alive(&self, robots: &BTreeSet<RobotId>) -> Arc<BTreeSet<RobotId>> {
        put(&self.alive, (robots.len(), robots.first().copied()), robots.clone())
    }
}

/// What is held somewhere, by name.
#[derive(Debug)]
struct Board<K, T: ?Sized> {
    held: BTreeMap<K, Weak<T>>,
    /// At how many it is looked through again.
    full: usize,
}

impl<K, T: ?Sized> Default for Board<K, T> {
    fn default() -> Self {
        Self { held: BTreeMap::new(), full: FEW }
    }
}

/// The one that is held already, if it is the same; else this one, for whoever comes next with the same.
fn put<K: Ord, T: PartialEq + ?Sized, V: Borrow<T> + Into<Arc<T>>>(
    board: &Mutex<Board<K, T>>,
    name: K,
    value: V,
) -> Arc<T> {
    // What is on it is held by others: a thread that ended half-way leaves nothing wrong behind.
    let mut board = board.lock().unwrap_or_else(PoisonError::into_inner);
    let held = board.held.get(&name).and_then(Weak::upgrade);
    if let Some(held) = held.filter(|held| **held == *value.borrow()) {
        return held;
    }
    let value = value.into();
    board.held.insert(name, Arc::downgrade(&value));
    if board.held.len() >= board.full {
        board.held.retain(|_, held| held.strong_count() > 0);
        board.full = FEW.max(2 * board.held.len());
    }
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
        assert!(!Arc::ptr_eq(&first, &shelf.vector(id(2), vec![1.0, 2.0])), "of another name");
    }

    #[test]
    fn robots_that_see_the_same_robots_hold_one_list_of_them() {
        let shelf = Shelf::default();
        let all: BTreeSet<RobotId> = (1..=50).map(RobotId).collect();
        let held = shelf.alive(&all);
        assert!(Arc::ptr_eq(&held, &shelf.alive(&all.clone())));
        let others: BTreeSet<RobotId> = (1..50).chain([60]).map(RobotId).collect();
        assert_eq!(*shelf.alive(&others), others, "as many, from the same one on");
        assert_eq!(*held, all);
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
