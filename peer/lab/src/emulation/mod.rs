//! The emulated network: a seeded discrete-event host of the same minds that Zenoh hosts.
//!
//! No clock: a run of a [`Scenario`] with a seed gives the same [`Report`] and the same [`Trace`] on
//! every machine and any number of threads, byte for byte. Every message is encoded, counted and decoded on its way; broadcasts run along the
//! shortest ways of what the robots believe to be connected, and are lost hop by hop.

mod answering;
mod calibration;
mod network;
mod observer;
mod poison;
mod pupil;
mod record;
mod report;
mod route;
mod rules;
mod scenario;
mod school;
mod statistics;
mod swarm;
mod teaching;
mod trace;

use std::io;
use std::sync::Arc;

pub use answering::{Answering, AskedBy};
pub use calibration::Calibration;
pub use network::Traffic;
pub use observer::{BlindObserver, Observer, ScoreClassifier, StatisticalObserver};
pub use poison::Poison;
#[cfg(feature = "experiments")]
pub(crate) use report::likeliest;
pub use report::{BytesPerRobot, Learned, Report, Summary, Table};
pub use rules::Rules;
pub use scenario::{
    Churn, Contender, Event, Fault, Group, Lies, LinkModel, Order, Scenario, ScenarioError, View,
};
pub use school::School;
pub use statistics::{Mean, Proportion};
pub use teaching::{Feedback, Teaching};
pub use trace::{Brief, Happening, Trace};

use gestalt_protocol::Heeded;
use gestalt_strategies::{Classifier, LearningError, Mind, Refusals, TrainingSet, Vocabulary};

use swarm::Swarm;

use crate::threads::Crew;

/// Runs a scenario with the statistical views it describes.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run.
pub fn run(scenario: &Scenario, seed: u64) -> Result<Report, ScenarioError> {
    let (report, _) = run_traced(scenario, seed, Trace::none())?;
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
    run_by(scenario, seed, Rules::default(), trace)
}

/// Runs a scenario in which all robots share, forget or fuse by rules of your own, with the statistical views it
/// describes.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run.
pub fn run_by<'a>(
    scenario: &'a Scenario,
    seed: u64,
    rules: Rules,
    trace: Trace<'a>,
) -> Result<(Report, io::Result<()>), ScenarioError> {
    scenario.validate()?;
    let mut observers = statistical_observers(scenario)?;
    let school = school_of_scores(scenario, &mut observers)?;
    Ok(Emulation::by(scenario, seed, observers, school, rules, trace)?.finish())
}

/// Runs a scenario with eyes of your own, one per robot, in place of the views it describes.
///
/// # Errors
/// A [`ScenarioError`] for a scenario that cannot be run, or another number of eyes than of robots.
pub fn run_with<'a>(
    scenario: &'a Scenario,
    seed: u64,
    observers: Vec<Box<dyn Observer>>,
    trace: Trace<'a>,
) -> Result<(Report, io::Result<()>), ScenarioError> {
    Ok(Emulation::new(scenario, seed, observers, None, trace)?.finish())
}

/// A run of a scenario that can be looked into after each showing.
pub struct Emulation<'a> {
    swarm: Swarm<'a>,
    scenario: &'a Scenario,
    seed: u64,
    shown: u32,
}

impl<'a> Emulation<'a> {
    /// A run that has not begun, with one pair of eyes per robot; robots that learn need a school.
    ///
    /// # Errors
    /// A [`ScenarioError`] for a scenario that cannot be run, another number of eyes than of robots, or a school
    /// where nobody learns or none where robots do.
    pub fn new(
        scenario: &'a Scenario,
        seed: u64,
        observers: Vec<Box<dyn Observer>>,
        school: Option<Arc<School>>,
        trace: Trace<'a>,
    ) -> Result<Self, ScenarioError> {
        Self::by(scenario, seed, observers, school, Rules::default(), trace)
    }

    /// The same with robots that share, forget or fuse by rules of your own.
    ///
    /// # Errors
    /// As [`Emulation::new`].
    pub fn by(
        scenario: &'a Scenario,
        seed: u64,
        observers: Vec<Box<dyn Observer>>,
        school: Option<Arc<School>>,
        rules: Rules,
        trace: Trace<'a>,
    ) -> Result<Self, ScenarioError> {
        scenario.validate()?;
        if observers.len() != scenario.swarm_size() {
            let mend =
                format!("{} robots, but {} observers: give each one", scenario.swarm_size(), observers.len());
            return Err(ScenarioError::Value { key: "robots", mend });
        }
        if school.is_some() != scenario.learning.is_some() {
            let mend = "robots learn with a school, and only then: give both or none".to_owned();
            return Err(ScenarioError::Value { key: "learning", mend });
        }
        if let (Some(teaching), Some(school)) = (&scenario.learning, &school) {
            // Nobody signs here.
            let checked = teaching.robots.check_share_bytes(school.space(), false);
            let wrong = |error: LearningError| {
                let mend = error.to_string();
                ScenarioError::Value { key: "learning.robots", mend }
            };
            checked.map_err(wrong)?;
        }
        Ok(Self {
            swarm: Swarm::new(scenario, seed, observers, (school, rules), trace),
            scenario,
            seed,
            shown: 0,
        })
    }

    /// Shows the next gesture and runs until the one after it is due; false when there is none left.
    pub fn show_next(&mut self) -> bool {
        if self.shown == self.scenario.rounds {
            return false;
        }
        self.shown += 1;
        self.swarm.pass(self.scenario.showing_at(self.shown));
        true
    }

    /// The same run, in which robots learn on so many threads, in place of as many as the machine has. What comes of it is the same.
    #[must_use]
    pub fn on_threads(mut self, threads: usize) -> Self {
        self.swarm.crew = Crew::of(threads);
        self
    }

    /// Makes these robots, by their position, learn from all they hold, at once: they are about to be asked for their classifiers.
    pub fn learn(&mut self, robots: &[usize]) {
        self.swarm.keep_up(robots);
    }

    /// The classifier of a robot, by its position, after learning from all it holds; `None` of a robot that does not
    /// learn, is down, or never met a sample.
    pub fn classifier(&mut self, robot: usize) -> Option<Arc<Classifier>> {
        self.swarm.learned(robot)
    }

    /// The samples a robot holds, by its position.
    #[must_use]
    pub fn training_set(&self, robot: usize) -> Option<&TrainingSet> {
        self.swarm.mind(robot)?.training_set()
    }

    /// Of each other robot: how many of its samples that robot holds, and how many of these it trains on.
    #[must_use]
    pub fn heeded(&self, robot: usize) -> Vec<Heeded> {
        self.swarm.mind(robot).map_or(Vec::new(), Mind::heeded)
    }

    /// What a robot has refused so far, by its position; `None` of one that is down, or lies.
    #[must_use]
    pub fn refusals(&self, robot: usize) -> Option<&Refusals> {
        Some(self.swarm.mind(robot)?.refusals())
    }

    /// What a robot has sent so far, by its position.
    #[must_use]
    pub fn traffic(&self, robot: usize) -> Traffic {
        self.swarm.traffic(robot)
    }

    /// How many questions were asked so far, and how often the instructor said what was shown.
    #[must_use]
    pub fn asked(&self) -> (u32, u32) {
        self.swarm.asked()
    }

    /// Runs to the end; the second value says whether the trace could be written.
    pub fn finish(self) -> (Report, io::Result<()>) {
        let (record, network, learned, written) = self.swarm.run();
        (Report::new(self.seed, &record, &network, learned), written)
    }
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
        summaries.push(Summary::of(contender.rule, contending.mind.alpha(), &reports));
    }
    Ok(summaries)
}

fn school_of_scores(
    scenario: &Scenario,
    observers: &mut [Box<dyn Observer>],
) -> Result<Option<Arc<School>>, ScenarioError> {
    let Some(teaching) = &scenario.learning else { return Ok(None) };
    let Some(seeing) = observers.iter_mut().find(|observer| observer.classifier().is_some()) else {
        let mend = "nobody sees anything to learn from: give a group a view".to_owned();
        return Err(ScenarioError::Value { key: "robots", mend });
    };
    let school = School::of_scores(&mut **seeing, vocabulary(scenario)?, teaching.robots.learner.clone())?;
    Ok(Some(Arc::new(school)))
}

fn vocabulary(scenario: &Scenario) -> Result<Vocabulary, ScenarioError> {
    Vocabulary::new((0..scenario.classes).map(|class| class.to_string()))
        .map_err(|error| ScenarioError::Value { key: "classes", mend: error.to_string() })
}

fn statistical_observers(scenario: &Scenario) -> Result<Vec<Box<dyn Observer>>, ScenarioError> {
    let vocabulary = vocabulary(scenario)?;
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
