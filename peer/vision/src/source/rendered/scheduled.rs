//! A rendered camera before a human who goes by the clock.

use std::time::Duration;

use super::RenderedSource;
use crate::human::{Human, Schedule};
use crate::source::{Frame, Scene, Source, SourceError};

/// A rendered camera that sees what a human shows at the time of day. Every process that knows the same human, schedule
/// and time sees the same.
pub struct ScheduledSource {
    camera: RenderedSource,
    human: Human,
    schedule: Schedule,
    zero: Duration,
}

impl ScheduledSource {
    /// `zero` is the time since 1970 at which the time of [`Source::next_frame`] is zero.
    #[must_use]
    pub fn new(camera: RenderedSource, human: Human, schedule: Schedule, zero: Duration) -> Self {
        Self { camera, human, schedule, zero }
    }
}

impl Source for ScheduledSource {
    fn describe(&self) -> String {
        "rendered by the clock".to_owned()
    }

    fn period(&self) -> Duration {
        self.camera.period()
    }

    /// Draws what the human shows at that time; the scene handed in is nothing to it.
    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        let (scene, away_m) = self.human.shows_at(self.zero + now, &self.schedule);
        self.camera.move_hand(away_m);
        self.camera.next_frame(now, &scene)
    }
}
