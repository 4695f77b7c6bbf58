//! SVG as PNG.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

use crate::error::DrawError;
use crate::font;

/// No picture is wider or higher, in pixels.
const MAX_SIDE: u32 = 16_384;

/// Renders an SVG drawing at its own size, on the background it brings, as the bytes of a PNG file.
///
/// Text is set in the embedded font, whatever family it asks for; a sign that it lacks, in the first of the system's
/// fonts that has it. One that no font has becomes a box: in a drawing that is left as SVG it is shown by whoever has one.
///
/// # Errors
/// [`DrawError::Svg`] for text that is no SVG, or larger than 16,384 pixels.
pub fn png(svg: &str) -> Result<Vec<u8>, DrawError> {
    render(svg)?.encode_png().map_err(|error| DrawError::Svg(error.to_string()))
}

/// The same as pixels, for who makes another file of them: width, height, and blue, green and red of each, row by row.
///
/// # Errors
/// As [`png()`].
pub fn bgr(svg: &str) -> Result<(u32, u32, Vec<u8>), DrawError> {
    let pixels = render(svg)?;
    let colours = pixels.pixels().iter().flat_map(|pixel| {
        let colour = pixel.demultiply();
        [colour.blue(), colour.green(), colour.red()]
    });
    Ok((pixels.width(), pixels.height(), colours.collect()))
}

fn render(svg: &str) -> Result<Pixmap, DrawError> {
    let options = Options {
        fontdb: font::embedded(),
        font_family: font::FAMILY.to_owned(),
        font_resolver: font::resolver(),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options).map_err(|error| DrawError::Svg(error.to_string()))?;
    let size = tree.size().to_int_size();
    if size.width().max(size.height()) > MAX_SIDE {
        let (width, height) = (size.width(), size.height());
        return Err(DrawError::Svg(format!("{width}×{height} pixels are more than {MAX_SIDE} a side")));
    }
    let mut pixels = Pixmap::new(size.width(), size.height())
        .ok_or_else(|| DrawError::Svg("a drawing without a size".to_owned()))?;
    resvg::render(&tree, Transform::default(), &mut pixels.as_mut());
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(svg: &str) -> Pixmap {
        Pixmap::decode_png(&png(svg).unwrap()).unwrap()
    }

    fn with_text(text: &str) -> Pixmap {
        pixels(&format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='60' height='30'><rect width='60' height='30' fill='white'/>\
             <text x='10' y='20' font-family='sans-serif' font-size='16'>{text}</text></svg>"
        ))
    }

    fn ink(picture: &Pixmap) -> u32 {
        picture.pixels().iter().map(|pixel| u32::from(255 - pixel.green())).sum()
    }

    #[test]
    fn letters_of_many_scripts_are_drawn_and_differ() {
        let pictures = ["3", "±", "ж", "λ", "א", "ب", "é"].map(with_text);
        for (i, picture) in pictures.iter().enumerate() {
            assert!(ink(picture) > 500, "sign {i} leaves no ink");
            assert!(
                pictures[..i].iter().all(|other| other.data() != picture.data()),
                "sign {i} looks like another"
            );
        }
        assert_eq!(ink(&with_text("")), 0);
    }

    #[test]
    fn an_embedded_picture_keeps_its_colours() {
        let red = pixels(
            "<svg xmlns='http://www.w3.org/2000/svg' width='4' height='4'><rect width='4' height='4' fill='#f00'/></svg>",
        );
        let first = red.pixels()[0];
        assert_eq!((first.red(), first.green(), first.blue(), first.alpha()), (255, 0, 0, 255));
    }

    #[test]
    fn pixels_are_blue_green_red_row_by_row() {
        let drawing = "<svg xmlns='http://www.w3.org/2000/svg' width='1' height='2'><rect width='1' height='1' fill='#123456'/>\
                       <rect y='1' width='1' height='1' fill='#fff'/></svg>";
        assert_eq!(bgr(drawing).unwrap(), (1, 2, vec![0x56, 0x34, 0x12, 255, 255, 255]));
    }

    #[test]
    fn what_is_no_drawing_is_refused_with_its_cause() {
        for svg in ["", "<svg", "no", "<svg xmlns='http://www.w3.org/2000/svg' width='1e9' height='1'/>"] {
            assert!(matches!(png(svg), Err(DrawError::Svg(cause)) if !cause.is_empty()), "{svg}");
        }
    }
}
