//! One robot that is served: its sight, its voice, and how well it is served.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{CameraState, RoundId, Status};
use opencv::core::Mat;
use opencv::prelude::*;

use super::desk::{Count, Look};
use super::tally::{Lately, Tally};
use crate::opinion::opinion;
use crate::stream::MAX_MEGAPIXELS;
use crate::telling::tell;
use gestalt_link::{FrameArrival, Robot};
use gestalt_vision::sight::Sight;
use gestalt_vision::source::{Frame, decode};

/// A robot that is served.
pub(super) struct Seat {
    robot: Arc<Robot>,
    state: Mutex<State>,
}

struct State {
    sight: Sight,
    /// The frame at hand; its buffer is used again.
    frame: Frame,
    tally: Tally,
    heard: Instant,
    camera: CameraState,
    trouble: String,
    judged: u64,
    /// The hand it saw last, and when, since its robot's start.
    hand: Option<(Vec<f32>, Duration)>,
}

impl Seat {
    pub fn new(robot: Arc<Robot>, sight: Sight, now: Instant) -> Self {
        let frame = Frame { image: Mat::default(), at: Duration::ZERO };
        let tally = Tally::new(now);
        let (camera, trouble) = (CameraState::Opening, String::new());
        let state = State { sight, frame, tally, heard: now, camera, trouble, judged: 0, hand: None };
        Self { robot, state: Mutex::new(state) }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Looks at a frame, and tells the robot what it showed.
    pub fn look(&self, arrival: &FrameArrival) {
        let mut state = self.lock();
        let state = &mut *state;
        state.heard = arrival.at;
        if let Err(cause) = decode(&arrival.picture(), MAX_MEGAPIXELS, &mut state.frame.image) {
            self.robot.count("frames_failed");
            self.robot.report_error(&format!("streams {cause}"));
            return self.note(state, CameraState::Failing, &cause.to_string());
        }
        let zero = self.robot.started();
        let age = Duration::from_micros(u64::from(arrival.header.age_us));
        // Two frames of which the older was longer under way must not change places.
        let at = arrival.at.saturating_duration_since(zero).saturating_sub(age);
        state.frame.at = at.max(state.frame.at);
        let judge = self.round().is_some();
        let taken = state.sight.take(&state.frame, judge);
        if let Some(Ok(observation)) = &taken.observation {
            state.hand = Some((observation.features.clone(), taken.at));
        }
        tell(taken, &self.robot, zero);
        state.judged += u64::from(judge);
        state.tally.served(age + arrival.at.elapsed());
        self.note(state, CameraState::Live, "");
    }

    fn note(&self, state: &mut State, camera: CameraState, trouble: &str) {
        if state.camera == camera && state.trouble == trouble {
            return;
        }
        state.camera = camera;
        trouble.clone_into(&mut state.trouble);
        self.robot.blind(camera != CameraState::Live);
        let size = [state.frame.image.cols(), state.frame.image.rows()];
        self.robot.update_camera(|status| {
            status.state = camera;
            trouble.clone_into(&mut status.trouble);
            status.size = size.map(i32::unsigned_abs);
        });
    }

    /// Puts how it goes into the robot's status. Says for how long nothing was heard of it.
    pub fn report(&self, now: Instant, count: Count, frozen_after: Duration) -> Duration {
        let mut state = self.lock();
        let Lately { fps_received, fps_served, delay } = state.tally.lately(now, count.received);
        let silent = now.saturating_duration_since(state.heard);
        if silent >= frozen_after {
            let trouble = "no frames arrive: see that `gestalt stream` runs, and its way here";
            self.note(&mut state, CameraState::Frozen, trouble);
        }
        let size = [state.frame.image.cols(), state.frame.image.rows()];
        let motion = state.sight.motion();
        let seen = state.hand.take().zip(self.robot.classifier());
        let opinion = seen.and_then(|((features, at), classifier)| opinion(&*classifier, &features, at));
        self.robot.update_camera(|status| {
            status.motion = motion;
            status.opinion = opinion.or(status.opinion.take());
            status.fps = fps_served as f32;
            status.delay_ms = delay.0.as_secs_f32() * 1e3;
            status.size = size.map(i32::unsigned_abs);
        });
        let whole = |value: f64| value.round() as u64;
        for (name, value) in [
            ("frames_received", count.received),
            ("frames_overwritten", count.overwritten),
            ("frames_judged", state.judged),
            ("frames_received_per_second", whole(fps_received)),
            ("frame_delay_p50_us", whole(delay.0.as_secs_f64() * 1e6)),
            ("frame_delay_p99_us", whole(delay.1.as_secs_f64() * 1e6)),
        ] {
            self.robot.set(name, value);
        }
        silent
    }

    /// The robot's account of itself.
    pub fn status(&self) -> Status {
        self.robot.status()
    }

    /// Lets the robot leave the swarm, and waits until it has.
    pub async fn leave(self: Arc<Self>) {
        // A worker may have a last look; its seat is free a few milliseconds later.
        let mut seat = self;
        let robot = loop {
            match Arc::try_unwrap(seat) {
                Ok(seat) => break seat.robot,
                Err(shared) => seat = shared,
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        };
        if let Some(robot) = Arc::into_inner(robot) {
            robot.stop().await;
        }
    }
}

impl Look for Seat {
    fn round(&self) -> Option<RoundId> {
        self.robot.open()
    }
}
