//! Pictures for people: of one round, with what every robot saw and what the swarm decided; and, in [`stages`], of
//! one frame on its way through perception.

mod canvas;
pub mod stages;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use opencv::core::{self, Mat, Point, Rect, Size, Vector};
use opencv::imgcodecs;
use thiserror::Error;

use canvas::{AGREES, BACKGROUND, CARD, DIFFERS, MUTED, TEXT, TRACK, centre, colour, fill, fit, write};

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

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The file or its folder may not be written.
    #[error("no permission to write {}: choose another folder, or grant it with chmod", .0.display())]
    Permission(PathBuf),
    /// The folder is not there.
    #[error("cannot write {}: its folder does not exist; make it with mkdir -p", .0.display())]
    NoFolder(PathBuf),
    /// The disk has no room left.
    #[error("cannot write {}: the disk is full; free some space or choose another folder", .0.display())]
    DiskFull(PathBuf),
    /// Anything else the operating system objects to.
    #[error("cannot write {}: {cause}", path.display())]
    Unwritable {
        /// Which file.
        path: PathBuf,
        /// What the operating system says.
        cause: io::Error,
    },
    /// A panel's image is empty or of another type, or OpenCV cannot encode.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// At most so many robots are shown; the picture says how many more there were.
pub const MAX_PANELS: usize = 48;

const MARGIN: i32 = 20;
const PANEL_WIDTH: i32 = 400;
const TITLE_HEIGHT: i32 = 40;
const VIEW_HEIGHT: i32 = 300;
const OPINION_HEIGHT: i32 = 96;
const PANEL_HEIGHT: i32 = TITLE_HEIGHT + VIEW_HEIGHT + OPINION_HEIGHT;
const BORDER: i32 = 4;

/// Draws the panels in a grid under a headline. The first line of the headline is large, the others are small.
///
/// # Errors
/// [`PictureError::OpenCv`] when a panel's image is empty or of another type than BGR, 8 bits.
pub fn round(panels: &[Panel<'_>], headline: &str) -> Result<Mat, PictureError> {
    let shown = &panels[..panels.len().min(MAX_PANELS)];
    let mut lines: Vec<String> = headline.lines().map(str::to_owned).collect();
    if shown.len() < panels.len() {
        lines.push(format!("{} more robots are not shown", panels.len() - shown.len()));
    }
    // A little wider than high, and never so narrow that a headline does not fit.
    let columns = ((shown.len() as f64 * 1.4).sqrt().ceil() as i32).max(2);
    let rows = (shown.len() as i32 + columns - 1) / columns;
    let head_height = 52 + 30 * lines.len().saturating_sub(1) as i32;
    let size = Size::new(
        MARGIN + columns * (PANEL_WIDTH + MARGIN),
        MARGIN + head_height + rows * (PANEL_HEIGHT + MARGIN) + if rows == 0 { MARGIN } else { 0 },
    );
    let mut picture = Mat::new_size_with_default(size, core::CV_8UC3, colour(BACKGROUND))?;
    let width = size.width - 2 * MARGIN;
    for (i, line) in lines.iter().enumerate() {
        let (y, scale, tone) =
            if i == 0 { (MARGIN + 26, 1.0, TEXT) } else { (MARGIN + 30 + 30 * i as i32, 0.65, MUTED) };
        write(&mut picture, line, Point::new(MARGIN, y), scale, tone, width)?;
    }
    for (i, panel) in shown.iter().enumerate() {
        let (row, column) = (i as i32 / columns, i as i32 % columns);
        let corner = Point::new(
            MARGIN + column * (PANEL_WIDTH + MARGIN),
            MARGIN + head_height + row * (PANEL_HEIGHT + MARGIN),
        );
        draw_panel(&mut picture, panel, corner)?;
    }
    Ok(picture)
}

/// Writes an image as PNG.
///
/// # Errors
/// [`PictureError`] names the path and what to do about it.
pub fn write_png(path: &Path, image: &Mat) -> Result<(), PictureError> {
    // Encoded first and written by us, since OpenCV does not say why a file cannot be written.
    let mut bytes = Vector::new();
    imgcodecs::imencode(".png", image, &mut bytes, &Vector::new())?;
    fs::write(path, bytes.as_slice()).map_err(|cause| PictureError::io(path, cause))
}

/// Finds out whether a picture can be written there, before the work that leads to it is done. Leaves everything as it was.
///
/// # Errors
/// [`PictureError`] names the path and what to do about it.
pub fn writable(path: &Path) -> Result<(), PictureError> {
    let failed = |cause| PictureError::io(path, cause);
    let was_there = path.exists();
    fs::OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
    if was_there { Ok(()) } else { fs::remove_file(path).map_err(failed) }
}

impl PictureError {
    fn io(path: &Path, cause: io::Error) -> Self {
        match cause.kind() {
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Permission(path.into())
            }
            io::ErrorKind::NotFound => Self::NoFolder(path.into()),
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull(path.into()),
            _ => Self::Unwritable { path: path.into(), cause },
        }
    }
}

fn draw_panel(picture: &mut Mat, panel: &Panel<'_>, corner: Point) -> opencv::Result<()> {
    let tone = match panel.correct {
        Some(true) => AGREES,
        Some(false) => DIFFERS,
        None => TRACK,
    };
    let outline =
        Rect::new(corner.x - BORDER, corner.y - BORDER, PANEL_WIDTH + 2 * BORDER, PANEL_HEIGHT + 2 * BORDER);
    fill(picture, outline, tone)?;
    fill(picture, Rect::new(corner.x, corner.y, PANEL_WIDTH, PANEL_HEIGHT), CARD)?;
    let title = Point::new(corner.x + 12, corner.y + 27);
    write(picture, &panel.title, title, 0.6, TEXT, PANEL_WIDTH - 24)?;

    let view = Rect::new(corner.x, corner.y + TITLE_HEIGHT, PANEL_WIDTH, VIEW_HEIGHT);
    fill(picture, view, BACKGROUND)?;
    fit(picture, panel.image, view)?;

    let base = corner.y + TITLE_HEIGHT + VIEW_HEIGHT;
    match &panel.opinion {
        Some((label, probability)) => {
            let tone = if panel.correct.is_some() { tone } else { TEXT };
            write(picture, label, Point::new(corner.x + 14, base + 50), 1.4, tone, 130)?;
            let percent = format!("{:.0} %", 100.0 * probability);
            write(picture, &percent, Point::new(corner.x + 14, base + 82), 0.6, MUTED, 130)?;
        }
        None => write(picture, "no hand", Point::new(corner.x + 14, base + 54), 0.75, MUTED, 130)?,
    }
    let bars = Rect::new(corner.x + 156, base + 12, PANEL_WIDTH - 156 - 14, OPINION_HEIGHT - 20);
    draw_bars(picture, panel, bars, tone)
}

/// One upright bar a class, its label below it; the likeliest in the panel's colour.
fn draw_bars(picture: &mut Mat, panel: &Panel<'_>, place: Rect, tone: u32) -> opencv::Result<()> {
    let count = panel.probabilities.len() as i32;
    if count == 0 {
        return Ok(());
    }
    let pitch = place.width / count;
    let (thickness, height) = ((pitch - 6).clamp(2, 26), place.height - 22);
    let likeliest = panel.opinion.as_ref().map(|(label, _)| label);
    for (i, (label, probability)) in panel.probabilities.iter().enumerate() {
        let x = place.x + pitch * i as i32 + (pitch - thickness) / 2;
        fill(picture, Rect::new(x, place.y, thickness, height), TRACK)?;
        let filled = (f64::from(height) * probability.clamp(0.0, 1.0)).round() as i32;
        let chosen = likeliest == Some(label);
        let bar = match (chosen, panel.correct) {
            (true, Some(_)) => tone,
            (true, None) => TEXT,
            _ => MUTED,
        };
        fill(picture, Rect::new(x, place.y + height - filled, thickness, filled), bar)?;
        let below = Point::new(x, place.y + place.height - 2);
        centre(picture, label, below, thickness, 0.5, if chosen { TEXT } else { MUTED }, pitch)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use opencv::core::Scalar;
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

    /// How many pixels have exactly that colour.
    fn pixels(picture: &Mat, rgb: u32) -> usize {
        let [_, red, green, blue] = rgb.to_be_bytes();
        let wanted = core::Vec3b::from([blue, green, red]);
        picture.data_typed::<core::Vec3b>().unwrap().iter().filter(|pixel| **pixel == wanted).count()
    }

    #[test]
    fn the_border_tells_who_agrees_with_the_swarm() {
        let image = view(100.0);
        let picture = |correct| round(&[panel(&image, correct)], "the swarm says 3").unwrap();
        for (correct, present, absent) in [(true, AGREES, DIFFERS), (false, DIFFERS, AGREES)] {
            let picture = picture(Some(correct));
            assert!(pixels(&picture, present) > 2 * PANEL_HEIGHT as usize * BORDER as usize);
            assert_eq!(pixels(&picture, absent), 0);
        }
        assert_eq!(pixels(&picture(None), AGREES) + pixels(&picture(None), DIFFERS), 0);
    }

    #[test]
    fn every_view_is_in_the_picture() {
        let images: Vec<Mat> = (0..7).map(|i| view(60.0 + f64::from(i))).collect();
        let panels: Vec<Panel<'_>> = images.iter().map(|image| panel(image, Some(true))).collect();
        let picture = round(&panels, "seven").unwrap();
        for i in 0..7 {
            let grey = 60 + i;
            let seen = pixels(&picture, grey << 16 | grey << 8 | grey);
            assert!(seen > 100_000, "{i}: {seen}");
        }
    }

    #[test]
    fn robots_that_do_not_fit_are_counted_and_odd_input_is_drawn() {
        let image = view(100.0);
        let mut odd = panel(&image, None);
        odd.title = "läng\u{0}\n".repeat(100);
        odd.opinion = None;
        odd.probabilities = vec![(String::new(), f64::NAN), ("x".repeat(64), 7.0)];
        assert!(round(&vec![odd.clone(); MAX_PANELS + 2], &odd.title).is_ok());
        assert!(round(&[], "").is_ok());
        odd.probabilities = vec![("k".into(), 0.01); 300];
        assert!(round(&[odd], "").is_ok());
        let empty = Mat::default();
        assert!(matches!(round(&[panel(&empty, None)], ""), Err(PictureError::OpenCv(_))));
    }

    #[test]
    fn what_is_written_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("round.png");
        write_png(&path, &view(77.0)).unwrap();
        let read = imgcodecs::imread(&path, imgcodecs::IMREAD_COLOR).unwrap();
        assert_eq!(read.data_bytes().unwrap(), view(77.0).data_bytes().unwrap());
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named_with_the_mend() {
        let folder = tempfile::tempdir().unwrap();
        let missing = write_png(&folder.path().join("no/round.png"), &view(1.0)).unwrap_err();
        assert!(missing.to_string().contains("no/round.png") && missing.to_string().contains("mkdir"));
        assert!(matches!(write_png(folder.path(), &view(1.0)), Err(PictureError::Unwritable { .. })));
        if Path::new("/dev/full").exists() {
            let full = write_png(Path::new("/dev/full"), &view(1.0)).unwrap_err();
            assert!(matches!(full, PictureError::DiskFull(_)), "{full}");
        }
    }
}
