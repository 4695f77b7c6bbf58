//! `gestalt emulate`: a swarm in a seeded, emulated network; or an experiment with many of them.

use std::fs::File;
use std::io::{self, BufWriter};
#[cfg(feature = "opencv")]
use std::path::Path;
use std::path::PathBuf;

use thiserror::Error;

use super::{Failure, progress};
use gestalt_lab::emulation::{self, Scenario, ScenarioError, Table, Trace};
#[cfg(feature = "opencv")]
use gestalt_lab::experiment::recognition::{self, Recognition};
#[cfg(feature = "opencv")]
use gestalt_lab::experiment::{self, Experiment, Materials, Progress};

/// Run a scenario in the emulated network, over several seeds, under each fusion rule that it compares; or an
/// experiment: how well swarms learn, over settings and seeds, with tables and plots.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// A scenario (see configs/emulation/) or an experiment (see configs/experiments/), commented JSON5
    scenario: PathBuf,
    /// Where an experiment's results go; a second call continues what is there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Pictures that an experiment's robots see, one folder per gesture; rendered hands if not given
    #[arg(long, value_name = "DIR", requires = "out")]
    dataset: Option<PathBuf>,
    /// Pictures to train the model on that an experiment's robots may start from; rendered hands if not given
    #[arg(long, value_name = "DIR", requires = "out")]
    start_dataset: Option<PathBuf>,
    /// How many seeds, counted from 0; the file's own number if not given
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
    /// The experiment cannot be read.
    #[error("cannot read the experiment {}: {source}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A scenario where an experiment is wanted.
    #[error("{} is no experiment (it has neither an axis nor swarms): leave out --out, or see configs/experiments/", .0.display())]
    NoExperiment(PathBuf),
    /// An experiment without a place for its results.
    #[error("{} is an experiment: say with --out DIR where its results go", .0.display())]
    NoOut(PathBuf),
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
    #[cfg(feature = "opencv")]
    if let Some(folder) = &args.out {
        return conduct(args, folder);
    }
    #[cfg(not(feature = "opencv"))]
    if args.out.is_some() {
        return Err(
            "this gestalt was built without OpenCV, and experiments look at hands: build it with".into()
        );
    }
    #[cfg(feature = "opencv")]
    if std::fs::read_to_string(&args.scenario)
        .is_ok_and(|text| Experiment::is_one(&text) || Recognition::is_one(&text))
    {
        return Err(EmulateError::NoOut(args.scenario.clone()).into());
    }
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

#[cfg(feature = "opencv")]
fn conduct(args: &Args, folder: &Path) -> Result<(), Failure> {
    let path = &args.scenario;
    let text =
        std::fs::read_to_string(path).map_err(|source| EmulateError::Read { path: path.clone(), source })?;
    let (looking, running) = (progress::bar("looking", 0), progress::bar("runs", 0));
    let report = |progress| {
        let (bar, done, total) = match progress {
            Progress::Looked(done, total) => (&looking, done, total),
            Progress::Ran(done, total) => (&running, done, total),
        };
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    };
    let table = if Recognition::is_one(&text) {
        recognition::conduct((&text, path), folder, args.seeds, report)?
    } else if Experiment::is_one(&text) {
        let materials = Materials { dataset: args.dataset.clone(), start: args.start_dataset.clone() };
        experiment::conduct((&text, path), &materials, folder, args.seeds, report)?
    } else {
        return Err(EmulateError::NoExperiment(path.clone()).into());
    };
    looking.finish_and_clear();
    running.finish_and_clear();
    super::say(&table)
}
