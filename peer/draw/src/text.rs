//! Lines of text: how wide they are, what of them fits, and how they are written into XML.

use std::sync::LazyLock;

use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

use crate::font::FONT;

/// The advance of each sign of the Basic Multilingual Plane up to here is looked up once, in thousandths of the letter height.
const KEPT: u32 = 0x600;

/// What stands for the rest of a text that is cut.
const CUT: char = '…';

/// The text as the content of an XML element or attribute. Control characters, which XML cannot hold in any notation,
/// become `�`.
///
/// ```
/// assert_eq!(gestalt_draw::escaped("<a & \"b\">\u{0}"), "&lt;a &amp; &quot;b&quot;&gt;\u{fffd}");
/// ```
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            sign if sign.is_control() => out.push('\u{fffd}'),
            sign => out.push(sign),
        }
    }
    out
}

/// How wide a text is in the embedded font, in pixels, at letters `size` pixels high. A sign that the font lacks counts
/// as a square.
#[must_use]
pub fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(advance).sum::<f64>() * size
}

/// The text if it is no wider than `width` pixels at letters `size` pixels high, else as much of its beginning as fits
/// with an ellipsis.
#[must_use]
pub fn fitting(text: &str, size: f64, width: f64) -> String {
    let room = width / size;
    let (mut used, mut kept) = (0.0, 0);
    for (at, sign) in text.char_indices() {
        used += advance(sign);
        if used > room {
            let beginning = text[..kept].trim_end();
            return format!("{beginning}{CUT}");
        }
        // As far as this an ellipsis would still fit.
        if used + advance(CUT) <= room {
            kept = at + sign.len_utf8();
        }
    }
    text.to_owned()
}

/// The width of a sign at letters of height 1.
fn advance(sign: char) -> f64 {
    static FEW: LazyLock<Vec<f64>> =
        LazyLock::new(|| (0..KEPT).map(|code| char::from_u32(code).map_or(0.0, looked_up)).collect());
    match FEW.get(sign as usize) {
        Some(advance) => *advance,
        None => looked_up(sign),
    }
}

fn looked_up(sign: char) -> f64 {
    let Ok(font) = FontRef::new(FONT) else { return 1.0 };
    let metrics = font.glyph_metrics(Size::new(1.0), LocationRef::default());
    let glyph = font.charmap().map(sign);
    glyph.and_then(|glyph| metrics.advance_width(glyph)).map_or(1.0, f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_as_wide_as_the_font_says() {
        // DejaVu Sans: 1,303 of 2,048 units for a digit, 569 for an i; CJK it has not.
        assert!((text_width("0", 2048.0) - 1303.0).abs() < 1.0);
        assert!((text_width("ii", 2048.0) - 2.0 * 569.0).abs() < 2.0);
        assert!((text_width("三", 10.0) - 10.0).abs() < 1e-9);
        assert_eq!(text_width("", 10.0), 0.0);
    }

    #[test]
    fn what_is_cut_fits_and_what_fits_is_not_cut() {
        for text in
            ["", "3", "✋ five", "a very long name of a gesture", "三三三三三三三三三三", "λλλλλλλλλλλλλλ"]
        {
            for width in [10.0, 40.0, 78.0, 1000.0] {
                let cut = fitting(text, 14.0, width);
                let fits = text_width(text, 14.0) <= width;
                assert_eq!(cut == text, fits, "{text} in {width}: {cut}");
                // Where not even an ellipsis fits, it stands alone.
                assert!(
                    text_width(&cut, 14.0) <= width.max(text_width("…", 14.0)),
                    "{text} in {width}: {cut}"
                );
            }
        }
        assert_eq!(fitting("one two", 10.0, text_width("one two", 10.0) - 1.0), "one t…");
    }
}
