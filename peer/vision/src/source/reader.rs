//! A source, read by a thread of its own: the newest frame wins, and nothing waits for a camera.
//!
//! A read may block for as long as it likes: whoever asks for frames goes on, and the process may end. What fails is
//! opened again, later and later, until it delivers.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

use super::{Frame, Scene, Source, SourceError};
use crate::steady::{BACK_OFF, Broken, Panics, caught};

/// Opens a source anew.
pub type Opener<F = Frame> = Box<dyn FnMut() -> Result<Box<dyn Source<F>>, SourceError> + Send>;

/// After this many errors in a row a file's source is opened anew, unless they are each of one picture.
const TOLERATED: u32 = 8;

/// Between two frames no more time is waited for than this, whatever a source says its period is.
const LONGEST: Duration = Duration::from_secs(3600);

/// A source being read. Dropping it ends the thread as soon as its read returns.
pub struct Reader<F = Frame> {
    shared: Arc<Shared<F>>,
}

/// What the thread and its owner share.
struct Shared<F> {
    state: Mutex<State<F>>,
    changed: Condvar,
    delivered: Notify,
}

struct State<F> {
    /// What the human shows; `None` while no frames are wanted.
    wanted: Option<Scene>,
    /// Frames are wanted again since the last one: the next one need not wait for its turn.
    hurry: bool,
    ended: bool,
    newest: Option<Result<F, SourceError>>,
    dropped: u64,
}

impl<F: Send + 'static> Reader<F> {
    /// Reads `source`, and what `open` gives when that fails, or at once when there is none yet. Frames are taken at the
    /// time since `zero`. Nothing is read before [`Reader::want`], but for a source that runs by itself.
    ///
    /// A source that panics is dropped and opened anew, until it has panicked [`PANICS`](crate::steady::PANICS) times in a row.
    ///
    /// # Errors
    /// When the system has no thread to spare.
    pub fn start(
        source: Option<Box<dyn Source<F>>>,
        open: Opener<F>,
        zero: Instant,
    ) -> std::io::Result<Self> {
        let state = State { wanted: None, hurry: false, ended: false, newest: None, dropped: 0 };
        let shared =
            Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), delivered: Notify::new() });
        let reading = Reading { shared: shared.clone(), source, open, zero, panics: Panics::default() };
        std::thread::Builder::new().name("camera".to_owned()).spawn(move || reading.run())?;
        Ok(Self { shared })
    }

    /// Says whether frames are wanted, and what the human shows in them.
    pub fn want(&self, scene: Option<Scene>) {
        let mut state = self.shared.lock();
        state.hurry |= state.wanted.is_none() && scene.is_some();
        state.wanted = scene;
        drop(state);
        self.shared.changed.notify_one();
    }

    /// Waits for the newest frame, or what is wrong with it. Cancelled, it has taken none.
    pub async fn next(&self) -> Result<F, SourceError> {
        loop {
            if let Some(newest) = self.shared.lock().newest.take() {
                return newest;
            }
            self.shared.delivered.notified().await;
        }
    }

    /// How many frames were replaced by newer ones before anybody took them.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.shared.lock().dropped
    }
}

impl<F> Drop for Reader<F> {
    fn drop(&mut self) {
        self.shared.lock().ended = true;
        self.shared.changed.notify_one();
    }
}

/// The thread's side.
struct Reading<F> {
    shared: Arc<Shared<F>>,
    source: Option<Box<dyn Source<F>>>,
    open: Opener<F>,
    zero: Instant,
    panics: Panics,
}

impl<F> Reading<F> {
    fn run(mut self) {
        let (first, longest) = BACK_OFF;
        let mut back_off = first;
        let mut errors = 0;
        let mut turn = Instant::now();
        loop {
            let Some(source) = &mut self.source else {
                match caught(&mut self.open) {
                    Ok(Ok(opened)) => self.source = Some(opened),
                    Ok(Err(error)) => {
                        self.shared.deliver(Err(error));
                        if self.shared.ended_within(back_off) {
                            return;
                        }
                        back_off = longest.min(2 * back_off);
                    }
                    Err(message) => {
                        if !self.goes_on_after_panic(message) {
                            return;
                        }
                    }
                }
                continue;
            };
            let (shared, zero) = (&*self.shared, self.zero);
            let read = caught(|| {
                let scene = shared.wait_for(turn, source.is_live())?;
                let read = source.next_frame(zero.elapsed(), &scene);
                Some((read, source.is_live(), source.period()))
            });
            let (read, live, period) = match read {
                Ok(Some(read)) => read,
                // Nobody reads any more.
                Ok(None) => return,
                Err(message) => {
                    if !self.goes_on_after_panic(message) {
                        return;
                    }
                    continue;
                }
            };
            match read {
                Ok(frame) => {
                    (errors, back_off) = (0, first);
                    self.shared.deliver(Ok(frame));
                }
                Err(error) => {
                    let (is_over, is_of_one) = (error.is_the_end(), error.is_of_one_picture());
                    errors = if is_of_one { 0 } else { errors + 1 };
                    self.shared.deliver(Err(error));
                    if is_over {
                        return;
                    }
                    if live && !is_of_one || errors > TOLERATED {
                        // Closed before it is opened again: a device serves one at a time.
                        self.close();
                        if self.shared.ended_within(back_off) {
                            return;
                        }
                        back_off = longest.min(2 * back_off);
                        continue;
                    }
                }
            }
            // One that fell behind drops frames; it never hurries to make up for them.
            turn = Instant::now().max(turn + period.min(LONGEST));
        }
    }

    /// Closes the source that panicked, tells of it, and waits. `false`: it is given up, or nobody reads any more.
    fn goes_on_after_panic(&mut self, message: String) -> bool {
        self.close();
        let wait = self.panics.note(self.zero.elapsed());
        let broken = if wait.is_some() { Broken::Again(message) } else { Broken::GivenUp(message) };
        self.shared.deliver(Err(broken.into()));
        wait.is_some_and(|wait| !self.shared.ended_within(wait))
    }

    /// A source may panic also as it is closed; then it is gone as well.
    fn close(&mut self) {
        let source = self.source.take();
        if let Err(message) = caught(|| drop(source)) {
            tracing::error!("the camera's source panicked as it was closed: {message}");
        }
    }
}

impl<F> Shared<F> {
    fn lock(&self) -> MutexGuard<'_, State<F>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
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

    fn deliver(&self, newest: Result<F, SourceError>) {
        let mut state = self.lock();
        let replaced = state.newest.replace(newest);
        state.dropped += u64::from(matches!(replaced, Some(Ok(_))));
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
        let (dropped, is_dropped) = mpsc::channel();
        std::thread::spawn(move || {
            drop(reader);
            dropped.send(()).unwrap();
        });
        is_dropped.recv_timeout(Duration::from_secs(10)).expect("it waits for nothing");
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

    /// Numbers that panic from one of them on.
    struct Fragile {
        reads: u32,
        panics_from: u32,
    }

    impl Source<u32> for Fragile {
        fn describe(&self) -> String {
            "numbers".to_owned()
        }
        fn period(&self) -> Duration {
            Duration::from_millis(1)
        }
        fn next_frame(&mut self, _: Duration, _: &Scene) -> Result<u32, SourceError> {
            self.reads += 1;
            assert!(self.reads < self.panics_from, "no more than {} numbers", self.panics_from);
            Ok(self.reads)
        }
    }

    #[tokio::test]
    async fn a_source_that_panics_is_named_and_opened_again_until_it_is_given_up() {
        let mut opened = 0;
        let open: Opener<u32> = Box::new(move || {
            opened += 1;
            // Opening panics, too.
            assert!(opened != 2, "not now");
            Ok(Box::new(Fragile { reads: 10 * opened, panics_from: 10 * opened + 3 }))
        });
        let reader = Reader::start(None, open, Instant::now()).unwrap();
        reader.want(Some(Scene::default()));
        let mut panics = Vec::new();
        loop {
            match tokio::time::timeout(PATIENCE, reader.next()).await.expect("it goes on") {
                Ok(_) => {}
                Err(SourceError::Panicked(broken @ Broken::GivenUp(_))) => {
                    panics.push(broken.to_string());
                    break;
                }
                Err(error) => panics.push(error.to_string()),
            }
        }
        assert_eq!(panics.len(), 5, "{panics:?}");
        assert!(panics[0].contains("no more than 13 numbers") && panics[1].contains("not now"), "{panics:?}");
        assert!(tokio::time::timeout(Duration::from_millis(50), reader.next()).await.is_err());
    }

    #[tokio::test]
    async fn bad_pictures_in_a_row_do_not_keep_a_folder_from_its_good_ones() {
        let folder = tempfile::tempdir().unwrap();
        for k in 0..12 {
            std::fs::write(folder.path().join(format!("{k:02}.jpg")), "a shopping list").unwrap();
        }
        let good = Mat::new_rows_cols_with_default(20, 22, CV_8UC3, Scalar::all(90.0)).unwrap();
        let path = folder.path().join("good.png");
        assert!(opencv::imgcodecs::imwrite(&path, &good, &opencv::core::Vector::new()).unwrap());
        let path = folder.path().to_owned();
        let open: Opener = Box::new(move || {
            Ok(Box::new(super::super::ImageFolder::open(&path, Duration::from_millis(1), true)?))
        });
        let reader = Reader::start(None, open, Instant::now()).unwrap();
        reader.want(Some(Scene::default()));
        for _ in 0..2 {
            while next(&reader).await.expect("the next picture").is_err() {}
        }
    }
}
