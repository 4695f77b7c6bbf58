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

/// Run a scenario in an emulated network, over several seeds, under each fusion rule that it compares; or an experiment:
/// how well swarms learn or recognise, over settings and seeds, with tables and plots
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt emulate configs/emulation/fusion.json5 --seeds 20
  gestalt emulate configs/experiments/rounds.json5 --out out/rounds")]
pub struct Args {
    /// Scenario (configs/emulation/) or experiment (configs/experiments/), JSON5
    scenario: PathBuf,
    /// Output folder of an experiment; running it again resumes it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Images the robots of an experiment see, one folder per gesture [default: synthetic hands]
    #[arg(long, value_name = "DIR", requires = "out")]
    dataset: Option<PathBuf>,
    /// Images to train the initial model on [default: synthetic hands]
    #[arg(long, value_name = "DIR", requires = "out")]
    start_dataset: Option<PathBuf>,
    /// Number of seeds, from 0 [default: as in the file]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seeds: Option<u32>,
    /// Print JSON Lines instead of the table of a scenario, one object per fusion rule
    #[arg(long)]
    json: bool,
    /// Write a trace of seed 0 to this file (JSON Lines)
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

/// Of more robots than this an emulation takes as little memory as it can: 10,000 that learn take more than 4 GiB.
const MANY: usize = 4000;

/// Why an emulation gave no result.
#[derive(Debug, Error)]
pub enum EmulateError {
    /// The scenario cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The experiment cannot be read.
    #[cfg(feature = "opencv")]
    #[error("cannot read the experiment {}: {source}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A scenario where an experiment is wanted.
    #[cfg(feature = "opencv")]
    #[error("{} is a scenario, not an experiment (it has neither `axis` nor `swarms`): leave out --out, or see configs/experiments/", .0.display())]
    NoExperiment(PathBuf),
    /// An experiment without a place for its results.
    #[cfg(feature = "opencv")]
    #[error("{} is an experiment: give --out DIR for its results", .0.display())]
    NoOut(PathBuf),
    /// The trace cannot be written.
    #[error(
        "cannot write the trace {path}: {source}: its folder must be there, with room, and yours to write to"
    )]
    Trace {
        /// Where to.
        path: String,
        /// Why not.
        source: io::Error,
    },
}

/// Whether a file is an experiment: this build cannot read it, but can say so.
#[cfg(not(feature = "opencv"))]
fn is_experiment(path: &std::path::Path) -> bool {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let keys = json5::from_str::<serde_json::Map<String, serde_json::Value>>(&text).unwrap_or_default();
    keys.contains_key("axis") || keys.contains_key("swarms")
}

/// Carries out `gestalt emulate`.
///
/// # Errors
/// See [`EmulateError`]; and when stdout is closed to the results.
pub fn run(args: &Args) -> Result<(), Failure> {
    if args.out.is_some() && args.trace.is_some() {
        return Err("--trace is of a scenario: an experiment leaves its rows in --out".into());
    }
    if args.out.is_some() && args.json {
        return Err("--json is of a scenario: an experiment leaves its rows in --out (results.csv)".into());
    }
    #[cfg(feature = "opencv")]
    if let Some(folder) = &args.out {
        return conduct(args, folder);
    }
    #[cfg(not(feature = "opencv"))]
    if args.out.is_some() || is_experiment(&args.scenario) {
        return Err(
            "this gestalt was built without OpenCV, which experiments need to look at hands: build it with the feature 'opencv'"
                .into()
        );
    }
    #[cfg(feature = "opencv")]
    if std::fs::read_to_string(&args.scenario)
        .is_ok_and(|text| Experiment::is_one(&text) || Recognition::is_one(&text))
    {
        return Err(EmulateError::NoOut(args.scenario.clone()).into());
    }
    let scenario = Scenario::load(&args.scenario)?;
    keep_memory_of(scenario.swarm_size());
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

/// Speed for memory, unless there are so many robots that it is the memory that is short.
fn keep_memory_of(robots: usize) {
    if robots <= MANY {
        crate::heaps::keep();
    }
}

#[cfg(feature = "opencv")]
fn conduct(args: &Args, folder: &Path) -> Result<(), Failure> {
    let path = &args.scenario;
    let text =
        std::fs::read_to_string(path).map_err(|source| EmulateError::Read { path: path.clone(), source })?;
    let (looking, running) = (progress::bar("features", 0), progress::bar("runs", 0));
    let report = |progress| {
        let (bar, done, total) = match progress {
            Progress::Looked(done, total) => (&looking, done, total),
            Progress::Ran(done, total) => (&running, done, total),
        };
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    };
    let table = if Recognition::is_one(&text) {
        if args.dataset.is_some() || args.start_dataset.is_some() {
            return Err(format!(
                "{} is about drawn hands alone: leave out --dataset and --start-dataset, or see configs/experiments/ for others",
                path.display()
            )
            .into());
        }
        recognition::conduct((&text, path), folder, args.seeds, report)?
    } else if Experiment::is_one(&text) {
        keep_memory_of(Experiment::parse(&text, path)?.most_robots()?);
        let materials = Materials { dataset: args.dataset.clone(), start: args.start_dataset.clone() };
        experiment::conduct((&text, path), &materials, folder, args.seeds, report)?
    } else {
        return Err(EmulateError::NoExperiment(path.clone()).into());
    };
    looking.finish_and_clear();
    running.finish_and_clear();
    super::say(&table)
}
