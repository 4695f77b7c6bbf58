//! Whoever waits for messages is woken while the signature of one is checked: to be woken takes about as long as a check.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

/// Nobody is woken early again within this time: a flood of what is refused wakes nobody for nothing.
const PAUSE: Duration = Duration::from_millis(10);

/// The longest that whoever was woken early waits for what it was woken for; a check takes half of it on a slow core.
const LONGEST: Duration = Duration::from_micros(200);

/// The checks that are under way.
#[derive(Default)]
pub(crate) struct Checks {
    under_way: AtomicUsize,
    woken: Mutex<Option<Instant>>,
}

/// A check that is under way until this is dropped.
pub(crate) struct Check<'a>(&'a Checks);

impl Checks {
    /// Begins one, and wakes whoever is to be given what comes of it.
    pub fn begin(&self, waiting: &Notify) -> Check<'_> {
        self.under_way.fetch_add(1, Ordering::AcqRel);
        let now = Instant::now();
        let mut woken = self.woken.lock().unwrap_or_else(PoisonError::into_inner);
        if woken.is_none_or(|woken| now.saturating_duration_since(woken) >= PAUSE) {
            *woken = Some(now);
            waiting.notify_one();
        }
        Check(self)
    }

    /// Waits until none is under way, but not for long.
    pub fn wait(&self) {
        let began = Instant::now();
        while self.under_way.load(Ordering::Acquire) > 0 && began.elapsed() < LONGEST {
            // A robot of one core checks on the core that this waits on.
            std::thread::yield_now();
        }
    }
}

impl Drop for Check<'_> {
    fn drop(&mut self) {
        self.0.under_way.fetch_sub(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn who_waits_is_woken_when_a_check_begins_and_then_waits_for_its_end() {
        let (checks, ready) = (Checks::default(), Notify::new());
        let check = checks.begin(&ready);
        ready.notified().await;
        let ended = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                ended.store(true, Ordering::Release);
                drop(check);
            });
            while checks.under_way.load(Ordering::Acquire) > 0 {
                checks.wait();
            }
            assert!(ended.load(Ordering::Acquire));
        });
    }

    #[test]
    fn nobody_waits_for_ever() {
        let (checks, ready) = (Checks::default(), Notify::new());
        let _endless = checks.begin(&ready);
        checks.wait();
    }

    #[tokio::test]
    async fn a_flood_wakes_once_in_a_while() {
        let (checks, ready) = (Checks::default(), Notify::new());
        let (mut woken, mut begun, start) = (0, 0, Instant::now());
        while start.elapsed() < 5 * PAUSE {
            drop(checks.begin(&ready));
            begun += 1;
            woken += u32::from(tokio::time::timeout(Duration::ZERO, ready.notified()).await.is_ok());
        }
        let pauses = start.elapsed().as_micros() / PAUSE.as_micros();
        assert!(woken >= 1 && u128::from(woken) <= pauses + 1, "{woken} of {begun} in {pauses} pauses");
    }
}
