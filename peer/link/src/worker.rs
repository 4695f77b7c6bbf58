//! A thread beside a robot's task: it is handed work, and takes all that has gathered at once.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A running thread, and the desk where its work gathers. Dropping it waits for the thread's end.
pub(crate) struct Worker<P> {
    desk: Arc<Desk<P>>,
    thread: Option<JoinHandle<()>>,
}

/// Where work gathers.
pub(crate) struct Desk<P> {
    state: Mutex<State<P>>,
    changed: Condvar,
}

struct State<P> {
    pending: P,
    ended: bool,
}

impl<P: Default + Send + 'static> Worker<P> {
    /// Starts a thread of that name, which `work`s until the desk says that it has ended.
    pub fn start(name: &str, work: impl FnOnce(&Desk<P>) + Send + 'static) -> std::io::Result<Self> {
        let state = State { pending: P::default(), ended: false };
        let desk = Arc::new(Desk { state: Mutex::new(state), changed: Condvar::new() });
        let of_thread = desk.clone();
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || work(&of_thread))?;
        Ok(Self { desk, thread: Some(thread) })
    }

    /// Adds to what is pending.
    pub fn hand_over(&self, add: impl FnOnce(&mut P)) {
        add(&mut self.desk.lock().pending);
        self.desk.changed.notify_one();
    }
}

impl<P> Drop for Worker<P> {
    fn drop(&mut self) {
        self.desk.lock().ended = true;
        self.desk.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            let name = thread.thread().name().unwrap_or("a worker").to_owned();
            if thread.join().is_err() {
                tracing::error!("the thread '{name}' ended badly");
            }
        }
    }
}

impl<P> Desk<P> {
    fn lock(&self) -> MutexGuard<'_, State<P>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until there is work, or no more will come. What is pending is taken; the second value says whether this
    /// was the last of it.
    pub fn take(&self, is_work: impl Fn(&P) -> bool) -> (P, bool)
    where
        P: Default,
    {
        let idle = |state: &mut State<P>| !is_work(&state.pending) && !state.ended;
        let mut state = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut state.pending), state.ended)
    }

    /// Puts back what could not be done, and waits so long, or until the end. Says whether that has come.
    pub fn put_back(&self, put: impl FnOnce(&mut P), pause: Duration) -> bool {
        let mut state = self.lock();
        put(&mut state.pending);
        let waited = self.changed.wait_timeout_while(state, pause, |state| !state.ended);
        waited.unwrap_or_else(PoisonError::into_inner).0.ended
    }
}
