//! Who moves before a camera that stands still: nobody, somebody, or somebody who holds still.
//!
//! Each frame is reduced to a small view (`view`) and compared with a slightly older one, and, while nothing moves, with
//! the empty scene (`background`). What is left of the difference after light, noise and trembling is allowed for
//! (`difference`) is the frame's motion energy; its recent course (`energy`) decides. Everything counts in seconds, so a
//! camera of 2 frames per second and one of 30 take the same parameters and tell the same story, each with its own
//! [`MotionDetector::delay`].
//!
//! **Still or empty?** Somebody who holds still differs from the empty scene. Until that was seen, a scene counts as
//! *still*: somebody may be in it. A scene is taken for empty when nothing moves in it for the first
//! [`MotionConfig::learn`]; when it comes back just as it was before somebody moved, since hardly anybody comes back to the
//! same pose, unless another scene has done so before; or when nothing at all moves in it for [`MotionConfig::absorb`]:
//! furniture.
//!
//! Limits: before a camera that moves itself everything moves. At 15 frames per second and fewer, a lamp or screen that
//! is switched cannot be told from a movement.

mod background;
mod difference;
mod energy;
mod view;

use std::time::Duration;

use gestalt_protocol::MotionState;
use opencv::core::{Mat, MatTraitConst, Size};
use thiserror::Error;

pub use crate::config::{MotionConfig, MotionConfigError};
use background::Background;
use difference::Difference;
use energy::Energy;
use view::View;

use crate::reduction::Reduction;

/// By how many pixels of a view, a hundredth of its width each two, things may tremble before a movement begins.
const COARSE: i32 = 2;

/// And while it lasts, and when a scene is compared with the empty one.
const FINE: i32 = 1;

/// Between frames that lie further apart than this, somebody who holds still sways as much as they ever do.
const SWAY: Duration = Duration::from_millis(250);

/// How much more of the picture must change between such frames,
const SLOW: f64 = 3.0;

/// and how much of what somebody covers of it: near hands sway over more pixels than far ones.
const SWAYS: f64 = 1.0 / 16.0;

/// Why a frame could not be watched, or a detector not be made.
#[derive(Debug, Error)]
pub enum MotionError {
    /// A parameter outside its range.
    #[error("motion: {0}")]
    Config(#[from] MotionConfigError),
    /// The frame is no picture of at least 16×16 pixels, 8-bit BGR. The detector is ready for the next one.
    #[error(
        "motion: a frame of {width}×{height} pixels and {channels} channels cannot be watched: 8-bit BGR, 16×16 or more"
    )]
    Frame {
        /// Its columns.
        width: i32,
        /// Its rows.
        height: i32,
        /// Its channels.
        channels: i32,
    },
    /// OpenCV failed.
    #[error("motion: OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// What a motion detector notices, once each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A hand moved from that time on, and now holds still.
    Shown {
        /// The time of the last frame before it moved.
        began: Duration,
    },
    /// The hand that held still is moving again, or gone.
    Left,
}

/// Watches the frames of one camera.
pub struct MotionDetector {
    config: MotionConfig,
    energy: Energy,
    difference: Difference,
    background: Background,
    state: MotionState,
    since: Duration,
    /// When the latest movement began; `None` when nothing has moved yet.
    began: Option<Duration>,
    /// Whether a hand was said to be shown that has not left.
    shown: bool,
    /// The share of the picture that somebody covers: what differed from the empty scene when last compared or, before that is
    /// known, the most that the movement changed.
    covered: f64,
    reduction: Reduction,
}

impl MotionDetector {
    /// A detector that has seen nothing yet. ([`MotionConfig::enabled`] is for whoever makes one to heed.)
    ///
    /// # Errors
    /// [`MotionError::Config`].
    pub fn new(config: MotionConfig) -> Result<Self, MotionError> {
        config.validate()?;
        Ok(Self {
            energy: Energy::new(&config),
            difference: Difference::default(),
            background: Background::new(&config),
            state: MotionState::Still,
            since: Duration::ZERO,
            began: None,
            shown: false,
            covered: 0.0,
            reduction: Reduction::default(),
            config,
        })
    }

    /// Takes in the next frame (BGR, 8 bits), taken at that time, and says what has begun or ended with it. A frame that
    /// is no newer than the last one tells nothing. Frames of another shape, or smaller than what all are
    /// reduced to, start everything anew.
    ///
    /// # Errors
    /// [`MotionError::Frame`] or [`MotionError::OpenCv`]; the detector is ready for the next frame.
    pub fn watch(&mut self, bgr: &Mat, at: Duration) -> Result<Option<Change>, MotionError> {
        let size = bgr.size()?;
        View::check(bgr, size)?;
        let mut reduction = std::mem::take(&mut self.reduction);
        let change = reduction.take(bgr, size).map_err(MotionError::from);
        let change = change.and_then(|()| self.watch_reduced(&reduction.image, size, at));
        self.reduction = reduction;
        change
    }

    /// The same, of a frame of size `whole` that was reduced already.
    pub(crate) fn watch_reduced(
        &mut self,
        reduced: &Mat,
        whole: Size,
        at: Duration,
    ) -> Result<Option<Change>, MotionError> {
        View::check(reduced, whole)?;
        if self.energy.newest().is_some_and(|newest| at <= newest) {
            return Ok(None);
        }
        let view = View::of(reduced, at, self.energy.spare())?;
        if self.energy.before().is_some_and(|before| !before.is_like(&view)) {
            return self.start_anew(view);
        }
        let gap = at.saturating_sub(self.energy.newest().unwrap_or(at));
        let Some(reference) = self.energy.reference_for(at) else {
            self.since = at;
            self.energy.begin(view);
            return Ok(None);
        };
        let moving = self.state == MotionState::Moving;
        // A movement goes on with less than it takes to begin one. Between the frames of a slow camera, though, somebody
        // who holds still sways as far as they ever do, and a hand that moves leaves its place altogether.
        let (reach, area) = match (at.saturating_sub(reference.at) > SWAY, moving) {
            (true, _) => (COARSE, (SLOW * self.config.area).max(SWAYS * self.covered)),
            (false, false) => (COARSE, self.config.area),
            (false, true) => (FINE, self.config.area / 2.0),
        };
        reference.allow(reach)?;
        let changed = self.difference.share(&view, reference, self.config.noise)?;
        let active = changed > area;
        let reference = reference.at;
        self.difference.learn_noise(gap);
        let before = self.energy.before().filter(|before| active && !moving && before.at != reference);
        let goes_on = match before {
            Some(before) => {
                before.allow(FINE)?;
                self.difference.share(&view, before, self.config.noise)? > self.config.area / 2.0
            }
            None => active,
        };
        self.energy.push(view, active, goes_on);
        if active && self.background.picture().is_none() {
            self.covered = if moving { self.covered.max(changed) } else { changed };
        }
        match self.state {
            MotionState::Moving => self.while_moving(),
            MotionState::Still => self.while_still(),
            MotionState::Empty => self.while_empty(),
        }
    }

    /// What it sees now.
    #[must_use]
    pub fn state(&self) -> MotionState {
        self.state
    }

    /// Since when it sees that, as far as it knows by now: the state was noticed up to [`MotionDetector::delay`] later.
    #[must_use]
    pub fn since(&self) -> Duration {
        self.since
    }

    /// How late a change of state is noticed at the rate of the latest frames; `None` before there were two. The end of
    /// a movement takes longest: about a frame at 2 frames per second, a little more than [`MotionConfig::hold`] at 30.
    #[must_use]
    pub fn delay(&self) -> Option<Duration> {
        self.energy.delay()
    }

    /// The scene without anybody, small, BGR, 8 bits, of the frame's aspect; `None` until one was seen.
    #[must_use]
    pub fn background(&self) -> Option<&Mat> {
        self.background.picture()
    }

    /// The camera is another one, or has another format.
    fn start_anew(&mut self, view: View) -> Result<Option<Change>, MotionError> {
        let left = std::mem::take(&mut self.shown).then_some(Change::Left);
        *self = Self::new(self.config.clone())?;
        self.since = view.at;
        self.energy.begin(view);
        Ok(left)
    }

    fn while_moving(&mut self) -> Result<Option<Change>, MotionError> {
        let Some(since) = self.energy.quiet_since() else { return Ok(None) };
        if !self.is_somebody_there()? {
            self.background.confirm();
            self.enter(MotionState::Empty, since);
            return Ok(None);
        }
        if !self.background.is_confirmed() && self.has_come_back()? {
            self.background.take_instead(self.energy.view())?;
            self.enter(MotionState::Empty, since);
            return Ok(None);
        }
        self.background.remember(self.energy.view());
        self.enter(MotionState::Still, since);
        self.shown = true;
        Ok(Some(Change::Shown { began: self.began.unwrap_or(since) }))
    }

    fn while_still(&mut self) -> Result<Option<Change>, MotionError> {
        if self.energy.moving_since().is_some() {
            return Ok(self.start_moving());
        }
        let quiet = self.energy.quiet_for();
        if self.began.is_none() && quiet >= self.config.hold && self.background.remembered().next().is_none()
        {
            // The first scene of all may be the empty one, and come back.
            self.background.remember(self.energy.view());
        }
        let patience = if self.began.is_none() { self.config.learn } else { self.config.absorb };
        if quiet >= patience {
            self.background.take_for_empty(self.energy.view())?;
        } else if self.background.picture().is_none()
            || !self.background.is_due(self.energy.view().at)
            || self.is_somebody_there()?
        {
            return Ok(None);
        }
        self.enter(MotionState::Empty, self.energy.view().at);
        Ok(std::mem::take(&mut self.shown).then_some(Change::Left))
    }

    fn while_empty(&mut self) -> Result<Option<Change>, MotionError> {
        if self.energy.moving_since().is_some() {
            return Ok(self.start_moving());
        }
        // A movement that begins slowly must not become part of the empty scene.
        if self.energy.is_calm() {
            self.background.follow(self.energy.view())?;
        }
        Ok(None)
    }

    fn start_moving(&mut self) -> Option<Change> {
        let began = self.energy.moving_since().unwrap_or_default();
        self.began = Some(began);
        self.enter(MotionState::Moving, began);
        std::mem::take(&mut self.shown).then_some(Change::Left)
    }

    fn enter(&mut self, state: MotionState, since: Duration) {
        self.state = state;
        self.since = since;
    }

    /// Whether the newest frame differs from the empty scene; it does as long as that was never seen.
    fn is_somebody_there(&mut self) -> Result<bool, MotionError> {
        let Some(empty) = self.background.view() else { return Ok(true) };
        empty.allow(FINE)?;
        let differs = self.difference.share(self.energy.view(), empty, self.config.noise)?;
        self.background.was_compared(self.energy.view().at);
        self.covered = differs;
        Ok(differs > self.config.presence)
    }

    /// Whether the newest frame shows a scene that held still once before. Half as much may differ as makes somebody.
    fn has_come_back(&mut self) -> Result<bool, MotionError> {
        for before in self.background.remembered() {
            before.allow(FINE)?;
            let differs = self.difference.share(self.energy.view(), before, self.config.noise)?;
            if differs <= self.config.presence / 2.0 {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

#[cfg(test)]
mod tests;
