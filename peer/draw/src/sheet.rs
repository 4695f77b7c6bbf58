//! A drawing made of areas, pictures and lines of text.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::font::FAMILY;
use crate::text::{escaped, fitting};

/// A colour as `0xRRGGBB`.
pub type Tone = u32;

/// A rectangle in pixels from the drawing's upper left corner; without width or height it is not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The left edge.
    pub x: f64,
    /// The upper edge.
    pub y: f64,
    /// Its width.
    pub width: f64,
    /// Its height.
    pub height: f64,
}

impl Place {
    /// A rectangle by its upper left corner and its size.
    #[must_use]
    pub fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self { x, y, width, height }
    }

    /// The largest place of these proportions (width by height) in the middle of this one.
    #[must_use]
    pub fn holding(self, width: f64, height: f64) -> Self {
        let scale = (self.width / width.max(1.0)).min(self.height / height.max(1.0));
        let (width, height) = (width * scale, height * scale);
        Self::new(self.x + (self.width - width) / 2.0, self.y + (self.height - height) / 2.0, width, height)
    }

    fn is_drawn(self) -> bool {
        self.width > 0.0 && self.height > 0.0
    }
}

/// Where a line of text stands over the point it is written at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    #[default]
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// How a line of text looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letters {
    /// Their height in pixels.
    pub size: f64,
    /// Their colour.
    pub tone: Tone,
    /// Where the line stands.
    pub anchor: Anchor,
}

impl Letters {
    /// A line that begins where it is written.
    #[must_use]
    pub fn new(size: f64, tone: Tone) -> Self {
        Self { size, tone, anchor: Anchor::Start }
    }

    /// The same letters at another anchor.
    #[must_use]
    pub fn anchored(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }
}

/// A drawing in the making.
#[derive(Clone, Debug)]
pub struct Sheet {
    size: (f64, f64),
    body: String,
}

// Writing to a string cannot fail: the results of `write!` are dropped below.
impl Sheet {
    /// An empty drawing of that size in pixels.
    #[must_use]
    pub fn new(width: f64, height: f64, background: Tone) -> Self {
        let mut sheet = Self { size: (width, height), body: String::new() };
        sheet.fill(Place::new(0.0, 0.0, width, height), background);
        sheet
    }

    /// Fills a place.
    pub fn fill(&mut self, place: Place, tone: Tone) {
        if place.is_drawn() {
            let Place { x, y, width, height } = place;
            let _ = writeln!(
                self.body,
                r##"<rect x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}" fill="#{tone:06x}"/>"##
            );
        }
    }

    /// Draws the outline of a place, `pen` pixels thick.
    pub fn outline(&mut self, place: Place, tone: Tone, pen: f64) {
        if place.is_drawn() {
            let Place { x, y, width, height } = place;
            let _ = writeln!(
                self.body,
                r##"<rect x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}" fill="none" stroke="#{tone:06x}" stroke-width="{pen:.2}"/>"##
            );
        }
    }

    /// Draws a line through all points and back to the first, `pen` pixels thick.
    pub fn contour(&mut self, points: impl IntoIterator<Item = (f64, f64)>, tone: Tone, pen: f64) {
        let mut path = String::new();
        for (x, y) in points {
            let _ = write!(path, "{x:.1},{y:.1} ");
        }
        if !path.is_empty() {
            let _ = writeln!(
                self.body,
                r##"<polygon points="{}" fill="none" stroke="#{tone:06x}" stroke-width="{pen:.2}"/>"##,
                path.trim_end()
            );
        }
    }

    /// Puts a picture (the bytes of a PNG file) into a place, which it fills.
    pub fn picture(&mut self, png: &[u8], place: Place) {
        if place.is_drawn() {
            let Place { x, y, width, height } = place;
            let _ = writeln!(
                self.body,
                r#"<image x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}" preserveAspectRatio="none" href="data:image/png;base64,{}"/>"#,
                STANDARD.encode(png)
            );
        }
    }

    /// Writes a line of text with its baseline at `(x, y)`, cut to `width` pixels.
    pub fn write(&mut self, text: &str, (x, y): (f64, f64), letters: Letters, width: f64) {
        let Letters { size, tone, anchor } = letters;
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escaped(&fitting(text, size, width));
        let _ = writeln!(
            self.body,
            r##"<text x="{x:.2}" y="{y:.2}" font-size="{size:.1}" fill="#{tone:06x}" text-anchor="{anchor}">{text}</text>"##
        );
    }

    /// The drawing as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let ((width, height), body) = (self.size, &self.body);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"'{FAMILY}', sans-serif\">\n{body}</svg>\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use resvg::tiny_skia::Pixmap;

    use super::*;
    use crate::png::png;

    fn pixels(sheet: &Sheet) -> Pixmap {
        Pixmap::decode_png(&png(&sheet.svg()).unwrap()).unwrap()
    }

    fn tone(picture: &Pixmap, x: u32, y: u32) -> Tone {
        let pixel = picture.pixel(x, y).unwrap();
        u32::from_be_bytes([0, pixel.red(), pixel.green(), pixel.blue()])
    }

    #[test]
    fn areas_and_pictures_are_where_they_were_put() {
        let mut inner = Sheet::new(2.0, 2.0, 0x00ff00);
        inner.fill(Place::new(0.0, 0.0, 0.0, 2.0), 0xff0000);
        let mut sheet = Sheet::new(20.0, 10.0, 0x112233);
        sheet.fill(Place::new(0.0, 0.0, 5.0, 5.0), 0xff0000);
        sheet.picture(&png(&inner.svg()).unwrap(), Place::new(10.0, 0.0, 10.0, 10.0));
        sheet.contour([(6.5, 1.5), (9.5, 1.5), (9.5, 4.5), (6.5, 4.5)], 0x0000ff, 1.0);
        sheet.contour([], 0x0000ff, 1.0);
        let picture = pixels(&sheet);
        assert_eq!(tone(&picture, 7, 2), 0x112233, "a contour is not filled");
        assert_eq!(
            picture.pixels().iter().filter(|pixel| pixel.blue() > 200).count(),
            12,
            "its line is drawn"
        );
        assert_eq!((picture.width(), picture.height()), (20, 10));
        assert_eq!(
            [tone(&picture, 2, 2), tone(&picture, 7, 7), tone(&picture, 15, 5)],
            [0xff0000, 0x112233, 0x00ff00]
        );
    }

    #[test]
    fn text_of_any_kind_leaves_valid_svg_with_the_text_in_it() {
        let mut sheet = Sheet::new(400.0, 100.0, 0xffffff);
        let labels = ["三", "λ", "✋ five", "<b>&\"'", "nul\u{0}", "\u{ffff}", "שלום", ""];
        for (n, label) in labels.iter().enumerate() {
            sheet.write(label, (10.0, 12.0 * n as f64), Letters::new(10.0, 0), 300.0);
        }
        let svg = sheet.svg();
        for text in ["三", "λ", "✋ five", "&lt;b&gt;&amp;", "nul\u{fffd}", "שלום"] {
            assert!(svg.contains(text), "{text} is missing in {svg}");
        }
        assert!(png(&svg).is_ok());
    }

    #[test]
    fn a_picture_keeps_its_proportions_in_the_middle() {
        let place = Place::new(100.0, 0.0, 400.0, 300.0);
        assert_eq!(place.holding(640.0, 360.0), Place::new(100.0, 37.5, 400.0, 225.0));
        assert_eq!(place.holding(1.0, 3.0), Place::new(250.0, 0.0, 100.0, 300.0));
    }
}
