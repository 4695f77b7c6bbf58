//! A video as FFmpeg reads it, one picture after the other.

use std::path::{Path, PathBuf};
use std::time::Duration;

use opencv::core::{Mat, Size};
use opencv::prelude::*;
use opencv::videoio::{self, VideoCapture};

use super::SourceError;
use super::image_file::MAX_MEGAPIXELS;
use super::picture::decode;

/// Assumed where a video does not say how many frames per second it has.
const PERIOD: Duration = Duration::from_millis(33);

/// How many pictures in a row may be none before a video is at its end: FFmpeg says the same of both.
const MOST_BAD: usize = 64;

/// How many pictures of a JPEG video are read to come to another place in it.
const MOST_READ: u64 = 20_000;

/// By how many pictures it is told whether a video is of JPEG.
const FIRST: usize = 8;

/// How each JPEG begins.
const JPEG: &[u8] = b"\xff\xd8\xff";

/// Videos that do not count their frames say how long they are, and so about how many they have.
const ABOUT: f64 = 0.95;

/// An open video.
pub(super) struct Ffmpeg {
    path: PathBuf,
    capture: VideoCapture,
    /// Whether its pictures are JPEG, and decoded here. OpenCV takes all pictures of a video for as large as the first: of a larger one it gives the picture
    /// before once more, and of a smaller one it reads on in whatever lies behind.
    is_jpeg: bool,
    /// What was read behind a bad picture.
    next: Option<Mat>,
    /// How many pictures were read or passed over.
    at: u64,
}

impl Ffmpeg {
    /// Opens a video whose pictures are not too large, and gives the time between two of them.
    ///
    /// # Errors
    /// When FFmpeg finds no video there, or its pictures are too large.
    pub fn open(path: &Path) -> Result<(Self, Duration), SourceError> {
        let (mut capture, size) = open(path)?;
        let period = period(capture.get(videoio::CAP_PROP_FPS)?);
        let is_jpeg = is_jpeg(path, &capture, size)? && as_they_are(&mut capture)?;
        Ok((Self { path: path.into(), capture, is_jpeg, next: None, at: 0 }, period))
    }

    /// Begins it again.
    ///
    /// # Errors
    /// As [`Ffmpeg::open`].
    pub fn rewind(&mut self) -> Result<(), SourceError> {
        // Another may be there by now.
        *self = Self::open(&self.path)?.0;
        Ok(())
    }

    /// The next picture; `None` at the end.
    ///
    /// # Errors
    /// [`SourceError::PassedOver`] for one that cannot be decoded; the next call goes on behind it.
    pub fn read(&mut self) -> Result<Option<Mat>, SourceError> {
        if let Some(next) = self.next.take() {
            return self.decoded(next).map(Some);
        }
        for bad in 0..=MOST_BAD {
            let mut read = Mat::default();
            if self.capture.read(&mut read)? && !read.empty() {
                self.at += 1;
                if bad == 0 {
                    return self.decoded(read).map(Some);
                }
                self.next = Some(read);
                return Err(self.passed_over(match bad {
                    1 => "FFmpeg cannot decode it".to_owned(),
                    bad => format!("FFmpeg cannot decode it, nor {} behind it", bad - 1),
                }));
            }
        }
        Ok(None)
    }

    /// Passes over a picture; `false` at the end.
    ///
    /// # Errors
    /// OpenCV's.
    pub fn grab(&mut self) -> Result<bool, SourceError> {
        if self.next.take().is_some() {
            return Ok(true);
        }
        for _ in 0..=MOST_BAD {
            if self.capture.grab()? {
                self.at += 1;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The place of the next picture, and how many there are; `None` where the video does not say.
    ///
    /// # Errors
    /// OpenCV's.
    pub fn place(&self) -> Result<Option<(f64, f64)>, SourceError> {
        let count = self.capture.get(videoio::CAP_PROP_FRAME_COUNT)?;
        let next = match self.is_jpeg {
            true => (self.at - u64::from(self.next.is_some())) as f64,
            false => self.capture.get(videoio::CAP_PROP_POS_FRAMES)?,
        };
        Ok((count >= 1.0 && next >= 0.0).then_some((next, count)))
    }

    /// Goes to the picture of that place; `false` where it cannot, or would read for long.
    ///
    /// # Errors
    /// OpenCV's, and those of [`Ffmpeg::open`].
    pub fn go_to(&mut self, place: f64) -> Result<bool, SourceError> {
        if !self.is_jpeg {
            self.next = None;
            return Ok(self.capture.set(videoio::CAP_PROP_POS_FRAMES, place)?);
        }
        // OpenCV finds places by times that it learns as it decodes.
        let place = place as u64;
        let (begins_anew, from) = if place < self.at { (true, 0) } else { (false, self.at) };
        if place - from > MOST_READ {
            return Ok(false);
        }
        self.next = None;
        if begins_anew {
            self.rewind()?;
        }
        while self.at < place && self.grab()? {}
        Ok(true)
    }

    /// At the end: how many pictures came, and how many there should be, where that is clearly more.
    ///
    /// # Errors
    /// OpenCV's.
    pub fn lacks(&self) -> Result<Option<(u64, u64)>, SourceError> {
        let lacking = self.place()?.filter(|(came, count)| came + 1.0 < ABOUT * count);
        Ok(lacking.map(|(came, count)| (came as u64, count as u64)))
    }

    fn decoded(&self, read: Mat) -> Result<Mat, SourceError> {
        if !self.is_jpeg {
            return Ok(read);
        }
        let mut image = Mat::default();
        decode(read.data_bytes()?, MAX_MEGAPIXELS, &mut image)
            .map_err(|error| self.passed_over(error.to_string()))?;
        Ok(image)
    }

    fn passed_over(&self, cause: String) -> SourceError {
        SourceError::PassedOver { path: self.path.clone(), cause }
    }
}

/// A video, and the size of its pictures, by its own word.
fn open(path: &Path) -> Result<(VideoCapture, Size), SourceError> {
    // To FFmpeg what stands before a colon is a protocol, unless a slash comes first. What begins at the root stays as it is.
    let file = Path::new(".").join(path);
    // Named explicitly, since OpenCV would otherwise try every backend it was built with.
    let capture = VideoCapture::from_file(file, videoio::CAP_FFMPEG)?;
    if !capture.is_opened()? {
        return Err(SourceError::NotAVideo(path.into()));
    }
    let (width, height) =
        (capture.get(videoio::CAP_PROP_FRAME_WIDTH)?, capture.get(videoio::CAP_PROP_FRAME_HEIGHT)?);
    let fits = width * height <= MAX_MEGAPIXELS * 1e6;
    if !fits {
        return Err(SourceError::TooLarge {
            path: path.into(),
            size: format!("{width}×{height} pixels"),
            limit: format!("{MAX_MEGAPIXELS} megapixels"),
        });
    }
    Ok((capture, Size::new(width as i32, height as i32)))
}

/// The time between two frames, of a video that says it has so many per second.
fn period(fps: f64) -> Duration {
    if (0.01..=1000.0).contains(&fps) { Duration::from_secs_f64(1.0 / fps) } else { PERIOD }
}

/// Has pictures given as they stand in the file; whether that can be.
fn as_they_are(capture: &mut VideoCapture) -> Result<bool, SourceError> {
    Ok(capture.set(videoio::CAP_PROP_FORMAT, -1.0)?)
}

/// Whether a video is of JPEG pictures of its own size: half a picture is a field of an interlaced one, which FFmpeg puts together. What is written to a pipe
/// can be read once: of that its own word counts.
fn is_jpeg(path: &Path, capture: &VideoCapture, size: Size) -> Result<bool, SourceError> {
    if !path.is_file() {
        let codec = (capture.get(videoio::CAP_PROP_FOURCC)? as u32).to_le_bytes();
        return Ok([b"MJPG", b"MJPE", b"JPEG"].iter().any(|name| codec.eq_ignore_ascii_case(*name)));
    }
    let mut probe = open(path)?.0;
    if !as_they_are(&mut probe)? {
        return Ok(false);
    }
    // The first may be damaged.
    for _ in 0..FIRST {
        let mut picture = Mat::default();
        if probe.read(&mut picture)? && !picture.empty() && picture.data_bytes()?.starts_with(JPEG) {
            let mut image = Mat::default();
            // What is a JPEG to FFmpeg alone is left to it.
            if decode(picture.data_bytes()?, MAX_MEGAPIXELS, &mut image).is_ok() {
                return Ok(image.size()? == size);
            }
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::picture::tests::encoded;
    use super::*;

    /// What comes of a file of these JPEG pictures, one after the other: the width of each that is given, and 0 for one that is passed over.
    fn widths(pictures: &[Vec<u8>]) -> Vec<i32> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mjpeg");
        fs::write(&path, pictures.concat()).unwrap();
        let (mut video, _) = Ffmpeg::open(&path).unwrap();
        assert!(video.is_jpeg);
        let mut widths = Vec::new();
        loop {
            match video.read() {
                Ok(Some(image)) => widths.push(image.cols()),
                Ok(None) => return widths,
                Err(error @ SourceError::PassedOver { .. }) => {
                    assert!(error.is_of_one_picture() && error.to_string().contains("film.mjpeg"), "{error}");
                    widths.push(0);
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    #[test]
    fn pictures_are_as_large_as_they_are_whatever_the_first_was() {
        let [small, large] = [(64, 48), (160, 120)].map(|(w, h)| encoded(".jpg", w, h));
        let grown = [vec![small.clone()], vec![large.clone(); 3]].concat();
        assert_eq!(widths(&grown), [64, 160, 160, 160]);
        let shrunk = [vec![large], vec![small; 3]].concat();
        assert_eq!(widths(&shrunk), [160, 64, 64, 64]);
    }

    #[test]
    fn a_picture_that_is_none_costs_itself_alone() {
        let good = encoded(".jpg", 64, 48);
        // Ends before it has begun; says that it has as many pixels as no memory can hold.
        let stub = b"\xff\xd8\xff\xdb\x00\x03\x00\xff\xd9".to_vec();
        let mut bomb = good.clone();
        let frame = bomb.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
        bomb[frame + 5..frame + 9].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
        for bad in [stub, bomb] {
            let pictures = [vec![good.clone(); 3], vec![bad], vec![good.clone(); 5]].concat();
            assert_eq!(widths(&pictures), [64, 64, 64, 0, 64, 64, 64, 64, 64]);
        }
    }

    #[test]
    fn a_video_that_does_not_say_its_rate_is_a_video_all_the_same() {
        assert_eq!(period(10.0), Duration::from_millis(100));
        for unknown in [0.0, -1.0, f64::NAN, f64::INFINITY, 90_000.0] {
            assert_eq!(period(unknown), PERIOD, "{unknown}");
        }
    }
}
