//! Means over seeds with their intervals: a table and figures.

use std::fmt::Write;

use super::outcome::Outcome;
use super::plan::{Recognition, SwarmPlan};
use crate::emulation::Mean;
use crate::experiment::chart::{Figure, Line, Panel};

/// A seed, and the outcome of each swarm.
pub type Run = (u64, Vec<Outcome>);

/// All that the experiment shows.
pub struct Summary {
    title: String,
    shown: String,
    /// How many gestures of each seed.
    showings: usize,
    rows: Vec<Row>,
}

struct Row {
    line: String,
    robots: usize,
    made_of: String,
    right: Mean,
    wrong: Mean,
    /// Over the seeds in which a robot found a hand.
    frames_right: Mean,
    undecided: Mean,
    /// Over the seeds that decided anything.
    decided_s: Mean,
    /// The difference to the first swarm, seed by seed.
    gain: Mean,
}

impl Summary {
    pub fn of(plan: &Recognition, runs: &[Run]) -> Self {
        let row = |(n, swarm): (usize, &SwarmPlan)| {
            let over = |measure: fn(&Outcome) -> f64| {
                Mean::of(&runs.iter().map(|(_, outcomes)| measure(&outcomes[n])).collect::<Vec<_>>())
            };
            let gains: Vec<f64> =
                runs.iter().map(|(_, outcomes)| outcomes[n].right - outcomes[0].right).collect();
            Row {
                line: swarm.line.clone(),
                robots: swarm.size(),
                made_of: swarm.describe(),
                right: over(|o| o.right),
                wrong: over(|o| o.wrong),
                frames_right: Mean::of(
                    &runs.iter().filter_map(|(_, o)| o[n].frames_right).collect::<Vec<_>>(),
                ),
                undecided: over(|o| o.undecided),
                decided_s: Mean::of(&runs.iter().filter_map(|(_, o)| o[n].decided_s).collect::<Vec<_>>()),
                gain: Mean::of(&gains),
            }
        };
        let shown = format!("{} seeds of {} gestures", runs.len(), plan.showings);
        let rows = plan.swarms.iter().enumerate().map(row).collect();
        Self { title: plan.title.clone(), shown, showings: plan.showings as usize, rows }
    }

    /// The table, with a word on how to read it.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# {}\n\n{}, drawn hands of people the classifier was not trained on. Means with 95 % intervals (brackets: Wilson's with \
             Student's t, of as many gestures as seeds show to be independent; ±: Student's t), in percent; `to the first`: the difference in `right` to the first row, seed by seed. `one frame right`: of the first frame that \
             each robot takes of each gesture; those in which it finds no hand are left out.\n\n\
             | swarm | made of | right | wrong | undecided | to the first | one frame right | decided after, s |\n|{}\n",
            self.title,
            self.shown,
            "---|".repeat(8)
        );
        for row in &self.rows {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} |",
                row.line,
                row.made_of,
                row.right.percent_of(self.showings),
                row.wrong.percent_of(self.showings),
                row.undecided.percent_of(self.showings),
                row.gain.points(),
                row.frames_right.percent_of(self.showings),
                row.decided_s.decimals(2),
            );
        }
        text
    }

    /// Decisions over the number of robots, a line each.
    pub fn figures(&self) -> Vec<(&'static str, Figure)> {
        let mut names: Vec<&String> = Vec::new();
        self.rows.iter().for_each(|row| {
            if !names.contains(&&row.line) {
                names.push(&row.line);
            }
        });
        let lines = |measure: fn(&Row) -> Mean| -> Vec<Line> {
            let points = |name: &String| {
                let mut points: Vec<(f64, Mean)> = self
                    .rows
                    .iter()
                    .filter(|row| row.line == *name)
                    .map(|row| (row.robots as f64, measure(row)))
                    .collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                points
            };
            names.iter().map(|name| Line { name: (*name).clone(), points: points(name) }).collect()
        };
        let mut marks: Vec<f64> = self.rows.iter().map(|row| row.robots as f64).collect();
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let figure = Figure {
            title: self.title.clone(),
            x: "robots".to_owned(),
            marks: Some(marks),
            logarithmic: false,
            trials: self.showings,
            panels: vec![
                Panel { y: "decided rightly, %", lines: lines(|row| row.right) },
                Panel { y: "decided wrongly, %", lines: lines(|row| row.wrong) },
            ],
        };
        vec![("robots", figure)]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn who_is_always_right_is_not_certain_and_who_sees_nothing_is_right_about_no_frame() {
        let text = "{ title: 't', showings: 12, swarms: [
            { line: 'near', robots: [{ camera: 'footbot', count: 2 }] },
            { line: 'far', robots: [{ camera: 'footbot', count: 2 }] } ] }";
        let plan = Recognition::parse(text, Path::new("test")).unwrap();
        let outcome = |right, frames_right, decided_s| Outcome {
            right,
            wrong: 0.0,
            undecided: 1.0 - right,
            frames_right,
            decided_s,
        };
        // In one of the seeds a robot far away found a hand, and was right.
        let far = |seed| outcome(0.0, (seed == 0).then_some(1.0), None);
        let runs: Vec<Run> =
            (0..20).map(|seed| (seed, vec![outcome(1.0, Some(0.5), Some(0.4)), far(seed)])).collect();
        let text = Summary::of(&plan, &runs).markdown();
        let row = |name: &str| text.lines().find(|line| line.starts_with(&format!("| {name} |"))).unwrap();
        let near = "| 100.0 [98.2, 100.0] | 0.0 [0.0, 1.8] | 0.0 [0.0, 1.8] | +0.0 in each | 50.0 [43.3, 56.7] | 0.40 ± 0.00 |";
        assert!(row("near").ends_with(near), "{text}");
        assert!(row("far").ends_with("| -100.0 in each | 100.0 | – |"), "{text}");
    }
}
