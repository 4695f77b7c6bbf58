//! The panels, side by side, with their key.

use std::error::Error;

use gestalt_protocol::ClassId;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Panel, Point};

/// The plane is drawn from −this to +this along both axes.
pub(super) const EXTENT: f32 = 3.2;

const SIDE: i32 = 300;
const GAP: i32 = 28;
const CAPTION: i32 = 52;
const HEAD: i32 = 104;

const INK: RGBColor = RGBColor(33, 37, 41);
const PALE_INK: RGBColor = RGBColor(108, 117, 125);
const FRAME: RGBColor = RGBColor(222, 226, 230);
const PAPER: RGBColor = RGBColor(250, 250, 252);
/// A blue and an orange that are told apart by every eye (Okabe & Ito 2008).
const COLOURS: [RGBColor; 2] = [RGBColor(0, 114, 178), RGBColor(213, 94, 0)];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

/// How a point looks.
#[derive(Clone, Copy)]
enum Look {
    /// Filled; 1 is full colour.
    Solid(f64),
    /// An outline on white.
    Hollow,
}

/// Marks, and what they mean.
type Key<'a> = (&'a [(ClassId, Look)], &'a str);

/// A row of panels or several, under one key.
struct Sheet<'a> {
    title: &'a str,
    columns: usize,
    key: &'a [Key<'a>],
    /// What becomes of the picks, and how they look.
    picked: (&'a str, Look),
    points: &'a [Point],
    /// How the other points look.
    look: &'a dyn Fn(usize) -> Look,
}

/// What is shared: personal samples are solid, those the swarm knows are hollow.
pub(super) fn selection(points: &[Point], panels: &[Panel]) -> Result<String, Box<dyn Error>> {
    const PERSONAL: Look = Look::Solid(0.55);
    let sheet = Sheet {
        title: "What each selection rule shares, in its order",
        columns: 3,
        key: &[
            (&[(ClassId(0), PERSONAL), (ClassId(1), PERSONAL)], "two gestures, personal"),
            (&[(ClassId(0), Look::Hollow), (ClassId(1), Look::Hollow)], "known to the swarm"),
        ],
        picked: ("shared", Look::Solid(1.0)),
        points,
        look: &|i| if points[i].common { Look::Hollow } else { PERSONAL },
    };
    sheet.draw(panels)
}

/// What is forgotten: the older a sample, the paler.
pub(super) fn forgetting(points: &[Point], panels: &[Panel]) -> Result<String, Box<dyn Error>> {
    let ages = [0.15, 0.45, 0.75].map(|age| (ClassId(0), Look::Solid(age)));
    let sheet = Sheet {
        title: "What each forgetting rule lets go while more samples come than fit, in its order",
        columns: 4,
        key: &[
            (&[(ClassId(0), Look::Solid(0.75)), (ClassId(1), Look::Solid(0.75))], "two gestures"),
            (&ages, "from the oldest to the newest"),
        ],
        picked: ("forgotten", Look::Hollow),
        points,
        look: &|i| Look::Solid(0.15 + 0.6 * i as f64 / points.len() as f64),
    };
    sheet.draw(panels)
}

impl Sheet<'_> {
    fn draw(&self, panels: &[Panel]) -> Result<String, Box<dyn Error>> {
        let rows = panels.len().div_ceil(self.columns);
        let width = GAP + (SIDE + GAP) * self.columns as i32;
        let height = HEAD + (CAPTION + SIDE + GAP) * rows as i32;
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, (width as u32, height as u32)).into_drawing_area();
            area.fill(&WHITE)?;
            self.draw_head(&area)?;
            for (i, panel) in panels.iter().enumerate() {
                let left = GAP + (SIDE + GAP) * (i % self.columns) as i32;
                let top = HEAD + (CAPTION + SIDE + GAP) * (i / self.columns) as i32;
                words(&area, panel.title, 19, INK, HPos::Left, (left, top + 10))?;
                words(&area, &panel.caption, 14, PALE_INK, HPos::Left, (left, top + 34))?;
                self.draw_plane(&area, (left, top + CAPTION), panel)?;
            }
            area.present()?;
        }
        Ok(text)
    }

    fn draw_head(&self, area: &Area<'_>) -> Drawn {
        words(area, self.title, 22, INK, HPos::Left, (GAP, 34))?;
        let mut x = GAP + 8;
        for (marks, meaning) in self.key {
            for (class, look) in *marks {
                mark(area, (x, 72), *class, *look, 6)?;
                x += 18;
            }
            words(area, meaning, 15, INK, HPos::Left, (x, 72))?;
            x += 8 * meaning.chars().count() as i32 + 24;
        }
        let (meaning, look) = self.picked;
        numbered(area, (x + 4, 72), ClassId(0), look, 1)?;
        words(area, meaning, 15, INK, HPos::Left, (x + 22, 72))
    }

    fn draw_plane(&self, area: &Area<'_>, (left, top): (i32, i32), panel: &Panel) -> Drawn {
        let corners = [(left, top), (left + SIDE, top + SIDE)];
        area.draw(&Rectangle::new(corners, PAPER.filled()))?;
        area.draw(&Rectangle::new(corners, FRAME))?;
        let pixel = |at: [f32; 2]| {
            let along = |x: f32| ((x + EXTENT) / (2.0 * EXTENT) * SIDE as f32).round() as i32;
            (left + along(at[0]), top + SIDE - along(at[1]))
        };
        for ends in &panel.boundary {
            area.draw(&PathElement::new(ends.map(pixel).to_vec(), PALE_INK.stroke_width(1)))?;
        }
        for (i, point) in self.points.iter().enumerate().filter(|(i, _)| !panel.picks.contains(i)) {
            mark(area, pixel(point.at), point.class, (self.look)(i), 5)?;
        }
        for (from, to) in &panel.ties {
            let ends = [*from, *to].map(|i| pixel(self.points[i].at)).to_vec();
            area.draw(&PathElement::new(ends, INK.mix(0.6).stroke_width(1)))?;
        }
        for (at, class) in &panel.means {
            let (x, y) = pixel(*at);
            let colour = COLOURS[class.index() % 2];
            for (colour, width, arm) in [(WHITE, 6, 19), (colour, 3, 18)] {
                area.draw(&PathElement::new(vec![(x - arm, y), (x + arm, y)], colour.stroke_width(width)))?;
                area.draw(&PathElement::new(vec![(x, y - arm), (x, y + arm)], colour.stroke_width(width)))?;
            }
        }
        for (number, picked) in (1..).zip(&panel.picks) {
            let point = &self.points[*picked];
            numbered(area, pixel(point.at), point.class, self.picked.1, number)?;
        }
        Ok(())
    }
}

/// A circle for one class, a square for the other.
fn mark(area: &Area<'_>, (x, y): (i32, i32), class: ClassId, look: Look, size: i32) -> Drawn {
    let colour = COLOURS[class.index() % 2];
    // Opaque, so that what lies below does not change its shade.
    let shade = |part: f64| {
        let mix = |c: u8| (255.0 - (255.0 - f64::from(c)) * part).round() as u8;
        RGBColor(mix(colour.0), mix(colour.1), mix(colour.2))
    };
    let styles = match look {
        Look::Solid(part) => [shade(part).filled(), shade((part + 0.25).min(1.0)).stroke_width(1)],
        Look::Hollow => [WHITE.filled(), colour.stroke_width(2)],
    };
    for style in styles {
        if class == ClassId(0) {
            area.draw(&Circle::new((x, y), size, style))?;
        } else {
            area.draw(&Rectangle::new([(x - size + 1, y - size + 1), (x + size - 1, y + size - 1)], style))?;
        }
    }
    Ok(())
}

/// A ringed mark with a number in it.
fn numbered(area: &Area<'_>, at: (i32, i32), class: ClassId, look: Look, number: u32) -> Drawn {
    area.draw(&Circle::new(at, 11, WHITE.filled()))?;
    area.draw(&Circle::new(at, 11, INK.stroke_width(1)))?;
    mark(area, at, class, look, 8)?;
    let ink = match look {
        Look::Solid(_) => WHITE,
        Look::Hollow => INK,
    };
    words(area, &number.to_string(), 12, ink, HPos::Center, at)
}

fn words(
    area: &Area<'_>,
    text: &str,
    size: i32,
    colour: RGBColor,
    horizontal: HPos,
    at: (i32, i32),
) -> Drawn {
    let style = ("sans-serif", size).into_font().color(&colour).pos(Pos::new(horizontal, VPos::Center));
    Ok(area.draw_text(text, &style, at)?)
}
