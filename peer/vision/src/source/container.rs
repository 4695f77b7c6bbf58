//! What a JPEG or PNG file claims to hold, before anything of it is decoded.
//!
//! Decoders give a JPEG that was cut short as a partly grey image, with a word at most, and decode any size. So the
//! container is checked first: what it is, how large, and whether its end is there.

use opencv::core::Size;
use thiserror::Error;

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
    /// A progressive JPEG of more scans than allowed; it was not decoded. Each goes through all of the picture, and may be a few bytes.
    #[error("a JPEG of more than {MOST_SCANS} scans: write it anew, `jpegtran` does")]
    TooManyScans,
}

/// The most scans of a JPEG that is decoded: encoders write about ten.
pub(super) const MOST_SCANS: usize = 100;

/// A whole file's claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Claim {
    pub width: u32,
    pub height: u32,
    /// A JPEG of one or three channels that is not to be turned.
    pub plain_jpeg: bool,
}

impl Claim {
    /// `None` when it is larger than any image in memory.
    pub fn size(&self) -> Option<Size> {
        Some(Size::new(i32::try_from(self.width).ok()?, i32::try_from(self.height).ok()?))
    }
}

/// What a whole JPEG or PNG file claims.
pub(super) fn inspect(bytes: &[u8]) -> Result<Claim, PictureError> {
    if let Some(rest) = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n") {
        inspect_png(rest)
    } else if let Some(rest) = bytes.strip_prefix(b"\xff\xd8\xff") {
        // The third byte belongs to the first marker.
        inspect_jpeg(&bytes[bytes.len() - rest.len() - 1..])
    } else {
        Err(PictureError::NotAnImage)
    }
}

/// Walks the chunks (length, type, data, checksum) up to the end chunk. The first tells the size: a decoder passes over others before it that it does not know.
fn inspect_png(mut rest: &[u8]) -> Result<Claim, PictureError> {
    const HEADER: &[u8] = b"\0\0\0\x0dIHDR";
    if rest.iter().zip(HEADER).any(|(found, meant)| found != meant) {
        return Err(PictureError::NotAnImage);
    }
    let fields = rest.get(8..16).ok_or(PictureError::Truncated)?;
    let (width, height) = (big_endian(&fields[..4]), big_endian(&fields[4..]));
    loop {
        let (Some(length), Some(kind)) = (rest.get(..4), rest.get(4..8)) else {
            return Err(PictureError::Truncated);
        };
        let end = (big_endian(length) as usize).saturating_add(12);
        if rest.len() < end {
            return Err(PictureError::Truncated);
        }
        if kind == b"IEND" {
            return Ok(Claim { width, height, plain_jpeg: false });
        }
        rest = &rest[end..];
    }
}

/// Walks the marker segments, and through the scans between them, up to the end-of-image marker (ITU-T T.81, B.1).
///
/// What decoders may read otherwise is no image: a second frame, of which some take the first, or a marker without a segment where there is none to be, behind
/// which another size could hide.
fn inspect_jpeg(mut rest: &[u8]) -> Result<Claim, PictureError> {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: u8 = 0xd9;
    const APPLICATION_1: u8 = 0xe1;
    let (mut claim, mut may_be_turned, mut scans) = (None, false, 0);
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
            let claim: Claim = claim.ok_or(PictureError::NotAnImage)?;
            return Ok(Claim { plain_jpeg: claim.plain_jpeg && !may_be_turned, ..claim });
        }
        if matches!(marker, 0x00 | 0x01 | 0xd0..=0xd8) || (marker == START_OF_SCAN && claim.is_none()) {
            return Err(PictureError::NotAnImage);
        }
        let Some(length) = rest.get(..2) else { return Err(PictureError::Truncated) };
        let length = big_endian(length) as usize;
        let Some(segment) = rest.get(..length) else { return Err(PictureError::Truncated) };
        may_be_turned |= marker == APPLICATION_1;
        // Start of frame, of any coding: C0 to CF but for tables (C4, C8, CC).
        if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
            let fields = segment.get(3..8).ok_or(PictureError::NotAnImage)?;
            let (height, width) = (big_endian(&fields[..2]), big_endian(&fields[2..4]));
            if claim.is_some() {
                return Err(PictureError::NotAnImage);
            }
            claim = Some(Claim { width, height, plain_jpeg: matches!(fields[4], 1 | 3) });
        }
        rest = &rest[length..];
        if marker == START_OF_SCAN {
            scans += 1;
            if scans > MOST_SCANS {
                return Err(PictureError::TooManyScans);
            }
            rest = &rest[end_of_scan(rest).ok_or(PictureError::Truncated)?..];
        }
    }
}

/// Where coded data ends: in it, 0xff is followed by a zero (stuffing) or a restart marker.
fn end_of_scan(coded: &[u8]) -> Option<usize> {
    memchr::memchr_iter(0xff, coded).find(|&at| !matches!(coded.get(at + 1), None | Some(0x00 | 0xd0..=0xd7)))
}

fn big_endian(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |value, byte| value << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, Mat, Scalar, Vector};
    use opencv::imgcodecs::imencode_def;

    use super::*;

    fn encoded(extension: &str, width: i32, height: i32) -> Vec<u8> {
        let picture = Mat::new_rows_cols_with_default(height, width, CV_8UC3, Scalar::all(90.0)).unwrap();
        let mut bytes = Vector::new();
        imencode_def(extension, &picture, &mut bytes).unwrap();
        bytes.iter().collect()
    }

    #[test]
    fn a_file_cut_short_anywhere_is_truncated() {
        for extension in [".jpg", ".png"] {
            let whole = encoded(extension, 40, 30);
            let claim = Claim { width: 40, height: 30, plain_jpeg: extension == ".jpg" };
            assert_eq!(inspect(&whole), Ok(claim));
            for length in 12..whole.len() {
                assert_eq!(inspect(&whole[..length]), Err(PictureError::Truncated), "{extension} {length}");
            }
        }
    }

    #[test]
    fn what_may_have_to_be_turned_is_not_plain() {
        let mut jpeg = encoded(".jpg", 40, 30);
        jpeg.splice(2..2, *b"\xff\xe1\x00\x08Exif\0\0");
        assert_eq!(inspect(&jpeg), Ok(Claim { width: 40, height: 30, plain_jpeg: false }));
    }

    #[test]
    fn scans_are_counted_before_each_costs_a_pass() {
        use opencv::imgcodecs::{IMWRITE_JPEG_PROGRESSIVE, imencode};
        let picture = Mat::new_rows_cols_with_default(30, 40, CV_8UC3, Scalar::all(90.0)).unwrap();
        let mut bytes = Vector::new();
        imencode(".jpg", &picture, &mut bytes, &vec![IMWRITE_JPEG_PROGRESSIVE, 1].into()).unwrap();
        let mut progressive: Vec<u8> = bytes.iter().collect();
        assert!(inspect(&progressive).is_ok());
        let last = progressive.windows(2).rposition(|marker| marker == [0xff, 0xda]).unwrap();
        let scan = progressive[last..progressive.len() - 2].to_vec();
        progressive.splice(last..last, scan.repeat(MOST_SCANS));
        assert_eq!(inspect(&progressive), Err(PictureError::TooManyScans));
    }

    /// Decoders read the first size of a JPEG, pass over markers that have no segment, and over chunks of a PNG that they do not know.
    #[test]
    fn no_size_hides_behind_another() {
        let jpeg = encoded(".jpg", 40, 30);
        let frame = jpeg.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
        let small = jpeg[frame..frame + 19].to_vec();
        let mut large = small.clone();
        large[5..9].fill(0x7f);
        let put = |bytes: &[u8], at: usize| {
            let mut jpeg = jpeg.clone();
            jpeg.splice(at..at, bytes.iter().copied());
            inspect(&jpeg)
        };
        assert_eq!(put(&large, frame), Err(PictureError::NotAnImage));
        assert_eq!(put(&small, jpeg.len() - 2), Err(PictureError::NotAnImage));
        for marker in [0x00, 0x01, 0xd0, 0xd7, 0xd8] {
            // Taken for a segment, it would reach to behind the frame that it hides.
            let hiding = [&[0xff, marker], &large[..]].concat();
            assert_eq!(put(&hiding, frame), Err(PictureError::NotAnImage), "{marker:x}");
        }
        let mut png = encoded(".png", 40, 30);
        png.splice(8..8, *b"\0\0\0\x08teSt\0\0\0\x01\0\0\0\x01sum.");
        assert_eq!(inspect(&png), Err(PictureError::NotAnImage));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_panic(bytes: Vec<u8>, png: bool) {
            let magic: &[u8] = if png { b"\x89PNG\r\n\x1a\n" } else { b"\xff\xd8\xff" };
            let _ = inspect(&[magic, &bytes].concat());
        }
    }
}
