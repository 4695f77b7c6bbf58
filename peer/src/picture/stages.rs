//! One frame on its way through perception: raw, white-balanced, mask, hand, features, opinion.

use opencv::core::{CV_8UC3, Mat, Point, Rect, Size};
use opencv::imgproc::{self, COLOR_GRAY2BGR, INTER_AREA, INTER_LINEAR, LINE_AA};
use opencv::prelude::*;

use super::PictureError;
use super::canvas::{AGREES, BACKGROUND, CARD, DIFFERS, MUTED, TEXT, TRACK, colour, fill, fit, write};

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

const MARGIN: i32 = 24;
const CARD_WIDTH: i32 = 400;
const HEAD: i32 = 84;
const CAPTION: i32 = 66;
const VIEW: i32 = 300;
const LOWER: i32 = 400;
const COLUMNS: i32 = 4;
const INSET: i32 = 16;
/// Two tones by turns, so that neighbouring groups are told apart (Okabe and Ito, 2008).
const GROUP_TONES: [u32; 2] = [0x56_b4_e9, 0xe6_9f_00];

/// Draws the six stages.
///
/// # Errors
/// [`PictureError::OpenCv`] when an image is empty or of another type.
pub fn draw(stages: &Stages<'_>) -> Result<Mat, PictureError> {
    let width = MARGIN + COLUMNS * (CARD_WIDTH + MARGIN);
    let upper_height = CAPTION + VIEW;
    let size = Size::new(width, HEAD + upper_height + MARGIN + CAPTION + LOWER + MARGIN);
    let mut picture = Mat::new_size_with_default(size, CV_8UC3, colour(BACKGROUND))?;
    for (i, line) in stages.headline.lines().take(2).enumerate() {
        let (y, scale, tone) = if i == 0 { (38, 1.0, TEXT) } else { (68, 0.6, MUTED) };
        write(&mut picture, line, Point::new(MARGIN, y), scale, tone, width - 2 * MARGIN)?;
    }

    let found = stages.hand.is_ok();
    let frame = stages.frame;
    let raw = framed(frame, stages.region, found)?;
    let balanced = framed(stages.balanced, stages.region, found)?;
    let mut mask = Mat::default();
    imgproc::cvt_color_def(stages.mask, &mut mask, COLOR_GRAY2BGR)?;
    let (part, verdict) = match &stages.hand {
        Ok(words) => ("the hand's pixels", words.as_str()),
        Err(cause) => ("pixels that may be a hand's", cause.as_str()),
    };
    let seen = format!("{} x {} pixels", frame.cols(), frame.rows());
    for (column, (title, words, image)) in [
        ("1  raw", seen.as_str(), Some(raw)),
        ("2  white-balanced", stages.balance.as_str(), Some(balanced)),
        ("3  mask", part, Some(mask)),
        ("4  hand", verdict, if found { Some(hand(stages)?) } else { None }),
    ]
    .into_iter()
    .enumerate()
    {
        let x = MARGIN + column as i32 * (CARD_WIDTH + MARGIN);
        let place = Rect::new(x, HEAD, CARD_WIDTH, upper_height);
        card(&mut picture, place, title, words, column < 3 || found)?;
        let view = Rect::new(place.x, place.y + CAPTION, place.width, VIEW);
        fill(&mut picture, view, BACKGROUND)?;
        match image {
            Some(image) => fit(&mut picture, &image, view)?,
            None => {
                let middle = Point::new(view.x + 130, view.y + VIEW / 2);
                write(&mut picture, "no hand", middle, 1.0, MUTED, view.width)?;
            }
        }
    }

    let y = HEAD + upper_height + MARGIN;
    let features = Rect::new(MARGIN, y, 3 * CARD_WIDTH + 2 * MARGIN, CAPTION + LOWER);
    let opinion = Rect::new(MARGIN + 3 * (CARD_WIDTH + MARGIN), y, CARD_WIDTH, CAPTION + LOWER);
    draw_features(&mut picture, stages, features)?;
    draw_opinion(&mut picture, stages, opinion)?;
    Ok(picture)
}

fn card(picture: &mut Mat, place: Rect, title: &str, words: &str, good: bool) -> opencv::Result<()> {
    fill(picture, place, CARD)?;
    let width = place.width - 2 * INSET;
    write(picture, title, Point::new(place.x + INSET, place.y + 28), 0.75, TEXT, width)?;
    let tone = if good { MUTED } else { DIFFERS };
    write(picture, words, Point::new(place.x + INSET, place.y + 53), 0.5, tone, width)
}

/// The image with the region marked in it.
fn framed(image: &Mat, region: Rect, found: bool) -> opencv::Result<Mat> {
    let mut framed = image.clone();
    if found {
        // As thick on the picture whatever the frame's size.
        let pen = (framed.cols() / 160).max(1);
        imgproc::rectangle(&mut framed, region, colour(AGREES), pen, LINE_AA, 0)?;
    }
    Ok(framed)
}

/// The balanced pixels of the hand, and nothing else.
fn hand(stages: &Stages<'_>) -> opencv::Result<Mat> {
    let size = stages.mask.size()?;
    let part = Mat::roi(stages.balanced, stages.region)?;
    let how = if size.width < part.cols() { INTER_AREA } else { INTER_LINEAR };
    let (mut scaled, mut hand) =
        (Mat::default(), Mat::new_size_with_default(size, CV_8UC3, colour(BACKGROUND))?);
    imgproc::resize(&part, &mut scaled, size, 0.0, 0.0, how)?;
    scaled.copy_to_masked(&mut hand, stages.mask)?;
    let bounds = imgproc::bounding_rect(stages.mask)?;
    Mat::roi(&hand, bounds)?.try_clone()
}

/// One bar a feature, rising or hanging from the line of 0, under the name of its group.
fn draw_features(picture: &mut Mat, stages: &Stages<'_>, place: Rect) -> opencv::Result<()> {
    let count: usize = stages.features.iter().map(|(_, values)| values.len()).sum();
    let (unit, full) = &stages.scale;
    let words =
        if count == 0 { "no hand, no features".to_owned() } else { format!("{count} values; {unit}") };
    card(picture, place, "5  features", &words, count > 0)?;
    let plot = Rect::new(place.x + 60, place.y + CAPTION + 34, place.width - 60 - INSET, LOWER - 34 - INSET);
    if count == 0 {
        return Ok(());
    }
    let hangs = stages.features.iter().flat_map(|(_, values)| values).any(|&value| value < 0.0);
    let zero = if hangs { plot.y + plot.height / 2 } else { plot.y + plot.height };
    let reach = f64::from(zero - plot.y);
    let marks: &[f32] = if hangs { &[1.0, 0.0, -1.0] } else { &[1.0, 0.5, 0.0] };
    for mark in marks {
        let y = zero - (f64::from(*mark) * reach) as i32;
        fill(picture, Rect::new(plot.x, y, plot.width, 1), TRACK)?;
        let label = format!("{:.1}", mark * full);
        write(picture, &label, Point::new(place.x + 10, y + 5), 0.42, MUTED, 46)?;
    }
    // A gap between groups.
    let gaps = stages.features.len() as f64 - 1.0;
    let gap = 18.0_f64.min(f64::from(plot.width) / 40.0);
    let pitch = (f64::from(plot.width) - gaps * gap) / count as f64;
    let mut x = f64::from(plot.x);
    for (group, (name, values)) in stages.features.iter().enumerate() {
        let tone = GROUP_TONES[group % 2];
        let span = (pitch * values.len() as f64) as i32;
        let label = Point::new(x as i32, place.y + CAPTION + 18);
        write(picture, name, label, 0.5, tone, span.max(40) + gap as i32)?;
        fill(picture, Rect::new(x as i32, place.y + CAPTION + 24, span, 2), tone)?;
        for value in values {
            let height = (f64::from((value / full).clamp(-1.0, 1.0)) * reach).round() as i32;
            let top = if height > 0 { zero - height } else { zero };
            let width = ((pitch * 0.8) as i32).max(1);
            fill(picture, Rect::new(x as i32, top, width, height.abs().max(1)), tone)?;
            x += pitch;
        }
        x += gap;
    }
    Ok(())
}

/// One lying bar a gesture, with its probability in figures.
fn draw_opinion(picture: &mut Mat, stages: &Stages<'_>, place: Rect) -> opencv::Result<()> {
    let probabilities = match &stages.opinion {
        Ok(probabilities) => probabilities,
        Err(cause) => return card(picture, place, "6  opinion", cause, false),
    };
    let best = probabilities.iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
    let words = best.map_or(String::new(), |(label, p)| format!("{label}, with probability {p:.2}"));
    card(picture, place, "6  opinion", &words, true)?;
    let pitch = ((LOWER - INSET) / (probabilities.len() as i32).max(1)).min(56);
    let letters = if pitch < 24 { 0.4 } else { 0.7 };
    for (i, (label, probability)) in probabilities.iter().enumerate() {
        let y = place.y + CAPTION + i as i32 * pitch + 6;
        if y + pitch > place.y + place.height {
            break;
        }
        let chosen = best.is_some_and(|(best, _)| best == label);
        let tone = if chosen { AGREES } else { MUTED };
        let base = y + pitch / 2 + (10.0 * letters) as i32;
        write(
            picture,
            label,
            Point::new(place.x + INSET, base),
            letters,
            if chosen { TEXT } else { MUTED },
            78,
        )?;
        let track = Rect::new(place.x + 100, y + 2, place.width - 100 - 84, (pitch - 10).max(2));
        fill(picture, track, TRACK)?;
        let filled = (f64::from(track.width) * probability.clamp(0.0, 1.0)).round() as i32;
        fill(picture, Rect::new(track.x, track.y, filled, track.height), tone)?;
        let percent = format!("{:.1} %", 100.0 * probability);
        write(picture, &percent, Point::new(track.x + track.width + 8, base), 0.5, MUTED, 76)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use opencv::core::{self, Scalar};

    use super::*;

    fn pixels(picture: &Mat, rgb: u32) -> usize {
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
        let picture = draw(&stages).unwrap();
        let shade = |level: u32| level << 16 | level << 8 | level;
        assert!(pixels(&picture, shade(71)) > 80_000, "raw");
        // The balanced frame, and the hand.
        assert!(pixels(&picture, shade(151)) > 100_000, "balanced");
        assert!(pixels(&picture, shade(255)) > 20_000, "mask");
        assert!(GROUP_TONES.iter().all(|&tone| pixels(&picture, tone) > 40_000), "features");
        let most = pixels(&picture, AGREES);
        stages.opinion = Ok(vec![("two".into(), 0.6), ("three".into(), 0.4)]);
        assert!(pixels(&draw(&stages).unwrap(), AGREES) < most, "the bar is as long as the probability");

        stages.hand = Err("nothing stands out".into());
        stages.features.clear();
        stages.opinion = Err("no hand".into());
        assert_eq!(pixels(&draw(&stages).unwrap(), AGREES), 0);
    }

    fn fill_mask(mask: &mut Mat) {
        let inner = Rect::new(20, 10, 40, 40);
        Mat::roi_mut(mask, inner).unwrap().set_to(&Scalar::all(255.0), &core::no_array()).unwrap();
    }
}
