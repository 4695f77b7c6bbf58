//! What a swarm makes of a change that nobody told it of, and whether the share of what it takes for unknown tells.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::plan::{Cell, Experiment};
use super::results::Run;
use super::setting::Drift;
use super::split::Split;
use super::standing::Standing;
use crate::emulation::Mean;

type Measure = fn(&Standing) -> f64;
type Written<'a> = &'a dyn Fn(Mean) -> String;

/// So many of the last rounds before the change are compared with the first one after it.
const BEFORE: usize = 5;

/// The rounds of one run around its change, or around its middle where nothing changes.
struct Around<'a> {
    before: &'a [Standing],
    after: &'a Standing,
    end: &'a Standing,
}

impl<'a> Around<'a> {
    fn of(run: &'a [Standing]) -> Option<Self> {
        let end = run.last()?;
        let change = usize::try_from(end.round / 2).ok()?;
        // Before the first round nobody may be able to tell.
        let before = run.get(change.checked_sub(BEFORE)? + 1..=change)?;
        Some(Self { before, after: run.get(change + 1)?, end })
    }

    fn highest_before(&self) -> f64 {
        self.before.iter().map(|standing| standing.unknown).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// The table of what changes half-way, where something does in any of the cells; nothing elsewhere.
#[must_use]
pub fn drift(
    experiment: &Experiment,
    cells: &[Cell],
    runs: &BTreeMap<Run, Vec<Standing>>,
    (seeds, split): (u32, &Split),
) -> Option<String> {
    if cells.iter().all(|cell| cell.setting.drift == Drift::None) {
        return None;
    }
    let mut text = "\n## A change half-way, and whether it is noticed\n\n".to_owned();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "| {} | unknown, before | after | end | single, before | after | end | alarm after | alarm before | AUROC |",
        experiment.axis.name
    );
    let _ = writeln!(text, "|{}", "---|".repeat(10));
    for cell in cells {
        let around: Vec<Around<'_>> = cell.runs(runs, seeds).into_values().filter_map(Around::of).collect();
        let _ = write!(text, "| {} ", cell.name());
        let percent = |mean: Mean| mean.percent_of(split.judged());
        let columns: [(Measure, Written<'_>); 2] = [(|it| it.unknown, &nats), (|it| it.single, &percent)];
        for (measure, written) in columns {
            let before = |it: &Around<'_>| it.before.iter().map(measure).sum::<f64>() / BEFORE as f64;
            let _ = write!(
                text,
                "| {} | {} | {} ",
                written(mean(around.iter().map(before))),
                written(mean(around.iter().map(|it| measure(it.after)))),
                written(mean(around.iter().map(|it| measure(it.end)))),
            );
        }
        let alarms: Vec<(bool, f64)> = (0..around.len()).filter_map(|n| alarm(&around, n)).collect();
        let after = alarms.iter().map(|(after, _)| f64::from(u8::from(*after)));
        let before = alarms.iter().map(|(_, before)| *before);
        // The rounds before a change follow each other: a seed has one alarm, or a part of one.
        let [after, before] = [mean(after), mean(before)].map(|alarms| alarms.percent_of(1));
        let _ = writeln!(text, "| {after} | {before} | {} |", auroc(&around));
    }
    let _ = writeln!(
        text,
        "\n`unknown`: the logarithm of the odds that single robots give that a held-out hand shows nothing they were taught, in nats; `before`: after the last {BEFORE} rounds before the change, asked of hands as \
         they were; `after`: after the first round after it, and `end`: after the last, asked of hands as they are then. `alarm`: it is more than it ever was in these {BEFORE} rounds of any \
         other seed; `alarm after`: in which part of the seeds, `alarm before`: in which part of these {BEFORE} rounds, all of them false. AUROC: how often a round after the change has more of it than one \
         before, of all seeds. Where nothing changes the same is said of the middle of the run. Accuracies and alarms in percent, all with 95 % intervals \
         (±: Student's t; brackets: Wilson's with Student's t). Held-out hands are {}.",
        split.describe()
    );
    Some(text)
}

/// Whether there is an alarm after the change of that seed, and in which part of the rounds before it: by what the others were before theirs.
fn alarm(around: &[Around<'_>], n: usize) -> Option<(bool, f64)> {
    let others = around.iter().enumerate().filter(|(other, _)| *other != n);
    let bound = others.map(|(_, it)| it.highest_before()).reduce(f64::max)?;
    let this = &around[n];
    let false_ones = this.before.iter().filter(|standing| standing.unknown > bound).count();
    Some((this.after.unknown > bound, false_ones as f64 / BEFORE as f64))
}

/// The area under the curve of hits against false alarms (Mann and Whitney's U), of rounds after and before the change.
fn auroc(around: &[Around<'_>]) -> String {
    let before = || around.iter().flat_map(|it| it.before).map(|standing| standing.unknown);
    let (mut above, mut pairs) = (0.0, 0.0);
    for after in around.iter().map(|it| it.after.unknown) {
        for before in before() {
            pairs += 1.0;
            above += if after > before { 1.0 } else { 0.5 * f64::from(u8::from(after == before)) };
        }
    }
    if pairs > 0.0 { format!("{:.3}", above / pairs) } else { "–".to_owned() }
}

fn mean(values: impl Iterator<Item = f64>) -> Mean {
    Mean::of(&values.collect::<Vec<_>>())
}

fn nats(mean: Mean) -> String {
    mean.decimals(2)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn split() -> Split {
        Split { held_out: [vec![0; 60], vec![0; 60]], ..Split::default() }
    }

    /// A run of twenty rounds in which so much is unknown up to the middle, and after it.
    fn run(before: f64, after: f64) -> Vec<Standing> {
        let unknown = |round| if round > 10 { after } else { before };
        (0..=20).map(|round| Standing { round, unknown: unknown(round), ..Standing::default() }).collect()
    }

    fn table(of_changed: impl Fn(u64) -> Vec<Standing>, seeds: u64) -> Option<String> {
        let text = "{ title: 't', base: { rounds: 20 }, axis: { name: 'change', values: [
            { name: 'light', set: { drift: 'light' } }, { name: 'nothing', set: {} } ] } }";
        let experiment = Experiment::parse(text, Path::new("test")).unwrap();
        let mut runs = BTreeMap::new();
        for seed in 0..seeds {
            runs.insert((String::new(), "light".to_owned(), seed), of_changed(seed));
            runs.insert((String::new(), "nothing".to_owned(), seed), run(0.1, 0.1));
        }
        drift(&experiment, &experiment.cells().unwrap(), &runs, (u32::try_from(seeds).unwrap(), &split()))
    }

    #[test]
    fn there_is_an_alarm_where_more_is_unknown_than_in_any_other_seed_before() {
        let table =
            table(|seed| run([0.1, 0.2][seed as usize % 2], [0.15, 0.6][seed as usize % 2]), 4).unwrap();
        let row = |name: &str| -> Vec<String> {
            let line = table.lines().find(|line| line.starts_with(&format!("| {name} "))).unwrap();
            line.split('|').map(|cell| cell.trim().to_owned()).collect()
        };
        let light = row("light");
        assert!(light[2].starts_with("0.15 ±") && light[3].starts_with("0.3"), "{light:?}");
        // Two of four are above .2; nothing is before. 1 of 2 × (.15 against .1 and .2), and 1 (.6 against both).
        assert!(
            light[8].starts_with("50.0 [") && light[9].starts_with("0.0 [0.0, 7") && light[10] == "0.750",
            "{light:?}"
        );
        let nothing = row("nothing");
        assert!(nothing[8].starts_with("0.0 [0.0, 7") && nothing[10] == "0.500", "{nothing:?}");
    }

    #[test]
    fn a_seed_that_was_always_high_is_a_false_alarm() {
        let table = table(|seed| run(if seed == 0 { 0.3 } else { 0.1 }, 0.2), 4).unwrap();
        let light: Vec<&str> = table
            .lines()
            .find(|line| line.starts_with("| light "))
            .unwrap()
            .split('|')
            .map(str::trim)
            .collect();
        // Of the three others the bound is the high one's .3; of that one it is .1.
        assert!(light[8].starts_with("25.0 [") && light[9].starts_with("25.0 ["), "{light:?}");
    }

    #[test]
    fn where_nothing_changes_there_is_no_table() {
        let text =
            "{ title: 't', base: { rounds: 1 }, axis: { name: 'x', values: [ { name: 'a', set: {} } ] } }";
        let experiment = Experiment::parse(text, Path::new("test")).unwrap();
        assert_eq!(drift(&experiment, &experiment.cells().unwrap(), &BTreeMap::new(), (1, &split())), None);
    }
}
