//! The recent course of motion energy: a ring of seconds, not of frames.

use std::collections::VecDeque;
use std::time::Duration;

use super::{MotionConfig, View};

/// The most frames that are remembered, however fast the camera.
const MAX_FRAMES: usize = 512;

/// The most views that are kept to be compared with: one is used, the ones after it are used later.
const MAX_VIEWS: usize = 32;

/// The fewest frames that a rate is taken from.
const FEWEST: usize = 5;

#[derive(Clone, Copy)]
struct Moment {
    at: Duration,
    /// Whether enough of the picture changed, compared with the view of the time `reference`.
    active: bool,
    /// Whether it also changed since the frame before.
    goes_on: bool,
    reference: Duration,
}

/// What moved lately, and the views that the next frames are compared with.
pub(super) struct Energy {
    compare: Duration,
    react: Duration,
    hold: Duration,
    moments: VecDeque<Moment>,
    /// Oldest first; the newest is the last frame's.
    views: VecDeque<View>,
    spare: Option<View>,
    /// The last frame in which something moved, or the first one.
    last_active: Duration,
}

impl Energy {
    pub fn new(config: &MotionConfig) -> Self {
        Self {
            compare: config.compare,
            react: config.react,
            hold: config.hold,
            moments: VecDeque::new(),
            views: VecDeque::new(),
            spare: None,
            last_active: Duration::ZERO,
        }
    }

    /// When the newest frame was taken.
    pub fn newest(&self) -> Option<Duration> {
        self.moments.back().map(|moment| moment.at)
    }

    /// The view of the frame before, while there is one.
    pub fn before(&mut self) -> Option<&mut View> {
        self.views.back_mut()
    }

    /// The view of the newest frame.
    pub fn view(&self) -> &View {
        self.views.back().expect("only asked for after a frame was pushed")
    }

    /// The newest view that is old enough to compare a frame of that time with; the oldest there is when none is.
    pub fn reference_for(&mut self, at: Duration) -> Option<&mut View> {
        let half_period = at.saturating_sub(self.newest()?) / 2;
        let old_enough = |view: &View| at.saturating_sub(view.at) + half_period >= self.compare;
        let found = self.views.iter().rposition(old_enough).unwrap_or(0);
        self.views.get_mut(found)
    }

    /// Buffers of a view that is no longer needed.
    pub fn spare(&mut self) -> View {
        self.spare.take().unwrap_or_default()
    }

    /// The first frame: there is nothing to compare it with.
    pub fn begin(&mut self, view: View) {
        self.last_active = view.at;
        self.moments.push_back(Moment { at: view.at, active: false, goes_on: false, reference: view.at });
        self.views.push_back(view);
    }

    /// The next frame, whether enough of it changed, and whether it also did since the frame before.
    pub fn push(&mut self, view: View, active: bool, goes_on: bool) {
        let at = view.at;
        let reference = self.reference_for(at).map_or(at, |view| view.at);
        if active {
            self.last_active = at;
        }
        self.moments.push_back(Moment { at, active, goes_on, reference });
        self.views.push_back(view);
        while self.views.len() > MAX_VIEWS || self.views.get(1).is_some_and(|second| second.at <= reference) {
            self.spare = self.views.pop_front();
        }
        let window = self.hold.max(2 * self.react);
        while self.moments.len() > MAX_FRAMES
            || self.moments.len() > FEWEST && self.moments.front().is_some_and(|m| m.at + window < at)
        {
            self.moments.pop_front();
        }
    }

    /// The time between two frames, lately.
    fn period(&self) -> Option<Duration> {
        let intervals = u32::try_from(self.moments.len().checked_sub(1)?).ok().filter(|n| *n > 0)?;
        Some((self.moments.back()?.at - self.moments.front()?.at) / intervals)
    }

    /// When the movement under way began, if it is one: the last moment before it. It must have lasted for `react` and go
    /// on, or have lasted twice as long: a lamp or a screen that is switched changes the picture once. Frames come early and
    /// late by a part of their period, so half of one is granted.
    pub fn moving_since(&self) -> Option<Duration> {
        let run = self.moments.iter().rev().take_while(|moment| moment.active);
        let first = run.last()?;
        let before = self.moments.iter().rev().find(|moment| !moment.active).map_or(first.at, |m| m.at);
        let lasts = self.newest()?.saturating_sub(before);
        let needed = if self.moments.back()?.goes_on { self.react } else { 2 * self.react };
        (lasts + self.period()? / 2 >= needed).then_some(first.reference)
    }

    /// Since when nothing has moved, if that is long enough to be stillness.
    pub fn quiet_since(&self) -> Option<Duration> {
        (self.quiet_for() + self.period()? / 2 >= self.hold).then_some(self.last_active)
    }

    /// For how long nothing has moved.
    pub fn quiet_for(&self) -> Duration {
        self.newest().unwrap_or_default().saturating_sub(self.last_active)
    }

    /// Whether nothing moved in the newest frame.
    pub fn is_calm(&self) -> bool {
        self.moments.back().is_some_and(|moment| !moment.active)
    }

    /// How late the end of a movement is noticed: stillness must last for `hold`, as a whole number of frames, after the
    /// last frame that differs from the one it is compared with.
    pub fn delay(&self) -> Option<Duration> {
        let period = self.period()?.max(Duration::from_micros(1));
        let frames = |window: Duration| {
            let frames = (window.as_secs_f64() / period.as_secs_f64() - 0.5).ceil().max(1.0);
            period.mul_f64(frames)
        };
        Some(frames(self.hold) + frames(self.compare).saturating_sub(period))
    }
}
