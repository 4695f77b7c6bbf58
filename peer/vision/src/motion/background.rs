//! The scene without anybody in it.

use std::collections::VecDeque;
use std::time::Duration;

use opencv::core::{self, Mat};
use opencv::imgproc;
use opencv::prelude::*;

use super::{MotionConfig, View};

/// The empty scene is followed, and compared with, no more often than this.
const INTERVAL: Duration = Duration::from_millis(100);

/// The most scenes that are remembered for their coming back.
const MAX_REMEMBERED: usize = 4;

/// What a camera sees when nobody is there, as a running mean.
pub(super) struct Background {
    adapt: Duration,
    /// 32-bit floating point, so that small differences add up.
    mean: Mat,
    view: Option<View>,
    compared: Duration,
    remembered: VecDeque<View>,
    /// Whether it has come back after a movement.
    confirmed: bool,
}

impl Background {
    pub fn new(config: &MotionConfig) -> Self {
        Self {
            adapt: config.adapt,
            mean: Mat::default(),
            view: None,
            compared: Duration::ZERO,
            remembered: VecDeque::new(),
            confirmed: false,
        }
    }

    /// The empty scene as a view; its time is that of the last frame taken into it.
    pub fn view(&mut self) -> Option<&mut View> {
        self.view.as_mut()
    }

    pub fn picture(&self) -> Option<&Mat> {
        self.view.as_ref().map(|view| &view.picture)
    }

    /// Takes a view for the empty scene, whatever was before.
    pub fn take_for_empty(&mut self, view: &View) -> opencv::Result<()> {
        view.picture.convert_to(&mut self.mean, core::CV_32F, 1.0, 0.0)?;
        self.confirmed = false;
        self.show(view.at)
    }

    /// Takes a view for the empty scene, and remembers what was taken for it before.
    pub fn take_instead(&mut self, view: &View) -> opencv::Result<()> {
        if let Some(before) = self.view.take() {
            self.remember(&before);
        }
        self.take_for_empty(view)
    }

    /// It has come back after a movement.
    pub fn confirm(&mut self) {
        self.confirmed = true;
        self.remembered.clear();
    }

    pub fn is_confirmed(&self) -> bool {
        self.confirmed
    }

    /// Follows an empty scene.
    pub fn follow(&mut self, view: &View) -> opencv::Result<()> {
        let Some(before) = &self.view else { return self.take_for_empty(view) };
        let passed = view.at.saturating_sub(before.at);
        if passed < INTERVAL {
            return Ok(());
        }
        let weight = 1.0 - (-passed.as_secs_f64() / self.adapt.as_secs_f64()).exp();
        imgproc::accumulate_weighted(&view.picture, &mut self.mean, weight, &core::no_array())?;
        self.show(view.at)
    }

    /// Whether it is time to compare a frame of that time with it again.
    pub fn is_due(&self, at: Duration) -> bool {
        at.saturating_sub(self.compared) >= INTERVAL
    }

    pub fn was_compared(&mut self, at: Duration) {
        self.compared = at;
    }

    /// Remembers a scene that held still, but was not the empty one as far as is known.
    pub fn remember(&mut self, view: &View) {
        if self.remembered.len() == MAX_REMEMBERED {
            self.remembered.pop_front();
        }
        self.remembered.push_back(view.clone());
    }

    pub fn remembered(&mut self) -> impl Iterator<Item = &mut View> {
        self.remembered.iter_mut()
    }

    fn show(&mut self, at: Duration) -> opencv::Result<()> {
        let view = self.view.get_or_insert_default();
        view.renew(at);
        self.mean.convert_to(&mut view.picture, core::CV_8U, 1.0, 0.0)
    }
}
