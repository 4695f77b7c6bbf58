//! What a run, and what many runs, show.

use std::fmt;
use std::time::Duration;

use gestalt_protocol::FusionRule;
use serde::Serialize;

use super::calibration::{Calibration, Heard, Said};
use super::network::{Network, Traffic};
use super::record::{Record, Showing};
use super::statistics::{Mean, Proportion};

/// What one run of a scenario shows. Shares are of the rounds that a robot opened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The seed it came of.
    pub seed: u64,
    /// How many robots there are.
    pub robots: usize,
    /// How many gestures were shown.
    pub showings: u64,
    /// Rounds in which the swarm decided for the gesture shown.
    pub right: Proportion,
    /// Rounds in which it decided for another.
    pub wrong: Proportion,
    /// Rounds in which it did not decide.
    pub undecided: Proportion,
    /// Rounds in which a robot announced the gesture shown as final.
    pub finally_right: Proportion,
    /// Rounds in which a robot announced another gesture as final.
    pub finally_wrong: Proportion,
    /// Rounds in which liars made a decision for another gesture out of the votes that were said, which robots believe.
    pub forged: Proportion,
    /// Rounds in which the likeliest class was the one shown, sure enough for a decision or not.
    pub likeliest_right: Proportion,
    /// First frames, one of each robot and showing, in which the robot found the gesture shown likeliest. Later ones are not counted: while a
    /// showing is hard robots look longer, by one fusion rule more so than by another.
    pub frames_right: Proportion,
    /// Votes counted in decisions whose likeliest class was the gesture shown.
    pub votes_right: Proportion,
    /// Rounds at whose end all robots that are up hold the same decision.
    pub unanimous: Proportion,
    /// Rounds at whose end two robots hold different classes.
    pub conflicts: u64,
    /// Whether, at the end of the scenario, all robots that are up hold the same gesture, or none, of the same round.
    pub agreed_at_the_end: bool,
    /// Milliseconds from the showing to the first robot that holds a class, per decided round.
    pub decided_ms: Mean,
    /// Milliseconds from the showing until no robot changes what it holds any more, per round.
    pub settled_ms: Mean,
    /// How often a decision was announced, per round.
    pub announcements: Mean,
    /// Bytes of votes a robot that does not lie says per second of an open round, to each of its next hops.
    pub vote_bytes_per_open_second: f64,
    /// Bytes that a robot puts on its links over the whole run, on average, by purpose.
    pub bytes_per_robot: BytesPerRobot,
    /// What robots have learned from at the end, if they learn.
    pub learned: Option<Learned>,
    /// Its decisions for a gesture.
    #[serde(skip)]
    pub(super) said: Vec<Said>,
    /// How many of the showings were of gestures that no instructor had named yet.
    pub untaught: u64,
}

/// Bytes that a robot puts on its links, without what the transport adds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BytesPerRobot {
    /// Its own votes.
    pub votes: f64,
    /// Repair with its neighbours.
    pub repair: f64,
    /// The decisions it holds and announces.
    pub decisions: f64,
    /// What instructors said through it, and its answers.
    pub words: f64,
    /// What it passes on for others, but samples.
    pub relayed: f64,
    /// The samples it published, whatever its number of links.
    pub published_samples: f64,
    /// All samples on its links: its own, those it passes on, and those told for repair.
    pub samples_on_links: f64,
}

/// What robots have learned from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// Samples held per robot that is up.
    pub samples: Mean,
    /// Of them those known to all: shared by it or by others.
    pub common: Mean,
    /// Whether all robots that are up have the same common knowledge.
    pub alike: bool,
}

impl Report {
    pub(super) fn new(seed: u64, record: &Record, network: &Network, learned: Option<Learned>) -> Self {
        let opened: Vec<&Showing> = record.showings.iter().filter(|s| s.opened).collect();
        let rounds = opened.len() as u64;
        let count = |holds: &dyn Fn(&Showing) -> bool| opened.iter().filter(|s| holds(s)).count() as u64;
        let decision = |showing: &Showing| showing.outcome.as_ref().and_then(|o| o.decision.clone());
        let decided = |showing: &Showing| decision(showing).and_then(|d| d.class);
        let counted: Vec<bool> = opened
            .iter()
            .flat_map(|showing| {
                let votes = decision(showing).map_or(Vec::new(), |d| d.certificate.votes);
                votes.into_iter().map(|vote| vote.class == showing.shown)
            })
            .collect();
        let holds = |robot: usize| record.holds[robot].as_ref().map(|held| (held.round, held.class));
        let mut held = network.up().filter(|robot| record.honest[*robot]).map(holds);
        let first = held.next();
        let total: Traffic = network.traffic.iter().copied().sum();
        let robots = network.size();
        let share = |bytes: u64| bytes as f64 / robots as f64;
        let ms = |showing: &Showing, at: Duration| (at - showing.at).as_secs_f64() * 1e3;
        let times = |at: &dyn Fn(&Showing) -> Option<Duration>| {
            Mean::of(&opened.iter().filter_map(|s| Some(ms(s, at(s)?))).collect::<Vec<_>>())
        };
        let open = record.open.as_secs_f64();
        // Liars have no round open.
        let of_honest = network.traffic.iter().zip(&record.honest).filter(|(_, honest)| **honest);
        let votes = of_honest.map(|(traffic, _)| traffic.votes).sum::<u64>();
        // Robots that do not learn know all gestures; those that do know what somebody named, and rightly.
        let taught = |n: usize| {
            let (showing, before) = (&record.showings[n], &record.showings[..n]);
            learned.is_none() || before.iter().any(|b| b.named_rightly && b.shown == showing.shown)
        };
        let heard: Vec<usize> = (0..record.showings.len()).filter(|n| record.showings[*n].opened).collect();
        let said = heard.iter().filter_map(|n| {
            let showing = &record.showings[*n];
            let made = decision(showing).filter(|made| made.class.is_some())?;
            let right = made.class == Some(showing.shown);
            Some(Said { confidence: made.confidence, right, taught: taught(*n) })
        });
        let said = said.collect();
        Self {
            seed,
            robots,
            showings: record.showings.len() as u64,
            right: Proportion::new(count(&|s| decided(s) == Some(s.shown)), rounds),
            wrong: Proportion::new(count(&|s| decided(s).is_some_and(|class| class != s.shown)), rounds),
            undecided: Proportion::new(count(&|s| decided(s).is_none()), rounds),
            finally_right: Proportion::new(count(&|s| s.finally_right), rounds),
            finally_wrong: Proportion::new(count(&|s| s.finally_wrong), rounds),
            forged: Proportion::new(count(&|s| s.forged), rounds),
            likeliest_right: Proportion::new(
                count(&|s| {
                    decision(s)
                        .is_some_and(|d| likeliest(&d.certificate.probabilities) == Some(s.shown.index()))
                }),
                rounds,
            ),
            frames_right: Proportion::new(record.frames_right, record.frames),
            votes_right: Proportion::new(
                counted.iter().filter(|right| **right).count() as u64,
                counted.len() as u64,
            ),
            unanimous: Proportion::new(count(&|s| s.outcome.as_ref().is_some_and(|o| o.unanimous)), rounds),
            conflicts: count(&|s| s.outcome.as_ref().is_some_and(|o| o.conflict)),
            agreed_at_the_end: first.is_some_and(|first| first.is_some() && held.all(|other| other == first)),
            decided_ms: times(&|s| s.first_held),
            settled_ms: times(&|s| s.last_held),
            announcements: Mean::of(&opened.iter().map(|s| f64::from(s.announcements)).collect::<Vec<_>>()),
            vote_bytes_per_open_second: if open > 0.0 { votes as f64 / open } else { 0.0 },
            bytes_per_robot: BytesPerRobot {
                votes: share(total.votes),
                repair: share(total.repair),
                decisions: share(total.decisions),
                words: share(total.words),
                relayed: share(total.relayed),
                published_samples: share(total.published_samples),
                samples_on_links: share(total.samples_on_links()),
            },
            untaught: heard.iter().filter(|n| !taught(**n)).count() as u64,
            learned,
            said,
        }
    }

    fn heard(&self) -> Heard<'_> {
        let taught = self.right.trials - self.untaught;
        Heard { said: &self.said, taught, untaught: self.untaught }
    }
}

/// The likeliest class; of equals the first, as a fusion takes it.
pub(crate) fn likeliest(probabilities: &[f64]) -> Option<usize> {
    // Reversed, because of equal maxima the last one is returned and a fusion takes the first.
    let ranked = probabilities.iter().enumerate().rev();
    ranked.max_by(|a, b| a.1.total_cmp(b.1)).map(|(class, _)| class)
}

/// What many runs of one scenario, with one seed each, show together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The fusion rule.
    pub rule: FusionRule,
    /// Its α.
    pub alpha: f64,
    /// How many seeds.
    pub seeds: usize,
    /// How many robots there are.
    pub robots: usize,
    /// Gestures shown that opened no round, of all seeds: robots were still in the one before. Nothing else counts them.
    pub unopened: u64,
    /// As in [`Report`], over the rounds of all seeds.
    pub right: Proportion,
    /// As in [`Report`], over the rounds of all seeds.
    pub wrong: Proportion,
    /// As in [`Report`], over the rounds of all seeds.
    pub undecided: Proportion,
    /// As in [`Report`], over the rounds of all seeds.
    pub likeliest_right: Proportion,
    /// The shares of those seeds in which a robot saw anything.
    pub frames_right: Mean,
    /// As in [`Report`], over the votes of all seeds.
    pub votes_right: Proportion,
    /// As in [`Report`], over the rounds of all seeds.
    pub unanimous: Proportion,
    /// As in [`Report`], over the rounds of all seeds.
    pub conflicts: u64,
    /// Seeds at whose end all robots agree.
    pub agreed_at_the_end: Proportion,
    /// The means of those seeds that decided anything.
    pub decided_ms: Mean,
    /// The means of those seeds in which a robot held anything.
    pub settled_ms: Mean,
    /// The means of the seeds.
    pub announcements: Mean,
    /// The values of the seeds.
    pub vote_bytes_per_open_second: Mean,
    /// Of the decisions of all seeds.
    pub calibration: Calibration,
}

impl Summary {
    /// Puts the reports of several seeds together.
    #[must_use]
    pub fn of(rule: FusionRule, alpha: f64, reports: &[Report]) -> Self {
        let pool = |of: &dyn Fn(&Report) -> Proportion| {
            Proportion::over_seeds(reports.iter().map(of).map(|p| (p.hits, p.trials)))
        };
        let mean = |of: &dyn Fn(&Report) -> f64| Mean::of(&reports.iter().map(of).collect::<Vec<_>>());
        let means = |of: &dyn Fn(&Report) -> Mean| Mean::of_means(reports.iter().map(of));
        let agreed = reports.iter().filter(|report| report.agreed_at_the_end).count();
        Self {
            rule,
            alpha,
            seeds: reports.len(),
            robots: reports.first().map_or(0, |report| report.robots),
            unopened: reports.iter().map(|report| report.showings - report.right.trials).sum(),
            right: pool(&|report| report.right),
            wrong: pool(&|report| report.wrong),
            undecided: pool(&|report| report.undecided),
            likeliest_right: pool(&|report| report.likeliest_right),
            frames_right: Mean::of_shares(reports.iter().map(|report| report.frames_right)),
            votes_right: pool(&|report| report.votes_right),
            unanimous: pool(&|report| report.unanimous),
            conflicts: reports.iter().map(|report| report.conflicts).sum(),
            agreed_at_the_end: Proportion::new(agreed as u64, reports.len() as u64),
            decided_ms: means(&|report| report.decided_ms),
            settled_ms: means(&|report| report.settled_ms),
            announcements: means(&|report| report.announcements),
            vote_bytes_per_open_second: mean(&|report| report.vote_bytes_per_open_second),
            calibration: Calibration::of(&reports.iter().map(Report::heard).collect::<Vec<_>>()),
        }
    }
}

/// Several summaries as a table for people: shares in percent with their 95 % intervals.
#[derive(Clone, Debug)]
pub struct Table<'a>(pub &'a [Summary]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent =
            |p: Proportion| format!("{:5.1} [{:.1}, {:.1}]", 100.0 * p.share, 100.0 * p.low, 100.0 * p.high);
        writeln!(
            f,
            "{:<20} {:>5}  {:<20} {:<18} {:>9}  {:<20} {:<20} {:>14} {:>9}",
            "rule",
            "alpha",
            "right %",
            "wrong %",
            "undecided",
            "likeliest right %",
            "unanimous %",
            "decided ms",
            "vote B/s"
        )?;
        for summary in self.0 {
            let rule = summary.rule;
            writeln!(
                f,
                "{rule:<20} {:>5}  {:<20} {:<18} {:>9}  {:<20} {:<20} {:>14} {:>9.0}",
                summary.alpha,
                percent(summary.right),
                percent(summary.wrong),
                summary.undecided.hits,
                percent(summary.likeliest_right),
                percent(summary.unanimous),
                summary.decided_ms.decimals(0),
                summary.vote_bytes_per_open_second.mean,
            )?;
        }
        writeln!(
            f,
            "\n{:<20} {:>5}  {:<19} {:<9} {:<26} {:<26} {:<28} {:<26}",
            "rule",
            "alpha",
            "calibration error",
            "by chance",
            "≥ .99 and wrong %",
            "untaught, and ≥ .9 %",
            "taught, and decided %",
            "of these right %"
        )?;
        for summary in self.0 {
            let Calibration { error, error_by_chance, .. } = summary.calibration;
            let of = |p: Proportion| match p.trials {
                0 => "–".to_owned(),
                trials => format!("{} of {trials}", percent(p)),
            };
            writeln!(
                f,
                "{:<20} {:>5}  {:<19} {:<9} {:<26} {:<26} {:<28} {:<26}",
                summary.rule,
                summary.alpha,
                error.decimals(3),
                error_by_chance.map_or("–".to_owned(), |error| format!("≤ {error:.3}")),
                of(summary.calibration.sure_and_wrong),
                of(summary.calibration.untaught_and_sure),
                of(summary.calibration.taught_and_decided),
                of(summary.calibration.taught_and_right),
            )?;
        }
        for Summary { rule, alpha, unopened, right, .. } in self.0.iter().filter(|it| it.unopened > 0) {
            let shown = unopened + right.trials;
            writeln!(
                f,
                "{rule}, α {alpha}: {unopened} of {shown} gestures shown opened no round, as robots were in the one before, and count nowhere"
            )?;
        }
        if let Some(any) = self.0.first() {
            writeln!(
                f,
                "{} robots, {} rounds of {} seeds; one frame of one robot is right in {} %, 95 % intervals {}",
                any.robots,
                any.right.trials,
                any.seeds,
                any.frames_right.percent(),
                match any.seeds {
                    0 | 1 => "(Wilson; of one seed, whose rounds count as independent)",
                    _ =>
                        "by seed (shares: Wilson with Student's t, of as many rounds as seeds show to be independent)",
                },
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, RobotId, RoundId};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::emulation::network::Kind;
    use crate::emulation::scenario::LinkModel;

    #[test]
    fn votes_of_liars_who_have_no_round_open_are_not_what_robots_say_in_one() {
        let mut network = Network::new(2, vec![(0, 1)], LinkModel::default(), ChaCha8Rng::seed_from_u64(1));
        let mut record = Record::new(vec![false, true]);
        record.show(Duration::ZERO, ClassId(0));
        record.open(Duration::ZERO, 1, RoundId { counter: 1, opener: RobotId(2), life: 7 });
        record.close(Duration::from_secs(2), 1);
        network.broadcast(0, 1000, Kind::Vote);
        network.broadcast(1, 30, Kind::Vote);
        let report = Report::new(0, &record, &network, None);
        assert_eq!((report.vote_bytes_per_open_second, report.bytes_per_robot.votes), (15.0, 515.0));
    }
}
