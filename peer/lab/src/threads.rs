//! Work on many robots that is done in any order.

use std::num::NonZero;
use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// In so many shares each thread gets its part of the work: the last ones even out what takes longer.
const SHARES: usize = 16;

/// Threads that stay, for work that comes a thousand times a second: to start some each time takes as long as a little work, and what threads leave of the
/// memory that they had is a tenth of all.
///
/// Whoever has work done is to be no thread of rayon's, see [`apart`].
pub(crate) struct Crew {
    threads: usize,
    /// All but the one that has work done, from the first time on that they are wanted.
    others: OnceLock<ThreadPool>,
}

impl Crew {
    /// So many threads, the one that has work done among them.
    pub fn of(threads: usize) -> Self {
        Self { threads: threads.max(1), others: OnceLock::new() }
    }

    /// As many threads as the machine has cores for.
    pub fn on_all_cores() -> Self {
        Self::of(std::thread::available_parallelism().map_or(1, NonZero::get))
    }

    /// Whether there is nobody but the one that has work done.
    pub fn is_alone(&self) -> bool {
        self.threads == 1
    }

    /// Does that with each of these.
    pub fn on_each<T: Send>(&self, all: Vec<T>, work: impl Fn(T) + Sync) {
        if self.is_alone() || all.len() < 2 {
            return all.into_iter().for_each(work);
        }
        let others = self.threads.min(all.len()) - 1;
        // Several at a time, where there are many: of a little work waiting for each other would be the most.
        let share = (all.len() / (SHARES * self.threads)).max(1);
        let left = Mutex::new(all.into_iter());
        let next =
            || left.lock().unwrap_or_else(PoisonError::into_inner).by_ref().take(share).collect::<Vec<T>>();
        let work_on = || {
            let mut some = next();
            while !some.is_empty() {
                some.into_iter().for_each(&work);
                some = next();
            }
        };
        self.others().in_place_scope(|scope| {
            for _ in 0..others {
                scope.spawn(|_| work_on());
            }
            work_on();
        });
    }

    /// The threads that wait for work.
    fn others(&self) -> &ThreadPool {
        self.others.get_or_init(|| {
            let threads = ThreadPoolBuilder::new().num_threads(self.threads - 1);
            threads.build().expect("the system gives an emulation its threads")
        })
    }
}

/// Does that on a thread of its own. A thread of rayon's that waits for others takes up other work meanwhile, which may be a whole emulation.
#[cfg(feature = "experiments")]
pub(crate) fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let done = std::thread::scope(|scope| scope.spawn(work).join());
    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
