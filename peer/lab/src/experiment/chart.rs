//! Charts: mean lines with 95 % bands, as SVG and PNG.

use std::path::Path;

use gestalt_draw::DrawError;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::emulation::Mean;

/// Colours that people who see colours differently tell apart (Okabe & Ito 2008), the yellow left out;
/// beside them grey and a dark violet.
const PALETTE: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(130, 130, 130),
    RGBColor(94, 22, 110),
];

/// The most lines that a plot is readable with.
pub const MOST_LINES: usize = 9;

const WIDTH: u32 = 1040;
const PANEL_HEIGHT: u32 = 430;
const LEGEND_ROW: u32 = 24;

/// A figure: panels side by side, with one legend.
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// What runs along the x axis.
    pub x: String,
    /// Where the x axis has its marks, if not anywhere.
    pub marks: Option<Vec<f64>>,
    /// Whether x grows by factors.
    pub logarithmic: bool,
    /// How many trials each share is of, in each seed.
    pub trials: usize,
    /// Side by side.
    pub panels: Vec<Panel>,
}

/// Lines over one pair of axes.
pub struct Panel {
    /// What runs along the y axis.
    pub y: &'static str,
    /// At most nine.
    pub lines: Vec<Line>,
}

/// A line of means over x.
pub struct Line {
    /// For the legend.
    pub name: String,
    /// In the order of x; shares, drawn in percent.
    pub points: Vec<(f64, Mean)>,
}

/// Draws figures into a folder, each as SVG and PNG of its name.
///
/// # Errors
/// See [`DrawError`].
pub fn draw_into(folder: &Path, figures: &[(&str, Figure)]) -> Result<(), DrawError> {
    for (name, figure) in figures {
        let svg = svg(figure).map_err(|cause| DrawError::Svg(cause.to_string()))?;
        for kind in ["svg", "png"] {
            gestalt_draw::write(&svg, &folder.join(format!("{name}.{kind}")))?;
        }
    }
    Ok(())
}

impl Figure {
    fn names(&self) -> Vec<&str> {
        let lines = self.panels.first().map_or(&[][..], |panel| &panel.lines);
        let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
        if names == [""] { Vec::new() } else { names }
    }

    /// The names in rows, each with where it begins.
    fn legend(&self) -> Vec<Vec<(u32, usize)>> {
        let (mut rows, mut x) = (vec![Vec::new()], 70);
        for (n, name) in self.names().into_iter().enumerate() {
            let width = 58 + 8 * name.chars().count() as u32;
            if x + width > WIDTH && x > 70 {
                rows.push(Vec::new());
                x = 70;
            }
            rows.last_mut().expect("there is a first row").push((x, n));
            x += width;
        }
        rows
    }

    fn size(&self) -> (u32, u32) {
        (WIDTH, PANEL_HEIGHT + 50 + LEGEND_ROW * self.legend().len() as u32)
    }

    /// Where x lies on paper.
    fn place(&self, x: f64) -> f64 {
        if self.logarithmic { x.log10() } else { x }
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

fn svg(figure: &Figure) -> Result<String, DrawingAreaErrorKind<std::io::Error>> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, figure.size()).into_drawing_area(), figure)?;
    Ok(text)
}

fn draw(area: &Area<'_>, figure: &Figure) -> Drawn {
    area.fill(&WHITE)?;
    let style = |size: u32| ("sans-serif", size).into_font().color(&BLACK);
    let middle = Pos::new(HPos::Center, VPos::Center);
    area.draw_text(&figure.title, &style(20).pos(middle), (WIDTH as i32 / 2, 22))?;

    let (panels, legend) = area.margin(44, 0, 4, 14).split_vertically(PANEL_HEIGHT);
    for (part, panel) in panels.split_evenly((1, figure.panels.len())).iter().zip(&figure.panels) {
        draw_panel(part, figure, panel)?;
    }
    let beside = Pos::new(HPos::Left, VPos::Center);
    let names = figure.names();
    for (row, entries) in (0..).zip(figure.legend()) {
        for (x, n) in entries {
            let (x, y) = (x as i32, 12 + LEGEND_ROW as i32 * row);
            legend.draw(&PathElement::new(vec![(x, y), (x + 34, y)], colour(n).stroke_width(3)))?;
            match n % 3 {
                0 => legend.draw(&Circle::new((x + 17, y), 5, colour(n).filled()))?,
                1 => legend.draw(&TriangleMarker::new((x + 17, y), 6, colour(n).filled()))?,
                _ => legend.draw(&Rectangle::new([(x + 13, y - 4), (x + 21, y + 4)], colour(n).filled()))?,
            }
            legend.draw_text(names[n], &style(15).pos(beside), (x + 42, y))?;
        }
    }
    area.present()
}

fn colour(n: usize) -> RGBColor {
    PALETTE[n % PALETTE.len()]
}

fn draw_panel(area: &Area<'_>, figure: &Figure, panel: &Panel) -> Drawn {
    let all = || panel.lines.iter().flat_map(|line| &line.points);
    let xs = all().map(|(x, _)| figure.place(*x));
    let (left, right) = xs.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
    let margin = if right > left { 0.03 * (right - left) } else { 0.5 };
    let interval = |mean: &Mean| mean.interval_of(figure.trials);
    let lowest = all().map(|(_, mean)| interval(mean).0).fold(1.0, f64::min);
    let floor = ((10.0 * lowest.max(0.0)).floor() * 10.0).min(90.0);
    let marks = match &figure.marks {
        Some(marks) => marks.iter().map(|x| figure.place(*x)).collect(),
        None => round_numbers(left, right),
    };
    let range = Marked { range: left - margin..right + margin, marks };
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(54)
        .y_label_area_size(62)
        .build_cartesian_2d(range, floor..100.5)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .axis_style(RGBColor(90, 90, 90))
        .x_desc(figure.x.as_str())
        .y_desc(panel.y)
        .axis_desc_style(("sans-serif", 17))
        .label_style(("sans-serif", 15))
        .x_label_formatter(&|x| number(if figure.logarithmic { 10_f64.powf(*x) } else { *x }))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .draw()?;
    let percent = |value: f64| 100.0 * value.clamp(0.0, 1.0);
    for (n, line) in panel.lines.iter().enumerate() {
        let upper = line.points.iter().map(|(x, mean)| (figure.place(*x), percent(interval(mean).1)));
        let lower = line.points.iter().map(|(x, mean)| (figure.place(*x), percent(interval(mean).0)));
        let band: Vec<(f64, f64)> = upper.chain(lower.rev()).map(|(x, y)| (x, y.max(floor))).collect();
        chart.draw_series([Polygon::new(band, colour(n).mix(0.16))])?;
    }
    for (n, line) in panel.lines.iter().enumerate() {
        let points = || line.points.iter().map(|(x, mean)| (figure.place(*x), percent(mean.mean)));
        chart.draw_series(LineSeries::new(points(), colour(n).stroke_width(2)))?;
        let ink = colour(n).filled();
        match n % 3 {
            0 => drop(chart.draw_series(points().map(|point| Circle::new(point, 3, ink)))?),
            1 => drop(chart.draw_series(points().map(|point| TriangleMarker::new(point, 4, ink)))?),
            _ => drop(chart.draw_series(
                points().map(|point| EmptyElement::at(point) + Rectangle::new([(-3, -3), (3, 3)], ink)),
            )?),
        }
    }
    Ok(())
}

/// A range with marks at places of our own choice.
struct Marked {
    range: std::ops::Range<f64>,
    marks: Vec<f64>,
}

impl Ranged for Marked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let part = (value - self.range.start) / (self.range.end - self.range.start);
        low + (part * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.marks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range.clone()
    }
}

/// Round numbers over a range, about eight.
fn round_numbers(low: f64, high: f64) -> Vec<f64> {
    let step = (high - low).max(1e-9) / 8.0;
    let unit = 10_f64.powf(step.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|n| n * unit).into_iter().find(|s| *s >= step).unwrap_or(unit);
    let first = (low / step).ceil() as i64;
    (first..=(high / step + 1e-9).floor() as i64).map(|n| n as f64 * step).collect()
}

/// A number as short as it can be written.
fn number(x: f64) -> String {
    let text = format!("{x:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let line = |name: &str, slope: f64| Line {
            name: name.to_owned(),
            points: (0..5)
                .map(|n| (f64::from(n), Mean { n: 20, mean: 0.5 + slope * f64::from(n), half_width: 0.05 }))
                .collect(),
        };
        let lines = || vec![line("alone", 0.02), line("together", 0.1)];
        Figure {
            title: "A test".to_owned(),
            x: "interaction rounds".to_owned(),
            marks: None,
            logarithmic: false,
            trials: 60,
            panels: vec![Panel { y: "one", lines: lines() }, Panel { y: "swarm", lines: lines() }],
        }
    }

    #[test]
    fn a_drawing_names_its_axes_and_lines() {
        let text = svg(&figure()).unwrap();
        for part in
            ["A test", "interaction rounds", "swarm", "alone", "together", "#0072B2", "#D55E00", "polygon"]
        {
            assert!(text.contains(part), "{part}");
        }
    }

    #[test]
    fn where_all_seeds_agree_a_band_has_a_width() {
        let line = |_| Line {
            name: String::new(),
            points: vec![(0.0, Mean::of(&[1.0; 20])), (1.0, Mean::of(&[1.0; 20]))],
        };
        let panels = [0, 1].map(|n| Panel { y: "one", lines: vec![line(n)] }).into();
        let text = svg(&Figure { panels, ..figure() }).unwrap();
        let bands: Vec<&str> = text.lines().filter(|line| line.starts_with("<polygon")).collect();
        assert_eq!(bands.len(), 2);
        for band in bands {
            let points = band.split_once("points=\"").unwrap().1;
            let heights: std::collections::BTreeSet<&str> = points
                .split_once('"')
                .unwrap()
                .0
                .split_whitespace()
                .map(|point| point.split_once(',').unwrap().1)
                .collect();
            assert_eq!(heights.len(), 2, "{band}");
        }
    }

    #[test]
    fn marks_are_round() {
        assert_eq!(round_numbers(0.0, 12.0), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0]);
        assert_eq!(number(0.5), "0.5");
        assert_eq!(number(100.0), "100");
    }
}
