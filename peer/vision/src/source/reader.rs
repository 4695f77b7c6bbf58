//! A source, read by a thread of its own: the newest frame wins, and nothing waits for a camera.
//!
//! A read may block for as long as it likes: whoever asks for frames goes on, and the process may end. What fails is
//! opened again, later and later, until it delivers.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

use super::{Frame, Scene, Source, SourceError};

/// Opens a source anew.
pub type Opener = Box<dyn FnMut() -> Result<Box<dyn Source>, SourceError> + Send>;

/// How long to wait before the second try, and the longest wait.
const BACK_OFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(4));

/// After this many errors in a row a file's source is opened anew; one bad image among good ones needs none of that.
const TOLERATED: u32 = 8;

/// A source being read. Dropping it ends the thread as soon as its read returns.
pub struct Reader {
    desk: Arc<Desk>,
}

/// Where the thread and its owner meet.
struct Desk {
    state: Mutex<State>,
    changed: Condvar,
    delivered: Notify,
}

#[derive(Default)]
struct State {
    /// What the human shows; `None` while no frames are wanted.
    wanted: Option<Scene>,
    /// Frames are wanted again since the last one: the next one need not wait for its turn.
    hurry: bool,
    ended: bool,
    newest: Option<Result<Frame, SourceError>>,
    dropped: u64,
}

impl Reader {
    /// Reads `source`, and what `open` gives when that fails, or at once when there is none yet. Frames are taken at the
    /// time since `zero`. Nothing is read before [`Reader::want`], but for a source that runs by itself.
    ///
    /// # Errors
    /// When the system has no thread to spare.
    pub fn start(source: Option<Box<dyn Source>>, open: Opener, zero: Instant) -> std::io::Result<Self> {
        let state = Mutex::new(State::default());
        let desk = Arc::new(Desk { state, changed: Condvar::new(), delivered: Notify::new() });
        let of_thread = desk.clone();
        std::thread::Builder::new()
            .name("camera".to_owned())
            .spawn(move || of_thread.read(source, open, zero))?;
        Ok(Self { desk })
    }

    /// Says whether frames are wanted, and what the human shows in them.
    pub fn want(&self, scene: Option<Scene>) {
        let mut state = self.desk.lock();
        state.hurry |= state.wanted.is_none() && scene.is_some();
        state.wanted = scene;
        drop(state);
        self.desk.changed.notify_one();
    }

    /// Waits for the newest frame, or what is wrong with it. Cancelled, it has taken none.
    pub async fn next(&self) -> Result<Frame, SourceError> {
        loop {
            if let Some(newest) = self.desk.lock().newest.take() {
                return newest;
            }
            self.desk.delivered.notified().await;
        }
    }

    /// How many frames were replaced by newer ones before anybody took them.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.desk.lock().dropped
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.desk.lock().ended = true;
        self.desk.changed.notify_one();
    }
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The thread's work.
    fn read(&self, mut source: Option<Box<dyn Source>>, mut open: Opener, zero: Instant) {
        let (first, longest) = BACK_OFF;
        let mut back_off = first;
        let mut errors = 0;
        let mut turn = Instant::now();
        loop {
            let Some(reading) = &mut source else {
                match open() {
                    Ok(opened) => source = Some(opened),
                    Err(error) => {
                        self.deliver(Err(error));
                        if self.ended_within(back_off) {
                            return;
                        }
                        back_off = longest.min(2 * back_off);
                    }
                }
                continue;
            };
            let Some(scene) = self.wait_for(turn, reading.is_live()) else { return };
            match reading.next_frame(zero.elapsed(), &scene) {
                Ok(frame) => {
                    (errors, back_off) = (0, first);
                    self.deliver(Ok(frame));
                }
                Err(error) => {
                    let is_over = matches!(error, SourceError::Ended(_));
                    self.deliver(Err(error));
                    if is_over {
                        return;
                    }
                    errors += 1;
                    if reading.is_live() || errors > TOLERATED {
                        // Closed before it is opened again: a device serves one at a time.
                        source = None;
                        if self.ended_within(back_off) {
                            return;
                        }
                        back_off = longest.min(2 * back_off);
                        continue;
                    }
                }
            }
            // One that fell behind drops frames; it never hurries to make up for them.
            turn = Instant::now().max(turn + reading.period());
        }
    }

    /// Waits until a frame is wanted and it is its turn; at once for a source that runs by itself. `None` at the end.
    fn wait_for(&self, turn: Instant, live: bool) -> Option<Scene> {
        let mut state = self.lock();
        loop {
            if state.ended {
                return None;
            }
            let wait = turn.saturating_duration_since(Instant::now());
            match state.wanted {
                _ if live => return Some(state.wanted.unwrap_or_default()),
                Some(scene) if state.hurry || wait.is_zero() => {
                    state.hurry = false;
                    return Some(scene);
                }
                Some(_) => {
                    state = self.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
                }
                None => state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    fn ended_within(&self, wait: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), wait, |state| !state.ended);
        waited.unwrap_or_else(PoisonError::into_inner).0.ended
    }

    fn deliver(&self, newest: Result<Frame, SourceError>) {
        let mut state = self.lock();
        state.dropped += u64::from(state.newest.replace(newest).is_some());
        drop(state);
        self.delivered.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use opencv::core::{CV_8UC3, Mat, Scalar};

    use super::*;

    /// A camera that gives a frame whenever it is told to, blocks until then, and fails when it is told so.
    struct Told(mpsc::Receiver<bool>);

    impl Source for Told {
        fn describe(&self) -> String {
            "a camera in a test".to_owned()
        }
        fn period(&self) -> Duration {
            Duration::from_millis(1)
        }
        fn is_live(&self) -> bool {
            true
        }
        fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
            match self.0.recv() {
                Ok(true) => Ok(Frame {
                    image: Mat::new_rows_cols_with_default(2, 2, CV_8UC3, Scalar::all(1.0))?,
                    at: now,
                }),
                _ => Err(SourceError::NotADevice("/dev/told".into())),
            }
        }
    }

    const PATIENCE: Duration = Duration::from_secs(10);

    async fn next(reader: &Reader) -> Option<Result<Frame, SourceError>> {
        tokio::time::timeout(PATIENCE, reader.next()).await.ok()
    }

    #[tokio::test]
    async fn the_newest_frame_wins_and_none_is_queued() {
        let (tell, told) = mpsc::channel();
        let open: Opener = Box::new(|| Err(SourceError::NotADevice("/dev/told".into())));
        let reader = Reader::start(Some(Box::new(Told(told))), open, Instant::now()).unwrap();
        for _ in 0..50 {
            tell.send(true).unwrap();
        }
        while reader.dropped() < 49 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        assert!(matches!(next(&reader).await, Some(Ok(_))));
        // The next one does not exist yet.
        assert!(tokio::time::timeout(Duration::from_millis(50), reader.next()).await.is_err());
    }

    #[tokio::test]
    async fn a_read_that_never_returns_keeps_nobody() {
        let (_tell, told) = mpsc::channel();
        let open: Opener = Box::new(|| Err(SourceError::NotADevice("/dev/told".into())));
        let reader = Reader::start(Some(Box::new(Told(told))), open, Instant::now()).unwrap();
        assert!(tokio::time::timeout(Duration::from_millis(50), reader.next()).await.is_err());
        let began = Instant::now();
        drop(reader);
        assert!(began.elapsed() < Duration::from_millis(50));
    }

    #[tokio::test]
    async fn a_camera_that_goes_away_is_opened_again_when_it_is_back() {
        let (tell, told) = mpsc::channel();
        let (plug_in, plugged_in) = mpsc::channel::<Told>();
        let open: Opener = Box::new(move || match plugged_in.try_recv() {
            Ok(camera) => Ok(Box::new(camera)),
            Err(_) => Err(SourceError::Missing("/dev/told".into())),
        });
        // It may be missing at the start, too.
        let reader = Reader::start(None, open, Instant::now()).unwrap();
        assert!(matches!(next(&reader).await, Some(Err(SourceError::Missing(_)))));
        plug_in.send(Told(told)).unwrap();
        tell.send(true).unwrap();
        while !matches!(next(&reader).await, Some(Ok(_))) {}
        tell.send(false).unwrap();
        assert!(matches!(next(&reader).await, Some(Err(SourceError::NotADevice(_)))));
        let (tell, told) = mpsc::channel();
        plug_in.send(Told(told)).unwrap();
        tell.send(true).unwrap();
        while !matches!(next(&reader).await, Some(Ok(_))) {}
    }
}
