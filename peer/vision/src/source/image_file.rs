//! Reads one image, and tells apart everything that may be wrong with its file.
//!
//! OpenCV's decoders give a JPEG that was cut short as a partly grey image without a word, and decode any size. So
//! the container is checked first: what it is, how large, and whether its end is there.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use opencv::core::{Mat, Vector};
use opencv::imgcodecs;
use opencv::prelude::*;
use thiserror::Error;

use super::SourceError;

/// The largest image that is decoded, in millions of pixels.
pub const MAX_MEGAPIXELS: f64 = 50.0;

/// The largest image file that is read, in bytes.
pub const MAX_IMAGE_BYTES: u64 = 64 << 20;

/// Reads a JPEG or PNG file as BGR, 8 bits, upright as its EXIF orientation says.
///
/// # Errors
/// [`SourceError`] names the file and what is wrong with it.
pub fn read_image(path: &Path) -> Result<Mat, SourceError> {
    let bytes = read_bounded(path)?;
    let mut image = Mat::default();
    match decode(&bytes, MAX_MEGAPIXELS, &mut image) {
        Ok(()) => Ok(image),
        Err(PictureError::NotAnImage) => Err(SourceError::NotAnImage(path.into())),
        Err(PictureError::Truncated) => Err(SourceError::Truncated(path.into())),
        Err(PictureError::TooLarge { width, height, .. }) => Err(SourceError::TooLarge {
            path: path.into(),
            size: format!("{width}×{height} pixels"),
            limit: format!("{MAX_MEGAPIXELS} megapixels"),
        }),
    }
}

/// Reads a file of at most `limit` bytes that is a whole JPEG, as it is; `None` for any other.
///
/// # Errors
/// [`SourceError`] when it cannot be read.
pub fn read_jpeg(path: &Path, limit: usize) -> Result<Option<Vec<u8>>, SourceError> {
    let bytes = read_bounded(path)?;
    let is_jpeg = bytes.len() <= limit && bytes.starts_with(b"\xff\xd8\xff") && inspect(&bytes).is_ok();
    Ok(is_jpeg.then_some(bytes))
}

/// Encoded bytes that are no picture, or none to be decoded.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PictureError {
    /// Neither JPEG nor PNG, or a damaged one.
    #[error("no JPEG or PNG picture that can be decoded")]
    NotAnImage,
    /// The end is missing. (A decoder would fill the rest with grey and say nothing.)
    #[error("a picture cut short: its end is missing")]
    Truncated,
    /// More pixels than allowed; it was not decoded.
    #[error("a picture of {width}×{height} pixels: at most {limit} megapixels are decoded")]
    TooLarge {
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
        /// In millions of pixels.
        limit: f64,
    },
}

/// Decodes a JPEG or PNG picture as BGR, 8 bits, upright, into a buffer that is reused where its size fits.
///
/// # Errors
/// See [`PictureError`]; the buffer then holds anything.
pub fn decode(bytes: &[u8], megapixels: f64, image: &mut Mat) -> Result<(), PictureError> {
    let (width, height) = inspect(bytes)?;
    if f64::from(width) * f64::from(height) > megapixels * 1e6 {
        return Err(PictureError::TooLarge { width, height, limit: megapixels });
    }
    // OpenCV says "cannot decode" with an empty image or with an error, depending on the decoder.
    let decoded = Mat::from_slice(bytes)
        .and_then(|bytes| imgcodecs::imdecode_to(&bytes, imgcodecs::IMREAD_COLOR, image));
    match decoded {
        Ok(decoded) if !decoded.empty() => Ok(()),
        _ => Err(PictureError::NotAnImage),
    }
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

/// Checks that a path is a readable file with something in it, and gives its size in bytes.
pub(super) fn check_file(path: &Path) -> Result<u64, SourceError> {
    let about = fs::metadata(path).map_err(|cause| SourceError::io(path, cause))?;
    if !about.is_file() {
        // A directory, or a pipe that would block.
        return Err(SourceError::io(path, io::Error::other("it is not a regular file")));
    }
    File::open(path).map_err(|cause| SourceError::io(path, cause))?;
    if about.len() == 0 { Err(SourceError::Empty(path.into())) } else { Ok(about.len()) }
}

fn read_bounded(path: &Path) -> Result<Vec<u8>, SourceError> {
    let size = check_file(path)?;
    if size > MAX_IMAGE_BYTES {
        return Err(SourceError::TooLarge {
            path: path.into(),
            size: format!("{} MB", size >> 20),
            limit: format!("{} MB", MAX_IMAGE_BYTES >> 20),
        });
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|cause| SourceError::io(path, cause))?;
    file.take(MAX_IMAGE_BYTES).read_to_end(&mut bytes).map_err(|cause| SourceError::io(path, cause))?;
    Ok(bytes)
}

/// The width and height that a whole JPEG or PNG file claims.
fn inspect(bytes: &[u8]) -> Result<(u32, u32), PictureError> {
    if let Some(rest) = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n") {
        inspect_png(rest)
    } else if let Some(rest) = bytes.strip_prefix(b"\xff\xd8\xff") {
        // The third byte belongs to the first marker.
        inspect_jpeg(&bytes[bytes.len() - rest.len() - 1..])
    } else {
        Err(PictureError::NotAnImage)
    }
}

/// Walks the chunks (length, type, data, checksum) up to the end chunk.
fn inspect_png(mut rest: &[u8]) -> Result<(u32, u32), PictureError> {
    let size = match rest.get(8..16) {
        Some(fields) => (big_endian(&fields[..4]), big_endian(&fields[4..])),
        None => return Err(PictureError::Truncated),
    };
    loop {
        let (Some(length), Some(kind)) = (rest.get(..4), rest.get(4..8)) else {
            return Err(PictureError::Truncated);
        };
        let end = (big_endian(length) as usize).saturating_add(12);
        if rest.len() < end {
            return Err(PictureError::Truncated);
        }
        if kind == b"IEND" {
            return Ok(size);
        }
        rest = &rest[end..];
    }
}

/// Walks the marker segments, and through the scans between them, up to the end-of-image marker (ITU-T T.81, B.1).
fn inspect_jpeg(mut rest: &[u8]) -> Result<(u32, u32), PictureError> {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: u8 = 0xd9;
    let mut size = None;
    loop {
        // A marker is 0xff, any number of times, and a code.
        let Some(fill) = rest.iter().position(|byte| *byte != 0xff) else {
            return Err(PictureError::Truncated);
        };
        if fill == 0 {
            return Err(PictureError::NotAnImage);
        }
        let marker = rest[fill];
        rest = &rest[fill + 1..];
        if marker == END_OF_IMAGE {
            return size.ok_or(PictureError::NotAnImage);
        }
        let Some(length) = rest.get(..2) else { return Err(PictureError::Truncated) };
        let length = big_endian(length) as usize;
        let Some(segment) = rest.get(..length) else { return Err(PictureError::Truncated) };
        // Start of frame, of any coding: C0 to CF but for tables (C4, C8, CC).
        if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
            let fields = segment.get(3..7).ok_or(PictureError::NotAnImage)?;
            size = Some((big_endian(&fields[2..]), big_endian(&fields[..2])));
        }
        rest = &rest[length..];
        if marker == START_OF_SCAN {
            // In coded data 0xff is followed by a zero (stuffing) or a restart marker; anything else ends it.
            let coded = |pair: &[u8]| pair[0] != 0xff || matches!(pair[1], 0x00 | 0xd0..=0xd7);
            let end = rest.windows(2).position(|pair| !coded(pair)).ok_or(PictureError::Truncated)?;
            rest = &rest[end..];
        }
    }
}

fn big_endian(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |value, byte| value << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use opencv::core::{self, Scalar};

    use super::*;

    fn encoded(extension: &str, width: i32, height: i32) -> Vec<u8> {
        let mut picture =
            Mat::new_rows_cols_with_default(height, width, core::CV_8UC3, Scalar::all(0.0)).unwrap();
        for (i, pixel) in picture.data_typed_mut::<core::Vec3b>().unwrap().iter_mut().enumerate() {
            *pixel = [(i * 7) as u8, (i / 5) as u8, (i * i / 11) as u8].into();
        }
        let mut bytes = Vector::new();
        imgcodecs::imencode(extension, &picture, &mut bytes, &Vector::new()).unwrap();
        bytes.to_vec()
    }

    fn read(bytes: &[u8]) -> Result<Mat, SourceError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image");
        fs::write(&path, bytes).unwrap();
        read_image(&path)
    }

    #[test]
    fn whole_images_are_read_in_their_size() {
        for extension in [".jpg", ".png"] {
            let image = read(&encoded(extension, 40, 30)).unwrap();
            assert_eq!((image.cols(), image.rows(), image.typ()), (40, 30, core::CV_8UC3));
        }
    }

    #[test]
    fn an_image_cut_short_anywhere_is_an_error() {
        for extension in [".jpg", ".png"] {
            let whole = encoded(extension, 40, 30);
            for length in 12..whole.len() {
                assert_eq!(inspect(&whole[..length]), Err(PictureError::Truncated), "{extension} {length}");
            }
            let half = read(&whole[..whole.len() / 2]);
            assert!(matches!(&half, Err(SourceError::Truncated(_))), "{extension}: {half:?}");
        }
    }

    #[test]
    fn bytes_behind_the_end_do_no_harm() {
        for extension in [".jpg", ".png"] {
            let mut bytes = encoded(extension, 40, 30);
            bytes.extend([0; 100]);
            assert!(read(&bytes).is_ok(), "{extension}");
        }
    }

    #[test]
    fn ten_megapixels_are_read() {
        let image = read(&encoded(".png", 3_872, 2_592)).unwrap();
        assert_eq!(image.cols() * image.rows(), 3_872 * 2_592);
    }

    #[test]
    fn a_bomb_is_refused_before_it_is_decoded() {
        let mut bomb = encoded(".png", 40, 30);
        bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        let error = read(&bomb).unwrap_err();
        assert!(error.to_string().contains("16384×16384"), "{error}");
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
    fn what_is_no_image_is_named_as_such() {
        let text = read(b"five fingers");
        assert!(matches!(&text, Err(SourceError::NotAnImage(path)) if path.ends_with("image")), "{text:?}");
        assert!(matches!(read(b""), Err(SourceError::Empty(_))));
        assert!(matches!(read_image(Path::new("/nowhere/x.jpg")), Err(SourceError::Missing(_))));
        assert!(matches!(read_image(Path::new("/")), Err(SourceError::Unreadable { .. })));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_panic(bytes: Vec<u8>, png: bool) {
            let magic: &[u8] = if png { b"\x89PNG\r\n\x1a\n" } else { b"\xff\xd8\xff" };
            let _ = inspect(&[magic, &bytes].concat());
        }
    }
}
