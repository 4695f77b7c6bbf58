//! A video file as a camera.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::ffmpeg::Ffmpeg;
use super::image_file::check_file;
use super::{Frame, Scene, Source, SourceError};

/// So many frames are passed over one by one; beyond that it is quicker to seek.
const GRABBED: u64 = 60;

/// The most that are passed over in a video that says nothing of its length.
const MOST_GRABBED: u64 = 30 * GRABBED;

/// The frames of a video file, decoded by FFmpeg. It runs on while nobody reads it, as what happens in front of a camera does.
pub struct Video {
    path: PathBuf,
    video: Ffmpeg,
    period: Duration,
    looping: bool,
    /// Whether this pass through the file has given a frame: one that gives none would loop for ever.
    gave_frame: bool,
    /// Whether it was said that there are fewer frames than there should be.
    said_short: bool,
    /// When its last frame was read.
    last: Option<Duration>,
}

impl Video {
    /// Opens a video; when `looping`, it starts again after its last frame.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, is no video, or its frames are too large.
    pub fn open(path: &Path, looping: bool) -> Result<Self, SourceError> {
        check_file(path)?;
        let (video, period) = Ffmpeg::open(path)?;
        let (gave_frame, said_short, last) = (false, false, None);
        Ok(Self { path: path.into(), video, period, looping, gave_frame, said_short, last })
    }

    /// Passes over what has been shown since the last frame was read. A video that ends meanwhile says so at the next.
    fn run_on(&mut self, now: Duration) -> Result<(), SourceError> {
        let Some(last) = self.last.replace(now) else { return Ok(()) };
        // A frame that is read a little late is the next one all the same.
        let shown = (now.saturating_sub(last).as_secs_f64() / self.period.as_secs_f64() + 1e-6) as u64;
        let passed_over = shown.saturating_sub(1);
        if passed_over <= GRABBED || !self.seek(passed_over)? {
            for _ in 0..passed_over.min(MOST_GRABBED) {
                if self.video.grab()? {
                    self.gave_frame = true;
                } else if self.looping && self.gave_frame {
                    self.video.rewind()?;
                    self.gave_frame = self.video.grab()?;
                } else {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Goes on by so many frames at once; `false` where the video does not say how many it has, or cannot.
    fn seek(&mut self, by: u64) -> Result<bool, SourceError> {
        let Some((next, count)) = self.video.place()? else { return Ok(false) };
        let to = next + by as f64;
        if self.looping {
            return self.video.go_to(to % count);
        }
        if to < count {
            return self.video.go_to(to);
        }
        // Its last frame is passed over with the others.
        let reached = self.video.go_to(count - 1.0)?;
        while reached && self.video.grab()? {}
        Ok(reached)
    }
}

impl Source for Video {
    fn describe(&self) -> String {
        format!("video {}", self.path.display())
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        self.run_on(now)?;
        loop {
            if let Some(image) = self.video.read()? {
                self.gave_frame = true;
                return Ok(Frame { image, at: now });
            }
            if !self.gave_frame {
                return Err(SourceError::NotAVideo(self.path.clone()));
            }
            let (video, lacks) = (self.describe(), self.video.lacks()?);
            if !self.looping {
                let short =
                    lacks.map(|(frames, of)| SourceError::CutShort { video: video.clone(), frames, of });
                return Err(short.unwrap_or(SourceError::Ended(video)));
            }
            self.video.rewind()?;
            self.gave_frame = false;
            if let Some((frames, of)) = lacks.filter(|_| !std::mem::replace(&mut self.said_short, true)) {
                let cause = format!("it begins again after {frames} of the {of} frames that it says it has");
                return Err(SourceError::PassedOver { path: self.path.clone(), cause });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use opencv::core::{self, Mat, Scalar, Size};
    use opencv::prelude::*;
    use opencv::videoio;

    use super::*;

    fn next(video: &mut Video) -> Result<Frame, SourceError> {
        video.next_frame(Duration::ZERO, &Scene::default())
    }

    /// Each frame is so much brighter than the one before, in grey levels.
    const STEP: f64 = 20.0;

    /// A video of `frames` grey frames at 10 per second.
    fn record(path: &Path, frames: u8) {
        let codec = videoio::VideoWriter::fourcc('M', 'J', 'P', 'G').unwrap();
        let size = Size::new(64, 48);
        let mut writer =
            videoio::VideoWriter::new_with_backend(path, videoio::CAP_FFMPEG, codec, 10.0, size, true)
                .unwrap();
        for frame in 0..frames {
            let grey = Scalar::all(f64::from(frame) * STEP);
            writer.write(&Mat::new_size_with_default(size, core::CV_8UC3, grey).unwrap()).unwrap();
        }
        writer.release().unwrap();
    }

    #[test]
    fn a_video_gives_its_frames_and_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five.avi");
        record(&path, 5);
        let mut video = Video::open(&path, false).unwrap();
        assert_eq!(video.period(), Duration::from_millis(100));
        for _ in 0..5 {
            assert_eq!(next(&mut video).unwrap().image.size().unwrap(), Size::new(64, 48));
        }
        assert!(matches!(next(&mut video), Err(SourceError::Ended(_))));
    }

    #[test]
    fn a_looping_video_starts_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("three.avi");
        record(&path, 3);
        let mut video = Video::open(&path, true).unwrap();
        let levels: Vec<u8> =
            (0..7).map(|_| next(&mut video).unwrap().image.data_bytes().unwrap()[0]).collect();
        assert_eq!(levels[0], levels[3]);
        assert_eq!(levels[1], levels[4]);
        assert!(levels[0] < levels[1] && levels[1] < levels[2], "{levels:?}");
    }

    /// Which of its frames a video of [`record`] shows at that time, in tenths of a second.
    fn shown(video: &mut Video, tenths: u32) -> Result<u32, SourceError> {
        let frame = video.next_frame(Duration::from_millis(100) * tenths, &Scene::default())?;
        Ok((f64::from(frame.image.data_bytes()?[0]) / STEP).round() as u32)
    }

    #[test]
    fn a_video_runs_on_while_nobody_looks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ten.avi");
        record(&path, 12);
        let mut video = Video::open(&path, true).unwrap();
        for at in [0, 1, 2, 7, 8] {
            assert_eq!(shown(&mut video, at).unwrap(), at);
        }
        // Once around, by one frame after the other, and eight times, by a jump.
        assert_eq!(shown(&mut video, 8 + 12).unwrap(), 8);
        assert_eq!(shown(&mut video, 8 + 12 + 8 * 12 + 2).unwrap(), 10);
        // And to what comes before it.
        assert_eq!(shown(&mut video, 118 + 8 * 12 - 3).unwrap(), 7);
        for pause in [20, 200] {
            let mut video = Video::open(&path, false).unwrap();
            assert_eq!(shown(&mut video, 0).unwrap(), 0);
            assert!(matches!(shown(&mut video, pause), Err(SourceError::Ended(_))), "{pause}");
        }
    }

    #[test]
    fn a_name_with_a_colon_is_a_name() {
        // Named alone, and so in the folder that the test runs in.
        let file = tempfile::Builder::new()
            .prefix("2026-11-30T15:50:00-")
            .suffix(".avi")
            .tempfile_in(".")
            .unwrap()
            .into_temp_path();
        record(&file, 2);
        let name = Path::new(file.file_name().unwrap());
        let mut video = Video::open(name, true).unwrap();
        // The last is of another pass through it.
        for _ in 0..3 {
            next(&mut video).unwrap();
        }
        assert_eq!(video.describe(), format!("video {}", name.display()));
    }

    #[test]
    fn what_is_no_video_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let open = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            let error = Video::open(&path, true).err().unwrap();
            assert!(error.to_string().contains(name), "{error}");
            error
        };
        assert!(matches!(open("empty.mp4", b""), SourceError::Empty(_)));
        assert!(matches!(open("text.mp4", b"a screenplay"), SourceError::NotAVideo(_)));
        let missing = Video::open(&folder.path().join("missing.mp4"), true).err().unwrap();
        assert!(matches!(missing, SourceError::Missing(_)));
    }

    #[test]
    fn a_video_cut_short_never_panics_and_says_that_it_came_to_its_end_too_soon() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.avi");
        record(&path, 12);
        let whole = fs::read(&path).unwrap();
        let mut short = 0;
        for tenths in [1, 4, 6, 9] {
            fs::write(&path, &whole[..whole.len() * tenths / 10]).unwrap();
            let Ok(mut video) = Video::open(&path, false) else { continue };
            let mut frames = 0;
            let error = loop {
                match next(&mut video) {
                    Ok(_) => {}
                    Err(error) if error.is_of_one_picture() => {}
                    Err(error) => break error,
                }
                frames += 1;
                assert!(frames <= 12);
            };
            match error {
                SourceError::CutShort { frames: came, of, .. } => {
                    assert_eq!((came, of), (frames, 12));
                    short += 1;
                }
                SourceError::Ended(_) | SourceError::NotAVideo(_) => {}
                error => panic!("{tenths} tenths: {error}"),
            }
        }
        assert!(short > 0);
    }
}
