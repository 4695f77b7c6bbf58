//! What a robot's status says of its camera, kept true.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::{Camera, CameraState, Motion, Opinion};
use gestalt_strategies::Classify;
use opencv::core::{Mat, Size};
use opencv::prelude::*;

use crate::opinion::opinion;
use gestalt_vision::source::SourceError;
use gestalt_vision::steady::caught;

/// The status is written this often at most.
pub const INTERVAL: Duration = Duration::from_millis(250);

/// Over which time the rate of the frames is taken.
const WINDOW: Duration = Duration::from_secs(3);

/// The fewest frames of which the rate is taken, and the most that are remembered.
const FRAMES: std::ops::RangeInclusive<usize> = 3..=256;

/// A camera that delivers nothing, or the same picture, for this long is frozen; a slow one has the time of three frames: of
/// those that came lately, or, until some have, of its model.
const PATIENCE: Duration = Duration::from_secs(2);

/// After this many errors in a row a file fails, and any camera after as many pictures that are none.
const ERRORS: u32 = 3;

/// Follows one camera, here or at the other end of a stream: its frames, its failures, and when neither comes. All times
/// since the same moment.
#[derive(Debug)]
pub struct CameraReport {
    /// It runs by itself: the same picture over and over is a fault, and so is any error but that of one picture.
    live: bool,
    /// After this many errors in a row it fails.
    errors_allowed: u32,
    patience: Duration,
    /// The time between two frames that its model says.
    period: Duration,
    /// What to do when no frames come.
    if_silent: &'static str,
    /// Since when frames are expected; `None` while nobody looks.
    expected: Option<Duration>,
    taken: VecDeque<Duration>,
    size: [u32; 2],
    delay: Option<Duration>,
    errors: u32,
    error: Option<String>,
    ended: bool,
    /// What keeps its frames from being judged.
    broken: Option<String>,
    /// The classifier panicked at the last hand.
    unclassified: Option<String>,
    picture: SamePicture,
    /// The features of the last hand, and when it was seen.
    hand: Option<(Vec<f32>, Duration)>,
    written: Option<Duration>,
    /// Something came over it that is not to wait until it is time to write.
    urgent: bool,
    said: (CameraState, String),
    blind: bool,
}

/// What has changed since the status was written last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct News {
    /// Whether the robot sees nothing from now on, or sees again.
    pub blind: Option<bool>,
    /// Its state, or what is wrong with a failing one, is not what was told last.
    pub state: bool,
}

impl CameraReport {
    /// A camera of this machine that nobody looks through yet. `live`: it runs by itself, so that any error but that of one picture, and the same
    /// picture over and over, is a fault. `period`: the time between two frames that its model says.
    #[must_use]
    pub fn of_camera(live: bool, period: Duration) -> Self {
        Self {
            live,
            errors_allowed: ERRORS,
            patience: PATIENCE,
            period,
            if_silent: "check the camera, its cable and its driver",
            expected: None,
            taken: VecDeque::new(),
            size: [0, 0],
            delay: None,
            errors: 0,
            error: None,
            ended: false,
            broken: None,
            unclassified: None,
            picture: SamePicture::default(),
            hand: None,
            written: None,
            urgent: false,
            said: (CameraState::None, String::new()),
            blind: false,
        }
    }

    /// A camera at the other end of a stream, from `now` on: it is blind until its first frame, and silent after `patience`.
    #[must_use]
    pub fn of_stream(patience: Duration, now: Duration) -> Self {
        Self {
            errors_allowed: 1,
            patience,
            if_silent: "see that `gestalt stream` runs and its camera does not hang, and check its way here",
            expected: Some(now),
            blind: true,
            ..Self::of_camera(false, Duration::ZERO)
        }
    }

    /// Frames are expected from now on.
    pub fn expect(&mut self, now: Duration) {
        if self.expected.is_none() {
            self.expected = Some(now);
            self.taken.clear();
        }
    }

    /// Nobody looks any more.
    pub fn rest(&mut self) {
        self.expected = None;
    }

    /// The camera delivered a picture at that time. Says whether it is worth looking at: a frozen one is not.
    pub fn note_frame(&mut self, image: &Mat, at: Duration) -> bool {
        self.note_size(Size::new(image.cols(), image.rows()), at);
        if !self.live {
            return true;
        }
        self.picture.note(checksum(image), at);
        !self.is_same_picture(at)
    }

    /// The camera delivered a picture of that size at that time.
    pub fn note_size(&mut self, size: Size, at: Duration) {
        self.urgent |= self.errors > 0 || self.taken.is_empty();
        self.errors = 0;
        self.error = None;
        let side = |length: i32| u32::try_from(length).unwrap_or_default();
        self.size = [side(size.width), side(size.height)];
        self.taken.push_back(at);
        while self.taken.len() > *FRAMES.end()
            || self.taken.len() > *FRAMES.start()
                && self.taken.front().is_some_and(|first| *first + WINDOW < at)
        {
            self.taken.pop_front();
        }
    }

    /// A frame was judged at that time; these are the features of its hand.
    pub fn note_judged(&mut self, taken: Duration, now: Duration, features: Option<Vec<f32>>) {
        const WEIGHT: f64 = 0.2;
        let delay = now.saturating_sub(taken);
        let before = self.delay.unwrap_or(delay);
        self.delay = Some(before.mul_f64(1.0 - WEIGHT) + delay.mul_f64(WEIGHT));
        self.urgent |= self.broken.take().is_some();
        if let Some(features) = features {
            self.hand = Some((features, taken));
        }
    }

    /// The camera failed.
    pub fn note_error(&mut self, error: &SourceError) {
        // What panicked is closed, if it were a file or not.
        let is_closed = matches!(error, SourceError::Panicked(_)) || self.live && !error.is_of_one_picture();
        let errors = if is_closed { self.errors_allowed } else { 1 };
        self.errors = self.errors.saturating_add(errors);
        self.error = Some(error.to_string());
        self.ended = error.is_the_end();
        self.urgent = true;
    }

    /// Its frames come, and cannot be judged: why, and how to fix it.
    pub fn note_broken(&mut self, trouble: String) {
        self.urgent |= self.broken.as_ref() != Some(&trouble);
        self.broken = Some(trouble);
    }

    /// How the camera goes, and what is wrong with it.
    #[must_use]
    pub fn state(&self, now: Duration) -> (CameraState, String) {
        let last = self.taken.back().copied();
        let trouble = self.error.clone().unwrap_or_default();
        if self.ended {
            return (CameraState::Ended, trouble);
        }
        if self.errors >= self.errors_allowed {
            return (CameraState::Failing, trouble);
        }
        if let Some(trouble) = self.broken.as_ref().or(self.unclassified.as_ref()) {
            return (CameraState::Failing, trouble.clone());
        }
        if let Some(expected) = self.expected {
            let silent = now.saturating_sub(last.map_or(expected, |last| last.max(expected)));
            if silent > self.patience() {
                let trouble = format!("no frame for {:.0} s: {}", silent.as_secs_f64(), self.if_silent);
                return (CameraState::Frozen, trouble);
            }
        }
        match last {
            Some(last) if self.is_same_picture(last) => {
                (CameraState::Frozen, identical(self.picture.lasted(last)))
            }
            None if self.size == [0, 0] => (CameraState::Opening, trouble),
            _ => (CameraState::Live, trouble),
        }
    }

    /// Whether a robot that has been silent for so long has left, where one has after that time: never before it is frozen.
    #[must_use]
    pub fn is_gone(&self, silent: Duration, after: Duration) -> bool {
        silent >= after && silent > self.patience()
    }

    /// Frames per second, lately.
    #[must_use]
    pub fn fps(&self) -> Option<f32> {
        let (first, last) = (self.taken.front()?, self.taken.back()?);
        let seconds = last.saturating_sub(*first).as_secs_f32();
        (self.taken.len() >= *FRAMES.start() && seconds > 0.0)
            .then(|| (self.taken.len() - 1) as f32 / seconds)
    }

    /// Whether something came over it that is not to wait until it is time to write.
    #[must_use]
    pub fn is_urgent(&self) -> bool {
        self.urgent
    }

    /// Whether it is time to write to the status again.
    #[must_use]
    pub fn is_due(&self, now: Duration) -> bool {
        self.urgent || self.written.is_none_or(|written| now.saturating_sub(written) >= INTERVAL)
    }

    /// What the status is to say, and what of it is news. The opinion is that of `classifier`, of the last hand seen.
    pub fn write(
        &mut self,
        now: Duration,
        source: &str,
        motion: Option<Motion>,
        classifier: Option<&dyn Classify>,
    ) -> (Camera, News) {
        self.written = Some(now);
        self.urgent = false;
        let opinion = classifier.and_then(|classifier| self.opinion(classifier));
        let (state, trouble) = self.state(now);
        let news = self.news(state, &trouble);
        let camera = Camera {
            source: source.to_owned(),
            state,
            trouble,
            size: self.size,
            fps: self.fps().filter(|_| state == CameraState::Live).unwrap_or_default(),
            delay_ms: self.delay.unwrap_or_default().as_secs_f32() * 1000.0,
            motion,
            opinion,
        };
        (camera, news)
    }

    fn news(&mut self, state: CameraState, trouble: &str) -> News {
        let blind = match state {
            CameraState::Live => false,
            CameraState::Frozen | CameraState::Failing | CameraState::Ended => true,
            // Nobody knows yet.
            CameraState::None | CameraState::Opening => self.blind,
        };
        let (said, words) = &self.said;
        let unsaid = *said != state || (state == CameraState::Failing && words != trouble);
        let news = News { blind: (blind != self.blind).then_some(blind), state: unsaid };
        self.blind = blind;
        if unsaid {
            self.said = (state, trouble.to_owned());
        }
        news
    }

    fn opinion(&mut self, classifier: &dyn Classify) -> Option<Opinion> {
        let (features, at) = self.hand.as_ref()?;
        match caught(|| opinion(classifier, features, *at)) {
            Ok(opinion) => {
                self.unclassified = None;
                opinion
            }
            Err(message) => {
                self.unclassified = Some(format!(
                    "the classifier panicked ({message}) and judges nothing: give the robot another model; RUST_BACKTRACE=1 shows where"
                ));
                // It would do so again.
                self.hand = None;
                None
            }
        }
    }

    /// How long a frame may fail to appear.
    fn patience(&self) -> Duration {
        let period = self.fps().map_or(self.period, |fps| Duration::from_secs_f32(1.0 / fps));
        self.patience.max(3 * period)
    }

    fn is_same_picture(&self, at: Duration) -> bool {
        self.live && self.picture.lasted(at) > self.patience()
    }
}

/// Since when a camera delivers the same picture.
#[derive(Debug, Default)]
pub(crate) struct SamePicture {
    checksum: u32,
    since: Duration,
}

impl SamePicture {
    /// A picture of that [`checksum`] came at that time.
    pub fn note(&mut self, checksum: u32, at: Duration) {
        if checksum != self.checksum {
            *self = Self { checksum, since: at };
        }
    }

    /// How long it had been the same at that time.
    pub fn lasted(&self, at: Duration) -> Duration {
        at.saturating_sub(self.since)
    }

    /// What is wrong with a camera that takes a picture every `period`, if it has delivered the same one for too long.
    pub fn trouble(&self, at: Duration, period: Duration) -> Option<String> {
        let lasted = self.lasted(at);
        (lasted > PATIENCE.max(3 * period)).then(|| identical(lasted))
    }
}

fn identical(lasted: Duration) -> String {
    let seconds = lasted.as_secs_f64();
    format!(
        "identical pictures for {seconds:.0} s: covered, saturated, or hanging; look at its lens and light, then unplug it and plug it in again"
    )
}

/// Of every sixteenth row: two pictures of a real sensor never agree in them.
pub(crate) fn checksum(image: &Mat) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for row in (0..image.rows()).step_by(16) {
        // A row that cannot be read does not tell pictures apart.
        if let Ok(row) = image.row(row)
            && let Ok(bytes) = row.data_bytes()
        {
            hasher.update(bytes);
        }
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests;
