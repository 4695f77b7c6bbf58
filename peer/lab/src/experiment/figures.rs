//! What an experiment shows: accuracy against rounds, bytes and whatever was varied.

use super::chart::{Figure, Line, MOST_LINES, Panel};
use super::plan::Cell;
use super::summary::{Curves, Summary};
use crate::emulation::Mean;

type Measure = fn(&Curves) -> &Vec<Mean>;

/// What the panels of a figure show.
const PANELS: [(&str, Measure); 2] = [
    ("accuracy of one robot, %", |curves| &curves.single),
    ("accuracy of the swarm, %", |curves| &curves.swarm),
];

/// The figures of an experiment, by their names.
#[must_use]
pub fn figures(summary: &Summary) -> Vec<(&'static str, Figure)> {
    // To Rust `inf` and `nan` are numbers; a name may be one.
    let number = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
    let numbers: Option<Vec<f64>> = summary.cells.iter().map(|(cell, _)| number(&cell.value)).collect();
    let last = |means: &[Mean]| means.last().copied().unwrap_or(Mean::of(&[]));
    let kilobytes = |means: &[Mean]| last(means).mean / 1000.0;
    let figure = |x: &str, panels| Figure {
        title: summary.title.clone(),
        x: x.to_owned(),
        marks: None,
        logarithmic: false,
        panels,
    };
    let bytes = "samples published per robot, kB";
    let mut figures = Vec::new();

    // A cell a line, over the rounds.
    let name = |cell: &Cell| {
        let value = format!("{} {}", summary.axis, cell.value);
        let value = if numbers.is_some() { value } else { cell.value.clone() };
        if summary.lines { format!("{}, {value}", cell.line) } else { value }
    };
    if summary.cells.len() <= MOST_LINES {
        let rounds = |measure: Measure, x: &dyn Fn(&Curves, usize) -> f64| -> Vec<Line> {
            let line = |(cell, curves): &(Cell, Curves)| Line {
                name: name(cell),
                points: measure(curves).iter().enumerate().map(|(n, mean)| (x(curves, n), *mean)).collect(),
            };
            summary.cells.iter().map(line).collect()
        };
        let panels = |x: &dyn Fn(&Curves, usize) -> f64| {
            PANELS.map(|(y, measure)| Panel { y, lines: rounds(measure, x) }).into()
        };
        figures.push(("rounds", figure("interaction rounds", panels(&|_, n| n as f64))));
        figures.push(("bytes", figure(bytes, panels(&|curves, n| curves.published[n].mean / 1000.0))));
    }

    // The end of each cell, over the values.
    if let Some(numbers) = numbers.filter(|_| summary.cells.len() > 1) {
        let mut names: Vec<&String> = summary.cells.iter().map(|(cell, _)| &cell.line).collect();
        names.dedup();
        let by = |measure: Measure, x: &dyn Fn(usize, &Curves) -> f64| -> Vec<Line> {
            let points = |line: &String| {
                let cells = summary.cells.iter().enumerate().filter(|(_, (cell, _))| cell.line == *line);
                cells.map(|(n, (_, curves))| (x(n, curves), last(measure(curves)))).collect()
            };
            names.iter().map(|line| Line { name: (*line).clone(), points: points(line) }).collect()
        };
        let panels = |x: &dyn Fn(usize, &Curves) -> f64| {
            PANELS.map(|(y, measure)| Panel { y, lines: by(measure, x) }).into()
        };
        let mut marks = numbers.clone();
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let wide = marks.first().is_some_and(|least| *least > 0.0 && marks.last() >= Some(&(10.0 * least)));
        let mut values = figure(&summary.axis, panels(&|n, _| numbers[n]));
        (values.marks, values.logarithmic) = (Some(marks), wide);
        figures.push(("values", values));
        if summary.cells.len() > MOST_LINES {
            figures.push(("bytes", figure(bytes, panels(&|_, curves| kilobytes(&curves.published)))));
        }
    }
    figures
}
