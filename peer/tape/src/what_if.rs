//! What would have been decided: the recorded votes, counted otherwise.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use gestalt_protocol::{ClassId, FusionRule, HeldVote, RobotId, RoundId};
use gestalt_rounds::{Quorum, RoundsConfig, RoundsConfigError};
use serde::Serialize;

use crate::count::{ballot, count, scale, votes};
use crate::run::{Run, Showing, Truth};

/// What is to be otherwise; what is `None` or empty stays as it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WhatIf {
    /// The fusion rule. With another one α is that rule's default, if none is given.
    pub rule: Option<FusionRule>,
    /// q.
    pub quorum: Option<Quorum>,
    /// α.
    pub alpha: Option<f64>,
    /// f.
    pub liars: Option<u32>,
    /// Robots that were not there: their votes do not count, and each that took part is one robot less.
    pub without: BTreeSet<RobotId>,
    /// Count what was heard so long after the round was first heard of, instead of what the decision rests on.
    pub until: Option<Duration>,
}

impl WhatIf {
    /// The configuration of robots that count so, if they counted by `was`.
    ///
    /// # Errors
    /// [`RoundsConfigError`] for one that no robot can work with.
    pub fn config(&self, was: &RoundsConfig) -> Result<RoundsConfig, RoundsConfigError> {
        let rule = self.rule.unwrap_or(was.rule);
        let config = RoundsConfig {
            rule,
            alpha: self.alpha.or(was.alpha.filter(|_| rule == was.rule)),
            quorum: self.quorum.unwrap_or(was.quorum),
            liars: self.liars.unwrap_or(was.liars),
            ..was.clone()
        };
        config.validate()?;
        Ok(config)
    }

    /// What robots of that configuration would have decided of a showing; `None` where nothing was announced of it.
    #[must_use]
    pub fn decide(&self, showing: &Showing, config: &RoundsConfig) -> Option<Option<ClassId>> {
        let certificate = &showing.decision()?.certificate;
        let there = |held: &HeldVote| !self.without.contains(&held.robot);
        let absent = votes(certificate).filter(|held| !there(held)).count();
        let robots = certificate.robots.saturating_sub(u32::try_from(absent).unwrap_or(u32::MAX));
        let ballot = match self.until {
            None => ballot(votes(certificate).filter(there)),
            Some(until) => {
                let end = showing.opened.saturating_add(u64::try_from(until.as_nanos()).unwrap_or(u64::MAX));
                let heard = showing.votes.iter().filter(|(at, _)| *at <= end);
                ballot(heard.map(|(_, held)| held.clone()).filter(there))
            }
        };
        let scale = scale(certificate).or_else(|| ballot.prevailing_scale());
        let pool = certificate.pool.filter(|_| config.rule == certificate.rule);
        Some(count(&ballot, scale, robots, config, pool).class)
    }
}

/// `majority, quorum 4, without 3`; `as it was` where nothing is otherwise.
impl fmt::Display for WhatIf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        parts.extend(self.rule.map(|rule| rule.name().to_owned()));
        parts.extend(self.quorum.map(|quorum| match quorum {
            Quorum::Majority => "quorum majority".to_owned(),
            Quorum::Evidence(robots) => format!("quorum {robots}"),
        }));
        parts.extend(self.alpha.map(|alpha| format!("alpha {alpha}")));
        parts.extend(self.liars.map(|liars| format!("liars {liars}")));
        if !self.without.is_empty() {
            let robots: Vec<String> = self.without.iter().map(ToString::to_string).collect();
            parts.push(format!("without {}", robots.join(" ")));
        }
        parts.extend(self.until.map(|until| format!("until {} ms", until.as_millis())));
        f.pad(&if parts.is_empty() { "as it was".to_owned() } else { parts.join(", ") })
    }
}

/// One showing, as it was decided and as it would have been.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Outcome {
    /// The round.
    pub round: RoundId,
    /// What was decided.
    pub happened: Option<ClassId>,
    /// What would have been.
    pub would: Option<ClassId>,
    /// What people said that it was.
    #[serde(skip)]
    pub truth: Option<Truth>,
}

/// What would have been decided in a whole run.
#[must_use]
pub fn outcomes(run: &Run, what: &WhatIf, config: &RoundsConfig) -> Vec<Outcome> {
    let outcome = |showing: &Showing| {
        let happened = showing.decision()?;
        let would = what.decide(showing, config)?;
        Some(Outcome { round: happened.round, happened: happened.class, would, truth: run.truth(showing) })
    };
    run.showings.iter().filter_map(outcome).collect()
}
