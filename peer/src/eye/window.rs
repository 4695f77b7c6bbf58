//! A window into a robot's eye, for whoever looks over its shoulder.
//!
//! The eye sees for its swarm first: it never looks where it would not have looked anyway, it never waits, and while nobody wants
//! to see anything, or has just been shown something, nothing is even copied.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_vision::sight::{Sight, Taken};
use opencv::core::{Mat, Rect};

/// Where an eye leaves what it sees.
#[derive(Debug)]
pub struct Window {
    /// The zero of the eye's time.
    zero: Instant,
    /// The least time between two glimpses.
    every: Duration,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    wanted: bool,
    closed: bool,
    /// When the last glimpse was taken.
    last: Option<Duration>,
    glimpse: Option<Glimpse>,
}

/// One frame, and what the eye found in it.
#[derive(Clone, Debug)]
pub struct Glimpse {
    /// The frame, BGR.
    pub image: Mat,
    /// When it was taken.
    pub taken: Instant,
    /// What was found.
    pub found: Found,
}

/// What an eye found in a frame.
#[derive(Clone, Debug)]
pub enum Found {
    /// It was not asked to: no round is open.
    NotLooked,
    /// Something moves, and what moves is no evidence.
    Moving,
    /// No hand, and why.
    NoHand(String),
    /// A hand.
    Hand {
        /// In which part of the frame.
        region: Rect,
        /// Which pixels of that part, scaled, with a margin of one pixel (255; elsewhere 0).
        mask: Mat,
        /// What a classifier judges it by.
        features: Vec<f32>,
    },
}

impl Found {
    /// What a sight found in the frame that it took last.
    #[must_use]
    pub fn of(taken: &Taken, sight: &Sight) -> Self {
        match &taken.observation {
            Some(Ok(observation)) => Self::Hand {
                region: sight.perception().region(),
                mask: sight.perception().mask().clone(),
                features: observation.features.clone(),
            },
            Some(Err(cause)) => Self::NoHand(cause.to_string()),
            None if sight
                .motion()
                .is_some_and(|motion| motion.state == gestalt_protocol::MotionState::Moving) =>
            {
                Self::Moving
            }
            None => Self::NotLooked,
        }
    }
}

impl Window {
    pub(super) fn new(zero: Instant, every: Duration) -> Self {
        Self { zero, every, state: Mutex::default(), changed: Condvar::new() }
    }

    /// Whether anybody wants to see something from now on.
    pub fn want(&self, wanted: bool) {
        self.state().wanted = wanted;
    }

    /// Nobody will want to see anything any more.
    pub fn close(&self) {
        *self.state() = State { closed: true, ..State::default() };
        self.changed.notify_all();
    }

    /// Waits for that long for the next glimpse; `Err` when the window was closed.
    ///
    /// # Errors
    /// [`Closed`].
    pub fn next(&self, patience: Duration) -> Result<Option<Glimpse>, Closed> {
        let waiting = |state: &mut State| state.glimpse.is_none() && !state.closed;
        let (mut state, _) = self
            .changed
            .wait_timeout_while(self.state(), patience, waiting)
            .unwrap_or_else(PoisonError::into_inner);
        if state.closed { Err(Closed) } else { Ok(state.glimpse.take()) }
    }

    /// Leaves a frame of that time there, if one is wanted and due. What nobody has taken is replaced.
    pub(super) fn offer(&self, image: &Mat, at: Duration, found: impl FnOnce() -> Found) {
        let mut state = self.state();
        let due = state.last.is_none_or(|last| at >= last + self.every);
        if !state.wanted || !due {
            return;
        }
        state.last = Some(at);
        // A frame may share its pixels with what the source fills next.
        let image = image.clone();
        state.glimpse = Some(Glimpse { image, taken: self.zero + at, found: found() });
        self.changed.notify_one();
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The window was closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nobody looks any more")]
pub struct Closed;

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use opencv::core::{CV_8UC3, Scalar};

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn nothing_is_kept_that_nobody_wants_and_no_more_than_was_asked_for() {
        let window = Window::new(Instant::now(), 500 * MS);
        let image = Mat::new_rows_cols_with_default(2, 2, CV_8UC3, Scalar::all(9.0)).unwrap();
        let asked = Cell::new(0);
        let offer = |at: u32| {
            window.offer(&image, at * MS, || {
                asked.set(asked.get() + 1);
                Found::NotLooked
            });
        };
        (0..5).for_each(offer);
        assert_eq!((asked.get(), window.next(MS).unwrap().is_none()), (0, true), "nobody wants it");
        window.want(true);
        (100..1700).step_by(10).for_each(offer);
        assert_eq!(asked.get(), 4, "at 100, 600, 1100 and 1600 ms");
        let glimpse = window.next(MS).unwrap().unwrap();
        assert_eq!(glimpse.taken, window.zero + 1600 * MS, "the newest is shown");
        assert!(window.next(MS).unwrap().is_none(), "and only once");
        window.want(false);
        offer(9000);
        assert_eq!(asked.get(), 4);
        window.close();
        assert!(matches!(window.next(MS), Err(Closed)));
    }
}
