//! Drawing on a picture: areas, images, and lines of text.

use opencv::core::{self, Mat, Point, Rect, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;

pub(super) const BACKGROUND: u32 = 0x16_1a_20;
pub(super) const CARD: u32 = 0x24_2a_33;
pub(super) const TRACK: u32 = 0x38_40_4c;
pub(super) const TEXT: u32 = 0xf2_f4_f7;
pub(super) const MUTED: u32 = 0x9a_a5_b4;
pub(super) const AGREES: u32 = 0x3f_b9_7f;
pub(super) const DIFFERS: u32 = 0xf0_7a_52;

/// A colour as 0xRRGGBB.
pub(super) fn colour(rgb: u32) -> Scalar {
    let [_, red, green, blue] = rgb.to_be_bytes();
    Scalar::new(blue.into(), green.into(), red.into(), 0.0)
}

/// Copies an image into a place of the picture, as large as it fits, in its own proportions.
pub(super) fn fit(picture: &mut Mat, image: &Mat, place: Rect) -> opencv::Result<()> {
    let scale = f64::min(
        f64::from(place.width) / f64::from(image.cols().max(1)),
        f64::from(place.height) / f64::from(image.rows().max(1)),
    );
    let side = |length: i32, limit: i32| ((f64::from(length) * scale).round() as i32).clamp(1, limit);
    let size = Size::new(side(image.cols(), place.width), side(image.rows(), place.height));
    let mut scaled = Mat::default();
    let how = if scale < 1.0 { imgproc::INTER_AREA } else { imgproc::INTER_CUBIC };
    imgproc::resize(image, &mut scaled, size, 0.0, 0.0, how)?;
    let corner =
        Point::new(place.x + (place.width - size.width) / 2, place.y + (place.height - size.height) / 2);
    let mut target = Mat::roi_mut(picture, Rect::from_point_size(corner, size))?;
    scaled.copy_to(&mut target)
}

pub(super) fn fill(picture: &mut Mat, place: Rect, tone: u32) -> opencv::Result<()> {
    if place.width <= 0 || place.height <= 0 {
        return Ok(());
    }
    Mat::roi_mut(picture, place)?.set_to(&colour(tone), &core::no_array()).map(drop)
}

const FONT: i32 = imgproc::FONT_HERSHEY_DUPLEX;

/// Writes text with its baseline at `at`, shortened to the width.
pub(super) fn write(
    picture: &mut Mat,
    text: &str,
    at: Point,
    scale: f64,
    tone: u32,
    width: i32,
) -> opencv::Result<()> {
    let text = fitting(text, scale, width)?;
    // Large letters need a thicker pen.
    let pen = if scale > 1.0 { 2 } else { 1 };
    imgproc::put_text(picture, &text, at, FONT, scale, colour(tone), pen, imgproc::LINE_AA, false)
}

/// Writes text centred over a width that begins at `at`.
pub(super) fn centre(
    picture: &mut Mat,
    text: &str,
    at: Point,
    width: i32,
    scale: f64,
    tone: u32,
    limit: i32,
) -> opencv::Result<()> {
    let text = fitting(text, scale, limit)?;
    let offset = (width - text_width(&text, scale)?) / 2;
    write(picture, &text, Point::new(at.x + offset, at.y), scale, tone, limit)
}

pub(super) fn text_width(text: &str, scale: f64) -> opencv::Result<i32> {
    Ok(imgproc::get_text_size(text, FONT, scale, 1, &mut 0)?.width)
}

/// The text in what OpenCV's font has (ASCII), cut to a width.
pub(super) fn fitting(text: &str, scale: f64, width: i32) -> opencv::Result<String> {
    let printable = |character: char| match character {
        '×' => 'x',
        '–' | '—' => '-',
        ' '..='~' => character,
        _ => '?',
    };
    // No text of more characters fits any picture.
    let mut text: String = text.chars().take(400).map(printable).collect();
    while text_width(&text, scale)? > width && text.len() > 2 {
        text.truncate(text.len() - if text.ends_with("..") { 3 } else { 1 });
        text.push_str("..");
    }
    Ok(text)
}
