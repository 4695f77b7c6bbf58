//! How well swarms of given cameras recognise gestures, without learning: heterogeneous perception, measured.
//!
//! ```text
//! file ─► plan: swarms ─┐
//! scene, person ─► takes: what each camera sees of each gesture ─► whole minds, emulated ─► CSV, table, plots
//! other people ─► training: one classifier for all cameras ─┘
//! ```
//!
//! Within a seed all swarms are shown the same gestures by the same people, and the n-th robot of every kind stands at the
//! same place: what differs between two swarms is what they are made of.

mod plan;
mod results;
mod takes;
mod training;
mod trial;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

pub use plan::{Kind, Recognition, SwarmPlan, Where};

use super::runner::{Progress, workers};
use super::{ExperimentError, chart};
use results::Summary;
use training::Classifiers;

/// Conducts the experiment and writes `experiment.json5`, `results.csv` (every swarm of every seed), `results.md` (means
/// with 95 % intervals) and plots into `folder`. Gives the text of the table.
///
/// # Errors
/// See [`ExperimentError`].
pub fn conduct(
    (text, origin): (&str, &Path),
    folder: &Path,
    seeds: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<String, ExperimentError> {
    let plan = Recognition::parse(text, origin)?;
    let seeds = seeds.unwrap_or(plan.seeds);
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| ExperimentError::Write { path, source })
    };
    std::fs::create_dir_all(folder)
        .map_err(|source| ExperimentError::Write { path: folder.to_owned(), source })?;
    write("experiment.json5", text)?;
    let classifiers = Classifiers::train(&plan, |done, total| progress(Progress::Looked(done, total)))?;

    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || -> Result<Vec<_>, ExperimentError> {
        let mut runs = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds as usize {
                return Ok(runs);
            }
            runs.push((seed, trial::run(&plan, &classifiers, seed as u64)?));
            progress(Progress::Ran(done.fetch_add(1, Ordering::Relaxed) + 1, seeds as usize));
        }
    };
    let mut runs = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers()).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|worker| worker.join().expect("a trial does not panic"));
        joined.collect::<Result<Vec<_>, _>>()
    })?
    .concat();
    runs.sort_by_key(|(seed, _)| *seed);

    let summary = Summary::of(&plan, &runs);
    write("results.csv", &results::csv(&plan, &runs))?;
    let table = summary.markdown();
    write("results.md", &table)?;
    chart::draw_into(folder, &summary.figures())?;
    Ok(table)
}
