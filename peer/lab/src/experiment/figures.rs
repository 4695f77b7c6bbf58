//! What an experiment shows: accuracy against rounds, bytes and whatever was varied.

use super::chart::{Figure, Line, MOST_LINES, Panel};
use super::plan::Cell;
use super::setting::Start;
use super::summary::{Curves, Summary};
use crate::emulation::Mean;

type Measure = fn(&Curves) -> &Vec<Mean>;

/// What the panels of a figure show.
const PANELS: [(&str, Measure); 2] = [
    ("accuracy of one robot, %", |curves| &curves.single),
    ("accuracy of the swarm, %", |curves| &curves.swarm),
];

/// The figures of an experiment, by their names. `judged`: how many hands are judged in each seed.
#[must_use]
pub fn figures(summary: &Summary, judged: usize) -> Vec<(&'static str, Figure)> {
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
        trials: judged,
        panels,
    };
    let bytes = "samples published per robot, kB";
    let mut figures = Vec::new();

    // Who knows nothing guesses, and that is not measured.
    let measured = |cell: &Cell, n: usize, mean: Mean| {
        if n == 0 && cell.setting.start == Start::Nothing { Mean::of(&[mean.mean]) } else { mean }
    };

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
                points: measure(curves)
                    .iter()
                    .enumerate()
                    .map(|(n, mean)| (x(curves, n), measured(cell, n, *mean)))
                    .collect(),
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
                let mut points: Vec<(f64, Mean)> =
                    cells.map(|(n, (_, curves))| (x(n, curves), last(measure(curves)))).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                points
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::super::plan::Experiment;
    use super::super::standing::Standing;
    use super::*;

    /// Each value is a number, and the more it is the less is published.
    fn shown(values: &[u32]) -> Vec<(&'static str, Figure)> {
        let named: Vec<String> =
            values.iter().map(|value| format!("{{ name: '{value}', set: {{}} }}")).collect();
        let text = format!(
            "{{ title: 't', base: {{ rounds: 1 }}, axis: {{ name: 'x', values: [{}] }} }}",
            named.join(", ")
        );
        let experiment = Experiment::parse(&text, Path::new("test")).unwrap();
        let cells = experiment.cells().unwrap();
        let mut runs = BTreeMap::new();
        for (cell, value) in cells.iter().zip(values) {
            let standing = |round| Standing {
                round,
                published: f64::from(round * 1000) / f64::from(*value),
                ..Standing::default()
            };
            for seed in 0..2 {
                runs.insert(cell.run(seed), vec![standing(0), standing(1)]);
            }
        }
        figures(&Summary::of(&experiment, &cells, &runs, 2), 60)
    }

    #[test]
    fn lines_run_along_x_whatever_the_order_in_the_file() {
        for (values, names) in [
            (&[10, 1, 5][..], &["rounds", "bytes", "values"][..]),
            (&[10, 1, 5, 2, 9, 3, 8, 4, 7, 6], &["values", "bytes"]),
        ] {
            let figures = shown(values);
            assert_eq!(figures.iter().map(|(name, _)| *name).collect::<Vec<_>>(), names);
            for (name, figure) in figures {
                for line in figure.panels.iter().flat_map(|panel| &panel.lines) {
                    let xs: Vec<f64> = line.points.iter().map(|(x, _)| *x).collect();
                    assert!(xs.len() > 1 && xs.is_sorted_by(|one, next| one < next), "{name}: {xs:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_guessed_before_anything_was_taught_has_no_interval() {
        let rounds = shown(&[1, 2]).remove(0).1;
        let line = &rounds.panels[0].lines[0].points;
        assert_eq!(line.iter().map(|(_, mean)| mean.n).collect::<Vec<_>>(), [1, 2]);
    }
}
