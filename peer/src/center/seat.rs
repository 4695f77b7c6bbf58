//! One robot that is served: its sight, its voice, and how well it is served.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{Motion, MotionState, RoundId, Status};
use opencv::core::{Mat, Size};

use super::frame_queue::{Count, Look};
use super::pace::{Pace, Paces};
use super::service::{Lately, Service};
use crate::body::alone;
use crate::camera_report::CameraReport;
use crate::stream::MAX_MEGAPIXELS;
use crate::telling::{tell, tell_camera};
use gestalt_link::{FrameArrival, Robot};
use gestalt_vision::sight::{Sight, Taken};
use gestalt_vision::source::{Frame, PictureError, SourceError, decode_reduced};
use gestalt_vision::steady::{Broken, Steady};

/// What the status says of the camera.
const SOURCE: &str = "stream";

/// A robot that is served.
pub(super) struct Seat {
    robot: Arc<Robot>,
    /// Held while a frame is decoded and looked at: by workers alone.
    eye: Mutex<Eye>,
    /// Never held for long.
    record: Mutex<Record>,
    /// Likewise.
    pace: Mutex<Pace>,
}

struct Eye {
    sight: Steady<Sight>,
    /// The frame at hand, as it is or reduced; their buffers are used again.
    whole: Frame,
    reduced: Frame,
}

struct Record {
    camera: CameraReport,
    motion: Option<Motion>,
    service: Service,
    heard: Instant,
    judged: u64,
}

impl Seat {
    /// A seat for that robot, which counts as blind until a picture of it was seen. It is silent after `patience`.
    pub fn new(robot: Arc<Robot>, sight: Steady<Sight>, paces: Paces, patience: Duration) -> Self {
        let now = Instant::now();
        robot.blind(true);
        let mut camera = CameraReport::of_stream(patience, robot.started().elapsed());
        tell_camera(&mut camera, &robot, SOURCE, None, robot.started());
        let frame = || Frame { image: Mat::default(), at: Duration::ZERO };
        let eye = Eye { sight, whole: frame(), reduced: frame() };
        let record = Record { camera, motion: None, service: Service::new(now), heard: now, judged: 0 };
        Self { robot, eye: Mutex::new(eye), record: Mutex::new(record), pace: Mutex::new(Pace::new(paces)) }
    }

    fn record(&self) -> MutexGuard<'_, Record> {
        self.record.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn pace(&self) -> MutexGuard<'_, Pace> {
        self.pace.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the swarm's newest roster has the robot with the key that it votes by.
    pub fn is_enrolled(&self) -> bool {
        self.robot.is_enrolled()
    }

    /// Looks at a frame, and tells the robot what it showed.
    ///
    /// # Errors
    /// When whatever looks for the robot is broken; its status says so already.
    pub fn look(&self, arrival: &FrameArrival) -> Result<(), Broken> {
        self.record().heard = arrival.at;
        let zero = self.robot.started();
        let age = Duration::from_micros(u64::from(arrival.header.age_us));
        let mut eye = self.eye.lock().unwrap_or_else(PoisonError::into_inner);
        let Eye { sight, whole, reduced } = &mut *eye;
        // Two frames of which the older was longer under way must not change places.
        let at = arrival.at.saturating_duration_since(zero).saturating_sub(age);
        let at = at.max(whole.at).max(reduced.at);
        let period = Duration::from_secs_f32(1.0 / arrival.header.fps.max(0.1));
        let judge = self.judges(zero + at, period);
        let now = zero.elapsed();
        let looked = sight.run(now, |sight| -> Result<(Size, Taken), PictureError> {
            let (picture, closely) = (arrival.picture(), sight.looks_closely(judge));
            let frame = if closely { whole } else { reduced };
            frame.at = at;
            let enough = |size| if closely { size } else { sight.enough(size) };
            let size = decode_reduced(&picture, MAX_MEGAPIXELS, enough, &mut frame.image)?;
            sight.rate_is(f64::from(arrival.header.fps));
            Ok((size, sight.take_reduced(frame, size, judge)))
        });
        let motion = sight.get().and_then(Sight::motion);
        let mut record = self.record();
        let record = &mut *record;
        record.motion = motion;
        self.pace().moves(motion.is_some_and(|motion| motion.state == MotionState::Moving));
        let said = match looked {
            Ok(Ok((size, taken))) => {
                record.camera.note_size(size, arrival.at.saturating_duration_since(zero));
                let hand = taken.observation.as_ref().and_then(|seen| seen.as_ref().ok());
                let features = hand.map(|observation| observation.features.clone());
                record.camera.note_judged(taken.at, zero.elapsed(), features);
                record.judged += u64::from(taken.observation.is_some());
                record.service.served(age + arrival.at.elapsed());
                tell(taken, &self.robot, zero);
                Ok(())
            }
            Ok(Err(cause)) => {
                self.robot.count("frames_failed");
                record.camera.note_error(&SourceError::Garbled { robot: arrival.robot, cause });
                Ok(())
            }
            Err(broken) => {
                record.camera.note_broken(format!("perception {broken}"));
                Err(broken)
            }
        };
        if record.camera.is_urgent() {
            tell_camera(&mut record.camera, &self.robot, SOURCE, motion, zero);
        }
        said
    }

    /// Whether a frame taken at that time is to be judged.
    fn judges(&self, taken: Instant, period: Duration) -> bool {
        let mut pace = self.pace();
        pace.follow(self.round(), Instant::now());
        pace.counts(taken, period)
    }

    /// Puts how it goes into the robot's status. Says whether it has left: it was silent for `gone_after`, and for longer than its camera may be.
    pub fn report(&self, now: Instant, count: Count, gone_after: Duration) -> bool {
        let mut record = self.record();
        let record = &mut *record;
        let Lately { fps_received, delay } = record.service.lately(now, count.received);
        tell_camera(&mut record.camera, &self.robot, SOURCE, record.motion, self.robot.started());
        let whole = |value: f64| value.round() as u64;
        for (name, value) in [
            ("frames_received", count.received),
            ("frames_overwritten", count.overwritten),
            ("frames_judged", record.judged),
            ("frames_received_per_second", whole(fps_received)),
            ("frame_delay_p50_us", whole(delay.0.as_secs_f64() * 1e6)),
            ("frame_delay_p99_us", whole(delay.1.as_secs_f64() * 1e6)),
        ] {
            self.robot.set(name, value);
        }
        record.camera.is_gone(now.saturating_duration_since(record.heard), gone_after)
    }

    /// The robot's account of itself.
    pub fn status(&self) -> Status {
        self.robot.status()
    }

    /// Lets the robot leave the swarm, and waits until it has.
    pub async fn leave(self: Arc<Self>) {
        // A worker may have a last look.
        let seat = alone(self).await;
        alone(seat.robot).await.stop().await;
    }
}

impl Look for Seat {
    fn round(&self) -> Option<RoundId> {
        self.robot.open()
    }

    fn due(&self, asked: Instant, now: Instant) -> Instant {
        let mut pace = self.pace();
        pace.follow(self.round(), now);
        pace.due(asked)
    }
}
