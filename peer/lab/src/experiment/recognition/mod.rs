//! How well swarms of given cameras recognise gestures, without learning: heterogeneous perception, measured.
//!
//! ```text
//! file ─► plan: swarms ─┐
//! scene, person ─► takes: what each camera sees of each gesture ─► whole minds, emulated ─► CSV, table, plots
//! other people ─► training: one classifier for all cameras ─┘
//! ```
//!
//! Within a seed all swarms are shown the same gestures by the same people, and the n-th robot of every swarm stands at the
//! same place: what differs between two swarms is what they are made of.

mod outcome;
mod plan;
mod results;
mod summary;
mod takes;
mod training;
mod trial;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use gestalt_vision::perception::FeatureSet;
use rayon::prelude::*;

pub use plan::{Kind, Recognition, SwarmPlan, Where};

use super::error::ExperimentError;
use super::fingerprint::this_program;
use super::materials::Materials;
use super::progress::Progress;
use super::{chart, folder};
use results::RecognitionResults;
use summary::Summary;
use training::Classifiers;

/// Conducts the experiment, or what is left of it, and writes into `folder`:
///
/// - `experiment.json5` and `run.json`: the experiment as given, seeds and program;
/// - `results.csv`: every swarm of every seed;
/// - `results.md`: means with 95 % intervals;
/// - plots, as `.svg` and `.png`.
///
/// Gives the text of the table. The same call after an interruption continues; neither the number of threads nor their
/// order changes a figure.
///
/// # Errors
/// See [`ExperimentError`]; the results so far are kept.
pub fn conduct(
    (text, origin): (&str, &Path),
    folder: &Path,
    seeds: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<String, ExperimentError> {
    let plan = Recognition::parse(text, origin)?;
    let seeds = seeds.unwrap_or(plan.seeds);
    let _alone =
        folder::claim(folder, text, &Materials::default(), seeds, &this_program(FeatureSet::Shape)?)?;
    let results = RecognitionResults::open(folder, &plan)?;
    let runs = run_what_is_left(&plan, results, seeds, &progress)?.finish()?;

    let counted: Vec<_> = runs.into_iter().filter(|(seed, _)| *seed < u64::from(seeds)).collect();
    let summary = Summary::of(&plan, &counted);
    let table = summary.markdown();
    let path = folder.join("results.md");
    gestalt_file::write(&path, table.as_bytes()).map_err(|source| ExperimentError::Write { path, source })?;
    chart::draw_into(folder, &summary.figures())?;
    Ok(table)
}

/// Runs each seed that there are no results of yet. The first error stops all.
fn run_what_is_left(
    plan: &Recognition,
    results: RecognitionResults,
    seeds: u32,
    progress: &(impl Fn(Progress) + Sync),
) -> Result<RecognitionResults, ExperimentError> {
    let left: Vec<u64> = (0..u64::from(seeds)).filter(|seed| !results.runs.contains_key(seed)).collect();
    let ran = seeds as usize - left.len();
    progress(Progress::Ran(ran, seeds as usize));
    if left.is_empty() {
        return Ok(results);
    }
    let classifiers = Classifiers::train(plan, |done, total| progress(Progress::Looked(done, total)))?;

    let stop = AtomicBool::new(false);
    let (results, failed) = (Mutex::new((results, ran)), Mutex::new(None));
    let run = |seed: u64| -> Result<(), ExperimentError> {
        let outcomes = trial::run(plan, &classifiers, seed, &stop)?;
        let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
        let (results, ran) = &mut *results;
        results.add(plan, seed, outcomes)?;
        *ran += 1;
        progress(Progress::Ran(*ran, seeds as usize));
        Ok(())
    };
    left.par_iter().with_max_len(1).for_each(|seed| {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        if let Err(error) = run(*seed) {
            // What others say after it is only that they were stopped.
            failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            stop.store(true, Ordering::Relaxed);
        }
    });
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => Ok(results.into_inner().unwrap_or_else(PoisonError::into_inner).0),
    }
}
