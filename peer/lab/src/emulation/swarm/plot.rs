//! What the liars of a swarm know together, and what they make of it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{
    Certificate, ClassId, Decision, HeldVote, RobotId, RoundId, Stamp, VocabularyId, Vote,
};
use gestalt_strategies::{Ballot, Fuse, MindConfig, follows};

/// Looks that liars say are behind their votes: as many as count.
const LOOKS: f32 = 16.0;

/// What the liars know of the newest round.
#[derive(Default)]
pub(super) struct Plot {
    round: Option<RoundId>,
    vocabulary: Option<VocabularyId>,
    /// All that each of the others said in it, in the order in which it was heard.
    said: BTreeMap<RobotId, Vec<HeldVote>>,
    /// What they want decided.
    pub goal: Option<ClassId>,
    /// For which gestures they have told a decision.
    pub told: BTreeSet<ClassId>,
    /// They count on through all rounds.
    sequence: u32,
}

impl Plot {
    /// Hears a vote of a robot that does not lie. Says whether it was news.
    pub fn hear(&mut self, held: &HeldVote) -> bool {
        let id = held.vote.round;
        if self.round.is_none_or(|round| round.counter < id.counter) {
            *self = Self { round: Some(id), sequence: self.sequence, ..Self::default() };
        }
        if self.round.is_none_or(|round| round.counter > id.counter) {
            return false;
        }
        if held.vote.vocabulary != VocabularyId::NONE {
            self.vocabulary = Some(held.vote.vocabulary);
        }
        let said = self.said.entry(held.robot).or_default();
        let news = said.iter().all(|other| other.stamp != held.stamp);
        if news {
            said.push(held.clone());
        }
        news
    }

    /// The gestures that were not shown, of which most speaks for the first.
    pub fn rivals(&self, shown: ClassId, classes: usize) -> Vec<ClassId> {
        let latest = self.said.values().filter_map(|said| said.iter().max_by_key(|held| held.stamp));
        let mut totals = vec![0.0; classes];
        for held in latest {
            for (total, value) in totals.iter_mut().zip(&held.vote.evidence) {
                *total += f64::from(*value);
            }
        }
        let mut rivals: Vec<usize> = (0..classes).filter(|class| *class != shown.index()).collect();
        rivals.sort_by(|a, b| totals[*b].total_cmp(&totals[*a]));
        rivals.into_iter().map(|class| ClassId(class as u32)).collect()
    }

    /// What a liar votes who is for that gesture.
    pub fn vote(&self, class: ClassId, classes: usize, clip: f64) -> Option<Vote> {
        let mut evidence = vec![-clip as f32; classes];
        evidence[class.index()] = clip as f32;
        Some(Vote {
            round: self.round?,
            vocabulary: self.vocabulary?,
            evidence,
            looks: LOOKS,
            unknown: None,
            named: vec![],
        })
    }

    /// The next stamp of a liar.
    pub fn stamp(&mut self) -> Stamp {
        self.sequence += 1;
        Stamp { boot: 1, sequence: self.sequence }
    }

    /// A decision for a gesture: on the votes of the liars and of so many of the others as suit it, of each the vote that does so most.
    pub fn choose(
        &mut self,
        class: ClassId,
        (shown, classes): (ClassId, usize),
        (liars, robots): (&[RobotId], usize),
        took: Duration,
        config: &MindConfig,
    ) -> Option<Decision> {
        let clip = config.clip as f32;
        let leads = |held: &HeldVote| {
            let of = |class: ClassId| held.vote.evidence.get(class.index()).map(|x| x.clamp(-clip, clip));
            Some(of(class)? - of(shown)?)
        };
        let mut suiting: Vec<(f32, HeldVote)> = self
            .said
            .values()
            .filter_map(|said| {
                let best = said.iter().filter_map(|held| Some((leads(held)?, held)));
                best.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(lead, held)| (lead, held.clone()))
            })
            .collect();
        suiting.sort_by(|a, b| b.0.total_cmp(&a.0));
        let stamp = self.stamp();
        let lie = self.vote(class, classes, config.clip)?;
        let lies =
            liars.iter().map(|robot| HeldVote { robot: *robot, stamp, vote: lie.clone(), signature: None });
        let empty =
            self.said.values().filter_map(|said| said.iter().find(|held| held.vote.evidence.is_empty()));
        // Whoever is not counted takes part at least, if it said so.
        let rest: Vec<HeldVote> = lies.chain(empty.cloned()).collect();
        let counter = self.round?.counter;
        let reached = || liars.iter().chain(self.said.keys()).copied();
        let enough = |counted: &usize| {
            let suiting = suiting[..*counted].iter().map(|(_, held)| held.robot);
            config.suffice_of(counter, reached(), liars.iter().copied().chain(suiting), robots as u32)
        };
        let least = (0..=suiting.len()).find(enough)?;
        // Beyond as many as are needed, none that speaks against it helps.
        let helps = |counted: &usize| *counted == least || suiting[counted - 1].0 > 0.0;
        (least..=suiting.len()).take_while(helps).find_map(|counted| {
            let mut ballot = Ballot::default();
            for held in suiting[..counted].iter().map(|(_, held)| held).chain(&rest) {
                ballot.cast(held.clone());
            }
            let decision = self.decide(class, &ballot, liars[0], robots, took, config)?;
            follows(&decision, &config.rule, config, robots as u32).then_some(decision)
        })
    }

    fn decide(
        &self,
        class: ClassId,
        ballot: &Ballot,
        author: RobotId,
        robots: usize,
        took: Duration,
        config: &MindConfig,
    ) -> Option<Decision> {
        let scale = ballot.prevailing_scale()?;
        let fusion = ballot.fuse(&config.rule, config.clip, scale)?;
        Some(Decision {
            round: self.round?,
            class: Some(class),
            confidence: fusion.probabilities[class.index()],
            author,
            is_final: true,
            certificate: Certificate {
                vocabulary: scale.vocabulary,
                rule: config.rule,
                pool: config.rule.pool(),
                probabilities: fusion.probabilities,
                unknown: None,
                votes: ballot.counted(&config.rule, config.clip, scale),
                others: ballot.uncounted(Some(scale)),
                robots: robots as u32,
                quorum: config.needs(robots as u32),
                elapsed_ms: took.as_millis() as u32,
                named: vec![],
                terms: config.terms(),
            },
        })
    }

    /// A decision that nobody draws from the votes of the liars alone, which are all it has.
    pub fn claim(
        &mut self,
        class: ClassId,
        classes: usize,
        liars: &[RobotId],
        robots: usize,
        config: &MindConfig,
    ) -> Option<Decision> {
        let (stamp, vote) = (self.stamp(), self.vote(class, classes, config.clip)?);
        let mut ballot = Ballot::default();
        for robot in liars {
            ballot.cast(HeldVote { robot: *robot, stamp, vote: vote.clone(), signature: None });
        }
        self.decide(class, &ballot, liars[0], robots, Duration::ZERO, config)
    }
}
