//! The emulated network: a seeded discrete-event host of the same minds that Zenoh hosts.
//!
//! One thread, no clock: a run of a [`Scenario`] with a seed gives the same [`Report`] and the same [`Trace`] on
//! every machine, byte for byte. Every message is encoded, counted and decoded on its way; broadcasts run along the
//! shortest ways of what the robots believe to be connected, and are lost hop by hop.

mod network;
mod observer;
mod record;
mod report;
mod route;
mod scenario;
mod statistics;
mod swarm;
mod trace;

use std::io;

pub use observer::{BlindObserver, Observer, ScoreClassifier, StatisticalObserver};
pub use report::{BytesPerRobot, Report, Summary, Table};
pub use scenario::{Churn, Contender, Event, Fault, Group, LinkModel, Scenario, ScenarioError, View};
pub use statistics::{Mean, Proportion};
pub use trace::{Brief, Happening, Trace};

use gestalt_strategies::Vocabulary;

use swarm::Swarm;

/// Runs a scenario with the statistical views it describes.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run.
pub fn run(scenario: &Scenario, seed: u64) -> Result<Report, ScenarioError> {
    scenario.validate()?;
    let (report, _) = run_with(scenario, seed, statistical_observers(scenario)?, Trace::none())?;
    Ok(report)
}

/// Runs a scenario and writes down what happens; the second value says whether that could be written.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run.
pub fn run_traced<'a>(
    scenario: &'a Scenario,
    seed: u64,
    trace: Trace<'a>,
) -> Result<(Report, io::Result<()>), ScenarioError> {
    run_with(scenario, seed, statistical_observers(scenario)?, trace)
}

/// Runs a scenario with eyes of one's own, one per robot, in place of the views it describes.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run, or another number of eyes than of robots.
pub fn run_with<'a>(
    scenario: &'a Scenario,
    seed: u64,
    observers: Vec<Box<dyn Observer>>,
    trace: Trace<'a>,
) -> Result<(Report, io::Result<()>), ScenarioError> {
    scenario.validate()?;
    if observers.len() != scenario.swarm_size() {
        let mend =
            format!("{} robots, but {} observers: give each one", scenario.swarm_size(), observers.len());
        return Err(ScenarioError::Value { key: "robots", mend });
    }
    let (record, network, written) = Swarm::new(scenario, seed, observers, trace).run();
    Ok((Report::new(seed, &record, &network), written))
}

/// Runs a scenario under each of its fusion rules (its own one if it compares none) over the same seeds, from 0:
/// every rule is shown the same frames. `ran` is called after each run.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run.
pub fn compare(
    scenario: &Scenario,
    seeds: u32,
    mut ran: impl FnMut(),
) -> Result<Vec<Summary>, ScenarioError> {
    let own = [Contender { rule: scenario.mind.rule, alpha: None }];
    let contenders = if scenario.compare.is_empty() { &own[..] } else { &scenario.compare };
    let mut summaries = Vec::new();
    for contender in contenders {
        let contending = scenario.contending(*contender);
        let mut reports = Vec::new();
        for seed in 0..u64::from(seeds) {
            reports.push(run(&contending, seed)?);
            ran();
        }
        summaries.push(Summary::of(contender.rule, contending.mind.alpha, &reports));
    }
    Ok(summaries)
}

fn statistical_observers(scenario: &Scenario) -> Result<Vec<Box<dyn Observer>>, ScenarioError> {
    let vocabulary = Vocabulary::new((0..scenario.classes).map(|class| class.to_string()))
        .map_err(|error| ScenarioError::Value { key: "classes", mend: error.to_string() })?;
    let eyes = |view: Option<View>| -> Box<dyn Observer> {
        match view {
            Some(view) => Box::new(StatisticalObserver::new(view, vocabulary.clone())),
            None => Box::new(BlindObserver),
        }
    };
    Ok(scenario.members().map(|group| eyes(group.view)).collect())
}

#[cfg(test)]
mod tests;
