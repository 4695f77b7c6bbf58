//! The parameters of a robot's rounds.

use std::time::Duration;

use gestalt_protocol::{Certificate, FusionRule, MAX_ROBOTS, RuleName, Terms};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::quorum::Quorum;

/// Parameters no robot can work with; each names the field and the mend.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RoundsConfigError {
    /// α outside its range for a pool.
    #[error("alpha is {0}: choose it above 0 and below 0.5, for example 0.05")]
    Alpha(f64),
    /// α outside its range for a share.
    #[error("alpha is {alpha}: for {rule} choose it above 0 and at most 0.5, which is more than half")]
    Share {
        /// α.
        alpha: f64,
        /// Which rule.
        rule: FusionRule,
    },
    /// A rule that Gestalt does not have.
    #[error(
        "the fusion rule '{0}' is none of Gestalt's: take one of majority, mean_probability, log_pool, \
         confidence_weighted and correlated_pool; a user's rule is handed to the robot by its program"
    )]
    Rule(RuleName),
    /// A quorum that is always or never met.
    #[error("quorum is {0}: choose \"majority\", or from 1 to {MAX_ROBOTS} robots")]
    Quorum(u32),
    /// As many liars as could make a decision of their own.
    #[error(
        "liars is {liars} and quorum is {quorum}: a quorum must be more than twice the liars, or \"majority\""
    )]
    Liars {
        /// f.
        liars: u32,
        /// q.
        quorum: u32,
    },
    /// A bound on the evidence that bounds nothing or leaves none.
    #[error("clip is {0}: choose it above 0 and at most 1000 nats, for example 6")]
    Clip(f64),
    /// A period of no length.
    #[error("{0} is zero: choose a duration above 0, for example 500ms")]
    Zero(&'static str),
    /// A duration so long that adding it up could overflow.
    #[error("{0} is longer than a day: choose a shorter duration")]
    TooLong(&'static str),
    /// Two durations in the wrong order.
    #[error("{longer} is shorter than {shorter}: make {longer} at least as long")]
    Order {
        /// The field that must not be the longer one.
        shorter: &'static str,
        /// The field that must not be the shorter one.
        longer: &'static str,
    },
}

/// How a robot takes part in rounds. All robots of a swarm should share these. In a configuration file durations are
/// written as `"500ms"`, and what is left out is the default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoundsConfig {
    /// How votes are fused: one of Gestalt's rules. One's own is handed in by
    /// [`Rounds::fused_by`](crate::Rounds::fused_by).
    pub rule: FusionRule,
    /// α: decide once the top class has 1 − α, of what the fusion rule gives. `None`: the rule's own default.
    /// - log pools, and rules of one's own: its probability, so that α is how often a decision may err where the robots' probabilities mean what
    ///   they say. `0.0 < α < 0.5`, by default 0.05.
    /// - majority: its share of the robots that have a first choice, so that α of them may be for others. `0.0 < α <= 0.5`, by default 0.5:
    ///   half of them, and more than for any other class.
    /// - mean of probabilities: its mean, so that the robots may give the others α on average. As for a majority.
    pub alpha: Option<f64>,
    /// q: how many robots a decision needs.
    pub quorum: Quorum,
    /// For how long a robot counts for the majority after its last vote: as long as parts of a swarm may be cut off from each other
    /// and neither is to take itself for the whole.
    #[serde(with = "humantime_serde")]
    pub lately: Duration,
    /// c: how many robots vote in a round, drawn by lot, in a swarm of more than one and a half times as many; those who are not drawn
    /// conclude from their votes. To each liar that a decision must withstand four more. 0: all vote, however many there are.
    pub committee: u32,
    /// f: how many lying robots a decision must withstand. Whichever f votes are left out, the others must decide the same (by confidence weighted, where some
    /// know gestures that others do not: in all but rare cases, far from sure); more than 2·f robots
    /// must give evidence; and a majority is more than (n + f) / 2 of n robots, all of which gave evidence.
    pub liars: u32,
    /// c: the bound on a robot's log-evidence for or against any class, in nats.
    pub clip: f64,
    /// τ: how long until a view may have changed enough to count as another look; frames closer in time are one.
    #[serde(with = "humantime_serde")]
    pub decorrelation: Duration,
    /// Whether a look counts for less, the more it resembles an earlier one of the round.
    pub discount_repeats: bool,
    /// How long a round waits for live robots that have not seen anything yet, before it decides without them. A robot
    /// that never sees makes every round last this long.
    #[serde(with = "humantime_serde")]
    pub patience: Duration,
    /// When a round ends undecided, from its opening.
    #[serde(with = "humantime_serde")]
    pub deadline: Duration,
    /// After hearing of a round, requests to open another have no effect for this long: a copy of the request
    /// for this one may still be on its way. Nor does a newer round end it; zero lets any newer one, at any time.
    #[serde(with = "humantime_serde")]
    pub refractory: Duration,
    /// The least time between two votes of one robot: no longer than the deadline, or none would come in time.
    #[serde(with = "humantime_serde")]
    pub vote_interval: Duration,
    /// A vote is said again after this long, while the round is open.
    #[serde(with = "humantime_serde")]
    pub vote_repeat: Duration,
    /// How long the spokesrobot lets decisions meet before it announces the greatest.
    #[serde(with = "humantime_serde")]
    pub settle: Duration,
    /// How much longer each next robot waits for the announcement before it makes it itself.
    #[serde(with = "humantime_serde")]
    pub takeover: Duration,
    /// The period of repair between neighbours while a round is open or the neighbourhood has just changed.
    #[serde(with = "humantime_serde")]
    pub repair_busy: Duration,
    /// The same when nothing happens.
    #[serde(with = "humantime_serde")]
    pub repair_idle: Duration,
}

impl Default for RoundsConfig {
    fn default() -> Self {
        Self {
            rule: FusionRule::default(),
            alpha: None,
            quorum: Quorum::Majority,
            lately: Duration::from_secs(120),
            committee: 72,
            liars: 0,
            clip: 6.0,
            decorrelation: Duration::from_millis(500),
            discount_repeats: true,
            patience: Duration::from_millis(1000),
            deadline: Duration::from_secs(5),
            refractory: Duration::from_millis(500),
            vote_interval: Duration::from_millis(250),
            vote_repeat: Duration::from_secs(1),
            settle: Duration::from_millis(200),
            takeover: Duration::from_millis(400),
            repair_busy: Duration::from_millis(500),
            repair_idle: Duration::from_secs(4),
        }
    }
}

impl RoundsConfig {
    /// q: how many robots a decision needs, of so many.
    #[must_use]
    pub fn needs(&self, robots: u32) -> u32 {
        match (self.quorum, self.committee_of(robots)) {
            // Of a committee all liars may be members, or none, and speak all the same.
            (Quorum::Majority, Some(size)) => (size / 2 + 1).saturating_add(self.liars),
            // Two majorities have an honest robot in common, whatever liars say to each (Malkhi & Reiter 1998).
            (Quorum::Majority, None) => robots.saturating_add(self.liars) / 2 + 1,
            (Quorum::Evidence(quorum), _) => quorum,
        }
    }

    /// How many robots must be known to hold a decision for it to be final, of so many.
    #[must_use]
    pub fn holders(&self, robots: u32) -> u32 {
        match self.quorum {
            Quorum::Majority => self.needs(robots),
            Quorum::Evidence(_) => 1,
        }
    }

    /// Whether these are enough to decide: the robots that take part, those of them that gave evidence, and all there are. Of a large swarm
    /// only those count who were drawn, see [`suffice_of`](Self::suffice_of).
    #[must_use]
    pub fn suffice(&self, reached: usize, contributors: usize, robots: u32) -> bool {
        let counted = match self.quorum {
            // What a robot said before it saw anything may be used against it.
            Quorum::Majority if self.liars == 0 => reached,
            Quorum::Majority | Quorum::Evidence(_) => contributors,
        };
        counted >= self.needs(robots) as usize
            && (self.liars == 0 || contributors as u64 > 2 * u64::from(self.liars))
    }

    /// Whether the top class of a fusion decides that has so much left if as many as are expected lied, see
    /// [`Fuse::withstands`](crate::Fuse::withstands).
    #[must_use]
    pub fn convinces(&self, probability: f64) -> bool {
        probability >= 1.0 - self.alpha()
    }

    /// α: the one chosen, or the default of the rule.
    #[must_use]
    pub fn alpha(&self) -> f64 {
        let by_rule = match self.rule {
            FusionRule::Majority | FusionRule::MeanProbability => 0.5,
            FusionRule::LogPool
            | FusionRule::ConfidenceWeighted
            | FusionRule::CorrelatedPool
            | FusionRule::Other(_) => 0.05,
        };
        self.alpha.unwrap_or(by_rule)
    }

    /// The terms by which it decides, as certificates state them.
    #[must_use]
    pub fn terms(&self) -> Terms {
        Terms {
            clip: self.clip,
            alpha: self.alpha(),
            majority: self.quorum == Quorum::Majority,
            liars: self.liars,
            committee: self.committee,
        }
    }

    /// One that decides by the rule and the terms that a certificate states.
    pub(crate) fn stated(certificate: &Certificate) -> Self {
        let Certificate { rule, quorum, terms, .. } = certificate;
        let Terms { clip, alpha, majority, liars, committee } = *terms;
        let quorum = if majority { Quorum::Majority } else { Quorum::Evidence(*quorum) };
        Self { rule: *rule, alpha: Some(alpha), quorum, liars, clip, committee, ..Self::default() }
    }

    /// Whether a robot can work with these parameters.
    ///
    /// # Errors
    /// The first [`RoundsConfigError`] found.
    pub fn validate(&self) -> Result<(), RoundsConfigError> {
        let alpha = self.alpha();
        match self.rule {
            _ if alpha > 0.0 && alpha < 0.5 => {}
            FusionRule::Majority | FusionRule::MeanProbability if alpha == 0.5 => {}
            rule @ (FusionRule::Majority | FusionRule::MeanProbability) => {
                return Err(RoundsConfigError::Share { alpha, rule });
            }
            _ => return Err(RoundsConfigError::Alpha(alpha)),
        }
        if let FusionRule::Other(name) = self.rule {
            return Err(RoundsConfigError::Rule(name));
        }
        if let Quorum::Evidence(quorum) = self.quorum {
            if !(1..=MAX_ROBOTS).contains(&(quorum as usize)) {
                return Err(RoundsConfigError::Quorum(quorum));
            }
            if u64::from(quorum) <= 2 * u64::from(self.liars) && self.liars > 0 {
                return Err(RoundsConfigError::Liars { liars: self.liars, quorum });
            }
        }
        if !(self.clip > 0.0 && self.clip <= 1000.0) {
            return Err(RoundsConfigError::Clip(self.clip));
        }
        let above_zero = [
            ("decorrelation", self.decorrelation),
            ("deadline", self.deadline),
            ("vote_interval", self.vote_interval),
            ("vote_repeat", self.vote_repeat),
            ("takeover", self.takeover),
            ("repair_busy", self.repair_busy),
            ("repair_idle", self.repair_idle),
        ];
        if let Some((field, _)) = above_zero.iter().find(|(_, duration)| duration.is_zero()) {
            return Err(RoundsConfigError::Zero(field));
        }
        let any = [
            ("patience", self.patience),
            ("refractory", self.refractory),
            ("settle", self.settle),
            ("lately", self.lately),
        ];
        let day = Duration::from_secs(24 * 60 * 60);
        if let Some((field, _)) = above_zero.iter().chain(&any).find(|(_, duration)| *duration > day) {
            return Err(RoundsConfigError::TooLong(field));
        }
        let ordered = [
            ("patience", self.patience, "deadline", self.deadline),
            ("vote_interval", self.vote_interval, "vote_repeat", self.vote_repeat),
            ("vote_interval", self.vote_interval, "deadline", self.deadline),
            ("repair_busy", self.repair_busy, "repair_idle", self.repair_idle),
        ];
        match ordered.iter().find(|(_, less, _, more)| less > more) {
            Some(&(shorter, _, longer, _)) => Err(RoundsConfigError::Order { shorter, longer }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid() {
        assert_eq!(RoundsConfig::default().validate(), Ok(()));
        // What a recording of before they were stated is read as.
        assert_eq!(RoundsConfig::default().terms(), Terms::default());
    }

    #[test]
    fn every_rule_decides_by_an_alpha_of_its_own() {
        for (rule, alpha) in FusionRule::ALL.into_iter().zip([0.5, 0.5, 0.05, 0.05, 0.05]) {
            let config = RoundsConfig { rule, ..RoundsConfig::default() };
            assert_eq!((config.alpha(), config.validate()), (alpha, Ok(())), "{rule}");
            assert!(config.convinces(1.0 - alpha) && !config.convinces(0.99 - alpha));
        }
        let chosen = RoundsConfig { alpha: Some(0.2), rule: FusionRule::Majority, ..RoundsConfig::default() };
        assert_eq!(chosen.alpha(), 0.2);
    }

    #[test]
    fn no_period_is_so_long_that_adding_it_up_overflows() {
        type Field = fn(&mut RoundsConfig) -> &mut Duration;
        let fields: [(&str, Field); 11] = [
            ("lately", |config| &mut config.lately),
            ("decorrelation", |config| &mut config.decorrelation),
            ("patience", |config| &mut config.patience),
            ("deadline", |config| &mut config.deadline),
            ("refractory", |config| &mut config.refractory),
            ("vote_interval", |config| &mut config.vote_interval),
            ("vote_repeat", |config| &mut config.vote_repeat),
            ("settle", |config| &mut config.settle),
            ("takeover", |config| &mut config.takeover),
            ("repair_busy", |config| &mut config.repair_busy),
            ("repair_idle", |config| &mut config.repair_idle),
        ];
        for (name, field) in fields {
            let mut config = RoundsConfig::default();
            *field(&mut config) = Duration::MAX;
            assert_eq!(config.validate(), Err(RoundsConfigError::TooLong(name)));
        }
    }

    #[test]
    fn what_no_robot_can_work_with_is_named() {
        let default = RoundsConfig::default;
        let ms = Duration::from_millis;
        for (config, field) in [
            (RoundsConfig { alpha: Some(0.5), ..default() }, "alpha"),
            (RoundsConfig { alpha: Some(0.51), rule: FusionRule::Majority, ..default() }, "majority"),
            (RoundsConfig { alpha: Some(f64::NAN), ..default() }, "alpha"),
            (RoundsConfig { rule: FusionRule::Other("mine".parse().unwrap()), ..default() }, "mine"),
            (RoundsConfig { quorum: Quorum::Evidence(0), ..default() }, "quorum"),
            (RoundsConfig { quorum: Quorum::Evidence(2), liars: 1, ..default() }, "liars"),
            (RoundsConfig { clip: f64::INFINITY, ..default() }, "clip"),
            (RoundsConfig { repair_busy: ms(0), ..default() }, "repair_busy"),
            (RoundsConfig { settle: Duration::MAX, ..default() }, "settle"),
            (RoundsConfig { patience: ms(6000), ..default() }, "patience"),
            (RoundsConfig { vote_repeat: ms(100), ..default() }, "vote_repeat"),
            (RoundsConfig { vote_interval: ms(6000), vote_repeat: ms(6000), ..default() }, "deadline"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
