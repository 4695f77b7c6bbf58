//! One frame on its way through perception: raw, white-balanced, mask, hand, features, opinion.

use gestalt_draw::{Letters, Place, Sheet, Tone};
use opencv::core::{CV_8UC3, Mat, Rect, Scalar};
use opencv::imgproc::{self, INTER_AREA, INTER_LINEAR};
use opencv::prelude::*;

use super::PictureError;
use super::frame::{embed, mark};
use super::tone::{AGREES, BACKGROUND, CARD, DIFFERS, MUTED, TEXT, TRACK};

/// Groups of features: each a name and its values.
pub type Groups = Vec<(String, Vec<f32>)>;

/// What bars show, and the value of a bar of full height.
pub type Scale = (String, f32);

/// What perception made of one frame.
#[derive(Debug)]
pub struct Stages<'a> {
    /// Where the frame comes from, and the camera. The first line is large, the others are small.
    pub headline: String,
    /// The frame as it came (BGR, 8 bits).
    pub frame: &'a Mat,
    /// The part of it that was looked at closely, in its pixels.
    pub region: Rect,
    /// The frame in white balance.
    pub balanced: &'a Mat,
    /// What made it so, in words.
    pub balance: String,
    /// The pixels of the region that are the hand (255, others 0); without a hand, the pixels of the frame that might
    /// have been.
    pub mask: &'a Mat,
    /// Whether there is a hand, or else why not.
    pub hand: Result<String, String>,
    /// The features. Empty without a hand.
    pub features: Groups,
    /// What the bars of the features show; negative values hang.
    pub scale: Scale,
    /// The label and probability (`0.0..=1.0`) of each gesture, or why there is none.
    pub opinion: Result<Vec<(String, f64)>, String>,
}

const MARGIN: f64 = 24.0;
const CARD_WIDTH: f64 = 400.0;
const HEAD: f64 = 84.0;
const CAPTION: f64 = 66.0;
const VIEW: f64 = 300.0;
const LOWER: f64 = 400.0;
const INSET: f64 = 16.0;
/// Left of the features stands what their bars are worth.
const AXIS: f64 = 60.0;
/// The labels stand left of the bars of the opinion, the percentages right of them.
const LABELS: f64 = 130.0;
const PERCENT: f64 = 76.0;
/// Two tones by turns, so that neighbouring groups are told apart (Okabe and Ito, 2008).
const GROUP_TONES: [Tone; 2] = [0x56_b4_e9, 0xe6_9f_00];

/// Draws the six stages as SVG.
///
/// # Errors
/// [`PictureError::OpenCv`] when an image is empty or of another type.
pub fn draw(stages: &Stages<'_>) -> Result<String, PictureError> {
    let width = MARGIN + 4.0 * (CARD_WIDTH + MARGIN);
    let upper_height = CAPTION + VIEW;
    let mut sheet = Sheet::new(width, HEAD + upper_height + MARGIN + CAPTION + LOWER + MARGIN, BACKGROUND);
    let headline = [(38.0, Letters::new(28.0, TEXT)), (68.0, Letters::new(17.0, MUTED))];
    for (line, (y, letters)) in stages.headline.lines().zip(headline) {
        sheet.write(line, (MARGIN, y), letters, width - 2.0 * MARGIN);
    }

    let found = stages.hand.is_ok();
    let hand = if found { Some(hand(stages)?) } else { None };
    let (part, verdict) = match &stages.hand {
        Ok(words) => ("the hand's pixels", words.as_str()),
        Err(cause) => ("pixels that may be a hand's", cause.as_str()),
    };
    let frame = stages.frame;
    let seen = format!("{} × {} pixels", frame.cols(), frame.rows());
    let region = found.then_some(stages.region);
    for (column, (title, words, image, marked)) in [
        ("1 raw", seen.as_str(), Some(frame), region),
        ("2 white-balanced", stages.balance.as_str(), Some(stages.balanced), region),
        ("3 mask", part, Some(stages.mask), None),
        ("4 hand", verdict, hand.as_ref(), None),
    ]
    .into_iter()
    .enumerate()
    {
        let place =
            Place::new(MARGIN + column as f64 * (CARD_WIDTH + MARGIN), HEAD, CARD_WIDTH, upper_height);
        card(&mut sheet, place, title, words, column < 3 || found);
        let view = Place::new(place.x, place.y + CAPTION, place.width, VIEW);
        sheet.fill(view, BACKGROUND);
        match image {
            Some(image) => {
                let shown = embed(&mut sheet, image, view)?;
                if let Some(region) = marked {
                    mark(&mut sheet, image, region, shown);
                }
            }
            None => {
                let middle = (view.x + 130.0, view.y + VIEW / 2.0);
                sheet.write("no hand", middle, Letters::new(28.0, MUTED), view.width);
            }
        }
    }

    let y = HEAD + upper_height + MARGIN;
    let features = Place::new(MARGIN, y, 3.0 * CARD_WIDTH + 2.0 * MARGIN, CAPTION + LOWER);
    let opinion = Place::new(MARGIN + 3.0 * (CARD_WIDTH + MARGIN), y, CARD_WIDTH, CAPTION + LOWER);
    draw_features(&mut sheet, stages, features);
    draw_opinion(&mut sheet, stages, opinion);
    Ok(sheet.svg())
}

fn card(sheet: &mut Sheet, place: Place, title: &str, words: &str, good: bool) {
    sheet.fill(place, CARD);
    let width = place.width - 2.0 * INSET;
    sheet.write(title, (place.x + INSET, place.y + 28.0), Letters::new(20.0, TEXT), width);
    let tone = if good { MUTED } else { DIFFERS };
    sheet.write(words, (place.x + INSET, place.y + 53.0), Letters::new(14.0, tone), width);
}

/// The balanced pixels of the hand, and nothing else.
fn hand(stages: &Stages<'_>) -> opencv::Result<Mat> {
    let size = stages.mask.size()?;
    let part = Mat::roi(stages.balanced, stages.region)?;
    let how = if size.width < part.cols() { INTER_AREA } else { INTER_LINEAR };
    let [_, red, green, blue] = BACKGROUND.to_be_bytes();
    let background = Scalar::new(blue.into(), green.into(), red.into(), 0.0);
    let (mut scaled, mut hand) = (Mat::default(), Mat::new_size_with_default(size, CV_8UC3, background)?);
    imgproc::resize(&part, &mut scaled, size, 0.0, 0.0, how)?;
    scaled.copy_to_masked(&mut hand, stages.mask)?;
    let bounds = imgproc::bounding_rect(stages.mask)?;
    Mat::roi(&hand, bounds)?.try_clone()
}

/// One bar a feature, rising or hanging from the line of 0, under the name of its group.
fn draw_features(sheet: &mut Sheet, stages: &Stages<'_>, place: Place) {
    let count: usize = stages.features.iter().map(|(_, values)| values.len()).sum();
    let (unit, full) = &stages.scale;
    let words =
        if count == 0 { "no hand, no features".to_owned() } else { format!("{count} values; {unit}") };
    card(sheet, place, "5 features", &words, count > 0);
    if count == 0 {
        return;
    }
    let (left, top) = (place.x + AXIS, place.y + CAPTION + 34.0);
    let plot = Place::new(left, top, place.width - AXIS - INSET, LOWER - 34.0 - INSET);
    let hangs = stages.features.iter().flat_map(|(_, values)| values).any(|&value| value < 0.0);
    let reach = if hangs { plot.height / 2.0 } else { plot.height };
    let zero = plot.y + reach;
    let marks: &[f32] = if hangs { &[1.0, 0.0, -1.0] } else { &[1.0, 0.5, 0.0] };
    for mark in marks {
        let y = zero - f64::from(*mark) * reach;
        sheet.fill(Place::new(plot.x, y, plot.width, 1.0), TRACK);
        let worth = format!("{:.1}", mark * full);
        sheet.write(&worth, (place.x + 10.0, y + 5.0), Letters::new(13.0, MUTED), AXIS - 14.0);
    }
    // A gap between groups.
    let gaps = stages.features.len() as f64 - 1.0;
    let gap = 18.0_f64.min(plot.width / 40.0);
    let pitch = (plot.width - gaps * gap) / count as f64;
    let mut x = plot.x;
    for (n, (name, values)) in stages.features.iter().enumerate() {
        let tone = GROUP_TONES[n % 2];
        let span = pitch * values.len() as f64;
        let name_at = (x, place.y + CAPTION + 18.0);
        sheet.write(name, name_at, Letters::new(14.0, tone), span.max(40.0) + gap - 4.0);
        sheet.fill(Place::new(x, place.y + CAPTION + 24.0, span, 2.0), tone);
        for value in values {
            let height = f64::from((value / full).clamp(-1.0, 1.0)) * reach;
            let top = if height > 0.0 { zero - height } else { zero };
            sheet.fill(Place::new(x, top, (pitch * 0.8).max(1.0), height.abs().max(1.0)), tone);
            x += pitch;
        }
        x += gap;
    }
}

/// One lying bar a gesture, with its probability in figures.
fn draw_opinion(sheet: &mut Sheet, stages: &Stages<'_>, place: Place) {
    let probabilities = match &stages.opinion {
        Ok(probabilities) => probabilities,
        Err(cause) => return card(sheet, place, "6 opinion", cause, false),
    };
    let best = probabilities.iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
    let words = best.map_or(String::new(), |(label, p)| format!("{label}, with probability {p:.2}"));
    card(sheet, place, "6 opinion", &words, true);
    let pitch = ((LOWER - INSET) / probabilities.len().max(1) as f64).min(56.0);
    let size = (pitch * 0.36).clamp(6.0, 18.0);
    // As much room as the labels need, and no more than there is.
    let widest =
        probabilities.iter().map(|(label, _)| gestalt_draw::text_width(label, size)).fold(40.0, f64::max);
    let labels = widest.min(LABELS);
    for (n, (label, probability)) in probabilities.iter().enumerate() {
        let y = place.y + CAPTION + n as f64 * pitch + 6.0;
        let chosen = best.is_some_and(|(best, _)| best == label);
        let height = (pitch - 10.0).max(2.0);
        let base = y + 2.0 + height / 2.0 + 0.36 * size;
        let letters = Letters::new(size, if chosen { TEXT } else { MUTED });
        sheet.write(label, (place.x + INSET, base), letters, labels);
        let left = INSET + labels + 14.0;
        let track = Place::new(place.x + left, y + 2.0, place.width - left - 8.0 - PERCENT, height);
        sheet.fill(track, TRACK);
        // What is not a number fills nothing.
        let filled = track.width * probability.clamp(0.0, 1.0).max(0.0);
        sheet.fill(Place { width: filled, ..track }, if chosen { AGREES } else { MUTED });
        let percent = format!("{:.1} %", 100.0 * probability);
        let beside = (track.x + track.width + 8.0, base);
        sheet.write(&percent, beside, Letters::new(size.min(14.0), MUTED), PERCENT);
    }
}

#[cfg(test)]
mod tests {
    use opencv::{core, imgcodecs};

    use super::*;

    fn drawn(stages: &Stages<'_>) -> Mat {
        let png = gestalt_draw::png(&draw(stages).unwrap()).unwrap();
        imgcodecs::imdecode(&core::Vector::<u8>::from_slice(&png), imgcodecs::IMREAD_COLOR).unwrap()
    }

    fn pixels(picture: &Mat, rgb: Tone) -> usize {
        let [_, red, green, blue] = rgb.to_be_bytes();
        let wanted = core::Vec3b::from([blue, green, red]);
        picture.data_typed::<core::Vec3b>().unwrap().iter().filter(|pixel| **pixel == wanted).count()
    }

    fn grey(level: f64) -> Mat {
        Mat::new_rows_cols_with_default(288, 384, CV_8UC3, Scalar::all(level)).unwrap()
    }

    #[test]
    fn every_stage_is_in_the_picture() {
        let (frame, balanced) = (grey(71.0), grey(151.0));
        let mut mask = Mat::new_rows_cols_with_default(60, 80, core::CV_8U, Scalar::all(0.0)).unwrap();
        fill_mask(&mut mask);
        let mut stages = Stages {
            headline: "a frame\nof a camera".into(),
            frame: &frame,
            region: Rect::new(10, 10, 80, 60),
            balanced: &balanced,
            balance: "gains".into(),
            mask: &mask,
            hand: Ok("quality 1.00".into()),
            features: vec![("blob".into(), vec![3.0; 10]), ("rings".into(), vec![-3.0; 10])],
            scale: ("standard deviations".into(), 3.0),
            opinion: Ok(vec![("two".into(), 0.25), ("three".into(), 0.75)]),
        };
        let picture = drawn(&stages);
        let shade = |level: u32| level << 16 | level << 8 | level;
        assert!(pixels(&picture, shade(71)) > 80_000, "raw");
        // The balanced frame, and the hand.
        assert!(pixels(&picture, shade(151)) > 100_000, "balanced");
        assert!(pixels(&picture, shade(255)) > 20_000, "mask");
        assert!(GROUP_TONES.iter().all(|&tone| pixels(&picture, tone) > 40_000), "features");
        let most = pixels(&picture, AGREES);
        stages.opinion = Ok(vec![("two".into(), 0.6), ("three".into(), 0.4)]);
        assert!(pixels(&drawn(&stages), AGREES) < most, "the bar is as long as the probability");

        stages.hand = Err("nothing stands out".into());
        stages.features.clear();
        stages.opinion = Err("no hand".into());
        assert_eq!(pixels(&drawn(&stages), AGREES), 0);
    }

    fn fill_mask(mask: &mut Mat) {
        let inner = Rect::new(20, 10, 40, 40);
        Mat::roi_mut(mask, inner).unwrap().set_to(&Scalar::all(255.0), &core::no_array()).unwrap();
    }
}
