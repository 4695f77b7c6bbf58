//! Many runs on all cores: each is written down as it ends, and none is run twice.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_vision::perception::FeatureSet;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::asking::asking;
use super::drift::drift;
use super::error::ExperimentError;
use super::figures::figures;
use super::fingerprint::this_program;
use super::folder;
use super::materials::Materials;
use super::plan::{Cell, Experiment};
use super::pool::Pool;
use super::progress::Progress;
use super::results::Results;
use super::school::Schools;
use super::setting::Start;
use super::split::Split;
use super::summary::Summary;
use super::{chart, trial};
use crate::emulation::{Rules, School};
use crate::threads::apart;

/// Conducts an experiment, or what is left of it, and writes into `folder`:
///
/// - `experiment.json5` and `run.json`: the experiment as given, seeds, datasets and program;
/// - `observations-….bin`: what robots see, kept for the next call;
/// - `results.csv`: every round of every run;
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
    materials: &Materials,
    folder: &Path,
    seeds: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<String, ExperimentError> {
    conduct_by((text, origin), (materials, &BTreeMap::new()), folder, seeds, progress)
}

/// The same with rules of your own: a setting whose `own_rules` names them shares, forgets and fuses by them. Rules that
/// have changed want another name or another folder: nobody can tell from the results.
///
/// # Errors
/// As [`conduct`]; [`ExperimentError::Setting`] for a name that there are no rules of.
pub fn conduct_by(
    (text, origin): (&str, &Path),
    (materials, rules): (&Materials, &BTreeMap<String, Rules>),
    folder: &Path,
    seeds: Option<u32>,
    progress: impl Fn(Progress) + Sync,
) -> Result<String, ExperimentError> {
    materials.check()?;
    let experiment = Experiment::parse(text, origin)?;
    let cells = experiment.cells()?;
    let rules = cells.iter().map(|cell| rules_of(cell, rules)).collect::<Result<Vec<_>, _>>()?;
    let seeds = seeds.unwrap_or(experiment.seeds);
    let hands = experiment.seen(materials.dataset.as_deref());
    let ready = materials.dataset.is_none() && experiment.hands.vocabulary.is_some();
    let starts_from_it = |cell: &Cell| cell.setting.start == Start::Model;
    let are_drawn = ready && hands.features != FeatureSet::Embedding;
    if materials.start.is_some() && (are_drawn || !cells.iter().any(starts_from_it)) {
        return Err(ExperimentError::Setting(
            "no robot starts from --start-dataset: leave it out, or say start: 'model'".to_owned(),
        ));
    }
    let program = this_program(hands.features)?;
    let _alone = folder::claim(folder, text, materials, seeds, &program)?;
    let looked = |done, total| progress(Progress::Looked(done, total));
    let pool = Pool::look(&experiment, materials.dataset.as_deref(), folder, program.eyes, looked)?;
    let pool = Arc::new(pool);
    let split = fewest_judged(&pool, seeds)?;
    let mut schools = Schools::new(pool.vocabulary()?, (hands.features, ready), materials.start.as_deref())?;
    let taught: Vec<Taught<'_>> = cells
        .iter()
        .zip(rules)
        .map(|(cell, rules)| Ok(Taught { cell, school: schools.of(&cell.setting)?, rules }))
        .collect::<Result<_, ExperimentError>>()?;

    let results = Results::open(folder, |(line, value, _)| {
        let cell = cells.iter().find(|cell| cell.line == *line && cell.value == *value);
        cell.map(|cell| cell.setting.rounds)
    })?;
    let runs = run_what_is_left(&taught, &pool, results, seeds, &progress)?.finish()?;

    let summary = Summary::of(&experiment, &cells, &runs, seeds);
    let table = summary.markdown(&pool, materials, &split)
        + &asking(&experiment, &cells, &runs, (seeds, split.judged())).unwrap_or_default()
        + &drift(&experiment, &cells, &runs, (seeds, &split)).unwrap_or_default();
    let path = folder.join("results.md");
    gestalt_file::write(&path, table.as_bytes()).map_err(|source| ExperimentError::Write { path, source })?;
    chart::draw_into(folder, &figures(&summary, split.judged()))?;
    Ok(table)
}

/// Of the splits of all seeds, before hours of runs, the one in which the fewest hands are judged: who is held out differs from seed to seed, and how many
/// hands those show, if not all show the same.
fn fewest_judged(pool: &Pool, seeds: u32) -> Result<Split, ExperimentError> {
    let draw = |seed| Split::draw(&pool.gestures, &pool.moments, &mut ChaCha8Rng::seed_from_u64(seed));
    let mut fewest = draw(0)?;
    for seed in 1..u64::from(seeds) {
        let split = draw(seed).map_err(|error| ExperimentError::Setting(format!("seed {seed}: {error}")))?;
        if split.judged() < fewest.judged() {
            fewest = split;
        }
    }
    Ok(fewest)
}

/// A cell and all that its runs share.
struct Taught<'a> {
    cell: &'a Cell,
    school: Arc<School>,
    rules: Rules,
}

/// The rules that a cell names; none of your own where it names none.
fn rules_of(cell: &Cell, rules: &BTreeMap<String, Rules>) -> Result<Rules, ExperimentError> {
    let Some(name) = &cell.setting.own_rules else { return Ok(Rules::default()) };
    rules.get(name).cloned().ok_or_else(|| {
        let named: Vec<&str> = rules.keys().map(String::as_str).collect();
        ExperimentError::Setting(format!(
            "own_rules: there are none of the name '{name}' (known: {}); a program of your own hands them to \
             experiment::conduct_by",
            if named.is_empty() { "none".to_owned() } else { named.join(", ") }
        ))
    })
}

/// Runs each cell with each seed that there are no results of yet. The first error stops all.
fn run_what_is_left(
    cells: &[Taught<'_>],
    pool: &Arc<Pool>,
    results: Results,
    seeds: u32,
    progress: &(impl Fn(Progress) + Sync),
) -> Result<Results, ExperimentError> {
    let all = (0..u64::from(seeds)).flat_map(|seed| cells.iter().map(move |cell| (cell, seed)));
    let left: Vec<_> =
        all.filter(|(taught, seed)| !results.runs.contains_key(&taught.cell.run(*seed))).collect();
    let total = seeds as usize * cells.len();
    let ran = total - left.len();
    progress(Progress::Ran(ran, total));

    let stop = AtomicBool::new(false);
    let results = Mutex::new((results, ran));
    let run = |(taught, seed): &(&Taught<'_>, u64)| -> Result<(), ExperimentError> {
        let Taught { cell, school, rules } = taught;
        let standings = apart(|| trial::run(&cell.setting, school, pool, *seed, (rules, &stop)))?;
        let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
        let (results, ran) = &mut *results;
        results.add(cell.run(*seed), standings)?;
        *ran += 1;
        progress(Progress::Ran(*ran, total));
        Ok(())
    };
    let failed = Mutex::new(None);
    // One run at a time to a thread, in their order: where it is stopped, the first are there.
    left.par_iter().with_max_len(1).for_each(|todo| {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        if let Err(error) = run(todo) {
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
