//! A vocabulary to show: each gesture as a camera in front of it sees it, with its name and its meaning.

use std::time::Duration;

use gestalt_draw::{Letters, Place, Sheet};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source, SourceError};
use gestalt_vision::vocabulary::GestureBook;
use opencv::core::Mat;

use super::PictureError;
use super::frame::embed;
use super::tone::{BACKGROUND, CARD, MUTED, TEXT};

const MARGIN: f64 = 20.0;
const HEAD: f64 = 64.0;
const CARD_WIDTH: f64 = 400.0;
const VIEW_HEIGHT: f64 = 300.0;
const WORDS_HEIGHT: f64 = 150.0;
const COLUMNS: usize = 4;
/// Who shows it, in which light: a person whose hand is turned little by nature.
const PERSON: u64 = 5;

/// The gestures of a vocabulary, drawn.
///
/// # Errors
/// [`SourceError`].
pub fn hands(book: &GestureBook) -> Result<Vec<Mat>, SourceError> {
    let camera = CameraModel { noise_sigma: 0.0, gain: 1.3, cast_bgr: [1.0; 3], ..CameraModel::laptop() };
    let pose = Pose { distance_m: 0.5, ..Pose::FRONTAL };
    let source = RenderedSource::new(camera, pose, Glove::default(), PERSON)?;
    let mut source = source.showing(book.poses().into());
    let mut show = |gesture| {
        let scene = Scene { gesture: Some(gesture), seed: PERSON };
        source.next_frame(Duration::ZERO, &scene).map(|frame| frame.image)
    };
    (0..).take(book.gestures.len()).map(&mut show).collect()
}

/// Draws it as SVG; `hands` are those of [`hands`].
///
/// # Errors
/// [`PictureError::OpenCv`].
pub fn draw(book: &GestureBook, hands: &[Mat]) -> Result<String, PictureError> {
    let columns = hands.len().clamp(1, COLUMNS);
    let rows = hands.len().div_ceil(columns);
    let width = MARGIN + columns as f64 * (CARD_WIDTH + MARGIN);
    let card_height = VIEW_HEIGHT + WORDS_HEIGHT;
    let mut sheet = Sheet::new(width, HEAD + rows as f64 * (card_height + MARGIN), BACKGROUND);
    sheet.write(&book.title, (MARGIN, 42.0), Letters::new(26.0, TEXT), width - 2.0 * MARGIN);
    for (n, (gesture, hand)) in book.gestures.iter().zip(hands).enumerate() {
        let x = MARGIN + (n % columns) as f64 * (CARD_WIDTH + MARGIN);
        let y = HEAD + (n / columns) as f64 * (card_height + MARGIN);
        sheet.fill(Place::new(x, y, CARD_WIDTH, card_height), CARD);
        embed(&mut sheet, hand, Place::new(x, y, CARD_WIDTH, VIEW_HEIGHT))?;
        let room = CARD_WIDTH - 28.0;
        let mut base = y + VIEW_HEIGHT + 32.0;
        sheet.write(&gesture.name, (x + 14.0, base), Letters::new(24.0, TEXT), room);
        for (words, tone) in [(&gesture.meaning, TEXT), (&gesture.show, MUTED)] {
            for line in lines(words, 15.0, room) {
                base += 24.0;
                sheet.write(&line, (x + 14.0, base), Letters::new(15.0, tone), room);
            }
        }
    }
    Ok(sheet.svg())
}

/// Words in at most two lines.
fn lines(words: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split_whitespace() {
        let last = lines.last().map(|line| format!("{line} {word}"));
        match last {
            // What is too long for two lines is cut by who writes it.
            Some(longer) if lines.len() == 2 || gestalt_draw::text_width(&longer, size) <= width => {
                *lines.last_mut().expect("there is a last one") = longer;
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use opencv::core::Vec3b;
    use opencv::prelude::*;

    use super::*;

    /// Where a picture shows the glove.
    fn glove(picture: &Mat) -> Vec<bool> {
        let is = |pixel: &Vec3b| i32::from(pixel[0].min(pixel[1])) - i32::from(pixel[2]) > 40;
        picture.data_typed::<Vec3b>().unwrap().iter().map(is).collect()
    }

    #[test]
    fn each_gesture_of_a_ready_vocabulary_has_an_outline_of_its_own() {
        for name in GestureBook::names() {
            let book = GestureBook::find(name).unwrap();
            let outlines: Vec<_> = hands(&book).unwrap().iter().map(glove).collect();
            for (n, outline) in outlines.iter().enumerate() {
                let area = outline.iter().filter(|on| **on).count();
                assert!(area > 3000, "{name}: {} is {area} pixels of a hand", book.gestures[n].name);
                for (m, other) in outlines[..n].iter().enumerate() {
                    let both = outline.iter().zip(other).filter(|(a, b)| **a && **b).count();
                    let either = outline.iter().zip(other).filter(|(a, b)| **a || **b).count();
                    let alike = both as f64 / either as f64;
                    let names = (&book.gestures[n].name, &book.gestures[m].name);
                    assert!(alike < 0.85, "{names:?} cover the same pixels: {alike:.2}");
                }
            }
        }
    }

    #[test]
    fn a_picture_has_every_name_and_meaning() {
        let book = GestureBook::find("rescue").unwrap();
        let svg = draw(&book, &hands(&book).unwrap()).unwrap();
        for gesture in &book.gestures {
            assert!(svg.contains(&format!(">{}<", gesture.name)), "{}", gesture.name);
            let begins: String = gesture.meaning.chars().take(20).collect();
            assert!(svg.contains(begins.trim_end()), "{begins}");
        }
        assert_eq!(lines("a b", 15.0, 400.0), ["a b"]);
        assert_eq!(lines(&"word ".repeat(60), 15.0, 400.0).len(), 2);
    }
}
