//! The latest vote of each robot in one round.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gestalt_protocol::{CountedVote, HeldVote, MAX_ROBOTS, RobotId, Stamp, VocabularyId, Vote};

use crate::columns::Columns;
use crate::config::RoundsConfig;
use crate::fuse::Fuse;
use crate::fusion::Fusion;
use crate::rows::Rows;

/// What became of a vote put into a [`Ballot`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cast {
    /// It is the latest of its robot: it counts now.
    Counted,
    /// The ballot holds that vote already, or a later one: nothing changed.
    Known,
    /// The ballot holds votes of [`MAX_ROBOTS`] other robots: refused.
    Full,
}

/// The list of gestures a ballot is counted over, and how many there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// The list.
    pub vocabulary: VocabularyId,
    /// How many gestures are on it; those that were named since come beside them.
    pub classes: usize,
}

impl Scale {
    /// Whether a vote is evidence on it.
    #[must_use]
    pub fn is_of(self, vote: &Vote) -> bool {
        vote.listed() == self.classes && vote.vocabulary == self.vocabulary
    }
}

/// The latest vote of each robot. Putting votes in commutes and repeats harmlessly: whatever the order and the
/// number of copies, the same votes make the same ballot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ballot {
    /// Robots that live in one process may hold one copy of each: see [`Follow::keep`](crate::Follow::keep).
    votes: BTreeMap<RobotId, Arc<HeldVote>>,
    counts: Counts,
    changes: Changes,
}

/// What is asked of the votes at every input, in a swarm of thousands too.
#[derive(Clone, Debug, Default, PartialEq)]
struct Counts {
    /// How many there are of each vocabulary and number of gestures.
    of_scale: BTreeMap<(u32, usize), usize>,
    /// How many know gestures that were named.
    with_named: usize,
}

/// How often a ballot has changed: no part of what it is.
#[derive(Clone, Copy, Debug, Default)]
struct Changes(u64);

impl PartialEq for Changes {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Ballot {
    /// Puts a vote in, if it is the latest of its robot.
    pub fn cast(&mut self, held: impl Into<Arc<HeldVote>>) -> Cast {
        let cast = self.put(held.into());
        self.changes.0 += u64::from(cast == Cast::Counted);
        cast
    }

    /// How often it has changed so far.
    #[must_use]
    pub(crate) fn changes(&self) -> u64 {
        self.changes.0
    }

    fn put(&mut self, held: Arc<HeldVote>) -> Cast {
        let full = self.votes.len() >= MAX_ROBOTS;
        match self.votes.entry(held.robot) {
            Entry::Occupied(known) if known.get().stamp >= held.stamp => Cast::Known,
            Entry::Occupied(mut known) => {
                self.counts.add(&held.vote);
                self.counts.remove(&known.insert(held).vote);
                Cast::Counted
            }
            Entry::Vacant(_) if full => Cast::Full,
            Entry::Vacant(place) => {
                self.counts.add(&held.vote);
                place.insert(held);
                Cast::Counted
            }
        }
    }

    /// Takes the votes of these robots out.
    pub fn strike(&mut self, robots: &BTreeSet<RobotId>) {
        for robot in robots {
            if let Some(struck) = self.votes.remove(robot) {
                self.counts.remove(&struck.vote);
                self.changes.0 += 1;
            }
        }
    }

    /// How many robots take part, seeing or not.
    #[must_use]
    pub fn len(&self) -> usize {
        self.votes.len()
    }

    /// Whether no robot takes part.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.votes.is_empty()
    }

    /// Whether that robot has said what it can: it has seen something, on whatever scale, or says that it cannot see.
    #[must_use]
    pub fn has_spoken(&self, robot: RobotId) -> bool {
        self.votes
            .get(&robot)
            .is_some_and(|held| !held.vote.evidence.is_empty() || held.vote.vocabulary == VocabularyId::NONE)
    }

    /// The vote of that robot.
    #[must_use]
    pub fn of(&self, robot: RobotId) -> Option<&HeldVote> {
        self.votes.get(&robot).map(|held| &**held)
    }

    /// Which vote of that robot is held.
    #[must_use]
    pub fn stamp(&self, robot: RobotId) -> Option<Stamp> {
        self.of(robot).map(|held| held.stamp)
    }

    /// Which votes are held, by robot.
    pub fn stamps(&self) -> impl Iterator<Item = (RobotId, Stamp)> + '_ {
        self.votes.values().map(|held| (held.robot, held.stamp))
    }

    /// The votes that one who holds `known` lacks or has only older versions of, by robot.
    pub fn lacking<'a>(&'a self, known: &'a BTreeMap<RobotId, Stamp>) -> impl Iterator<Item = HeldVote> + 'a {
        let lacking = |held: &&HeldVote| known.get(&held.robot).is_none_or(|theirs| *theirs < held.stamp);
        self.all().filter(lacking).cloned()
    }

    /// The scale most votes with evidence are on; of equals the one of the smaller vocabulary, then of fewer classes.
    #[must_use]
    pub fn prevailing_scale(&self) -> Option<Scale> {
        let with_evidence = self.counts.of_scale.iter().filter(|((_, classes), _)| *classes > 0);
        // Reversed, because of equal maxima the last one is returned.
        let (&(vocabulary, classes), _) = with_evidence.rev().max_by_key(|(_, votes)| **votes)?;
        Some(Scale { vocabulary: VocabularyId(vocabulary), classes })
    }

    /// How many robots gave evidence on that scale.
    #[must_use]
    pub fn contributors(&self, scale: Scale) -> usize {
        self.counts.of_scale.get(&(scale.vocabulary.0, scale.classes)).copied().unwrap_or_default()
    }

    /// The gestures that the votes on that scale are evidence for: those of the list, and all that were named and any of the robots knows.
    #[must_use]
    pub fn columns(&self, scale: Scale) -> Columns {
        // Mostly nobody knows any.
        let know_more = (self.counts.with_named > 0).then(|| self.on(scale)).into_iter().flatten();
        Columns::of(scale.classes, know_more.map(|held| &held.vote))
    }

    /// How many of these robots take part, seeing or not; and how many of them gave evidence on that scale.
    #[must_use]
    pub fn turnout(&self, robots: &BTreeSet<RobotId>, scale: Scale) -> (usize, usize) {
        let mut robots = robots.iter().peekable();
        let (mut reached, mut gave) = (0, 0);
        for (robot, held) in &self.votes {
            while robots.next_if(|other| *other < robot).is_some() {}
            if robots.next_if_eq(&robot).is_some() {
                reached += 1;
                gave += usize::from(scale.is_of(&held.vote));
            }
        }
        (reached, gave)
    }

    /// All evidence on that scale as one distribution over its [`columns`](Self::columns), with "unknown" as a last class where any of the robots can tell; `None` when there is
    /// none, or the rule makes none of it. Of the gestures it is asked only which of those it is that any of the robots was taught.
    #[must_use]
    pub fn fuse(&self, rule: &dyn Fuse, clip: f64, scale: Scale) -> Option<Fusion> {
        self.rows(&self.columns(scale), clip, scale).fuse(rule, clip)
    }

    /// How likely the top class of a fusion of this ballot is if as many of the robots lied as are expected.
    #[must_use]
    pub fn withstands(&self, rule: &dyn Fuse, config: &RoundsConfig, scale: Scale, fusion: &Fusion) -> f64 {
        let rows = self.rows(&self.columns(scale), config.clip, scale);
        rows.withstands(rule, config.clip, fusion, config.liars)
    }

    /// The votes that [`Ballot::fuse`] counts, as a certificate lists them.
    #[must_use]
    pub fn counted(&self, rule: &dyn Fuse, clip: f64, scale: Scale) -> Vec<CountedVote> {
        let columns = self.columns(scale);
        self.on(scale)
            .map(|HeldVote { robot, stamp, vote, signature }| CountedVote {
                robot: *robot,
                stamp: *stamp,
                class: columns.top(vote),
                weight: weight(rule, clip, vote),
                vote: vote.clone(),
                signature: *signature,
            })
            .collect()
    }

    /// The votes that [`Ballot::fuse`] does not count on that scale: all of them where there is none.
    #[must_use]
    pub fn uncounted(&self, scale: Option<Scale>) -> Vec<HeldVote> {
        let counted = |held: &&HeldVote| !scale.is_some_and(|scale| scale.is_of(&held.vote));
        self.all().filter(counted).cloned().collect()
    }

    /// Whether that vote of that robot is held, word for word; `None` when another one of it, or none, is held.
    #[must_use]
    pub(crate) fn confirms(&self, robot: RobotId, stamp: Stamp, vote: &Vote) -> Option<bool> {
        let held = self.votes.get(&robot).filter(|held| held.stamp == stamp)?;
        let same = held.vote.vocabulary == vote.vocabulary && held.vote.evidence == vote.evidence;
        Some(same && held.vote.unknown == vote.unknown && held.vote.named == vote.named)
    }

    /// The votes on that scale, over these columns of it.
    pub(crate) fn rows(&self, columns: &Columns, clip: f64, scale: Scale) -> Rows<'_> {
        Rows::of(columns, clip, self.on(scale).map(|held| &held.vote))
    }

    fn on(&self, scale: Scale) -> impl Iterator<Item = &HeldVote> + Clone {
        self.all().filter(move |held| scale.is_of(&held.vote))
    }

    fn all(&self) -> impl Iterator<Item = &HeldVote> + Clone {
        self.votes.values().map(|held| &**held)
    }
}

/// What a vote weighs, as a certificate lists it.
pub(crate) fn weight(rule: &dyn Fuse, clip: f64, vote: &Vote) -> f32 {
    let weight = rule.weight(clip, &vote.evidence) as f32;
    if weight.is_finite() && weight >= 0.0 { weight } else { 0.0 }
}

impl Counts {
    fn add(&mut self, vote: &Vote) {
        *self.of_scale.entry(scale_of(vote)).or_default() += 1;
        self.with_named += usize::from(!vote.named.is_empty());
    }

    /// Of a vote that was added.
    fn remove(&mut self, vote: &Vote) {
        self.with_named -= usize::from(!vote.named.is_empty());
        if let Entry::Occupied(mut votes) = self.of_scale.entry(scale_of(vote)) {
            *votes.get_mut() -= 1;
            if *votes.get() == 0 {
                votes.remove();
            }
        }
    }
}

fn scale_of(vote: &Vote) -> (u32, usize) {
    (vote.vocabulary.0, vote.listed())
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, FusionRule, RoundId};
    use proptest::prelude::*;

    use super::*;

    const SCALE: Scale = Scale { vocabulary: VocabularyId(9), classes: 3 };

    fn vote(evidence: &[f32]) -> Vote {
        Vote {
            round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
            vocabulary: SCALE.vocabulary,
            evidence: evidence.to_vec(),
            looks: 1.0,
            unknown: None,
            named: vec![],
        }
    }

    fn held(robot: RobotId, stamp: Stamp, vote: Vote) -> HeldVote {
        HeldVote { robot, stamp, vote, signature: None }
    }

    fn stamp(boot: u32, sequence: u32) -> Stamp {
        Stamp { boot, sequence }
    }

    #[test]
    fn the_latest_vote_replaces_the_earlier() {
        let mut ballot = Ballot::default();
        assert_eq!(ballot.cast(held(RobotId(1), stamp(1, 5), vote(&[3.0, 0.0, 0.0]))), Cast::Counted);
        assert_eq!(ballot.cast(held(RobotId(1), stamp(1, 4), vote(&[0.0, 3.0, 0.0]))), Cast::Known);
        assert_eq!(ballot.fuse(&FusionRule::LogPool, 6.0, SCALE).unwrap().top.0, 0);
        assert_eq!(ballot.cast(held(RobotId(1), stamp(2, 0), vote(&[0.0, 0.0, 3.0]))), Cast::Counted);
        assert_eq!(ballot.fuse(&FusionRule::LogPool, 6.0, SCALE).unwrap().top.0, 2);
        assert_eq!(ballot.len(), 1);
    }

    #[test]
    fn a_null_vote_takes_part_without_counting() {
        let mut ballot = Ballot::default();
        ballot.cast(held(RobotId(1), stamp(1, 1), vote(&[])));
        assert!(!ballot.has_spoken(RobotId(1)));
        assert_eq!(ballot.len(), 1);
        assert_eq!(ballot.contributors(SCALE), 0);
        assert_eq!(ballot.prevailing_scale(), None);
        assert_eq!(ballot.fuse(&FusionRule::Majority, 6.0, SCALE), None);
    }

    #[test]
    fn only_votes_on_one_scale_are_fused() {
        let mut ballot = Ballot::default();
        for robot in 1..=2 {
            ballot.cast(held(RobotId(robot), stamp(1, 1), vote(&[3.0, 0.0, 0.0])));
        }
        ballot.cast(held(
            RobotId(3),
            stamp(1, 1),
            Vote { vocabulary: VocabularyId(8), ..vote(&[0.0, 6.0, 0.0]) },
        ));
        ballot.cast(held(RobotId(4), stamp(1, 1), vote(&[0.0, 6.0])));
        assert_eq!(ballot.prevailing_scale(), Some(SCALE));
        assert_eq!(ballot.contributors(SCALE), 2);
        let counted: Vec<_> = ballot.counted(&FusionRule::LogPool, 6.0, SCALE);
        assert_eq!(
            counted.iter().map(|v| (v.robot.0, v.class.0, v.weight)).collect::<Vec<_>>(),
            [(1, 0, 1.0), (2, 0, 1.0)]
        );
    }

    #[test]
    fn a_ballot_never_outgrows_the_largest_swarm() {
        let mut ballot = Ballot::default();
        for robot in 0..MAX_ROBOTS as u32 {
            assert_eq!(ballot.cast(held(RobotId(robot), stamp(1, 1), vote(&[]))), Cast::Counted);
        }
        assert_eq!(ballot.cast(held(RobotId(u32::MAX), stamp(1, 1), vote(&[]))), Cast::Full);
        assert_eq!(ballot.cast(held(RobotId(0), stamp(1, 2), vote(&[]))), Cast::Counted);
        assert_eq!(ballot.len(), MAX_ROBOTS);
    }

    #[test]
    fn gestures_that_were_named_come_and_go_with_the_votes_that_know_them() {
        let circle = ClassId::named(&"ana".parse().unwrap(), "circle");
        let knows = || Vote { named: vec![circle], ..vote(&[3.0, 0.0, 0.0, 1.0]) };
        let mut ballot = Ballot::default();
        let named = |ballot: &Ballot| ballot.columns(SCALE).named().to_vec();
        for (robot, sequence, said, expected) in [
            (1, 1, vote(&[3.0, 0.0, 0.0]), vec![]),
            (2, 1, knows(), vec![circle]),
            (3, 1, knows(), vec![circle]),
            (2, 2, vote(&[3.0, 0.0, 0.0]), vec![circle]),
            (2, 1, knows(), vec![circle]),
            (3, 2, vote(&[3.0, 0.0, 0.0]), vec![]),
            (1, 2, knows(), vec![circle]),
        ] {
            ballot.cast(held(RobotId(robot), stamp(1, sequence), said));
            assert_eq!(named(&ballot), expected, "{robot} {sequence}");
        }
        ballot.strike(&[RobotId(1)].into());
        assert_eq!(named(&ballot), []);
    }

    /// Votes as the authors say them: what carries one stamp is one vote.
    fn said() -> impl Strategy<Value = Vec<(RobotId, Stamp, Vote)>> {
        prop::collection::vec((0..6u32, 0..2u32, 0..4u32), 1..30).prop_map(|keys| {
            keys.into_iter()
                .map(|(robot, boot, sequence)| {
                    let k = (7 * robot + 5 * boot + 3 * sequence) as f32;
                    (RobotId(robot), stamp(boot, sequence), vote(&[k.sin() * 9.0, k.cos(), -k.sin()]))
                })
                .collect()
        })
    }

    proptest! {
        #[test]
        fn order_and_repetition_make_no_difference(
            (votes, shuffled) in said().prop_flat_map(|votes| {
                let twice: Vec<_> = votes.iter().chain(&votes).cloned().collect();
                (Just(votes), Just(twice).prop_shuffle())
            })
        ) {
            let count = |votes: &[(RobotId, Stamp, Vote)]| {
                let mut ballot = Ballot::default();
                for (robot, stamp, vote) in votes {
                    ballot.cast(held(*robot, *stamp, vote.clone()));
                }
                ballot
            };
            let (once, again) = (count(&votes), count(&shuffled));
            prop_assert_eq!(&once, &again);
            for scale in [SCALE, Scale { classes: 0, ..SCALE }] {
                prop_assert_eq!(once.contributors(scale), once.on(scale).count());
            }
            for rule in FusionRule::ALL {
                prop_assert_eq!(once.fuse(&rule, 6.0, SCALE), again.fuse(&rule, 6.0, SCALE));
            }
        }
    }
}
