//! Votes as fusion rules take them: first whether it is a gesture that was taught at all, then which.

use std::borrow::Cow;

use gestalt_protocol::{ClassId, FusionRule, Vote};

use crate::columns::Columns;
use crate::fuse::Fuse;
use crate::fusion::{Fusion, top_of};

/// The evidence of the votes for the gestures, and for whether it is any that was taught.
///
/// Robots that look at one hand are many witnesses of which gesture it is, for each sees it from elsewhere. Of whether anybody ever taught it they
/// are one: all learned from the same showings. So the evidence for the gestures goes to the rule, and that for "unknown" is averaged. With d(k) by
/// what a robot's evidence for gesture k exceeds that for "unknown", T the gestures that any of the robots was taught, and U how many were not:
///
/// S = mean of ln Σ exp d(k) over T, P(taught) = exp S / (exp S + U + 1), P(k) = P(taught) · P(k | T) by the rule
///
/// "Unknown" and each gesture that nobody was taught share the rest alike.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rows<'a> {
    /// By how many robots each gesture was learned.
    known_by: Vec<usize>,
    /// For each vote its evidence for each gesture.
    rows: Vec<Cow<'a, [f32]>>,
    /// For each vote that tells, one after the other, and each gesture: d(k).
    leads: Vec<f64>,
    /// How many votes tell.
    tell: usize,
}

/// The gestures among which a rule is asked to choose, and what it chose.
struct Choice<'a> {
    of: Vec<usize>,
    part: Part<'a>,
    fusion: Fusion,
}

/// The evidence of each vote for some of the gestures.
pub(crate) enum Part<'a> {
    All(&'a [Cow<'a, [f32]>]),
    /// One vote after the other: for a swarm of a thousand, one piece of memory and not a thousand.
    Picked(Vec<f32>, usize),
}

impl Part<'_> {
    /// By vote.
    pub fn rows(&self) -> Vec<&[f32]> {
        match self {
            Self::All(rows) => rows.iter().map(AsRef::as_ref).collect(),
            Self::Picked(values, width) => values.chunks_exact((*width).max(1)).collect(),
        }
    }
}

impl<'a> Rows<'a> {
    /// Those of votes over these gestures; "unknown" is compared after clipping both to ±`clip`.
    pub fn of(columns: &Columns, clip: f64, votes: impl Iterator<Item = &'a Vote>) -> Self {
        let mut known_by = vec![0; columns.len()];
        let most = votes.size_hint().1.unwrap_or_default();
        let mut rows = Vec::with_capacity(most);
        let (mut leads, mut tell) = (Vec::with_capacity(most * columns.len()), 0);
        let clipped = |value: f32| f64::from(value).min(clip).max(-clip);
        for vote in votes {
            let row = columns.row(vote);
            for (place, (class, known_by)) in columns.classes().zip(&mut known_by).enumerate() {
                let is_known = match &row {
                    // Of the same gestures as the columns.
                    Cow::Borrowed(evidence) => {
                        evidence.get(place).is_some_and(|value| tells_apart(vote, *value))
                    }
                    Cow::Owned(_) => knows(vote, class),
                };
                *known_by += usize::from(is_known);
            }
            if let Some(unknown) = vote.unknown.map(clipped) {
                leads.extend(row.iter().map(|value| clipped(*value) - unknown));
                leads.resize((tell + 1) * columns.len(), 0.0);
                tell += 1;
            }
            rows.push(row);
        }
        Self { known_by, rows, leads, tell }
    }

    /// How many probabilities a fusion has: one for each gesture, and where any robot tells, one for "unknown".
    pub fn classes(&self) -> usize {
        self.known_by.len() + usize::from(self.tells())
    }

    /// The gestures that any robot was taught: all of them, where no robot tells what is unknown.
    pub fn taught(&self) -> Vec<usize> {
        self.known_by_more_than(0)
    }

    /// The evidence of each vote for these.
    pub fn of_taught(&self) -> Part<'_> {
        self.restricted(&self.taught())
    }

    /// All of it as one distribution over [`Self::classes`]; `None` when there is none, or the rule makes none of it.
    pub fn fuse(&self, rule: &dyn Fuse, clip: f64) -> Option<Fusion> {
        if self.rows.is_empty() {
            return None;
        }
        let choice = self.choose(rule, clip, self.taught())?;
        if !self.tells() {
            return Some(choice.fusion);
        }
        let [taught, each] = shares(self.odds(0), self.known_by.len() - choice.of.len());
        let mut probabilities = vec![each; self.classes()];
        for (class, p) in choice.of.iter().zip(&choice.fusion.probabilities) {
            probabilities[*class] = p * taught;
        }
        let top = top_of(&probabilities);
        let margin = if choice.top() == Some(top.index()) { choice.fusion.margin } else { 0.0 };
        Some(Fusion { probabilities, top, margin })
    }

    /// The least probability that the top class of that fusion has left if so many of the robots lied; 0 where that is no gesture that was taught.
    pub fn withstands(&self, rule: &dyn Fuse, clip: f64, fusion: &Fusion, liars: u32) -> f64 {
        let top = fusion.top.index();
        let which = |known_by: usize| {
            let choice = self.choose(rule, clip, self.known_by_more_than(known_by));
            let choice = choice.filter(|choice| choice.top() == Some(top))?;
            if choice.of.len() == 1 {
                return Some(1.0);
            }
            Some(rule.withstands(clip, &choice.part.rows(), &choice.fusion, liars))
        };
        if !self.tells() || liars == 0 {
            let share = fusion.probabilities.get(top).filter(|_| self.tells() && fusion.margin > 0.0);
            return which(0).map_or(0.0, |all| share.map_or(all, |share| all.min(*share)));
        }
        // What liars pretend to have been taught is nobody's gesture without them.
        let firm = self.known_by_more_than(liars as usize);
        let [taught, _] = shares(self.odds(liars as usize), self.known_by.len() - firm.len());
        let which = [which(0), which(liars as usize)].into_iter().map(|which| which.unwrap_or(0.0));
        let always = if rule.rule() == FusionRule::Majority { self.always_for(top, liars) } else { 1.0 };
        taught * which.fold(always, f64::min)
    }

    /// The least part of a majority that is for a gesture, whatever liars pretend to have been taught: by that they can make robots abstain who find what they
    /// do not know themselves likeliest. Who finds that gesture likelier than all others is for it in any case.
    fn always_for(&self, top: usize, liars: u32) -> f64 {
        let is_for = |row: &&Cow<'_, [f32]>| {
            let others = row.iter().enumerate().filter(|(class, _)| *class != top);
            row.get(top)
                .is_some_and(|of_top| others.map(|(_, of_other)| of_other).all(|other| other < of_top))
        };
        let [always, robots] = [self.rows.iter().filter(is_for).count(), self.rows.len()]
            .map(|robots| robots.saturating_sub(liars as usize));
        if robots == 0 { 0.0 } else { always as f64 / robots as f64 }
    }

    fn tells(&self) -> bool {
        self.tell > 0
    }

    /// The gestures that more than so many robots know; all of them, where no robot tells what is unknown.
    fn known_by_more_than(&self, robots: usize) -> Vec<usize> {
        let known = |class: &usize| !self.tells() || self.known_by[*class] > robots;
        (0..self.known_by.len()).filter(known).collect()
    }

    /// The evidence for these gestures, ascending.
    fn restricted(&self, gestures: &[usize]) -> Part<'_> {
        if gestures.len() == self.known_by.len() {
            return Part::All(&self.rows);
        }
        let mut values = Vec::with_capacity(self.rows.len() * gestures.len());
        for row in &self.rows {
            values.extend(gestures.iter().map(|class| row.get(*class).copied().unwrap_or_default()));
        }
        Part::Picked(values, gestures.len())
    }

    /// What the rule makes of the evidence for these gestures. Of a single one it is not asked.
    fn choose(&self, rule: &dyn Fuse, clip: f64, of: Vec<usize>) -> Option<Choice<'_>> {
        let part = self.restricted(&of);
        let fusion = match of[..] {
            [] => Fusion { probabilities: Vec::new(), top: ClassId(0), margin: 0.0 },
            [class] => {
                Fusion { probabilities: vec![1.0], top: ClassId(0), margin: self.known_by[class] as f64 }
            }
            _ => rule.fuse(clip, of.len(), &part.rows()).filter(|fusion| fusion.is_sound(of.len()))?,
        };
        Some(Choice { of, part, fusion })
    }

    /// S over the gestures that more than so many robots know, without as many of the robots that are surest of them.
    fn odds(&self, liars: usize) -> f64 {
        let firm = self.known_by_more_than(liars);
        let of_robot = |leads: &[f64]| {
            let lead = |class: &usize| leads.get(*class).map_or(0.0, |lead| lead.exp());
            firm.iter().map(lead).sum::<f64>().ln()
        };
        let mut odds: Vec<f64> = self.leads.chunks(self.known_by.len().max(1)).map(of_robot).collect();
        if liars > 0 {
            odds.sort_by(f64::total_cmp);
            odds.truncate(self.tell.saturating_sub(liars));
        }
        if odds.is_empty() { f64::NEG_INFINITY } else { odds.iter().sum::<f64>() / odds.len() as f64 }
    }
}

impl Choice<'_> {
    /// The likeliest gesture.
    fn top(&self) -> Option<usize> {
        self.of.get(self.fusion.top.index()).copied()
    }
}

/// Whether that robot was taught that gesture: one that was not is as likely to it as "unknown", to the bit. Who tells nothing of that was taught all
/// gestures, or none where all are as likely.
pub(crate) fn knows(vote: &Vote, class: ClassId) -> bool {
    vote.evidence_for(class).is_some_and(|of_class| tells_apart(vote, of_class))
}

/// Whether that evidence of a vote is of a gesture that its robot was taught.
fn tells_apart(vote: &Vote, of_class: f32) -> bool {
    match vote.unknown {
        Some(unknown) => of_class != unknown,
        None => vote.evidence.iter().any(|other| *other != of_class),
    }
}

/// How likely it is that it was taught, and each of so many gestures that were not and "unknown", by the logarithm of the odds of the first against one of
/// them.
fn shares(odds: f64, untaught: usize) -> [f64; 2] {
    // The form that cannot overflow.
    let (taught, each) = if odds > 0.0 { (1.0, (-odds).exp()) } else { (odds.exp(), 1.0) };
    let sum = taught + (untaught as f64 + 1.0) * each;
    [taught / sum, each / sum]
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{RobotId, RoundId, VocabularyId};
    use proptest::prelude::*;

    use super::*;

    const CLIP: f64 = 6.0;

    fn vote(evidence: &[f32], unknown: Option<f32>) -> Vote {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        Vote {
            round,
            vocabulary: VocabularyId(1),
            evidence: evidence.to_vec(),
            looks: 1.0,
            unknown,
            named: vec![],
        }
    }

    fn fused(rule: FusionRule, votes: &[Vote]) -> Fusion {
        Rows::of(&Columns::of(votes[0].listed(), votes.iter()), CLIP, votes.iter()).fuse(&rule, CLIP).unwrap()
    }

    #[test]
    fn where_no_robot_tells_the_rule_has_the_votes_as_they_are() {
        let votes = [vote(&[1.0, -1.0], None), vote(&[0.0, 0.0], None)];
        let rows: Vec<&[f32]> = votes.iter().map(|vote| vote.evidence.as_slice()).collect();
        for rule in FusionRule::ALL {
            assert_eq!(fused(rule, &votes), rule.fuse(CLIP, 2, &rows).unwrap(), "{rule}");
        }
    }

    #[test]
    fn a_thousand_robots_know_no_better_than_one_whether_it_was_ever_taught() {
        for rule in FusionRule::ALL {
            let doubtful = vote(&[2.0, -1.0, 1.0], Some(1.0));
            let (one, many) =
                (fused(rule, std::slice::from_ref(&doubtful)), fused(rule, &vec![doubtful; 1000]));
            assert!((one.probabilities[3] - many.probabilities[3]).abs() < 1e-9, "{rule}: {one:?} {many:?}");
            // Of what was taught more are surer.
            assert!(many.probabilities[0] >= one.probabilities[0] - 1e-9, "{rule}");
        }
    }

    #[test]
    fn unknown_and_what_nobody_was_taught_are_as_likely_and_all_is_a_distribution() {
        let untaught = [vote(&[0.5, -3.5, 1.0, 1.0], Some(1.0)), vote(&[0.0, -2.0, 0.7, 0.7], Some(0.7))];
        for rule in FusionRule::ALL {
            let Fusion { probabilities, top, margin } = fused(rule, &untaught);
            assert_eq!(probabilities[2], probabilities[3], "{rule}");
            assert_eq!(probabilities[2], probabilities[4], "{rule}");
            assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{rule}");
            if top.index() > 1 {
                assert_eq!(margin, 0.0, "no lead of what was never taught");
            }
        }
    }

    #[test]
    fn who_was_taught_it_is_believed_by_those_who_were_not() {
        // One robot knows the first two gestures and sees neither; another knows the third.
        let votes = [vote(&[-3.0, -3.0, 2.0], Some(2.0)), vote(&[-1.0, -1.0, 3.0], Some(-1.0))];
        let pool = fused(FusionRule::LogPool, &votes);
        assert_eq!(pool.top, ClassId(2));
        assert!(pool.probabilities[2] > 0.8, "{pool:?}");
    }

    #[test]
    fn of_a_single_gesture_it_is_asked_whether_it_is_that() {
        for rule in FusionRule::ALL {
            let near = vote(&[2.0, -1.0, -1.0], Some(-1.0));
            let Fusion { probabilities, top, .. } = fused(rule, &[near.clone(), near]);
            let odds = 3.0_f64.exp();
            assert_eq!(top, ClassId(0));
            assert!((probabilities[0] - odds / (odds + 3.0)).abs() < 1e-9, "{rule}: {probabilities:?}");
        }
    }

    #[test]
    fn robots_without_a_classifier_are_as_sure_of_all() {
        let nothing = [vote(&[0.0; 3], None), vote(&[1.0, 1.0, 1.0], Some(1.0))];
        for rule in FusionRule::ALL {
            assert_eq!(fused(rule, &nothing).probabilities, vec![0.25; 4], "{rule}");
        }
    }

    /// Evidence for four gestures, of which a robot knows some.
    fn votes(robots: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vote>> {
        let one = (prop::collection::vec(-8.0f32..8.0, 4), -8.0f32..8.0, prop::bits::u8::between(0, 4));
        let one = one.prop_map(|(mut evidence, unknown, taught)| {
            for (class, value) in evidence.iter_mut().enumerate() {
                if taught & 1 << class == 0 {
                    *value = unknown;
                }
            }
            vote(&evidence, Some(unknown))
        });
        prop::collection::vec(one, robots)
    }

    proptest! {
        #[test]
        fn whatever_liars_add_honest_votes_alone_give_as_much(honest in votes(1..8), lies in votes(0..4)) {
            for rule in [FusionRule::LogPool, FusionRule::CorrelatedPool, FusionRule::Majority] {
                let all: Vec<Vote> = honest.iter().chain(&lies).cloned().collect();
                let rows = Rows::of(&Columns::of(4, [].iter()), CLIP, all.iter());
                let Some(fusion) = rows.fuse(&rule, CLIP) else { continue };
                let least = rows.withstands(&rule, CLIP, &fusion, lies.len() as u32);
                let alone = Rows::of(&Columns::of(4, [].iter()), CLIP, honest.iter()).fuse(&rule, CLIP);
                let left = alone.as_ref().map_or(0.0, |alone| alone.probabilities[fusion.top.index()]);
                prop_assert!(left >= least - 1e-9, "{rule}: {left} {least} {alone:?}");
            }
        }
    }
}
