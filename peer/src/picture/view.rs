//! What a robot sees now: the frame, the hand in it, and what it is taken for.

use gestalt_draw::{Letters, Place, Sheet};
use gestalt_vision::source::Frame;
use opencv::core::{Mat, Point, Rect, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use super::PictureError;
use super::frame::{embed, mark};
use super::tone::{AGREES, BACKGROUND, DIFFERS, MUTED, TEXT};

/// What is drawn.
#[derive(Debug)]
pub struct View<'a> {
    /// The robot and its camera.
    pub title: &'a str,
    /// The frame (BGR, 8 bits).
    pub frame: &'a Mat,
    /// In which part of the frame a hand was found, and which pixels of that part it is: scaled, with a margin of one pixel.
    pub hand: Option<(Rect, &'a Mat)>,
    /// What it is taken for, and how surely (`0.0..=1.0`); or else why it is taken for nothing.
    pub opinion: Result<(String, f64), String>,
}

/// Below the frame stands a line of text.
const LINE: f64 = 44.0;
/// No frame is shown wider or higher, in pixels: who wants the camera's own resolution subscribes to the camera.
const MAX_SIDE: f64 = 1280.0;

/// Draws it as SVG.
///
/// # Errors
/// [`PictureError::OpenCv`] when an image is empty or of another type.
pub fn draw(view: &View<'_>) -> Result<String, PictureError> {
    let (width, height) = (f64::from(view.frame.cols()), f64::from(view.frame.rows()));
    let shrunk = (MAX_SIDE / width.max(height).max(1.0)).min(1.0);
    let shown = Place::new(0.0, 0.0, (width * shrunk).round().max(1.0), (height * shrunk).round().max(1.0));
    let mut sheet = Sheet::new(shown.width, shown.height + LINE, BACKGROUND);
    embed(&mut sheet, view.frame, shown)?;
    if let Some((region, mask)) = view.hand {
        mark(&mut sheet, view.frame, region, shown);
        outline(&mut sheet, region, mask, shown.width / width.max(1.0))?;
    }
    let (words, tone) = match &view.opinion {
        Ok((label, probability)) => (format!("{label}  {:.0} %", 100.0 * probability), AGREES),
        Err(cause) => (cause.clone(), if view.hand.is_some() { DIFFERS } else { MUTED }),
    };
    // As much room for the robot's name as its opinion leaves.
    let taken = gestalt_draw::text_width(&words, 20.0).min(shown.width * 0.6);
    let base = shown.height + 29.0;
    sheet.write(&words, (10.0, base), Letters::new(20.0, tone), shown.width * 0.6);
    sheet.write(view.title, (24.0 + taken, base), Letters::new(14.0, TEXT), shown.width - taken - 34.0);
    Ok(sheet.svg())
}

/// The same as a picture.
///
/// # Errors
/// [`PictureError`].
pub fn picture(view: &View<'_>) -> Result<Mat, PictureError> {
    let (width, height, pixels) = gestalt_draw::bgr(&draw(view)?)?;
    let frame = Frame::from_bgr(width, height, &pixels, std::time::Duration::ZERO);
    frame.map(|frame| frame.image).map_err(|cause| {
        PictureError::OpenCv(opencv::Error::new(opencv::core::StsBadSize, cause.to_string()))
    })
}

/// The edge of the hand.
fn outline(sheet: &mut Sheet, region: Rect, mask: &Mat, scale: f64) -> opencv::Result<()> {
    if mask.cols() < 3 || mask.rows() < 3 {
        return Ok(());
    }
    let mut edges = Vector::<Vector<Point>>::new();
    imgproc::find_contours(
        mask,
        &mut edges,
        imgproc::RETR_EXTERNAL,
        imgproc::CHAIN_APPROX_SIMPLE,
        Point::default(),
    )?;
    let across = f64::from(region.width) / f64::from(mask.cols() - 2);
    let down = f64::from(region.height) / f64::from(mask.rows() - 2);
    for edge in edges {
        let points = edge.iter().map(|point| {
            let x = f64::from(region.x) + (f64::from(point.x) - 0.5) * across;
            let y = f64::from(region.y) + (f64::from(point.y) - 0.5) * down;
            (x * scale, y * scale)
        });
        sheet.contour(points, AGREES, 1.5);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8U, CV_8UC3, Scalar, Vec3b};

    use super::*;

    fn tone(picture: &Mat, x: i32, y: i32) -> u32 {
        let pixel = picture.at_2d::<Vec3b>(y, x).unwrap();
        u32::from_be_bytes([0, pixel[2], pixel[1], pixel[0]])
    }

    #[test]
    fn the_hand_is_marked_where_it_is_and_the_rest_of_the_frame_is_left_as_it_was() {
        let frame = Mat::new_rows_cols_with_default(288, 384, CV_8UC3, Scalar::all(99.0)).unwrap();
        // A hand of 40×40 pixels in the middle of a part of 80×60 that is seen at twice its size.
        let mut mask = Mat::new_rows_cols_with_default(122, 162, CV_8U, Scalar::all(0.0)).unwrap();
        let inner = Rect::new(41, 21, 80, 80);
        Mat::roi_mut(&mut mask, inner)
            .unwrap()
            .set_to(&Scalar::all(255.0), &opencv::core::no_array())
            .unwrap();
        let mut view = View {
            title: "robot-3",
            frame: &frame,
            hand: Some((Rect::new(100, 50, 80, 60), &mask)),
            opinion: Ok(("three".to_owned(), 0.93)),
        };
        let picture = super::picture(&view).unwrap();
        assert_eq!((picture.cols(), picture.rows()), (384, 288 + 44));
        for (x, y, what) in
            [(100, 80, "left of the part"), (140, 50, "top of it"), (120, 80, "left of the hand")]
        {
            let near = (-2..=2).any(|off| tone(&picture, x + off, y + off) == AGREES);
            assert!(near, "{what}: {:06x}", tone(&picture, x, y));
        }
        for (x, y) in [(10, 10), (140, 80), (110, 60), (300, 200)] {
            assert_eq!(tone(&picture, x, y), 0x63_63_63, "{x} {y}");
        }
        let ink = |picture: &Mat| {
            let below = Rect::new(0, 288, 384, 44);
            let below = Mat::roi(picture, below).unwrap().try_clone().unwrap();
            below.data_typed::<Vec3b>().unwrap().iter().filter(|pixel| pixel[1] > 100).count()
        };
        assert!(ink(&picture) > 200, "what it is taken for is written below");

        (view.hand, view.opinion) = (None, Err("no hand".to_owned()));
        let picture = super::picture(&view).unwrap();
        assert_eq!(tone(&picture, 100, 80), 0x63_63_63, "nothing is marked where no hand was found");
        assert!(super::picture(&View { frame: &Mat::default(), ..view }).is_err());
    }

    #[test]
    fn a_large_frame_is_shown_smaller() {
        let frame = Mat::new_rows_cols_with_default(1000, 4000, CV_8UC3, Scalar::all(99.0)).unwrap();
        let view = View { title: "", frame: &frame, hand: None, opinion: Err(String::new()) };
        let picture = super::picture(&view).unwrap();
        assert_eq!((picture.cols(), picture.rows()), (1280, 320 + 44));
    }
}
