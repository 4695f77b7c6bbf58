//! Parts that outlive their own panics: a camera's driver, a source of your own, perception.
//!
//! What panicked may be half changed, so it is dropped and made anew, later each time. One that panics again and again is
//! given up: a robot whose eye works now and then keeps its swarm waiting, one that is known to be blind does not.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use thiserror::Error;

/// How long to wait before the second try, and the longest wait.
pub(crate) const BACK_OFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(4));

/// After this many panics in a row a part is given up.
pub const PANICS: u32 = 5;

/// A part that has worked for this long has recovered: its next panic is its first.
pub const RECOVERED: Duration = Duration::from_secs(10);

/// Why a part gives nothing at the moment.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Broken {
    /// It panicked; it is made anew.
    #[error("panicked ({0}) and is started anew; it is a bug: RUST_BACKTRACE=1 shows where")]
    Again(String),
    /// It panicked [`PANICS`] times in a row, and is given up.
    #[error(
        "panicked {PANICS} times in a row ({0}) and is not started again: fix the bug that RUST_BACKTRACE=1 shows, then restart the program"
    )]
    GivenUp(String),
    /// It cannot be made anew.
    #[error("panicked, and cannot be started anew: {0}")]
    NotMade(String),
}

/// Runs what may panic; `Err` is what it said as it did. Whatever it was changing must not be used again.
///
/// # Errors
/// The panic's message.
pub fn caught<R>(run: impl FnOnce() -> R) -> Result<R, String> {
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
    })
}

/// Counts the panics of one part.
#[derive(Debug, Default)]
pub struct Panics {
    in_a_row: u32,
    last: Option<Duration>,
}

impl Panics {
    /// Notes a panic at `now`. Gives how long to wait until the part is made anew; `None`: it is given up.
    pub fn note(&mut self, now: Duration) -> Option<Duration> {
        if self.last.is_some_and(|last| now.saturating_sub(last) >= RECOVERED) {
            self.in_a_row = 0;
        }
        self.in_a_row += 1;
        self.last = Some(now);
        let (first, longest) = BACK_OFF;
        let wait = longest.min(first * 2u32.saturating_pow(self.in_a_row - 1));
        (self.in_a_row < PANICS).then_some(wait)
    }
}

type Make<T> = Box<dyn FnMut() -> Result<T, String> + Send>;

/// A part that is made anew when it panics. All times are of one clock.
pub struct Steady<T> {
    part: Option<T>,
    make: Make<T>,
    panics: Panics,
    /// What is wrong, and when the part is made anew; `None`: never.
    broken: Option<(Broken, Option<Duration>)>,
}

impl<T> Steady<T> {
    /// That part, and what makes the next one, or says why there is none.
    pub fn new(part: T, make: impl FnMut() -> Result<T, String> + Send + 'static) -> Self {
        Self { part: Some(part), make: Box::new(make), panics: Panics::default(), broken: None }
    }

    /// Lets the part work at `now`.
    ///
    /// # Errors
    /// See [`Broken`], also for as long as it rests after a panic.
    pub fn run<R>(&mut self, now: Duration, work: impl FnOnce(&mut T) -> R) -> Result<R, Broken> {
        if let Some((broken, again)) = &self.broken {
            if again.is_none_or(|again| now < again) {
                return Err(broken.clone());
            }
            match caught(&mut self.make).and_then(|made| made) {
                Ok(part) => (self.part, self.broken) = (Some(part), None),
                Err(cause) => return Err(self.note(now, cause, Broken::NotMade)),
            }
        }
        let Some(part) = &mut self.part else { unreachable!("a part that is missing is broken") };
        match caught(|| work(part)) {
            Ok(done) => Ok(done),
            Err(message) => {
                // It may panic again as it goes.
                let part = self.part.take();
                let _ = caught(|| drop(part));
                Err(self.note(now, message, Broken::Again))
            }
        }
    }

    /// The part, unless it is broken.
    pub fn get(&self) -> Option<&T> {
        self.part.as_ref()
    }

    fn note(&mut self, now: Duration, message: String, kind: fn(String) -> Broken) -> Broken {
        let wait = self.panics.note(now);
        let broken = if wait.is_some() { kind(message) } else { Broken::GivenUp(message) };
        self.broken = Some((broken.clone(), wait.map(|wait| now + wait)));
        broken
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// A part that is the number of those made before it.
    fn part() -> (Steady<u32>, Arc<AtomicU32>) {
        let made = Arc::new(AtomicU32::new(0));
        let count = made.clone();
        (Steady::new(0, move || Ok(count.fetch_add(1, Ordering::Relaxed) + 1)), made)
    }

    #[test]
    fn a_part_that_panics_rests_and_is_made_anew() {
        let (mut part, made) = part();
        assert_eq!(part.run(ms(0), |part| *part), Ok(0));
        let broken = part.run(ms(10), |_| -> u32 { panic!("a {} fell out", "bit") }).unwrap_err();
        assert!(broken.to_string().contains("a bit fell out"), "{broken}");
        assert!(part.get().is_none());
        assert_eq!(part.run(ms(259), |part| *part), Err(broken), "it rests");
        assert_eq!((part.run(ms(260), |part| *part), made.load(Ordering::Relaxed)), (Ok(1), 1));
    }

    #[test]
    fn one_that_keeps_panicking_is_given_up() {
        let (mut part, made) = part();
        let mut rests = Vec::new();
        let mut last = String::new();
        for now in 0..60_000 {
            if part.run(ms(now), |_| panic!("again")).unwrap_err().to_string() != last || part.get().is_some()
            {
                last = part.run(ms(now), |_| ()).unwrap_err().to_string();
            }
            if rests.len() < made.load(Ordering::Relaxed) as usize {
                rests.push(now);
            }
        }
        assert_eq!(rests, [250, 750, 1750, 3750], "later each time");
        assert!(last.contains("5 times in a row (again)"), "{last}");
    }

    #[test]
    fn one_that_panics_seldom_is_never_given_up() {
        let (mut part, made) = part();
        for day in 1..=100 {
            let now = RECOVERED * day;
            assert!(matches!(part.run(now, |_| panic!("once")), Err(Broken::Again(_))));
            assert!(part.run(now + ms(250), |_| ()).is_ok());
        }
        assert_eq!(made.load(Ordering::Relaxed), 100);
    }

    #[test]
    fn one_that_cannot_be_made_says_why_and_is_tried_again() {
        let mut tries = 0;
        let mut part = Steady::new((), move || {
            tries += 1;
            if tries < 3 { Err("no room".to_owned()) } else { Ok(()) }
        });
        assert!(part.run(ms(0), |()| panic!("first")).is_err());
        assert_eq!(part.run(ms(250), |()| ()), Err(Broken::NotMade("no room".to_owned())));
        assert_eq!(part.run(ms(750), |()| ()), Err(Broken::NotMade("no room".to_owned())));
        assert_eq!(part.run(ms(1750), |()| ()), Ok(()));
    }
}
