//! Many runs on all cores: each is written down as it ends, and none is run twice.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};

use super::plan::Experiment;
use super::pool::Pool;
use super::results::{Results, Run};
use super::school::Schools;
use super::trial::Standing;
use super::{ExperimentError, chart, table, trial};
use crate::emulation::School;

/// How many threads work.
pub(super) fn workers() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Where real hands come from.
#[derive(Clone, Debug, Default)]
pub struct Materials {
    /// Pictures that robots see; rendered hands when there are none.
    pub dataset: Option<PathBuf>,
    /// Pictures that a model is trained on to start from; rendered hands, seen from the front, when there are none.
    pub start: Option<PathBuf>,
}

/// How far an experiment has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// So many hands were looked at, of so many.
    Looked(usize, usize),
    /// So many runs have ended, of so many.
    Ran(usize, usize),
}

/// Conducts an experiment, or what is left of it, and writes into `folder`:
///
/// - `experiment.json5` and `run.json`: the experiment as given, seeds and datasets;
/// - `observations-….bin`: what robots see, kept for the next call;
/// - `results.csv`: every round of every run;
/// - `results.md`: means with 95 % intervals;
/// - plots, as `.svg` and `.png`.
///
/// Gives the text of the table. The same call after an interruption continues.
///
/// # Errors
/// See [`ExperimentError`]; the results so far are kept.
pub fn conduct(
    (text, origin): (&str, &Path),
    materials: &Materials,
    folder: &Path,
    seeds: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<String, ExperimentError> {
    let experiment = Experiment::parse(text, origin)?;
    let seeds = seeds.unwrap_or(experiment.seeds);
    std::fs::create_dir_all(folder)
        .map_err(|source| ExperimentError::Write { path: folder.to_owned(), source })?;
    write_down(text, materials, folder, seeds)?;
    let pool = Pool::look(&experiment, materials.dataset.as_deref(), folder, |done, total| {
        progress(Progress::Looked(done, total));
    })?;
    let pool = Arc::new(pool);
    let mut schools = Schools::new(pool.vocabulary()?, materials.start.as_deref())?;
    let cells = experiment.cells()?;
    let cells: Vec<(_, Arc<School>)> = cells
        .into_iter()
        .map(|cell| schools.of(&cell.setting).map(|school| (cell, school)))
        .collect::<Result<_, _>>()?;

    let mut results = Results::open(folder)?;
    results.keep_whole(|(line, value, _)| {
        let cell = cells.iter().find(|(cell, _)| cell.line == *line && cell.value == *value);
        cell.map(|(cell, _)| cell.setting.rounds)
    })?;
    let all = (0..u64::from(seeds)).flat_map(|seed| (0..cells.len()).map(move |cell| (cell, seed)));
    let named = |(cell, seed): (usize, u64)| -> Run {
        (cells[cell].0.line.clone(), cells[cell].0.value.clone(), seed)
    };
    let left: Vec<(usize, u64)> = all.filter(|run| !results.runs.contains_key(&named(*run))).collect();
    let total = seeds as usize * cells.len();
    let mut done = total - left.len();
    progress(Progress::Ran(done, total));

    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (ended, ends) = mpsc::channel::<((usize, u64), Result<Vec<Standing>, ExperimentError>)>();
    std::thread::scope(|scope| -> Result<(), ExperimentError> {
        for _ in 0..workers().min(left.len()) {
            let (ended, cells, left, pool) = (ended.clone(), &cells, &left, &pool);
            let (next, stop) = (&next, &stop);
            scope.spawn(move || {
                while let Some(&(cell, seed)) = left.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (what, school) = &cells[cell];
                    let standings = trial::run(&what.setting, school, pool, seed);
                    if stop.load(Ordering::Relaxed) || ended.send(((cell, seed), standings)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(ended);
        for (run, standings) in ends {
            let kept = standings.and_then(|standings| results.add(named(run), standings));
            if kept.is_err() {
                stop.store(true, Ordering::Relaxed);
                return kept;
            }
            done += 1;
            progress(Progress::Ran(done, total));
        }
        Ok(())
    })?;

    let cells: Vec<_> = cells.into_iter().map(|(cell, _)| cell).collect();
    let summary = table::Summary::of(&experiment, &cells, &results.runs, seeds);
    let table = summary.markdown(&pool, materials);
    let path = folder.join("results.md");
    std::fs::write(&path, &table).map_err(|source| ExperimentError::Write { path, source })?;
    chart::draw_all(&summary, folder)?;
    Ok(table)
}

/// Writes what is run beside its results; refuses to mix it with something else.
fn write_down(text: &str, materials: &Materials, folder: &Path, seeds: u32) -> Result<(), ExperimentError> {
    let path = |name: &str| folder.join(name);
    let place = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    let datasets =
        serde_json::json!({ "dataset": place(&materials.dataset), "start": place(&materials.start) });
    let before = std::fs::read_to_string(path("run.json")).ok();
    if let Some(before) = before.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok()) {
        let same = std::fs::read_to_string(path("experiment.json5")).is_ok_and(|before| before == text);
        if !same || before["datasets"] != datasets {
            return Err(ExperimentError::Other(folder.to_owned()));
        }
    }
    let run = serde_json::json!({
        "seeds": (0..seeds).collect::<Vec<_>>(),
        "datasets": datasets,
        "version": env!("CARGO_PKG_VERSION"),
    });
    for (name, text) in [("experiment.json5", text.to_owned()), ("run.json", format!("{run:#}\n"))] {
        let path = path(name);
        std::fs::write(&path, text).map_err(|source| ExperimentError::Write { path, source })?;
    }
    Ok(())
}
