//! What was measured, seed by seed, in a file that survives an interruption.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::outcome::Outcome;
use super::plan::Recognition;
use crate::experiment::error::ExperimentError;
use crate::experiment::ledger::Ledger;

/// A swarm of a seed, as a row of `results.csv`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    /// The swarm's place in the plan, from 1.
    swarm: usize,
    line: String,
    robots: usize,
    made_of: String,
    seed: u64,
    right: f64,
    wrong: f64,
    undecided: f64,
    frames_right: Option<f64>,
    decided_s: Option<f64>,
}

/// `results.csv`: the outcomes of all swarms of each seed that ended.
#[derive(Debug)]
pub struct RecognitionResults {
    ledger: Ledger,
    /// The outcomes of each seed, in the order of the plan.
    pub runs: BTreeMap<u64, Vec<Outcome>>,
    rows: BTreeMap<u64, Vec<Row>>,
}

impl RecognitionResults {
    /// Opens or begins the results in `folder`. Of what is there, those seeds are kept that have all swarms of the plan.
    ///
    /// # Errors
    /// [`ExperimentError::Read`], [`ExperimentError::Write`], or [`ExperimentError::Table`] for a file of another layout.
    pub fn open(folder: &Path, plan: &Recognition) -> Result<Self, ExperimentError> {
        let mut rows: BTreeMap<u64, Vec<Row>> = BTreeMap::new();
        let keep = |all: Vec<Row>| {
            all.into_iter().for_each(|row| rows.entry(row.seed).or_default().push(row));
            rows.retain(|_, rows| rows.iter().map(|row| row.swarm).eq(1..=plan.swarms.len()));
            rows.values().flatten().cloned().collect()
        };
        let (ledger, _) = Ledger::open(folder, keep)?;
        let runs = rows.iter().map(|(seed, rows)| (*seed, rows.iter().map(outcome).collect())).collect();
        Ok(Self { ledger, runs, rows })
    }

    /// Writes down a seed that has ended.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn add(
        &mut self,
        plan: &Recognition,
        seed: u64,
        outcomes: Vec<Outcome>,
    ) -> Result<(), ExperimentError> {
        let rows: Vec<Row> = (1..)
            .zip(plan.swarms.iter().zip(&outcomes))
            .map(|(swarm, (of, outcome))| Row {
                swarm,
                line: of.line.clone(),
                robots: of.size(),
                made_of: of.describe(),
                seed,
                right: outcome.right,
                wrong: outcome.wrong,
                undecided: outcome.undecided,
                frames_right: outcome.frames_right,
                decided_s: outcome.decided_s,
            })
            .collect();
        self.ledger.add(&rows)?;
        self.rows.insert(seed, rows);
        self.runs.insert(seed, outcomes);
        Ok(())
    }

    /// Puts the seeds into order, whichever ended first, and gives them back.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn finish(self) -> Result<BTreeMap<u64, Vec<Outcome>>, ExperimentError> {
        let rows: Vec<Row> = self.rows.into_values().flatten().collect();
        self.ledger.finish(&rows)?;
        Ok(self.runs)
    }
}

fn outcome(row: &Row) -> Outcome {
    let Row { right, wrong, undecided, frames_right, decided_s, .. } = *row;
    Outcome { right, wrong, undecided, frames_right, decided_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_read_as_they_were_and_half_a_seed_is_run_again() {
        let text = "{ title: 't', swarms: [
            { line: 'Foot-bots, \"old\"', robots: [{ camera: 'footbot', count: 10 }] },
            { line: 'mixed', robots: [{ camera: 'footbot', count: 4 }, { camera: 'parrot', count: 2 }] } ] }";
        let plan = Recognition::parse(text, Path::new("test")).unwrap();
        let outcome = |right, decided_s: Option<f64>| Outcome {
            right,
            wrong: 0.25,
            undecided: 0.75 - right,
            frames_right: decided_s.map(|_| 1.0 / 3.0),
            decided_s,
        };
        let outcomes = vec![outcome(0.0, None), outcome(0.5, Some(0.7))];
        let folder = tempfile::tempdir().unwrap();
        let mut results = RecognitionResults::open(folder.path(), &plan).unwrap();
        results.add(&plan, 1, outcomes.clone()).unwrap();
        results.add(&plan, 0, outcomes.clone()).unwrap();
        let all = [(0, outcomes.clone()), (1, outcomes.clone())].into();
        assert_eq!(RecognitionResults::open(folder.path(), &plan).unwrap().runs, all);

        let path = folder.path().join("results.csv");
        let whole = std::fs::read_to_string(&path).unwrap();
        let without_last_row = &whole[..whole.trim_end().rfind('\n').unwrap() + 1];
        std::fs::write(&path, without_last_row).unwrap();
        assert_eq!(RecognitionResults::open(folder.path(), &plan).unwrap().runs.len(), 1);
    }
}
