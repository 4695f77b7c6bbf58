//! An SVG drawing as a picture of pixels, so that one chart becomes both.
//!
//! It reads what plotters' SVG backend writes, which is little: rectangles, lines, polylines, polygons, circles and
//! lines of text, each with one colour and one opacity. Anything else is an error, not a gap in the picture.

use std::collections::BTreeMap;

use opencv::core::{self, Mat, Point, Rect, Scalar, Size, Vector};
use opencv::imgproc;
use opencv::prelude::*;
use thiserror::Error;

/// Pixels for each unit of the drawing: fine enough for print.
pub const SCALE: i32 = 2;

const FONT: i32 = imgproc::FONT_HERSHEY_SIMPLEX;

/// OpenCV's font at scale 1 is about as large as others are at this size.
const FONT_UNIT: f64 = 31.0;

/// A drawing that cannot be made a picture.
#[derive(Debug, Error)]
pub enum RasterError {
    /// Something that plotters does not write.
    #[error("<{tag}>: no {attribute} that is understood")]
    Svg {
        /// In which element.
        tag: String,
        /// What is missing or not understood.
        attribute: &'static str,
    },
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// The picture of a drawing, 8-bit BGR, on white.
///
/// # Errors
/// See [`RasterError`].
pub fn rasterise(svg: &str) -> Result<Mat, RasterError> {
    let mut picture = Mat::default();
    for element in svg.split('<').skip(1) {
        let Some((tag, text)) = element.split_once('>') else { continue };
        if tag.starts_with(['/', '!', '?']) {
            continue;
        }
        let element = Element::read(tag);
        match element.tag {
            "svg" => {
                let size = (element.number("height")?, element.number("width")?);
                picture = Mat::new_rows_cols_with_default(size.0, size.1, core::CV_8UC3, Scalar::all(255.0))?;
            }
            _ => element.draw(&mut picture, text)?,
        }
    }
    Ok(picture)
}

struct Element<'a> {
    tag: &'a str,
    attributes: BTreeMap<&'a str, &'a str>,
}

impl<'a> Element<'a> {
    fn read(tag: &'a str) -> Self {
        let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
        let mut attributes = BTreeMap::new();
        while let Some((key, value)) = rest.split_once("=\"") {
            let (value, after) = value.split_once('"').unwrap_or((value, ""));
            attributes.insert(key.trim(), value);
            rest = after;
        }
        Self { tag: name, attributes }
    }

    fn draw(&self, picture: &mut Mat, text: &str) -> Result<(), RasterError> {
        let filled = self.attributes.get("fill").is_some_and(|fill| *fill != "none");
        let ink = self.colour(if filled { "fill" } else { "stroke" })?;
        let pen = self.attributes.get("stroke-width").map_or(Ok(1), |_| self.number("stroke-width"))?;
        let thickness = if filled { imgproc::FILLED } else { pen.max(1) };
        let smooth = imgproc::LINE_AA;
        let opacity = self.real("opacity")?;
        let before = if opacity < 1.0 { Some(picture.clone()) } else { None };
        match self.tag {
            "rect" => {
                let corner = self.point("x", "y")?;
                let size = Size::new(self.number("width")?, self.number("height")?);
                let rect = Rect::from_point_size(corner, size);
                imgproc::rectangle(picture, rect, ink, thickness, imgproc::LINE_8, 0)?;
            }
            "line" => {
                let (from, to) = (self.point("x1", "y1")?, self.point("x2", "y2")?);
                imgproc::line(picture, from, to, ink, pen.max(1), smooth, 0)?;
            }
            "polyline" => imgproc::polylines(picture, &self.points()?, false, ink, pen.max(1), smooth, 0)?,
            "polygon" => imgproc::fill_poly(picture, &self.points()?, ink, smooth, 0, Point::default())?,
            "circle" => {
                let centre = self.point("cx", "cy")?;
                imgproc::circle(picture, centre, self.number("r")?, ink, thickness, smooth, 0)?;
            }
            "text" => self.write(picture, text.trim(), ink)?,
            _ => return Err(self.odd("tag")),
        }
        if let Some(before) = before {
            let opaque = picture.clone();
            core::add_weighted(&opaque, opacity, &before, 1.0 - opacity, 0.0, picture, -1)?;
        }
        Ok(())
    }

    fn write(&self, picture: &mut Mat, text: &str, ink: Scalar) -> Result<(), RasterError> {
        // What the font has is ASCII.
        let text = text.replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">");
        let text: String = text.chars().map(|c| if c.is_ascii() { c } else { '-' }).collect();
        let size = self.real("font-size")?;
        let (scale, pen) = (size * f64::from(SCALE) / FONT_UNIT, if size > 14.0 { 2 } else { 1 });
        let mut below = 0;
        let extent = imgproc::get_text_size(&text, FONT, scale, pen, &mut below)?;
        let left = match self.text("text-anchor")? {
            "start" => 0,
            "middle" => -extent.width / 2,
            "end" => -extent.width,
            _ => return Err(self.odd("text-anchor")),
        };
        let baseline = match self.text("dy")? {
            "0.76em" => extent.height,
            "0.5ex" => extent.height / 2,
            "-0.5ex" => -below / 2,
            _ => return Err(self.odd("dy")),
        };
        let anchor = self.point("x", "y")?;
        let put = |on: &mut Mat, at: Point| {
            imgproc::put_text(on, &text, at, FONT, scale, ink, pen, imgproc::LINE_AA, false)
        };
        match self.attributes.get("transform") {
            None => put(picture, anchor + Point::new(left, baseline))?,
            // Upwards: a quarter turn against the clock about the anchor.
            Some(turn) if turn.starts_with("rotate(270") => {
                let (rows, columns) = (extent.height + below + 2, extent.width + 2);
                let mut flat =
                    Mat::new_rows_cols_with_default(rows, columns, core::CV_8UC3, Scalar::all(255.0))?;
                put(&mut flat, Point::new(0, extent.height))?;
                let mut upright = Mat::default();
                core::rotate(&flat, &mut upright, core::ROTATE_90_COUNTERCLOCKWISE)?;
                let corner = Point::new(anchor.x + baseline - extent.height, anchor.y - left - columns);
                let place = Rect::from_point_size(corner, upright.size()?);
                if place & Rect::new(0, 0, picture.cols(), picture.rows()) != place {
                    return Err(self.odd("room in the picture"));
                }
                upright.copy_to(&mut Mat::roi_mut(picture, place)?)?;
            }
            Some(_) => return Err(self.odd("transform")),
        }
        Ok(())
    }

    fn odd(&self, attribute: &'static str) -> RasterError {
        RasterError::Svg { tag: self.tag.chars().take(20).collect(), attribute }
    }

    fn text(&self, key: &'static str) -> Result<&'a str, RasterError> {
        self.attributes.get(key).copied().ok_or_else(|| self.odd(key))
    }

    fn real(&self, key: &'static str) -> Result<f64, RasterError> {
        let value = self.text(key)?.parse::<f64>().ok().filter(|value| value.abs() < 10_000.0);
        value.ok_or_else(|| self.odd(key))
    }

    /// A length in pixels.
    fn number(&self, key: &'static str) -> Result<i32, RasterError> {
        Ok((self.real(key)? * f64::from(SCALE)).round() as i32)
    }

    fn point(&self, x: &'static str, y: &'static str) -> Result<Point, RasterError> {
        Ok(Point::new(self.number(x)?, self.number(y)?))
    }

    fn points(&self) -> Result<Vector<Point>, RasterError> {
        let pairs = self.text("points")?.split_whitespace().map(|pair| {
            let (x, y) = pair.split_once(',')?;
            let pixels = |text: &str| {
                let value = text.parse::<f64>().ok().filter(|value| value.abs() < 10_000.0)?;
                Some((value * f64::from(SCALE)).round() as i32)
            };
            Some(Point::new(pixels(x)?, pixels(y)?))
        });
        pairs.collect::<Option<Vec<_>>>().map(Vector::from_iter).ok_or_else(|| self.odd("points"))
    }

    /// `#RRGGBB` as OpenCV orders it.
    fn colour(&self, key: &'static str) -> Result<Scalar, RasterError> {
        let hex = self.text(key)?.strip_prefix('#').filter(|hex| hex.len() == 6);
        let rgb = hex.and_then(|hex| u32::from_str_radix(hex, 16).ok()).ok_or_else(|| self.odd(key))?;
        let part = |shift: u32| f64::from(rgb >> shift & 0xff);
        Ok(Scalar::new(part(0), part(8), part(16), 0.0))
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::Vec3b;
    use plotters::prelude::*;
    use plotters::style::FontTransform;
    use plotters::style::text_anchor::{HPos, Pos, VPos};

    use super::*;

    fn drawn(draw: impl FnOnce(&DrawingArea<SVGBackend<'_>, plotters::coord::Shift>)) -> Mat {
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, (200, 200)).into_drawing_area();
        draw(&area);
        drop(area);
        rasterise(&svg).unwrap()
    }

    fn colour(picture: &Mat, x: i32, y: i32) -> [u8; 3] {
        picture.at_2d::<Vec3b>(y * SCALE, x * SCALE).unwrap().0
    }

    #[test]
    fn what_is_drawn_has_its_colour_and_place() {
        let picture = drawn(|area| {
            area.draw(&Rectangle::new([(10, 10), (20, 20)], RGBColor(200, 100, 0).filled())).unwrap();
            area.draw(&Polygon::new(vec![(40, 10), (60, 10), (60, 30), (40, 30)], BLUE.mix(0.5))).unwrap();
            area.draw(&PathElement::new(vec![(0, 50), (99, 50)], RED.stroke_width(3))).unwrap();
            area.draw(&Circle::new((150, 150), 10, GREEN.filled())).unwrap();
        });
        assert_eq!((picture.cols(), picture.rows()), (400, 400));
        assert_eq!(colour(&picture, 15, 15), [0, 100, 200], "blue, green, red");
        assert_eq!(colour(&picture, 70, 20), [255; 3]);
        let [blue, green, red] = colour(&picture, 50, 20);
        assert!(blue == 255 && green == red && (126..=129).contains(&green), "half of it shines through");
        assert_eq!(colour(&picture, 50, 50), [0, 0, 255]);
        assert_eq!(colour(&picture, 156, 154), [0, 255, 0]);
    }

    #[test]
    fn text_stands_where_it_is_anchored_also_upright() {
        let ink = |transform: FontTransform| {
            let picture = drawn(|area| {
                let style = ("sans-serif", 20).into_font().transform(transform).color(&BLACK);
                let style = style.pos(Pos::new(HPos::Left, VPos::Bottom));
                area.draw_text("accuracy", &style, (100, 100)).unwrap();
            });
            let (mut grey, mut dark) = (Mat::default(), Mat::default());
            imgproc::cvt_color_def(&picture, &mut grey, imgproc::COLOR_BGR2GRAY).unwrap();
            imgproc::threshold(&grey, &mut dark, 128.0, 255.0, imgproc::THRESH_BINARY_INV).unwrap();
            let bounds = imgproc::bounding_rect(&dark).unwrap();
            (bounds.x / SCALE, bounds.y / SCALE, bounds.width / SCALE, bounds.height / SCALE)
        };
        let (x, y, width, height) = ink(FontTransform::None);
        assert!((98..105).contains(&x) && (95..=104).contains(&(y + height)) && width > 3 * height);
        let (x, y, width, height) = ink(FontTransform::Rotate270);
        assert!(
            (95..=102).contains(&(y + height)) && (95..=104).contains(&(x + width)) && height > 3 * width
        );
    }

    #[test]
    fn what_is_not_understood_is_said() {
        let svg = "<svg width=\"9\" height=\"9\">\n<ellipse fill=\"#000000\" opacity=\"1\"/></svg>";
        assert!(rasterise(svg).is_err());
        assert!(rasterise(&svg.replace("ellipse", "circle")).unwrap_err().to_string().contains("cx"));
    }
}
