//! Encoded pictures: decoded, as a whole or smaller than they are, and encoded.
//!
//! JPEG is decoded by libjpeg-turbo itself. OpenCV asks the same library, and then turns the channels of every pixel around one by
//! one, which takes twice as long as decoding (1.4 ms instead of 0.45 ms for 640×360). Whatever is no plain JPEG is OpenCV's.

use opencv::core::{CV_8UC3, Mat, Scalar, Size, Vector};
use opencv::imgcodecs;
use opencv::prelude::*;
use turbojpeg::{Decompressor, Image, PixelFormat};

use super::SourceError;
use super::container::{PictureError, inspect};

/// Decodes a JPEG or PNG picture as BGR, 8 bits, upright, into a buffer that is reused where its size fits.
///
/// # Errors
/// See [`PictureError`]; the buffer then holds anything.
pub fn decode(bytes: &[u8], megapixels: f64, image: &mut Mat) -> Result<(), PictureError> {
    decode_reduced(bytes, megapixels, |whole| whole, image).map(drop)
}

/// The same, but where the picture is a JPEG only at a half, a quarter or an eighth of its sides, as long as that is no smaller than
/// what is `enough` for a picture of its size: little more is then done than to read it. Gives the size of the whole picture.
///
/// # Errors
/// As [`decode`].
pub fn decode_reduced(
    bytes: &[u8],
    megapixels: f64,
    enough: impl FnOnce(Size) -> Size,
    image: &mut Mat,
) -> Result<Size, PictureError> {
    let claim = inspect(bytes)?;
    let (width, height) = (claim.width, claim.height);
    let size = claim.size().filter(|_| f64::from(width) * f64::from(height) <= megapixels * 1e6);
    let size = size.ok_or(PictureError::TooLarge { width, height, limit: megapixels })?;
    if claim.plain_jpeg && size.width > 0 && size.height > 0 {
        let enough = enough(size);
        let reduced = |by: i32| Size::new((size.width + by - 1) / by, (size.height + by - 1) / by);
        let fits = |size: &Size| size.width >= enough.width && size.height >= enough.height;
        let target = [8, 4, 2].map(reduced).into_iter().find(fits).unwrap_or(size);
        // What libjpeg-turbo finds fault with OpenCV may still make something of.
        if decode_jpeg(bytes, target, image).is_some() {
            return Ok(size);
        }
    }
    // Should the library read another size than this was let in for, it is not decoded.
    if jpeg_size(bytes).is_some_and(|found| found != (width as usize, height as usize)) {
        return Err(PictureError::NotAnImage);
    }
    // OpenCV says "cannot decode" with an empty image or with an error, depending on the decoder.
    let decoded = Mat::from_slice(bytes)
        .and_then(|bytes| imgcodecs::imdecode_to(&bytes, imgcodecs::IMREAD_COLOR, image));
    match decoded {
        Ok(decoded) if !decoded.empty() => Ok(Size::new(decoded.cols(), decoded.rows())),
        _ => Err(PictureError::NotAnImage),
    }
}

/// The width and height that the library reads; `None` of what it takes for no JPEG.
fn jpeg_size(bytes: &[u8]) -> Option<(usize, usize)> {
    // It is not set up to find that a PNG is none.
    let mut library = bytes.starts_with(b"\xff\xd8").then(Decompressor::new)?.ok()?;
    library.read_header(bytes).ok().map(|found| (found.width, found.height))
}

/// Decodes a JPEG at one of the sizes that its library can reduce it to.
fn decode_jpeg(bytes: &[u8], size: Size, image: &mut Mat) -> Option<()> {
    if image.size().ok()? != size || image.typ() != CV_8UC3 || !image.is_continuous() {
        *image = Mat::new_size_with_default(size, CV_8UC3, Scalar::all(0.0)).ok()?;
    }
    let (width, height) = (usize::try_from(size.width).ok()?, usize::try_from(size.height).ok()?);
    let pixels = image.data_bytes_mut().ok()?;
    let picture = Image { pixels, width, pitch: 3 * width, height, format: PixelFormat::BGR };
    Decompressor::new().ok()?.decompress(bytes, picture).ok()
}

/// What is left of a picture that travelled as a JPEG of that quality, 0 to 100.
///
/// # Errors
/// [`SourceError::OpenCv`].
pub fn through_jpeg(picture: &Mat, quality: i32) -> Result<Mat, SourceError> {
    let jpeg = encode_jpeg(picture, quality)?;
    Ok(imgcodecs::imdecode(&Vector::from_slice(&jpeg), imgcodecs::IMREAD_COLOR)?)
}

/// Encodes a picture, blue, green, red, 8 bits, as JPEG of that quality, `1..=100`.
///
/// # Errors
/// OpenCV's, for a picture of another kind or without pixels.
pub fn encode_jpeg(picture: &Mat, quality: i32) -> Result<Vec<u8>, opencv::Error> {
    let quality = Vector::from_slice(&[imgcodecs::IMWRITE_JPEG_QUALITY, quality]);
    let mut encoded = Vector::new();
    imgcodecs::imencode(".jpg", picture, &mut encoded, &quality)?;
    Ok(encoded.to_vec())
}

#[cfg(test)]
pub(super) mod tests {
    use opencv::core::{self, NORM_INF, NORM_L1, no_array, norm2};
    use opencv::imgproc::{INTER_AREA, resize};

    use super::super::MAX_MEGAPIXELS;
    use super::*;

    pub(in super::super) fn encoded(extension: &str, width: i32, height: i32) -> Vec<u8> {
        let mut picture =
            Mat::new_rows_cols_with_default(height, width, core::CV_8UC3, Scalar::all(0.0)).unwrap();
        for (i, pixel) in picture.data_typed_mut::<core::Vec3b>().unwrap().iter_mut().enumerate() {
            *pixel = [(i * 7) as u8, (i / 5) as u8, (i * i / 11) as u8].into();
        }
        let mut bytes = Vector::new();
        imgcodecs::imencode(extension, &picture, &mut bytes, &Vector::new()).unwrap();
        bytes.to_vec()
    }

    #[test]
    fn a_buffer_of_the_right_size_is_reused() {
        let (first, second) = (encoded(".jpg", 40, 30), encoded(".jpg", 40, 30));
        let mut image = Mat::default();
        decode(&first, MAX_MEGAPIXELS, &mut image).unwrap();
        let data = image.data();
        decode(&second, MAX_MEGAPIXELS, &mut image).unwrap();
        assert_eq!(image.data(), data);
        assert_eq!(
            decode(&first, 0.001, &mut image),
            Err(PictureError::TooLarge { width: 40, height: 30, limit: 0.001 })
        );
    }

    #[test]
    fn a_whole_picture_is_to_the_bit_what_opencv_makes_of_it() {
        for (width, height) in [(640, 360), (37, 23), (1, 1)] {
            let jpeg = encoded(".jpg", width, height);
            let mut image = Mat::default();
            decode(&jpeg, MAX_MEGAPIXELS, &mut image).unwrap();
            let theirs = imgcodecs::imdecode(&Vector::from_slice(&jpeg), imgcodecs::IMREAD_COLOR).unwrap();
            assert_eq!(norm2(&image, &theirs, NORM_INF, &no_array()).unwrap(), 0.0, "{width}×{height}");
        }
    }

    #[test]
    fn a_picture_is_reduced_as_far_as_is_enough_and_shows_the_same() {
        // Smooth, as cameras see: of pixels that have nothing in common, every reduction makes something else.
        let coarse =
            imgcodecs::imdecode(&Vector::from_slice(&encoded(".png", 8, 5)), imgcodecs::IMREAD_COLOR);
        let mut picture = Mat::default();
        resize(&coarse.unwrap(), &mut picture, Size::new(640, 361), 0.0, 0.0, INTER_AREA).unwrap();
        let jpeg = encode_jpeg(&picture, 90).unwrap();
        for (enough, expected) in
            [((640, 361), 1), ((321, 10), 1), ((320, 181), 2), ((160, 90), 4), ((1, 1), 8)]
        {
            let mut image = Mat::default();
            let enough = Size::new(enough.0, enough.1);
            let whole = decode_reduced(&jpeg, MAX_MEGAPIXELS, |_| enough, &mut image).unwrap();
            assert_eq!(whole, Size::new(640, 361));
            let size = image.size().unwrap();
            assert_eq!(size, Size::new((640 + expected - 1) / expected, (361 + expected - 1) / expected));
            let mut by_area = Mat::default();
            resize(&picture, &mut by_area, size, 0.0, 0.0, INTER_AREA).unwrap();
            let apart = norm2(&image, &by_area, NORM_L1, &no_array()).unwrap() / f64::from(3 * size.area());
            assert!(apart < 4.0, "at 1/{expected}: {apart:.2} grey levels apart");
        }
        // A PNG is decoded as it is.
        let mut image = Mat::default();
        decode_reduced(&encoded(".png", 40, 30), MAX_MEGAPIXELS, |_| Size::new(1, 1), &mut image).unwrap();
        assert_eq!(image.size().unwrap(), Size::new(40, 30));
    }

    #[test]
    fn damaged_data_is_no_worse_than_with_opencv() {
        let mut jpeg = encoded(".jpg", 64, 48);
        let middle = jpeg.len() / 2;
        jpeg[middle..middle + 8].fill(0x55);
        let mut image = Mat::default();
        let theirs = imgcodecs::imdecode(&Vector::from_slice(&jpeg), imgcodecs::IMREAD_COLOR).unwrap();
        assert_eq!(decode(&jpeg, MAX_MEGAPIXELS, &mut image).is_ok(), !theirs.empty());
    }
}
