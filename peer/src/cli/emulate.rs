//! `gestalt emulate`: a swarm in a seeded, emulated network.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::PathBuf;

use thiserror::Error;

use super::{Failure, progress};
use crate::emulation::{self, Scenario, ScenarioError, Table, Trace};

/// Run a scenario in the emulated network, over several seeds, under each fusion rule that it compares.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// The scenario, commented JSON5; see configs/emulation/
    scenario: PathBuf,
    /// How many seeds, counted from 0; the scenario's own number if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seeds: Option<u32>,
    /// One JSON object per fusion rule on stdout, in place of the table
    #[arg(long)]
    json: bool,
    /// Write all that happens with seed 0 to this file, one JSON object a line
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

/// Why an emulation gave no result.
#[derive(Debug, Error)]
pub enum EmulateError {
    /// The scenario cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The trace cannot be written.
    #[error("cannot write the trace {path}: {source}")]
    Trace {
        /// Where to.
        path: String,
        /// Why not.
        source: io::Error,
    },
}

/// Carries out `gestalt emulate`.
///
/// # Errors
/// See [`EmulateError`]; and when stdout is closed to the results.
pub fn run(args: &Args) -> Result<(), Failure> {
    let scenario = Scenario::load(&args.scenario)?;
    if let Some(path) = &args.trace {
        let failed = |source| EmulateError::Trace { path: path.display().to_string(), source };
        let mut file = BufWriter::new(File::create(path).map_err(failed)?);
        let (_, written) = emulation::run_traced(&scenario, 0, Trace::to(&mut file))?;
        written.map_err(failed)?;
    }

    let seeds = args.seeds.unwrap_or(scenario.seeds);
    let runs = seeds as usize * scenario.compare.len().max(1);
    let progress = progress::bar("runs", runs);
    let summaries = emulation::compare(&scenario, seeds, || progress.inc(1))?;
    progress.finish_and_clear();

    if args.json {
        for summary in &summaries {
            super::say(&format!("{}\n", serde_json::to_string(summary)?))?;
        }
        Ok(())
    } else {
        super::say(&Table(&summaries).to_string())
    }
}
