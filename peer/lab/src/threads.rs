//! Work on many robots that is done in any order.

use std::num::NonZero;
use std::sync::{Mutex, PoisonError};

/// As many threads as the machine has cores for.
pub(crate) fn all_cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Does that with each of these, on so many threads at most.
pub(crate) fn on_each<T: Send>(threads: usize, all: Vec<T>, work: impl Fn(T) + Sync) {
    let threads = threads.min(all.len());
    if threads <= 1 {
        return all.into_iter().for_each(work);
    }
    let left = Mutex::new(all.into_iter());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work_on = || {
        while let Some(one) = next() {
            work(one);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work_on);
        }
        work_on();
    });
}
