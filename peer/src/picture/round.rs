//! A round: what every robot saw, what it made of it, and what the swarm decided.

use gestalt_draw::{Anchor, Letters, Place, Sheet, Tone};
use opencv::core::Mat;

use super::PictureError;
use super::frame::embed;
use super::tone::{AGREES, BACKGROUND, CARD, DIFFERS, MUTED, TEXT, TRACK};

/// One robot's part of the picture.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// The robot and its camera.
    pub title: String,
    /// What it saw (BGR, 8 bits).
    pub image: &'a Mat,
    /// The label of the class it found likeliest, and that class's probability; `None`: it saw no hand.
    pub opinion: Option<(String, f64)>,
    /// Whether it agrees with the swarm: colours the border. `None` when it has no opinion or the swarm no decision.
    pub correct: Option<bool>,
    /// Each class's label and probability, `0.0..=1.0`: one bar each.
    pub probabilities: Vec<(String, f64)>,
}

/// At most so many robots are shown; the picture says how many more there were.
pub const MAX_PANELS: usize = 48;

const MARGIN: f64 = 20.0;
const PANEL_WIDTH: f64 = 400.0;
const TITLE_HEIGHT: f64 = 40.0;
const VIEW_HEIGHT: f64 = 300.0;
const OPINION_HEIGHT: f64 = 96.0;
const PANEL_HEIGHT: f64 = TITLE_HEIGHT + VIEW_HEIGHT + OPINION_HEIGHT;
const BORDER: f64 = 4.0;
/// The label and its probability stand left of the bars.
const OPINION_WIDTH: f64 = 132.0;
/// How large a short label is written, and how small one that would not fit.
const LABEL_SIZES: [f64; 3] = [40.0, 26.0, 18.0];

/// Draws the panels in a grid under a headline, as SVG. The first line of the headline is large, the others are small.
///
/// # Errors
/// [`PictureError::OpenCv`] when a panel's image is empty or of another type than BGR, 8 bits.
pub fn round(panels: &[Panel<'_>], headline: &str) -> Result<String, PictureError> {
    let shown = &panels[..panels.len().min(MAX_PANELS)];
    let mut lines: Vec<String> = headline.lines().map(str::to_owned).collect();
    if shown.len() < panels.len() {
        lines.push(format!("{} more robots are not shown", panels.len() - shown.len()));
    }
    // A little wider than high, and never so narrow that a headline does not fit.
    let columns = ((shown.len() as f64 * 1.4).sqrt().ceil() as usize).max(2);
    let rows = shown.len().div_ceil(columns);
    let head_height = 52.0 + 30.0 * lines.len().saturating_sub(1) as f64;
    let width = MARGIN + columns as f64 * (PANEL_WIDTH + MARGIN);
    let height = MARGIN + head_height + (rows as f64 * (PANEL_HEIGHT + MARGIN)).max(MARGIN);
    let mut sheet = Sheet::new(width, height, BACKGROUND);
    for (n, line) in lines.iter().enumerate() {
        let (y, letters) = match n {
            0 => (MARGIN + 26.0, Letters::new(27.0, TEXT)),
            n => (MARGIN + 30.0 + 30.0 * n as f64, Letters::new(17.0, MUTED)),
        };
        sheet.write(line, (MARGIN, y), letters, width - 2.0 * MARGIN);
    }
    for (n, panel) in shown.iter().enumerate() {
        let (row, column) = ((n / columns) as f64, (n % columns) as f64);
        let x = MARGIN + column * (PANEL_WIDTH + MARGIN);
        let y = MARGIN + head_height + row * (PANEL_HEIGHT + MARGIN);
        draw_panel(&mut sheet, panel, (x, y))?;
    }
    Ok(sheet.svg())
}

fn draw_panel(sheet: &mut Sheet, panel: &Panel<'_>, (x, y): (f64, f64)) -> opencv::Result<()> {
    let tone = match panel.correct {
        Some(true) => AGREES,
        Some(false) => DIFFERS,
        None => TRACK,
    };
    let (wide, high) = (PANEL_WIDTH + 2.0 * BORDER, PANEL_HEIGHT + 2.0 * BORDER);
    sheet.fill(Place::new(x - BORDER, y - BORDER, wide, high), tone);
    sheet.fill(Place::new(x, y, PANEL_WIDTH, PANEL_HEIGHT), CARD);
    sheet.write(&panel.title, (x + 12.0, y + 27.0), Letters::new(17.0, TEXT), PANEL_WIDTH - 24.0);

    let view = Place::new(x, y + TITLE_HEIGHT, PANEL_WIDTH, VIEW_HEIGHT);
    sheet.fill(view, BACKGROUND);
    embed(sheet, panel.image, view)?;

    let base = y + TITLE_HEIGHT + VIEW_HEIGHT;
    match &panel.opinion {
        Some((label, probability)) => {
            let tone = if panel.correct.is_some() { tone } else { TEXT };
            let fits = |size: &&f64| gestalt_draw::text_width(label, **size) <= OPINION_WIDTH;
            let size = LABEL_SIZES.iter().find(fits).unwrap_or(&LABEL_SIZES[2]);
            sheet.write(label, (x + 14.0, base + 50.0), Letters::new(*size, tone), OPINION_WIDTH);
            let percent = format!("{:.0} %", 100.0 * probability);
            sheet.write(&percent, (x + 14.0, base + 82.0), Letters::new(17.0, MUTED), OPINION_WIDTH);
        }
        None => sheet.write("no hand", (x + 14.0, base + 54.0), Letters::new(20.0, MUTED), OPINION_WIDTH),
    }
    let left = OPINION_WIDTH + 24.0;
    let bars = Place::new(x + left, base + 12.0, PANEL_WIDTH - left - 14.0, OPINION_HEIGHT - 20.0);
    draw_bars(sheet, panel, bars, tone);
    Ok(())
}

/// One upright bar a class, its label below it; the likeliest in the panel's colour.
fn draw_bars(sheet: &mut Sheet, panel: &Panel<'_>, place: Place, tone: Tone) {
    let pitch = place.width / panel.probabilities.len().max(1) as f64;
    let (thickness, height) = ((pitch - 6.0).clamp(pitch.min(2.0), 26.0), place.height - 22.0);
    let likeliest = panel.opinion.as_ref().map(|(label, _)| label);
    for (n, (label, probability)) in panel.probabilities.iter().enumerate() {
        let middle = place.x + pitch * (n as f64 + 0.5);
        let x = middle - thickness / 2.0;
        sheet.fill(Place::new(x, place.y, thickness, height), TRACK);
        // What is not a number fills nothing.
        let filled = height * probability.clamp(0.0, 1.0).max(0.0);
        let chosen = likeliest == Some(label);
        let bar = match (chosen, panel.correct) {
            (true, Some(_)) => tone,
            (true, None) => TEXT,
            _ => MUTED,
        };
        sheet.fill(Place::new(x, place.y + height - filled, thickness, filled), bar);
        let letters = Letters::new(13.0, if chosen { TEXT } else { MUTED }).anchored(Anchor::Middle);
        sheet.write(label, (middle, place.y + place.height - 3.0), letters, pitch - 2.0);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gestalt_vision::camera_model::CameraModel;
    use gestalt_vision::pose::Pose;
    use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};
    use opencv::core::{self, Scalar};
    use opencv::imgcodecs;
    use opencv::prelude::*;

    use super::*;

    fn view(grey: f64) -> Mat {
        Mat::new_rows_cols_with_default(288, 384, core::CV_8UC3, Scalar::all(grey)).unwrap()
    }

    fn panel(image: &Mat, correct: Option<bool>) -> Panel<'_> {
        Panel {
            title: "robot 1 – footbot".into(),
            image,
            opinion: Some(("3".into(), 0.75)),
            correct,
            probabilities: vec![("2".into(), 0.25), ("3".into(), 0.75)],
        }
    }

    fn drawn(svg: &str) -> Mat {
        let png = gestalt_draw::png(svg).unwrap();
        imgcodecs::imdecode(&core::Vector::<u8>::from_slice(&png), imgcodecs::IMREAD_COLOR).unwrap()
    }

    /// How many pixels have exactly that colour.
    fn pixels(picture: &Mat, rgb: Tone) -> usize {
        let [_, red, green, blue] = rgb.to_be_bytes();
        let wanted = core::Vec3b::from([blue, green, red]);
        picture.data_typed::<core::Vec3b>().unwrap().iter().filter(|pixel| **pixel == wanted).count()
    }

    #[test]
    fn the_border_tells_who_agrees_with_the_swarm() {
        let image = view(100.0);
        let picture = |correct| drawn(&round(&[panel(&image, correct)], "the swarm says 3").unwrap());
        for (correct, present, absent) in [(true, AGREES, DIFFERS), (false, DIFFERS, AGREES)] {
            let picture = picture(Some(correct));
            assert!(pixels(&picture, present) > (2.0 * PANEL_HEIGHT * BORDER) as usize);
            assert_eq!(pixels(&picture, absent), 0);
        }
        assert_eq!(pixels(&picture(None), AGREES) + pixels(&picture(None), DIFFERS), 0);
    }

    #[test]
    fn every_view_is_in_the_picture() {
        let images: Vec<Mat> = (0..7).map(|i| view(60.0 + f64::from(i))).collect();
        let panels: Vec<Panel<'_>> = images.iter().map(|image| panel(image, Some(true))).collect();
        let picture = drawn(&round(&panels, "seven").unwrap());
        for i in 0..7 {
            let grey = 60 + i;
            let seen = pixels(&picture, grey << 16 | grey << 8 | grey);
            assert!(seen > 100_000, "{i}: {seen}");
        }
    }

    #[test]
    fn labels_of_any_script_stay_what_they_are() {
        let image = view(100.0);
        let labels = ["三", "λ", "✋ five", "thumb & <fist>", "שלוש"];
        let mut named = panel(&image, Some(true));
        named.opinion = Some(("三".into(), 0.9));
        named.probabilities = labels.iter().map(|label| ((*label).to_owned(), 0.2)).collect();
        let svg = round(&[named], "shown λ").unwrap();
        for text in [">三<", ">λ<", "shown λ", ">שלוש<"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        drawn(&svg);
    }

    #[test]
    fn robots_that_do_not_fit_are_counted_and_odd_input_is_drawn() {
        let image = view(100.0);
        let mut odd = panel(&image, None);
        odd.title = "läng\u{0}\n".repeat(100);
        odd.opinion = None;
        odd.probabilities = vec![(String::new(), f64::NAN), ("x".repeat(64), 7.0)];
        let many = round(&vec![odd.clone(); MAX_PANELS + 2], "two too many").unwrap();
        assert!(many.contains("2 more robots are not shown"));
        drawn(&round(&[odd.clone()], &odd.title).unwrap());
        drawn(&round(&[], "").unwrap());
        odd.probabilities = vec![("k".into(), 0.01); 300];
        drawn(&round(&[odd], "").unwrap());
        let empty = Mat::default();
        assert!(matches!(round(&[panel(&empty, None)], ""), Err(PictureError::OpenCv(_))));
    }

    #[test]
    fn a_round_of_eight_robots_is_drawn_as_a_whole() {
        let labels = ["零", "one", "λύο", "三", "✋ four", "a hand with all five fingers"];
        let frames: Vec<Mat> = (0..8_u32)
            .map(|n| {
                let camera = if n < 6 { CameraModel::footbot() } else { CameraModel::parrot() };
                let pose = Pose { bearing_deg: f64::from(n) * 15.0 - 50.0, ..Pose::FRONTAL };
                let mut source = RenderedSource::new(camera, pose, Glove::Cyan, u64::from(n)).unwrap();
                let scene = Scene { gesture: Some(4), seed: 3 };
                source.next_frame(Duration::ZERO, &scene).unwrap().image
            })
            .collect();
        let panels: Vec<Panel<'_>> = frames
            .iter()
            .enumerate()
            .map(|(n, image)| {
                let likeliest = [3, 5, 4, 4, 4, 2, 0, 4][n];
                let p = |k: usize| if k == likeliest { 0.55 } else { 0.09 };
                Panel {
                    title: format!("footbot-{} <with & a name that is longer than its panel>", n + 1),
                    image,
                    opinion: (n != 6).then(|| (labels[likeliest].to_owned(), 0.55)),
                    correct: (n != 6).then_some(likeliest == 4),
                    probabilities: (0..6).map(|k| (labels[k].to_owned(), p(k))).collect(),
                }
            })
            .collect();
        let svg =
            round(&panels, "round 27: shown ✋ four, the swarm decides ✋ four (0.985, 8 robots)").unwrap();
        let picture = drawn(&svg);
        assert_eq!((picture.cols(), picture.rows()), (1700, 984));
        assert!(pixels(&picture, AGREES) > 4000 && pixels(&picture, DIFFERS) > 3000);
    }
}
