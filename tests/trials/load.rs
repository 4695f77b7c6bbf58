//! How much of the processor a trial takes, and who runs beside whom.

use std::sync::{Condvar, Mutex, PoisonError};

/// What a trial does most of its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// It waits: for rounds, leases, deadlines. Half a core is plenty.
    Waits,
    /// It computes, or sees through cameras: a core.
    Works,
    /// It measures the whole process or fills the machine: nothing runs beside it.
    Alone,
}

/// The places of this machine, two for each core. Trials take theirs in the order in which they ask, so that one that needs
/// all of them is not kept waiting by those that need one.
pub(crate) struct Room {
    places: usize,
    free: Mutex<usize>,
    freed: Condvar,
    door: Mutex<()>,
}

/// Places taken; given back when dropped.
pub(crate) struct Place<'a> {
    room: &'a Room,
    taken: usize,
}

impl Room {
    pub(crate) fn of_this_machine() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        // More would share the network stack, the disk and the scheduler rather than the cores.
        Self::new(2 * cores.min(4))
    }

    fn new(places: usize) -> Self {
        Self { places, free: Mutex::new(places), freed: Condvar::new(), door: Mutex::new(()) }
    }

    pub(crate) fn places(&self) -> usize {
        self.places
    }

    /// Waits until there is room.
    pub(crate) fn take(&self, load: Load) -> Place<'_> {
        let taken = match load {
            Load::Waits => 1,
            Load::Works => 2.min(self.places),
            Load::Alone => self.places,
        };
        let _first = self.door.lock().unwrap_or_else(PoisonError::into_inner);
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut free =
            self.freed.wait_while(free, |free| *free < taken).unwrap_or_else(PoisonError::into_inner);
        *free -= taken;
        Place { room: self, taken }
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        *self.room.free.lock().unwrap_or_else(PoisonError::into_inner) += self.taken;
        self.room.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_waits_runs_side_by_side_and_who_wants_to_be_alone_is_next() {
        let room = Room::new(4);
        let first = room.take(Load::Waits);
        let second = room.take(Load::Works);
        let (say, said) = mpsc::channel();
        std::thread::scope(|scope| {
            let told = say.clone();
            let room = &room;
            scope.spawn(move || {
                let _all = room.take(Load::Alone);
                told.send("alone").unwrap();
            });
            // The one that wants to be alone stands at the door.
            while room.door.try_lock().is_ok() {
                std::thread::yield_now();
            }
            scope.spawn(move || {
                let _place = room.take(Load::Waits);
                say.send("beside").unwrap();
            });
            drop(first);
            assert!(
                said.recv_timeout(Duration::from_millis(50)).is_err(),
                "one of four places is taken twice"
            );
            drop(second);
            assert_eq!([said.recv().unwrap(), said.recv().unwrap()], ["alone", "beside"]);
        });
        assert_eq!(*room.free.lock().unwrap(), 4, "all places are given back");
    }
}
