//! Whether a picture is worth learning from.

use gestalt_vision::perception::{FeatureSet, HandConfig, NoObservation, Perception, PerceptionError};
use opencv::core::{
    CMP_GE, CMP_LE, CV_64F, Mat, NORM_L1, Rect, Size, Vector, compare, count_non_zero, mean_std_dev,
    no_array, norm2,
};
use opencv::imgproc::{
    COLOR_BGR2GRAY, INTER_AREA, INTER_LINEAR, MORPH_RECT, cvt_color_def, dilate_def,
    get_structuring_element_def, laplacian_def, resize,
};
use opencv::prelude::*;
use thiserror::Error;

/// The side of the square that a hand's surroundings are compared as, in pixels.
const THUMBNAIL: i32 = 32;

/// Two views whose mean difference is below so many grey levels show the same: a still camera's noise makes 1 to 2.
const SAME: f64 = 4.0;

/// The least sharpness, see [`Unfit::Blurred`].
const SHARP: f64 = 40.0;

/// The largest share of a hand that may be burnt out, or black.
const CLIPPED: f64 = 0.25;

/// From this grey level on a pixel is burnt out; up to that one, black.
const BURNT: f64 = 250.0;
const BLACK: f64 = 8.0;

/// Why a picture is not worth keeping, and what to do.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Unfit {
    /// There is no hand to learn.
    #[error("{0}: hold the hand into the picture, against a calm background")]
    NoHand(String),
    /// The hand runs out of the picture.
    #[error("the hand is cut off: move it to the middle, or farther away")]
    CutOff,
    /// Parts of the hand are white.
    #[error("{:.0} % of the hand is burnt out: less light, or a shorter exposure", 100.0 * .0)]
    Bright(f64),
    /// Parts of the hand are black.
    #[error("{:.0} % of the hand is black: more light", 100.0 * .0)]
    Dark(f64),
    /// Edges are soft: the variance of the Laplacian of the hand, at 192 pixels, in squared grey levels (J. L. Pech-Pacheco et al.,
    /// "Diatom autofocusing in brightfield microscopy", 2000).
    #[error(
        "blurred (sharpness {0:.0}, at least {SHARP} is needed): hold still, or give the camera light and time to focus"
    )]
    Blurred(f64),
    /// A picture like it was kept already.
    #[error("like one that was kept already: turn the hand a little")]
    Repeated,
}

impl Unfit {
    /// One word for counting.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::NoHand(_) => "no hand",
            Self::CutOff => "cut off",
            Self::Bright(_) => "burnt out",
            Self::Dark(_) => "dark",
            Self::Blurred(_) => "blurred",
            Self::Repeated => "repeated",
        }
    }
}

/// What keeps pictures from being judged at all.
#[derive(Debug, Error)]
pub enum JudgeError {
    /// There are no eyes.
    #[error(transparent)]
    Perception(#[from] PerceptionError),
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// Judges one picture after the other, and remembers those it let pass.
pub struct Judge {
    perception: Perception,
    /// Whether a hand must be seen.
    hand: bool,
    kept: Vec<Mat>,
}

impl Judge {
    /// With the eyes of that feature set. `hand`: whether pictures must show one; those of the folder `none` need not.
    ///
    /// # Errors
    /// [`JudgeError::Perception`].
    pub fn new(features: FeatureSet, hand: bool) -> Result<Self, JudgeError> {
        Ok(Self { perception: Perception::new(features, HandConfig::default())?, hand, kept: Vec::new() })
    }

    /// Whether a picture, 8-bit BGR of any size, is worth keeping; if it is, it is remembered as kept. `Ok(Some(…))` says why not.
    ///
    /// # Errors
    /// [`JudgeError::OpenCv`].
    pub fn judge(&mut self, picture: &Mat) -> Result<Option<Unfit>, JudgeError> {
        let whole = Rect::new(0, 0, picture.cols(), picture.rows());
        let region = match self.perception.observe(picture) {
            Ok(_) => self.perception.region() & whole,
            Err(NoObservation::OpenCv(error)) => return Err(error.into()),
            Err(error) if self.hand || whole.area() == 0 => {
                return Ok(Some(Unfit::NoHand(error.to_string())));
            }
            Err(_) => whole,
        };
        let grey = grey(&picture.roi(region)?.try_clone()?)?;
        if self.hand
            && let Some(unfit) = of_hand(&grey, self.perception.mask(), region, whole)?
        {
            return Ok(Some(unfit));
        }
        let view = resized(&grey, Size::new(THUMBNAIL, THUMBNAIL))?;
        let pixels = f64::from(THUMBNAIL * THUMBNAIL);
        for kept in &self.kept {
            if norm2(&view, kept, NORM_L1, &no_array())? / pixels < SAME {
                return Ok(Some(Unfit::Repeated));
            }
        }
        self.kept.push(view);
        Ok(None)
    }
}

/// What is wrong with a hand: `mask` marks its pixels in `grey`, at a size of its own, with a margin of one pixel.
fn of_hand(grey: &Mat, mask: &Mat, region: Rect, whole: Rect) -> Result<Option<Unfit>, JudgeError> {
    let inner = Rect::new(1, 1, mask.cols() - 2, mask.rows() - 2);
    if inner.width < 8 || inner.height < 8 {
        return Ok(Some(Unfit::NoHand("the hand is too small".to_owned())));
    }
    let mask = mask.roi(inner)?.try_clone()?;
    if is_cut_off(&mask, region, whole)? {
        return Ok(Some(Unfit::CutOff));
    }
    let grey = resized(grey, mask.size()?)?;
    let pixels = f64::from(count_non_zero(&mask)?.max(1));
    let share = |level: f64, how: i32| -> opencv::Result<f64> {
        let (mut clipped, mut of_it) = (Mat::default(), Mat::default());
        compare(&grey, &level, &mut clipped, how)?;
        opencv::core::bitwise_and(&clipped, &mask, &mut of_it, &no_array())?;
        Ok(f64::from(count_non_zero(&of_it)?) / pixels)
    };
    let (burnt, black) = (share(BURNT, CMP_GE)?, share(BLACK, CMP_LE)?);
    if burnt > CLIPPED {
        return Ok(Some(Unfit::Bright(burnt)));
    }
    if black > CLIPPED {
        return Ok(Some(Unfit::Dark(black)));
    }
    let sharpness = sharpness(&grey, &mask)?;
    Ok((sharpness < SHARP).then_some(Unfit::Blurred(sharpness)))
}

/// Whether a hand runs out of the picture at two opposite sides. An arm comes in from one, or over a corner.
fn is_cut_off(mask: &Mat, region: Rect, whole: Rect) -> opencv::Result<bool> {
    // So many of the mask's outermost pixels are the hand's, where its region ends with the picture.
    const SHARE: f64 = 0.05;
    let (width, height) = (mask.cols(), mask.rows());
    let runs_out = |at_edge: bool, side: Rect| -> opencv::Result<bool> {
        let length = f64::from(side.width.max(side.height));
        Ok(at_edge && f64::from(count_non_zero(&mask.roi(side)?.try_clone()?)?) > SHARE * length)
    };
    let left = runs_out(region.x <= 0, Rect::new(0, 0, 1, height))?;
    let right = runs_out(region.x + region.width >= whole.width, Rect::new(width - 1, 0, 1, height))?;
    let top = runs_out(region.y <= 0, Rect::new(0, 0, width, 1))?;
    let bottom = runs_out(region.y + region.height >= whole.height, Rect::new(0, height - 1, width, 1))?;
    Ok(left && right || top && bottom)
}

/// The variance of the Laplacian of a hand and its outline.
fn sharpness(grey: &Mat, mask: &Mat) -> opencv::Result<f64> {
    let kernel = get_structuring_element_def(MORPH_RECT, Size::new(9, 9))?;
    let (mut wide, mut edges) = (Mat::default(), Mat::default());
    dilate_def(mask, &mut wide, &kernel)?;
    laplacian_def(grey, &mut edges, CV_64F)?;
    let (mut mean, mut deviation) = (Vector::<f64>::new(), Vector::<f64>::new());
    mean_std_dev(&edges, &mut mean, &mut deviation, &wide)?;
    Ok(deviation.iter().next().unwrap_or_default().powi(2))
}

fn grey(picture: &Mat) -> opencv::Result<Mat> {
    let mut grey = Mat::default();
    cvt_color_def(picture, &mut grey, COLOR_BGR2GRAY)?;
    Ok(grey)
}

fn resized(picture: &Mat, size: Size) -> opencv::Result<Mat> {
    let how = if picture.cols() > size.width { INTER_AREA } else { INTER_LINEAR };
    let mut small = Mat::default();
    resize(picture, &mut small, size, 0.0, 0.0, how)?;
    Ok(small)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gestalt_vision::camera_model::CameraModel;
    use gestalt_vision::pose::Pose;
    use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};
    use opencv::core::{CV_8UC3, Scalar};
    use opencv::imgproc::gaussian_blur_def;

    use super::*;

    fn hand(fingers: u8) -> Mat {
        let mut source =
            RenderedSource::new(CameraModel::laptop(), Pose::FRONTAL, Glove::default(), 5).unwrap();
        source.next_frame(Duration::ZERO, &Scene { gesture: Some(fingers), seed: 1 }).unwrap().image
    }

    fn judge() -> Judge {
        Judge::new(FeatureSet::Shape, true).unwrap()
    }

    #[test]
    fn a_good_picture_is_kept_once_and_another_gesture_is_another_picture() {
        let mut judge = judge();
        assert_eq!(judge.judge(&hand(3)).unwrap(), None);
        assert_eq!(judge.judge(&hand(3)).unwrap(), Some(Unfit::Repeated));
        assert_eq!(judge.judge(&hand(5)).unwrap(), None);
        assert_eq!(judge.judge(&hand(5)).unwrap(), Some(Unfit::Repeated));
    }

    #[test]
    fn what_nobody_can_learn_from_is_refused_with_the_reason() {
        let mut judge = judge();
        let mut blurred = Mat::default();
        gaussian_blur_def(&hand(3), &mut blurred, Size::new(31, 31), 8.0).unwrap();
        let refused = judge.judge(&blurred).unwrap();
        assert!(matches!(refused, Some(Unfit::Blurred(_) | Unfit::NoHand(_))), "{refused:?}");
        let black = Mat::new_rows_cols_with_default(480, 640, CV_8UC3, Scalar::all(0.0)).unwrap();
        assert!(matches!(judge.judge(&black).unwrap(), Some(Unfit::NoHand(_))));
        assert!(matches!(judge.judge(&Mat::default()).unwrap(), Some(Unfit::NoHand(_))));
        assert_eq!(judge.judge(&hand(3)).unwrap(), None);
    }

    #[test]
    fn a_hand_that_is_burnt_out_or_black_or_cut_off_is_told_apart() {
        let mask =
            Mat::new_rows_cols_with_default(102, 102, opencv::core::CV_8UC1, Scalar::all(255.0)).unwrap();
        let of = |level: f64, region: Rect| {
            let grey =
                Mat::new_rows_cols_with_default(100, 100, opencv::core::CV_8UC1, Scalar::all(level)).unwrap();
            of_hand(&grey, &mask, region, Rect::new(0, 0, 640, 480)).unwrap()
        };
        let middle = Rect::new(200, 200, 100, 100);
        assert_eq!(of(255.0, middle), Some(Unfit::Bright(1.0)));
        assert_eq!(of(0.0, middle), Some(Unfit::Dark(1.0)));
        assert!(matches!(of(128.0, middle), Some(Unfit::Blurred(_))));
        assert_eq!(of(128.0, Rect::new(200, 0, 100, 480)), Some(Unfit::CutOff));
        // An arm that comes in over a corner is none.
        assert!(matches!(of(128.0, Rect::new(540, 380, 100, 100)), Some(Unfit::Blurred(_))));
    }

    #[test]
    fn pictures_without_a_gesture_need_no_hand_and_are_kept_once() {
        let mut judge = Judge::new(FeatureSet::Shape, false).unwrap();
        let wall = Mat::new_rows_cols_with_default(480, 640, CV_8UC3, Scalar::all(90.0)).unwrap();
        assert_eq!(judge.judge(&wall).unwrap(), None);
        assert_eq!(judge.judge(&wall).unwrap(), Some(Unfit::Repeated));
    }
}
