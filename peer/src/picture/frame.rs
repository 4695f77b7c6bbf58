//! Frames in pictures: as PNG, no larger than they are shown.

use std::path::Path;

use gestalt_draw::{Place, Sheet};
use opencv::core::{Mat, Rect, Size, Vector};
use opencv::prelude::*;
use opencv::{imgcodecs, imgproc};

use super::PictureError;
use super::tone::AGREES;

/// Writes a frame (BGR or grey, 8 bits) as it is to a PNG file.
///
/// # Errors
/// [`PictureError`] names the path and what to do about it.
pub fn write_png(path: &Path, image: &Mat) -> Result<(), PictureError> {
    Ok(gestalt_draw::save(encode(image)?.as_slice(), path)?)
}

/// Puts a frame into the middle of a place, as large as it fits in its own proportions; gives where it lies.
pub(super) fn embed(sheet: &mut Sheet, image: &Mat, place: Place) -> opencv::Result<Place> {
    let (width, height) = (f64::from(image.cols()), f64::from(image.rows()));
    let shown = place.holding(width, height);
    // What is shown smaller than it is need not be kept whole; what is shown larger is enlarged by who shows it.
    let png = if shown.width < width {
        let size = Size::new(shown.width.round().max(1.0) as i32, shown.height.round().max(1.0) as i32);
        let mut reduced = Mat::default();
        imgproc::resize(image, &mut reduced, size, 0.0, 0.0, imgproc::INTER_AREA)?;
        encode(&reduced)?
    } else {
        encode(image)?
    };
    sheet.picture(png.as_slice(), shown);
    Ok(shown)
}

/// Marks a region of an image that is shown in a place.
pub(super) fn mark(sheet: &mut Sheet, image: &Mat, region: Rect, shown: Place) {
    let scale = shown.width / f64::from(image.cols().max(1));
    let [x, y, width, height] =
        [region.x, region.y, region.width, region.height].map(|pixels| f64::from(pixels) * scale);
    sheet.outline(Place::new(shown.x + x, shown.y + y, width, height), AGREES, 2.5);
}

/// The fastest compression: a noisy frame becomes hardly smaller by the others.
fn encode(image: &Mat) -> opencv::Result<Vector<u8>> {
    let mut bytes = Vector::new();
    let fast = Vector::from_slice(&[imgcodecs::IMWRITE_PNG_COMPRESSION, 1]);
    imgcodecs::imencode(".png", image, &mut bytes, &fast)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use opencv::core::{self, Scalar};

    use super::*;

    #[test]
    fn what_is_written_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.png");
        let frame = Mat::new_rows_cols_with_default(288, 384, core::CV_8UC3, Scalar::new(1.0, 2.0, 3.0, 0.0))
            .unwrap();
        write_png(&path, &frame).unwrap();
        let read = imgcodecs::imread(&path, imgcodecs::IMREAD_COLOR).unwrap();
        assert_eq!(read.data_bytes().unwrap(), frame.data_bytes().unwrap());
    }
}
