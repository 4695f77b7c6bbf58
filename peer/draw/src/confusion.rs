//! The confusion matrix, as a table of text and as a drawing.

use std::fmt::Write;
use std::path::Path;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Evaluation, Vocabulary};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::error::DrawError;
use crate::file::{check, write};
use crate::text::{fitting, text_width};

/// A row per true gesture: how often it was judged to be which, its recall and its precision.
#[must_use]
pub fn table(evaluation: &Evaluation, vocabulary: &Vocabulary) -> String {
    let labels = vocabulary.labels();
    let width = |text: &str| text.chars().count();
    let counts = evaluation.confusion().iter().flatten().map(|count| width(&count.to_string()));
    let column = labels.iter().map(|label| width(label)).chain(counts).max().unwrap_or(1) + 1;
    let row_label = column.max(width("truth"));

    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(text, "  {:>row_label$} │", "truth");
    for label in labels {
        let _ = write!(text, "{label:>column$}");
    }
    let _ = writeln!(text, " │ recall precision");
    let _ = writeln!(
        text,
        "  {}┼{}┼{}",
        "─".repeat(row_label + 1),
        "─".repeat(column * labels.len() + 1),
        "─".repeat(17)
    );
    let part =
        |p: Option<gestalt_strategies::Proportion>| p.map_or("–".to_owned(), |p| format!("{:.3}", p.value));
    for ((class, label), row) in (0_u32..).zip(labels).zip(evaluation.confusion()) {
        let _ = write!(text, "  {label:>row_label$} │");
        for (answer, count) in row.iter().enumerate() {
            // Zeros off the diagonal are noise to the eye.
            let count =
                if *count == 0 && answer != class as usize { "·".to_owned() } else { count.to_string() };
            let _ = write!(text, "{count:>column$}");
        }
        let (recall, precision) = (evaluation.recall(ClassId(class)), evaluation.precision(ClassId(class)));
        let _ = writeln!(text, " │ {:>6} {:>9}", part(recall), part(precision));
    }
    text
}

/// Draws the matrix as an SVG or PNG file: rows are the truth, columns the answers, shades the part of the row.
///
/// # Errors
/// See [`DrawError`]; a path that cannot be is found before anything is drawn.
pub fn draw(evaluation: &Evaluation, vocabulary: &Vocabulary, path: &Path) -> Result<(), DrawError> {
    check(path)?;
    let svg = svg(evaluation, vocabulary).map_err(|cause| DrawError::Svg(cause.to_string()))?;
    write(&svg, path)
}

const CELL: i32 = 48;
const MARGIN: i32 = 110;

/// The size of letters in plotters' measure, and their height in pixels.
const LETTERS: f64 = 14.0;
const HEIGHT: f64 = LETTERS / 1.24;

/// What is left free beside a heading.
const GAP: i32 = 10;

/// A row's heading is no wider, in pixels.
const WIDEST: f64 = 300.0;

/// What stands beside the rows and above the columns.
struct Headings {
    rows: Vec<String>,
    columns: Vec<String>,
    /// Where the columns begin, to the right of the rows' headings.
    left: i32,
}

impl Headings {
    /// The gestures by name, or, where a name is wider than its column, by number, and the names beside the rows alone.
    fn of(labels: &[String]) -> Self {
        let fits = |label: &String| text_width(label, HEIGHT) <= f64::from(CELL - GAP / 2);
        let (rows, columns) = if labels.iter().all(fits) {
            (labels.to_vec(), labels.to_vec())
        } else {
            let numbered = |(number, label)| {
                (fitting(&format!("#{number} {label}"), HEIGHT, WIDEST), format!("#{number}"))
            };
            (1..).zip(labels).map(numbered).unzip()
        };
        let widest = rows.iter().map(|row| text_width(row, HEIGHT)).fold(0.0, f64::max);
        let left = MARGIN.max(widest.ceil() as i32 + 2 * GAP);
        Self { rows, columns, left }
    }
}

fn svg(evaluation: &Evaluation, vocabulary: &Vocabulary) -> Result<String, Box<dyn std::error::Error>> {
    let Headings { rows, columns, left } = Headings::of(vocabulary.labels());
    let side = CELL * vocabulary.classes() as i32 + 20;
    let mut text = String::new();
    {
        let size = ((left + side) as u32, (MARGIN + side) as u32);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE)?;
        let style = |size: f64, colour: RGBColor, horizontal: HPos| {
            ("sans-serif", size).into_font().color(&colour).pos(Pos::new(horizontal, VPos::Center))
        };
        let accuracy = evaluation.accuracy().map_or(0.0, |p| p.value);
        let title = format!("{} images, accuracy {accuracy:.3}", evaluation.count());
        area.draw_text(&title, &style(18.0, BLACK, HPos::Left), (20, 24))?;
        area.draw_text("truth ↓  judged →", &style(13.0, BLACK, HPos::Left), (20, 50))?;
        for (i, (row, column)) in (0..).zip(rows.iter().zip(&columns)) {
            let middle = CELL * i + CELL / 2;
            area.draw_text(row, &style(LETTERS, BLACK, HPos::Right), (left - GAP, MARGIN + middle))?;
            area.draw_text(column, &style(LETTERS, BLACK, HPos::Center), (left + middle, MARGIN - 16))?;
        }
        for (i, row) in (0..).zip(evaluation.confusion()) {
            let total: u64 = row.iter().sum();
            for (j, &count) in (0..).zip(row) {
                let part = if total == 0 { 0.0 } else { count as f64 / total as f64 };
                let (x, y) = (left + CELL * j, MARGIN + CELL * i);
                // Right answers in blue, wrong ones in red, both darker with their part of the row.
                let full = if i == j { (31, 78, 140) } else { (190, 40, 40) };
                let mix = |c: u8| (255.0 - (255.0 - f64::from(c)) * part.sqrt()) as u8;
                let shade = RGBColor(mix(full.0), mix(full.1), mix(full.2));
                let cell = [(x, y), (x + CELL - 1, y + CELL - 1)];
                area.draw(&Rectangle::new(cell, shade.filled()))?;
                area.draw(&Rectangle::new(cell, RGBColor(220, 220, 220)))?;
                if count > 0 {
                    let ink = if part > 0.3 { WHITE } else { BLACK };
                    let centre = (x + CELL / 2, y + CELL / 2);
                    area.draw_text(&count.to_string(), &style(LETTERS, ink, HPos::Center), centre)?;
                }
            }
        }
        area.present()?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluation() -> (Evaluation, Vocabulary) {
        let mut evaluation = Evaluation::new(3);
        for _ in 0..12 {
            evaluation.record(ClassId(0), &[0.9, 0.1, 0.0]);
        }
        evaluation.record(ClassId(0), &[0.0, 0.2, 0.8]);
        evaluation.record(ClassId(1), &[0.0, 1.0, 0.0]);
        (evaluation, Vocabulary::new(["fist", "palm", "one"]).unwrap())
    }

    #[test]
    fn the_table_can_be_read_off() {
        let (evaluation, vocabulary) = evaluation();
        let expected = "  truth │ fist palm  one │ recall precision\n\
                        \u{20} ──────┼────────────────┼─────────────────\n\
                        \u{20}  fist │   12    ·    1 │  0.923     1.000\n\
                        \u{20}  palm │    ·    1    · │  1.000     1.000\n\
                        \u{20}   one │    ·    ·    0 │      –     0.000\n";
        assert_eq!(table(&evaluation, &vocabulary), expected);
    }

    #[test]
    fn each_gesture_has_headings_of_its_own_that_have_room() {
        // Alike for longer than anything that is written.
        let [left, right] = ["left", "right"].map(|hand| format!("{}{hand}", "on and ".repeat(14)));
        for labels in [
            ["0", "1", "2"],
            ["fist", "palm", "thumb_index_middle"],
            ["thumb_and_index_apart", "thumb_and_index_together", "1"],
            ["三三三三三三三三三三三三一", "三三三三三三三三三三三三二", "三"],
            [left.as_str(), right.as_str(), "1"],
        ] {
            let labels = labels.map(str::to_owned);
            let Headings { rows, columns, left } = Headings::of(&labels);
            for headings in [&rows, &columns] {
                let different: std::collections::BTreeSet<_> = headings.iter().collect();
                assert_eq!(different.len(), labels.len(), "{headings:?}");
            }
            assert!(rows.iter().all(|row| text_width(row, HEIGHT) <= f64::from(left - 2 * GAP)), "{rows:?}");
            assert!(columns.iter().all(|head| text_width(head, HEIGHT) < f64::from(CELL)), "{columns:?}");
            assert!((MARGIN..=WIDEST as i32 + 2 * GAP).contains(&left), "{left}");
            // What is short stays whole.
            let whole = |(row, label): (&String, &String)| label.len() > 50 || row.ends_with(label.as_str());
            assert!(rows.iter().zip(&labels).all(whole), "{rows:?}");
        }
    }

    #[test]
    fn the_drawing_holds_every_label_and_count() {
        let (evaluation, vocabulary) = evaluation();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("matrix.svg");
        draw(&evaluation, &vocabulary, &path).unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        for text in ["fist", "palm", "one", "\n12\n", "accuracy 0.929"] {
            assert!(svg.contains(text), "{text} is missing in {svg}");
        }
        let wrong = draw(&evaluation, &vocabulary, &folder.path().join("matrix.bmp"));
        assert!(matches!(wrong, Err(DrawError::Name(_))));
        let nowhere = draw(&evaluation, &vocabulary, &folder.path().join("missing/matrix.svg"));
        assert!(matches!(nowhere, Err(DrawError::NoFolder(_))));
    }
}
