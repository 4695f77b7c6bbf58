//! The frames of one robot, received at a peer: its camera is somewhere else.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{FrameHeader, FrameTaken, RobotId};
use opencv::core::Mat;

use gestalt_link::{FrameArrival, FrameGate, LinkError, Robot};
use gestalt_vision::source::{Frame, PictureError, Scene, Source, SourceError, decode};

/// The largest streamed picture that is decoded, in millions of pixels: 3840×2160.
pub const MAX_MEGAPIXELS: f64 = 8.3;

/// How long the next frame is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Where the newest frame of a robot waits.
#[derive(Debug)]
pub struct Inlet {
    robot: RobotId,
    newest: Mutex<Option<FrameArrival>>,
    arrived: Condvar,
    gate: OnceLock<FrameGate>,
    /// The bits of the frames per second that the sender states; 0 until it has.
    fps: AtomicU32,
}

impl Inlet {
    /// For the frames of that robot.
    #[must_use]
    pub fn new(robot: RobotId) -> Arc<Self> {
        Arc::new(Self {
            robot,
            newest: Mutex::new(None),
            arrived: Condvar::new(),
            gate: OnceLock::new(),
            fps: AtomicU32::new(0),
        })
    }

    /// Opens it at that robot's session.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn open(self: &Arc<Self>, at: &Robot) -> Result<(), LinkError> {
        let inlet = Arc::downgrade(self);
        let on_frame = move |frame| {
            if let Some(inlet) = inlet.upgrade() {
                inlet.put(frame);
            }
        };
        let gate = at.receive_frames(Some(self.robot), on_frame).await?;
        // One that is open already keeps its gate.
        let _ = self.gate.set(gate);
        Ok(())
    }

    fn put(&self, frame: FrameArrival) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(frame);
        self.arrived.notify_one();
    }

    /// Takes the newest frame, when one comes in time, and asks for the next.
    fn take(&self) -> Option<FrameArrival> {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut newest, _) = self
            .arrived
            .wait_timeout_while(newest, PATIENCE, |newest| newest.is_none())
            .unwrap_or_else(PoisonError::into_inner);
        let frame = newest.take()?;
        drop(newest);
        self.acknowledge(&frame);
        Some(frame)
    }

    /// Passes over the frame that waits if it was taken longer ago, and asks for the next.
    pub fn skip_older(&self, than: Duration) {
        let mut newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let stale = newest.take_if(|frame| age(frame) > than);
        drop(newest);
        if let Some(frame) = stale {
            self.acknowledge(&frame);
        }
    }

    /// The frames per second that the camera takes, as its sender states; `None` before its first frame.
    #[must_use]
    pub fn fps(&self) -> Option<f64> {
        let fps = f32::from_bits(self.fps.load(Ordering::Relaxed));
        (fps > 0.0).then(|| f64::from(fps))
    }

    fn acknowledge(&self, frame: &FrameArrival) {
        self.fps.store(frame.header.fps.to_bits(), Ordering::Relaxed);
        if let Some(gate) = self.gate.get() {
            let FrameHeader { nonce, sequence, .. } = frame.header;
            gate.taken(self.robot, &FrameTaken { nonce, sequence, round: gate.round() });
        }
    }
}

/// How long ago a frame was taken.
fn age(frame: &FrameArrival) -> Duration {
    Duration::from_micros(u64::from(frame.header.age_us)) + frame.at.elapsed()
}

/// A camera that is somewhere else: the frames that `gestalt stream` sends.
#[derive(Debug)]
pub struct StreamSource {
    inlet: Arc<Inlet>,
    period: Duration,
    /// When the last frame was taken.
    last: Duration,
}

impl StreamSource {
    /// The frames that come in there, one every `period`, or as they come.
    #[must_use]
    pub fn new(inlet: Arc<Inlet>, period: Duration) -> Self {
        Self { inlet, period, last: Duration::ZERO }
    }
}

impl Source for StreamSource {
    fn describe(&self) -> String {
        format!("stream of robot {}", self.inlet.robot)
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        let called = Instant::now();
        let arrival = self.inlet.take().ok_or(SourceError::NoFrames(self.inlet.robot))?;
        let mut image = Mat::default();
        decode(&arrival.picture(), MAX_MEGAPIXELS, &mut image)
            .map_err(|cause: PictureError| SourceError::Garbled { robot: self.inlet.robot, cause })?;
        let age = age(&arrival);
        // Two frames of which the older was longer under way must not change places.
        self.last = self.last.max((now + called.elapsed()).saturating_sub(age));
        Ok(Frame { image, at: self.last })
    }
}
