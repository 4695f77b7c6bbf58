//! The confusion matrix, as a table of text and as a drawing.

use std::fmt::Write;
use std::path::Path;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Evaluation, Vocabulary};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::error::DrawError;
use crate::file::{check, write};
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

fn svg(evaluation: &Evaluation, vocabulary: &Vocabulary) -> Result<String, Box<dyn std::error::Error>> {
    let side = MARGIN + CELL * vocabulary.classes() as i32 + 20;
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (side as u32, side as u32)).into_drawing_area();
        area.fill(&WHITE)?;
        let style = |size: i32, colour: RGBColor, horizontal: HPos| {
            ("sans-serif", size).into_font().color(&colour).pos(Pos::new(horizontal, VPos::Center))
        };
        let accuracy = evaluation.accuracy().map_or(0.0, |p| p.value);
        let title = format!("{} images, accuracy {accuracy:.3}", evaluation.count());
        area.draw_text(&title, &style(18, BLACK, HPos::Left), (20, 24))?;
        area.draw_text("truth ↓  judged →", &style(13, BLACK, HPos::Left), (20, 50))?;
        for (i, label) in (0..).zip(vocabulary.labels()) {
            let middle = MARGIN + CELL * i + CELL / 2;
            let short: String = label.chars().take(12).collect();
            area.draw_text(&short, &style(14, BLACK, HPos::Right), (MARGIN - 10, middle))?;
            area.draw_text(&short, &style(14, BLACK, HPos::Center), (middle, MARGIN - 16))?;
        }
        for (i, row) in (0..).zip(evaluation.confusion()) {
            let total: u64 = row.iter().sum();
            for (j, &count) in (0..).zip(row) {
                let part = if total == 0 { 0.0 } else { count as f64 / total as f64 };
                let (x, y) = (MARGIN + CELL * j, MARGIN + CELL * i);
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
                    area.draw_text(&count.to_string(), &style(14, ink, HPos::Center), centre)?;
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
