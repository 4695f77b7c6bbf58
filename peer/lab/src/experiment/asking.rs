//! What it takes to teach a swarm that asks: how many answers, and how often it asks.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::plan::{Cell, Experiment};
use super::results::Run;
use super::standing::Standing;
use crate::emulation::{Feedback, Mean};

/// Accuracies that are to be reached.
const MILESTONES: [f64; 2] = [0.80, 0.90];

/// So many rounds in a row must be that good.
const IN_A_ROW: usize = 3;

type Measure = fn(&Standing) -> f64;

/// Whose accuracies.
const WHOSE: [(&str, Measure); 2] =
    [("swarm", |standing| standing.swarm), ("single robot", |standing| standing.single)];

/// The table of labels and questions, where in any of the cells the instructor speaks when asked; nothing elsewhere.
#[must_use]
pub fn asking(
    experiment: &Experiment,
    cells: &[Cell],
    runs: &BTreeMap<Run, Vec<Standing>>,
    (seeds, judged): (u32, usize),
) -> Option<String> {
    let asked = cells.iter().any(|cell| cell.setting.feedback == Feedback::Asked);
    if !asked {
        return None;
    }
    let runs_of = |cell: &Cell| cell.runs(runs, seeds);
    let mut text = "\n## Labels and questions\n\n".to_owned();
    // Writing to a string cannot fail.
    let _ =
        write!(text, "| {} | labels in all | swarm, end | single, end | to the first ", experiment.axis.name);
    for (whose, _) in WHOSE {
        for milestone in MILESTONES {
            let _ = write!(text, "| labels to {:.0} %, {whose} | of the first's ", 100.0 * milestone);
        }
    }
    let _ = writeln!(text, "| questions per round, by thirds of the rounds |");
    let _ = writeln!(text, "|{}", "---|".repeat(6 + 2 * WHOSE.len() * MILESTONES.len()));
    for cell in cells {
        let firsts = cells.iter().find(|first| first.line == cell.line).map(runs_of).unwrap_or_default();
        let of_cell = runs_of(cell);
        let last = |measure: Measure| {
            Mean::of(&of_cell.values().filter_map(|run| run.last()).map(measure).collect::<Vec<_>>())
        };
        let pairs = of_cell.iter().filter_map(|(seed, run)| Some((run.last()?, firsts.get(seed)?.last()?)));
        let gain = Mean::of(&pairs.map(|(run, first)| run.swarm - first.swarm).collect::<Vec<_>>());
        let name = cell.name();
        let _ = write!(
            text,
            "| {name} | {:.1} | {} | {} | {} ",
            last(|standing| standing.labels).mean,
            last(|standing| standing.swarm).percent_of(judged),
            last(|standing| standing.single).percent_of(judged),
            gain.points(),
        );
        for (_, measure) in WHOSE {
            for milestone in MILESTONES {
                let needed = |run: &[Standing]| labels_to(run, measure, milestone);
                let own: Vec<f64> = of_cell.values().filter_map(|run| needed(run)).collect();
                let ratio = of_cell.iter().filter_map(|(seed, run)| {
                    let (own, first) = (needed(run)?, needed(firsts.get(seed)?)?);
                    (own > 0.0 && first > 0.0).then(|| (own / first).ln())
                });
                let _ = write!(
                    text,
                    "| {} | {} ",
                    reached(&own, of_cell.len()),
                    factor(&ratio.collect::<Vec<_>>())
                );
            }
        }
        let thirds = thirds(of_cell.values().copied());
        let _ = writeln!(text, "| {} |", thirds.map(|rate| format!("{rate:.2}")).join(", "));
    }
    let _ = writeln!(
        text,
        "\n`labels`: answers of the instructor. `to`: given when the accuracy on held-out hands had first been that high after {IN_A_ROW} rounds in a row, over the \
         seeds in which it was; how many of all is said beside it. `of the first's`: the geometric mean of the ratio to the first row of its line, seed by seed, where both \
         reached it and needed labels for it. Means with 95 % intervals (±: Student's t; brackets of accuracies: Wilson's with Student's t)."
    );
    Some(text)
}

/// How many labels were given when the measure had first been so high for [`IN_A_ROW`] rounds.
fn labels_to(run: &[Standing], measure: Measure, milestone: f64) -> Option<f64> {
    let row = run.windows(IN_A_ROW).find(|row| row.iter().all(|standing| measure(standing) >= milestone))?;
    row.first().map(|standing| standing.labels)
}

/// The mean, and in how many of the seeds.
fn reached(labels: &[f64], seeds: usize) -> String {
    match labels {
        [] => format!("– (0 of {seeds})"),
        _ => {
            format!("{} ({} of {seeds})", Mean::of(labels).decimals(1), labels.len())
        }
    }
}

/// The geometric mean of ratios, with its interval, from their logarithms.
fn factor(logarithms: &[f64]) -> String {
    if logarithms.len() < 2 {
        return "–".to_owned();
    }
    let mean = Mean::of(logarithms);
    let [low, high] = [-mean.half_width, mean.half_width].map(|by| (mean.mean + by).exp());
    format!("{:.2} [{low:.2}, {high:.2}] of {}", mean.mean.exp(), logarithms.len())
}

/// Questions per round, in each third of the rounds.
fn thirds<'a>(runs: impl Iterator<Item = &'a [Standing]>) -> [f64; 3] {
    let (mut rates, mut seeds) = ([0.0; 3], 0.0);
    for run in runs {
        let rounds = run.len().saturating_sub(1);
        seeds += 1.0;
        for (third, rate) in rates.iter_mut().enumerate() {
            let [from, to] = [third * rounds / 3, (third + 1) * rounds / 3];
            if let (Some(before), Some(after)) = (run.get(from), run.get(to))
                && to > from
            {
                *rate += (after.questions - before.questions) / (to - from) as f64;
            }
        }
    }
    rates.map(|rate| if seeds > 0.0 { rate / seeds } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A run in which a label is given every `every` rounds, each worth so much.
    fn run(rounds: u32, every: u32, worth: f64) -> Vec<Standing> {
        let standing = |round| {
            let labels = f64::from(round / every);
            let single = (labels * worth).min(1.0);
            Standing { round, single, swarm: single, questions: labels, labels, ..Standing::default() }
        };
        (0..=rounds).map(standing).collect()
    }

    #[test]
    fn labels_are_counted_until_it_stays_that_good_for_three_rounds() {
        let measure: Measure = |standing| standing.swarm;
        assert_eq!(labels_to(&run(30, 3, 0.1), measure, 0.85), Some(9.0));
        assert_eq!(labels_to(&run(20, 3, 0.1), measure, 0.85), None);
        let mut lucky = run(30, 3, 0.1);
        lucky[3].swarm = 0.95;
        assert_eq!(labels_to(&lucky, measure, 0.85), Some(9.0), "once is luck");
    }

    #[test]
    fn rows_are_compared_seed_by_seed_where_both_reached_it() {
        let text = "{ title: 't', base: { rounds: 60, feedback: 'asked' }, axis: { name: 'x', values: [
            { name: 'a', set: { 'answering.asked_by': 'random' } }, { name: 'b', set: {} } ] } }";
        let experiment = Experiment::parse(text, Path::new("test")).unwrap();
        let mut runs = BTreeMap::new();
        for (seed, worth) in [(0, 0.0625), (1, 0.125), (2, 0.01)] {
            runs.insert((String::new(), "a".to_owned(), seed), run(60, 3, worth));
            runs.insert((String::new(), "b".to_owned(), seed), run(60, 4, 2.0 * worth));
        }
        let table = asking(&experiment, &experiment.cells().unwrap(), &runs, (3, 60)).unwrap();
        let row = table.lines().find(|line| line.starts_with("| b ")).unwrap();
        // 8 and 4 labels against 15 and 8 for .90.
        let ratio = ((8.0f64 / 15.0).ln() + (4.0f64 / 8.0).ln()) / 2.0;
        assert!(row.contains(&format!("{:.2} [", ratio.exp())) && row.contains("of 2"), "{table}");
        assert!(row.contains("(2 of 3)") && row.ends_with("| 0.25, 0.25, 0.25 |"), "{table}");
    }

    #[test]
    fn where_nobody_is_asked_there_is_no_table() {
        let text =
            "{ title: 't', base: { rounds: 1 }, axis: { name: 'x', values: [ { name: 'a', set: {} } ] } }";
        let experiment = Experiment::parse(text, Path::new("test")).unwrap();
        assert_eq!(asking(&experiment, &experiment.cells().unwrap(), &BTreeMap::new(), (1, 60)), None);
    }
}
