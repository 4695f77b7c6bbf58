//! A thread beside a robot's task: it is handed work, and takes all that has gathered at once.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A running thread, and the tray where its work gathers. Dropping it waits for the thread's end.
pub(crate) struct Worker<P> {
    tray: Arc<Tray<P>>,
    thread: Option<JoinHandle<()>>,
}

/// Where work gathers.
pub(crate) struct Tray<P> {
    state: Mutex<State<P>>,
    changed: Condvar,
}

struct State<P> {
    pending: P,
    ended: bool,
}

impl<P: Send + 'static> Worker<P> {
    /// Starts a thread of that name, which `work`s until the tray says that it has ended; `died` is told of a panic that
    /// `work` did not catch itself.
    pub fn start(
        name: &str,
        pending: P,
        work: impl FnOnce(&Tray<P>) + Send + 'static,
        died: impl FnOnce(&(dyn Any + Send)) + Send + 'static,
    ) -> std::io::Result<Self> {
        let state = State { pending, ended: false };
        let tray = Arc::new(Tray { state: Mutex::new(state), changed: Condvar::new() });
        let of_thread = tray.clone();
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| work(&of_thread))) {
                died(&*panic);
            }
        })?;
        Ok(Self { tray, thread: Some(thread) })
    }

    /// Adds to what is pending.
    pub fn hand_over<T>(&self, add: impl FnOnce(&mut P) -> T) -> T {
        let added = add(&mut self.tray.lock().pending);
        self.tray.changed.notify_one();
        added
    }
}

impl<P> Drop for Worker<P> {
    fn drop(&mut self) {
        self.tray.lock().ended = true;
        self.tray.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // Its panic was told of when it happened.
            let _ = thread.join();
        }
    }
}

impl<P> Tray<P> {
    fn lock(&self) -> MutexGuard<'_, State<P>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until there is work, but no longer than `patience`, or no more will come; and takes what there is. The second
    /// value says whether this was the last of it.
    pub fn take<T>(
        &self,
        is_work: impl Fn(&P) -> bool,
        patience: Duration,
        take: impl FnOnce(&mut P) -> T,
    ) -> (T, bool) {
        let idle = |state: &mut State<P>| !is_work(&state.pending) && !state.ended;
        let waited = self.changed.wait_timeout_while(self.lock(), patience, idle);
        let mut state = waited.unwrap_or_else(PoisonError::into_inner).0;
        (take(&mut state.pending), state.ended)
    }

    /// Puts back what could not be done, and waits so long, or until the end. Says whether that has come.
    pub fn put_back(&self, put: impl FnOnce(&mut P), pause: Duration) -> bool {
        let mut state = self.lock();
        put(&mut state.pending);
        let waited = self.changed.wait_timeout_while(state, pause, |state| !state.ended);
        waited.unwrap_or_else(PoisonError::into_inner).0.ended
    }
}
