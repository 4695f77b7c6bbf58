//! What was measured, run by run, in a file that survives an interruption.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::ExperimentError;
use super::ledger::Ledger;
use super::standing::Standing;

/// Names a run: line, value, seed.
pub type Run = (String, String, u64);

/// A round of a run, as a row of `results.csv`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    line: String,
    value: String,
    seed: u64,
    round: u32,
    single: f64,
    swarm: f64,
    majority: f64,
    published_bytes: f64,
    link_bytes: f64,
    samples: f64,
    questions: f64,
    labels: f64,
    heeded_honest: f64,
    heeded_liars: f64,
    least_heeded: f64,
    certified: f64,
    unknown: f64,
}

/// `results.csv`: all rounds of each run that ended.
#[derive(Debug)]
pub struct Results {
    ledger: Ledger,
    /// The standings of each run, from before the first round on.
    pub runs: BTreeMap<Run, Vec<Standing>>,
}

impl Results {
    /// Opens or begins the results in `folder`. Of what is there, those runs are kept that have as many rounds as
    /// `rounds` says.
    ///
    /// # Errors
    /// [`ExperimentError::Read`], [`ExperimentError::Write`], or [`ExperimentError::Table`] for a file of another layout.
    pub fn open(folder: &Path, rounds: impl Fn(&Run) -> Option<u32>) -> Result<Self, ExperimentError> {
        let mut runs: BTreeMap<Run, Vec<Standing>> = BTreeMap::new();
        let keep = |all: Vec<Row>| {
            for row in all {
                let (run, standing) = taken_apart(row);
                runs.entry(run).or_default().push(standing);
            }
            runs.retain(|run, standings| {
                let numbered = standings.iter().map(|standing| standing.round);
                rounds(run).is_some_and(|rounds| numbered.eq(0..=rounds))
            });
            rows(&runs)
        };
        let (ledger, _) = Ledger::open(folder, keep)?;
        Ok(Self { ledger, runs })
    }

    /// Writes down a run that has ended.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn add(&mut self, run: Run, standings: Vec<Standing>) -> Result<(), ExperimentError> {
        let rows: Vec<Row> = standings.iter().map(|standing| row(&run, standing)).collect();
        self.ledger.add(&rows)?;
        self.runs.insert(run, standings);
        Ok(())
    }

    /// Puts the runs into order, whichever ended first, and gives them back.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn finish(self) -> Result<BTreeMap<Run, Vec<Standing>>, ExperimentError> {
        self.ledger.finish(&rows(&self.runs))?;
        Ok(self.runs)
    }
}

fn rows(runs: &BTreeMap<Run, Vec<Standing>>) -> Vec<Row> {
    let of_run = |(run, standings): (&Run, &Vec<Standing>)| -> Vec<Row> {
        standings.iter().map(|standing| row(run, standing)).collect()
    };
    runs.iter().flat_map(of_run).collect()
}

fn row((line, value, seed): &Run, standing: &Standing) -> Row {
    Row {
        line: line.clone(),
        value: value.clone(),
        seed: *seed,
        round: standing.round,
        single: standing.single,
        swarm: standing.swarm,
        majority: standing.majority,
        published_bytes: standing.published,
        link_bytes: standing.on_links,
        samples: standing.samples,
        questions: standing.questions,
        labels: standing.labels,
        heeded_honest: standing.heeded_honest,
        heeded_liars: standing.heeded_liars,
        least_heeded: standing.least_heeded,
        certified: standing.certified,
        unknown: standing.unknown,
    }
}

fn taken_apart(row: Row) -> (Run, Standing) {
    let standing = Standing {
        round: row.round,
        single: row.single,
        swarm: row.swarm,
        majority: row.majority,
        published: row.published_bytes,
        on_links: row.link_bytes,
        samples: row.samples,
        questions: row.questions,
        labels: row.labels,
        heeded_honest: row.heeded_honest,
        heeded_liars: row.heeded_liars,
        least_heeded: row.least_heeded,
        certified: row.certified,
        unknown: row.unknown,
    };
    ((row.line, row.value, row.seed), standing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standings(rounds: u32) -> Vec<Standing> {
        let standing = |round| Standing {
            round,
            single: 1.0 / 3.0,
            swarm: 0.5,
            majority: 0.75,
            published: 10.5,
            on_links: 20.0,
            samples: 3.0,
            questions: 1.0,
            labels: 1.0,
            heeded_honest: 1.0,
            heeded_liars: 1.0,
            least_heeded: 1.0,
            certified: 0.0,
            unknown: 0.2,
        };
        (0..=rounds).map(standing).collect()
    }

    fn run(seed: u64) -> Run {
        ("a, \"b\"".to_owned(), "0.5".to_owned(), seed)
    }

    #[test]
    fn runs_are_read_as_they_were_and_what_was_cut_short_is_run_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        let mut results = Results::open(folder.path(), |_| Some(2)).unwrap();
        results.add(run(0), standings(2)).unwrap();
        results.add(run(1), standings(2)).unwrap();
        let whole = std::fs::read_to_string(&path).unwrap();
        // In the midst of the second run.
        for cut in [1, 10, 80, 100] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let mut again = Results::open(folder.path(), |_| Some(2)).unwrap();
            assert_eq!(again.runs, [(run(0), standings(2))].into(), "{cut}");
            again.add(run(1), standings(2)).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
        }
        let other_rounds = Results::open(folder.path(), |_| Some(3)).unwrap();
        assert!(other_rounds.runs.is_empty());
    }

    #[test]
    fn the_file_does_not_tell_which_run_ended_first() {
        let written = |order: [u64; 3]| {
            let folder = tempfile::tempdir().unwrap();
            let mut results = Results::open(folder.path(), |_| Some(2)).unwrap();
            order.into_iter().for_each(|seed| results.add(run(seed), standings(2)).unwrap());
            results.finish().unwrap();
            std::fs::read(folder.path().join("results.csv")).unwrap()
        };
        assert_eq!(written([0, 1, 2]), written([2, 0, 1]));
    }
}
