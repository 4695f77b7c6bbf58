//! Means over seeds with their intervals, and a table of them.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::materials::Materials;
use super::plan::{Cell, Experiment, MOST_PLACES};
use super::pool::Pool;
use super::results::Run;
use super::setting::Start;
use super::split::Split;
use super::standing::Standing;
use super::trial::{ALL_EXAMINED, EXAMINED};
use crate::emulation::Mean;

/// Accuracies that a single robot is to reach.
const MILESTONES: [f64; 2] = [0.85, 0.90];

/// All that an experiment shows.
#[derive(Debug)]
pub struct Summary {
    /// The question.
    pub title: String,
    /// What the values are of.
    pub axis: String,
    /// Whether there are several lines.
    pub lines: bool,
    /// How many seeds.
    pub seeds: usize,
    /// Each cell with its curves.
    pub cells: Vec<(Cell, Curves)>,
}

/// The mean of each measure after each round.
#[derive(Clone, Debug)]
pub struct Curves {
    /// Accuracy of single robots.
    pub single: Vec<Mean>,
    /// Accuracy of the swarm.
    pub swarm: Vec<Mean>,
    /// Accuracy of the swarm by majority.
    pub majority: Vec<Mean>,
    /// Bytes of samples published per robot.
    pub published: Vec<Mean>,
    /// Bytes of samples on the links of a robot.
    pub on_links: Vec<Mean>,
    /// Samples held per robot.
    pub samples: Vec<Mean>,
    /// What single robots judge rightly, whatever the liars had said.
    pub certified: Vec<Mean>,
    /// The accuracy of a single robot, averaged over all rounds but the start.
    pub over_rounds: Mean,
    /// By how much it is above that of the first cell, seed by seed.
    pub gain_over_rounds: Mean,
    /// The same after the last round.
    pub gain_at_the_end: Mean,
}

impl Summary {
    /// Puts the runs of these cells together, seeds 0 up to `seeds`.
    #[must_use]
    pub fn of(
        experiment: &Experiment,
        cells: &[Cell],
        runs: &BTreeMap<Run, Vec<Standing>>,
        seeds: u32,
    ) -> Self {
        let first = cells.first().map(|cell| cell.runs(runs, seeds)).unwrap_or_default();
        let curves = |cell: &Cell| {
            let of_cell = cell.runs(runs, seeds);
            let over = |measure: &dyn Fn(&Standing) -> f64| -> Vec<Mean> {
                (0..=cell.setting.rounds as usize)
                    .map(|round| {
                        Mean::of(&of_cell.values().map(|run| measure(&run[round])).collect::<Vec<_>>())
                    })
                    .collect()
            };
            let last = |run: &[Standing]| run.last().map_or(0.0, |standing| standing.single);
            let paired = |measure: &dyn Fn(&[Standing]) -> f64| {
                let pairs = of_cell.iter().filter_map(|(seed, run)| Some((*run, *first.get(seed)?)));
                Mean::of(&pairs.map(|(run, first)| measure(run) - measure(first)).collect::<Vec<_>>())
            };
            Curves {
                single: over(&|s| s.single),
                swarm: over(&|s| s.swarm),
                majority: over(&|s| s.majority),
                published: over(&|s| s.published),
                on_links: over(&|s| s.on_links),
                samples: over(&|s| s.samples),
                certified: over(&|s| s.certified),
                over_rounds: Mean::of(&of_cell.values().map(|run| over_rounds(run)).collect::<Vec<_>>()),
                gain_over_rounds: paired(&over_rounds),
                gain_at_the_end: paired(&last),
            }
        };
        Self {
            title: experiment.title.clone(),
            axis: experiment.axis.name.clone(),
            lines: experiment.lines.is_some(),
            seeds: seeds as usize,
            cells: cells.iter().map(|cell| (cell.clone(), curves(cell))).collect(),
        }
    }

    /// The table, with a word on how to read it.
    #[must_use]
    pub fn markdown(&self, pool: &Pool, materials: &Materials, split: &Split) -> String {
        let mut text = format!("# {}\n\n", self.title);
        let percent = |mean: Mean| mean.percent_of(split.judged());
        // Who knows nothing guesses, and that is not measured.
        let start = |cell: &Cell, mean: Mean| match cell.setting.start {
            Start::Nothing => format!("{:.1}", 100.0 * mean.mean),
            Start::Model | Start::Shipped => percent(mean),
        };
        let hands = materials.dataset.as_ref().map_or("rendered hands".to_owned(), |folder| {
            format!("pictures of {}", folder.file_name().unwrap_or_default().to_string_lossy())
        });
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{} seeds; {hands}, gestures {}; a hand is found in {:.1} % of the views. Means with 95 % intervals \
             (±: Student's t; brackets: Wilson's with Student's t, of as many of the {} hands judged in each seed as seeds show to be independent), \
             accuracies in percent on {}.\n",
            self.seeds,
            pool.gestures.join(" "),
            100.0 * pool.found(),
            split.judged(),
            split.describe(),
        );
        let [low, high] = MILESTONES.map(|milestone| format!("{:.0} %", 100.0 * milestone));
        let line = if self.lines { "line | " } else { "" };
        let _ = writeln!(
            text,
            "| {line}{} | single, start | single, end | swarm, end | majority, end | single, mean of rounds | \
             to the first: end | mean of rounds | rounds to {low} | to {high} | published, B per robot | on links, B per robot | \
             samples held |",
            self.axis,
        );
        let _ = writeln!(text, "|{}", "---|".repeat(13 + usize::from(self.lines)));
        for (cell, curves) in &self.cells {
            let last = |means: &[Mean]| means.last().copied().unwrap_or(Mean::of(&[]));
            let [low, high] =
                MILESTONES.map(|m| rounds_to(&curves.single, m).map_or("–".to_owned(), |n| n.to_string()));
            let line = if self.lines { format!("{} | ", cell.line) } else { String::new() };
            let _ = writeln!(
                text,
                "| {line}{} | {} | {} | {} | {} | {} | {} | {} | {low} | {high} | {} | {} | {} |",
                cell.value,
                start(cell, curves.single.first().copied().unwrap_or(Mean::of(&[]))),
                percent(last(&curves.single)),
                percent(last(&curves.swarm)),
                percent(last(&curves.majority)),
                percent(curves.over_rounds),
                Mean::points(curves.gain_at_the_end),
                Mean::points(curves.gain_over_rounds),
                last(&curves.published).decimals(0),
                last(&curves.on_links).decimals(0),
                last(&curves.samples).decimals(0),
            );
        }
        text.push_str(
            "\n`single`: each robot judges what it sees; `swarm`: the logarithmic pool of all robots' views of one moment. \
             Views in which a robot finds no hand are left out of both. `to the first`: the difference to the first row for single robots, seed by seed. `rounds to`: the first round \
             after which the mean of single robots is that high, and stays so. `published`: samples as their author says \
             them, once; `on links`: with what robots relay and tell for repair.\n",
        );
        if self.cells.iter().any(|(cell, _)| cell.setting.robots > ALL_EXAMINED) {
            let _ = writeln!(
                text,
                "\nOf more than {ALL_EXAMINED} robots, {EXAMINED} drawn by the seed are examined, the same after each round; bytes and samples are \
                 those of all."
            );
        }
        let robots = self.cells.iter().map(|(cell, _)| cell.setting.robots).max().unwrap_or(0);
        text.push_str(&crowded(robots, pool.places).unwrap_or_default());
        self.write_certified(&mut text, split);
        text
    }

    /// Of robots that learn from groups of authors apart: what is certain.
    fn write_certified(&self, text: &mut String, split: &Split) {
        for (cell, curves) in self.cells.iter().filter(|(cell, _)| cell.setting.learning.learner.groups > 0) {
            let last = curves.certified.last().copied().unwrap_or(Mean::of(&[]));
            let line = if self.lines { format!("{}, ", cell.line) } else { String::new() };
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "\n{line}{}: at the end single robots judge {} % rightly, whatever {} had said.",
                cell.value,
                last.percent_of(split.judged()),
                match cell.setting.liars {
                    0 | 1 => "any one other robot".to_owned(),
                    liars => format!("any {liars} others"),
                },
            );
        }
    }
}

/// That some robots see the same, where there are more of them than places.
fn crowded(robots: usize, places: usize) -> Option<String> {
    (robots > places).then(|| {
        format!(
            "\n**Up to {robots} robots stand at {places} places**: who stand at one place are taught and judged by the same views, so with more robots than places nothing \
             more is seen. For a place each set `hands.places`, and for pictures `photographs.places`, to {} in the experiment's file.\n",
            robots.min(MOST_PLACES)
        )
    })
}

/// The accuracy of single robots, averaged over the rounds.
fn over_rounds(run: &[Standing]) -> f64 {
    let rounds = run.len().saturating_sub(1).max(1) as f64;
    run.iter().skip(1).map(|standing| standing.single).sum::<f64>() / rounds
}

/// The first round from which on the mean is at least `milestone`.
#[must_use]
pub fn rounds_to(curve: &[Mean], milestone: f64) -> Option<usize> {
    let below = curve.iter().rposition(|mean| mean.mean < milestone);
    let first = below.map_or(0, |below| below + 1);
    (first < curve.len()).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_milestone_is_reached_when_it_is_not_lost_again() {
        let curve = |values: &[f64]| values.iter().map(|v| Mean::of(&[*v])).collect::<Vec<_>>();
        assert_eq!(rounds_to(&curve(&[0.1, 0.9, 0.8, 0.9, 0.95]), 0.85), Some(3));
        assert_eq!(rounds_to(&curve(&[0.9, 0.9]), 0.85), Some(0));
        assert_eq!(rounds_to(&curve(&[0.9, 0.8]), 0.85), None);
    }

    #[test]
    fn more_robots_than_places_are_warned_of() {
        assert_eq!(crowded(24, 24), None);
        assert!(
            crowded(100, 24)
                .unwrap()
                .contains("`hands.places`, and for pictures `photographs.places`, to 100")
        );
    }

    #[test]
    fn differences_are_taken_seed_by_seed() {
        let text = "{ title: 't', base: { rounds: 1 }, axis: { name: 'x', values: [
            { name: 'a', set: {} }, { name: 'b', set: {} } ] } }";
        let experiment = Experiment::parse(text, std::path::Path::new("test")).unwrap();
        let standing =
            |round, single| Standing { round, single, swarm: 1.0, majority: 1.0, ..Standing::default() };
        let mut runs = BTreeMap::new();
        for (seed, ease) in [(0, 0.2), (1, 0.6)] {
            for (value, skill) in [("a", 0.0), ("b", 0.1)] {
                let run = vec![standing(0, 0.0), standing(1, ease + skill)];
                runs.insert((String::new(), value.to_owned(), seed), run);
            }
        }
        let summary = Summary::of(&experiment, &experiment.cells().unwrap(), &runs, 2);
        let (_, b) = &summary.cells[1];
        assert!((b.gain_at_the_end.mean - 0.1).abs() < 1e-12 && b.gain_at_the_end.half_width < 1e-9);
        assert!(b.single[1].half_width > 1.0, "the seeds themselves differ much");
    }
}
