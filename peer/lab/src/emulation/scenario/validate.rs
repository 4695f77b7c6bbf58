//! Whether a scenario can be run.

use std::time::Duration;

use gestalt_protocol::MAX_CLASSES;

use super::Scenario;
use super::error::ScenarioError;
use super::link_model::LinkModel;

/// The most robots: more do not fit into the memory of any machine that this runs on.
const MOST: usize = 1_000_000;

/// The most rounds.
const MOST_ROUNDS: u32 = 100_000;

/// The longest that anything may take: as many rounds of it can be added up.
const DAY: Duration = Duration::from_secs(24 * 60 * 60);

/// The fewest and the most frames per second: of fewer no run sees one, and the time between two must be one that there is.
const SLOWEST: f64 = 0.001;
const FASTEST: f64 = 1000.0;

impl Scenario {
    /// Whether the scenario can be run.
    ///
    /// # Errors
    /// The first [`ScenarioError`] found.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        let wrong = |key, mend: String| Err(ScenarioError::Value { key, mend });
        let size = self.swarm_size();
        if !(1..=MOST).contains(&size) {
            return wrong("robots", format!("{size} robots in all: choose 1 to {MOST}"));
        }
        if !(2..=MAX_CLASSES).contains(&self.classes) {
            return wrong("classes", format!("is {}: choose 2 to {MAX_CLASSES}", self.classes));
        }
        if !(1..=MOST_ROUNDS).contains(&self.rounds) {
            return wrong("rounds", format!("is {}: choose 1 to {MOST_ROUNDS}", self.rounds));
        }
        if let Some((key, _)) = self.durations().into_iter().find(|(_, duration)| *duration > DAY) {
            return wrong(key, "is longer than a day: choose a shorter duration".to_owned());
        }
        let end = DAY * MOST_ROUNDS;
        if let Some((key, _)) = self.times().into_iter().find(|(_, time)| *time > end) {
            return wrong(key, format!("is later than any run ends: choose at most {MOST_ROUNDS} days"));
        }
        if self.seeds == 0 {
            return wrong("seeds", "is 0: choose at least 1".to_owned());
        }
        if !(0.0..1.0).contains(&self.link.loss) {
            return wrong("link.loss", format!("is {}: choose from 0 to below 1", self.link.loss));
        }
        for view in self.robots.iter().filter_map(|group| group.view) {
            if !(SLOWEST..=FASTEST).contains(&view.fps) {
                let mend = format!("is {}: choose {SLOWEST} to {FASTEST}", view.fps);
                return wrong("robots.view.fps", mend);
            }
            if !(view.signal >= 0.0 && view.signal <= 100.0) {
                return wrong("robots.view.signal", format!("is {}: choose 0 to 100", view.signal));
            }
            if !(0.0..=1.0).contains(&view.likeness) {
                return wrong("robots.view.likeness", format!("is {}: choose 0 to 1", view.likeness));
            }
            if !(0.0..=1.0).contains(&view.persistence) {
                return wrong("robots.view.persistence", format!("is {}: choose 0 to 1", view.persistence));
            }
        }
        if self.members().all(|group| group.lies.is_some()) {
            return wrong("robots.lies", "all lie: nobody is left to be deceived".to_owned());
        }
        if self.members().any(|group| group.lies.is_some()) && self.learning.is_some() {
            return wrong(
                "robots.lies",
                "robots that learn are not lied to here: leave out learning".to_owned(),
            );
        }
        if self.members().any(|group| group.poison.is_some()) && self.learning.is_none() {
            return wrong("robots.poison", "nobody learns who could be poisoned: give learning".to_owned());
        }
        self.mind.validate()?;
        if let Some(teaching) = &self.learning {
            teaching.robots.validate()?;
            if !(0.0..=1.0).contains(&teaching.answering.wrong) {
                return wrong("learning.answering.wrong", "choose from 0 to 1, for example 0.1".to_owned());
            }
            if teaching.after >= self.interval {
                return wrong("learning.after", "speak before the next gesture is shown".to_owned());
            }
        }
        for contender in &self.compare {
            self.contending(*contender).mind.validate()?;
        }
        if self.interval <= self.mind.refractory {
            return wrong(
                "interval",
                "no longer than mind.refractory: no second round would open".to_owned(),
            );
        }
        if let Some(churn) = self.churn
            && (churn.period.is_zero() || churn.until <= churn.from)
        {
            return wrong("churn", "choose a period above 0 and an end after the beginning".to_owned());
        }
        let end = self.showing_at(self.rounds);
        if self.churn.is_some_and(|churn| churn.until >= end) {
            let mend = format!("the run ends at {end:?}: choose an earlier end of the churn, or more rounds");
            return wrong("churn.until", mend);
        }
        self.check_faults()
    }

    /// How long things take, by key.
    fn durations(&self) -> Vec<(&'static str, Duration)> {
        let LinkModel { latency, jitter, detection, .. } = self.link;
        let mut durations = vec![
            ("interval", self.interval),
            ("link.latency", latency),
            ("link.jitter", jitter),
            ("link.detection", detection),
        ];
        durations.extend(self.churn.map(|churn| ("churn.period", churn.period)));
        durations.extend(self.learning.as_ref().map(|teaching| ("learning.after", teaching.after)));
        durations
    }

    /// When things happen, by key.
    fn times(&self) -> Vec<(&'static str, Duration)> {
        let faults = self.faults.iter().map(|fault| ("faults.at", fault.at));
        let churn =
            self.churn.iter().flat_map(|churn| [("churn.from", churn.from), ("churn.until", churn.until)]);
        faults.chain(churn).collect()
    }
}
