//! Reads one image, and tells apart everything that may be wrong with its file.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use opencv::core::Mat;

use super::SourceError;
use super::container::{MOST_SCANS, PictureError, inspect};
use super::picture::decode;

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
        Err(PictureError::TooManyScans) => Err(SourceError::TooLarge {
            path: path.into(),
            size: format!("more than {MOST_SCANS} scans"),
            limit: "what any encoder writes".to_owned(),
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

/// Checks that a path is a readable file with something in it, and gives its size in bytes.
pub(super) fn check_file(path: &Path) -> Result<u64, SourceError> {
    let size = gestalt_file::open(path).and_then(|file| Ok(file.metadata()?.len()));
    match size.map_err(|cause| SourceError::io(path, cause))? {
        0 => Err(SourceError::Empty(path.into())),
        size => Ok(size),
    }
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

#[cfg(test)]
mod tests {
    use std::fs;

    use opencv::core;
    use opencv::prelude::*;

    use super::super::picture::tests::encoded;
    use super::*;

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
    fn an_image_cut_short_is_an_error() {
        for extension in [".jpg", ".png"] {
            let whole = encoded(extension, 40, 30);
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
    fn what_is_no_image_is_named_as_such() {
        let text = read(b"five fingers");
        assert!(matches!(&text, Err(SourceError::NotAnImage(path)) if path.ends_with("image")), "{text:?}");
        assert!(matches!(read(b""), Err(SourceError::Empty(_))));
        assert!(matches!(read_image(Path::new("/nowhere/x.jpg")), Err(SourceError::Missing(_))));
        assert!(matches!(read_image(Path::new("/")), Err(SourceError::Unreadable { .. })));
    }
}
