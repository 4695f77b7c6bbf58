//! Whose samples have how much room in a full training set: no author's push out those of the others.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{ClassId, MAX_ROBOTS, RobotId};

use crate::sample::{HeldSample, HeldSamples, SetPart};

/// However small the share of an author is, so many samples are no flood.
pub(crate) const LEAST: usize = 5;

/// How many samples of a gesture that was named while the swarm works are not forgotten.
const YOUNG: usize = 20;

/// The shares of a set's room, once it is known who is there. In a swarm of n robots that say something and a set of T samples each other
/// robot has max(5, ⌈1.25 · T/n⌉), whether it is there or not; all robots together that were never alive in this life, max(5, ⌈T/4⌉): whoever makes up
/// names has that at most. Of a robot's own samples max(5, ⌈T/n⌉), but at most half of T, stay whatever others send. All
/// that matters when the set is full, and not before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shares {
    /// Whose set it is, once it was told of others.
    me: Option<RobotId>,
    /// The robots alive now, this one among them or not: as the others of its process know them too, one list serves all.
    alive: Arc<BTreeSet<RobotId>>,
    /// Those of them that say nothing: names without robots, maybe.
    silent: BTreeSet<RobotId>,
    /// Those that were alive at any time in this life and are not now: with those at most [`MAX_ROBOTS`].
    gone: BTreeSet<RobotId>,
    /// How many samples of strangers are held; `None` before they are counted.
    strange: Option<usize>,
    /// Nobody has a share: whatever the rule of forgetting names goes, whosever it is.
    none: bool,
}

impl Shares {
    /// Nobody's.
    pub fn none() -> Self {
        Self { none: true, ..Self::default() }
    }

    /// These robots are alive now. Gives those that were not before.
    pub fn meet(&mut self, me: RobotId, alive: Arc<BTreeSet<RobotId>>) -> BTreeSet<RobotId> {
        self.silent.retain(|robot| alive.contains(robot));
        let before = std::mem::replace(&mut self.alive, alive);
        self.me = Some(me);
        let others = |robot: &RobotId| *robot != me;
        let new = self.alive.difference(&before).copied().filter(others).collect();
        self.gone.extend(before.difference(&self.alive).copied().filter(others));
        self.gone.retain(|robot| !self.alive.contains(robot));
        self.strange = None;
        if self.others() + self.gone.len() > MAX_ROBOTS {
            self.gone.clear();
        }
        new
    }

    /// Those of the living say nothing, and no others. Gives those that did until now.
    pub fn pass_over(&mut self, silent: &BTreeSet<RobotId>) -> BTreeSet<RobotId> {
        if self.silent == *silent {
            return BTreeSet::new();
        }
        let counted = silent.iter().copied().filter(|robot| self.is_said_alive(*robot)).collect();
        let before = std::mem::replace(&mut self.silent, counted);
        before.difference(&self.silent).copied().collect()
    }

    /// The set is another.
    pub fn recount(&mut self) {
        self.strange = None;
    }

    /// A sample came into the set.
    pub fn came(&mut self, sample: &HeldSample) {
        if self.is_strange(sample) {
            self.strange = self.strange.map(|strange| strange + 1);
        }
    }

    /// A sample went.
    pub fn went(&mut self, sample: &HeldSample) {
        if self.is_strange(sample) {
            self.strange = self.strange.map(|strange| strange.saturating_sub(1));
        }
    }

    fn is_strange(&self, sample: &HeldSample) -> bool {
        let author = sample.author().filter(|_| sample.part == SetPart::External);
        author.is_some_and(|author| !self.has_met(author))
    }

    /// Whether that robot was alive at any time in this life, as far as is kept.
    fn has_met(&self, robot: RobotId) -> bool {
        self.is_said_alive(robot) || self.gone.contains(&robot)
    }

    fn is_said_alive(&self, robot: RobotId) -> bool {
        self.me != Some(robot) && self.alive.contains(&robot)
    }

    /// Whether that robot is alive, and says something.
    pub fn is_alive(&self, robot: RobotId) -> bool {
        self.is_said_alive(robot) && !self.silent.contains(&robot)
    }

    /// How many other robots are alive, and say something.
    fn others(&self) -> usize {
        let all = self.alive.len() - usize::from(self.me.is_some_and(|me| self.alive.contains(&me)));
        all.saturating_sub(self.silent.len())
    }

    /// The sample to go because its author, or all strangers together, have more than their share: of whoever is furthest
    /// above, the oldest of the class that it has most of; of a young one only where it has no others.
    pub fn above(&mut self, samples: &HeldSamples, capacity: usize) -> Option<u64> {
        let n = self.robots().filter(|_| !self.none)?;
        let each = LEAST.max((5 * capacity).div_ceil(4 * n));
        let strangers = LEAST.max(capacity.div_ceil(4));
        let count =
            || samples.authors().filter(|(author, _)| !self.has_met(*author)).map(|(_, held)| held).sum();
        let of_strangers = self.strange.unwrap_or_else(count);
        self.strange = Some(of_strangers);
        // Who hides gets no more room than who is there, and takes none from robots that are off.
        let (author, held) = samples.authors_of_most().next()?;
        let excess = held.saturating_sub(each);
        let excess_of_strangers = of_strangers.saturating_sub(strangers);
        if excess == 0 && excess_of_strangers == 0 {
            return None;
        }
        if excess_of_strangers >= excess {
            let mut authors = samples.authors_of_most().map(|(author, _)| author);
            oldest_of_most(samples, authors.find(|author| !self.has_met(*author))?)
        } else {
            oldest_of_most(samples, author)
        }
    }

    /// The sample to go in place of that one, if it is an own one and no more of them may go: the oldest of another robot,
    /// of the same class if there is one.
    pub fn in_place_of(&self, victim: &HeldSample, samples: &HeldSamples, capacity: usize) -> Option<u64> {
        if victim.part == SetPart::External || !self.own_stay(samples, capacity) {
            return None;
        }
        let external = |sample: &&HeldSample| sample.part == SetPart::External;
        let alike = samples.part_keys(SetPart::External, victim.class).first().copied();
        alike.or_else(|| samples.iter().find(external).map(|sample| sample.key))
    }

    /// Whether there are so few own samples that none goes for those of others.
    fn own_stay(&self, samples: &HeldSamples, capacity: usize) -> bool {
        let robots = self.robots().filter(|_| !self.none);
        let reserve = robots.map(|n| LEAST.max(capacity.div_ceil(n)).min(capacity / 2));
        let own = samples.total(SetPart::Personal) + samples.total(SetPart::Shared);
        reserve.is_some_and(|reserve| own <= reserve)
    }

    /// The sample to go in place of one of that class, if it is young: all others are of gestures that have been shown for longer. The oldest of the gesture of
    /// which there are most, but for own ones while no more of them may go.
    pub fn in_place_of_young(&self, class: ClassId, samples: &HeldSamples, capacity: usize) -> Option<u64> {
        if !is_young(samples, class) {
            return None;
        }
        let own_stay = self.own_stay(samples, capacity);
        let may_go = |sample: &&HeldSample| sample.part == SetPart::External || !own_stay;
        let oldest = |class: &ClassId| samples.with_keys(samples.class_keys(*class)).find(may_go);
        let many = samples.classes().filter(|class| samples.class_count(*class) > YOUNG);
        let most = many.filter(|class| oldest(class).is_some());
        let most = most.max_by_key(|class| (samples.class_count(*class), *class))?;
        oldest(&most).map(|sample| sample.key)
    }

    /// How many robots there are of which something is to be expected; `None` for one that knows of no other.
    pub fn robots(&self) -> Option<usize> {
        Some(self.others() + 1).filter(|robots| *robots > 1)
    }
}

/// Whether a gesture was named while the swarm works, and there are few samples of it as yet.
fn is_young(samples: &HeldSamples, class: ClassId) -> bool {
    class.is_named() && samples.class_count(class) <= YOUNG
}

/// Of the samples of that author, the oldest of the class that most of them are of; of a young one only where there is no other.
fn oldest_of_most(samples: &HeldSamples, of: RobotId) -> Option<u64> {
    let theirs = |key: &&u64| samples.get(**key).and_then(HeldSample::author) == Some(of);
    let of_class = |class| samples.part_keys(SetPart::External, class).iter().filter(theirs);
    let order = |class: &ClassId| (!is_young(samples, *class), of_class(*class).count(), Reverse(*class));
    let most = samples.classes().filter(|class| of_class(*class).next().is_some()).max_by_key(order)?;
    of_class(most).next().copied()
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{RoundId, SampleId};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{ForgettingRule, SelectionRule, TrainingSet};

    const ME: RobotId = RobotId(1);

    fn circle() -> ClassId {
        ClassId::named(&"ana".parse().unwrap(), "circle")
    }

    /// Robot 1's shares among three robots, and so many samples of each of these, the first the oldest.
    fn held(coming: &[(u32, ClassId, usize)]) -> (Shares, HeldSamples) {
        let (mut shares, mut samples) = (Shares::default(), HeldSamples::default());
        shares.meet(ME, Arc::new((1..=3).map(RobotId).collect()));
        let all = coming.iter().flat_map(|(author, class, n)| std::iter::repeat_n((*author, *class), *n));
        for ((author, class), key) in all.zip(1..) {
            let is_own = author == ME.0;
            let part = if is_own { SetPart::Personal } else { SetPart::External };
            let id = SampleId { author: RobotId(author), life: 1, number: key };
            let round = RoundId { counter: 1, opener: ME, life: 0 };
            let (id, key, vector) = ((!is_own).then_some(id), u64::from(key), [0.0].into());
            samples.insert(HeldSample { key, part, id, class, round, vector });
        }
        (shares, samples)
    }

    #[test]
    fn who_alone_saw_what_was_named_loses_its_samples_of_other_gestures_first() {
        // Of 24 each other robot has ten.
        let listed = ClassId(4);
        let (mut shares, samples) =
            held(&[(3, ClassId(0), 10), (2, circle(), 8), (2, listed, 3), (1, listed, 4)]);
        let goes = shares.above(&samples, 24).and_then(|key| samples.get(key)).unwrap();
        assert_eq!((goes.author(), goes.class), (Some(RobotId(2)), listed));
        // There is nothing else of it, or there are many.
        for coming in [vec![(2, circle(), 11)], vec![(3, circle(), 10), (2, circle(), 11), (2, listed, 3)]] {
            let (mut shares, samples) = held(&coming);
            let goes = shares.above(&samples, 24).and_then(|key| samples.get(key)).unwrap();
            assert_eq!((goes.author(), goes.class), (Some(RobotId(2)), circle()));
        }
    }

    #[test]
    fn without_shares_the_rule_of_forgetting_alone_says_what_goes() {
        let left = |shared: bool| {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let rules = (SelectionRule::Random.build(), ForgettingRule::Fifo.build());
            let mut set = TrainingSet::new(ME, 12, rules.0, rules.1);
            if !shared {
                set = set.without_shares();
            }
            set.meet(Arc::new((1..=3).map(RobotId).collect()));
            let round = RoundId { counter: 1, opener: ME, life: 0 };
            for _ in 0..3 {
                set.keep(ClassId(0), round, vec![0.0], &mut rng);
            }
            // The last of them sends more than its five.
            for (author, number) in (1..=3).map(|n| (3, n)).chain((1..=10).map(|n| (2, n))) {
                let id = SampleId { author: RobotId(author), life: 1, number };
                set.receive(id, ClassId(0), round, [0.0], &mut rng);
            }
            let of = |author| set.iter().filter(|it| it.author() == Some(RobotId(author))).count();
            [set.total(SetPart::Personal), of(3), of(2)]
        };
        assert_eq!(left(true), [3, 3, 6]);
        assert_eq!(left(false), [0, 2, 10]);
    }

    #[test]
    fn names_that_say_nothing_take_no_robots_share_until_they_speak() {
        let (mut shares, _) = held(&[]);
        shares.meet(ME, Arc::new((1..=20).map(RobotId).collect()));
        assert_eq!(shares.robots(), Some(20));
        let silent = (4..=20).map(RobotId).collect();
        assert_eq!(shares.pass_over(&silent), [].into());
        assert_eq!((shares.robots(), shares.is_alive(RobotId(4))), (Some(3), false));
        assert!(shares.has_met(RobotId(4)), "no stranger for that");
        let silent = (5..=20).map(RobotId).collect();
        assert_eq!(shares.pass_over(&silent), [RobotId(4)].into());
        assert_eq!((shares.robots(), shares.is_alive(RobotId(4))), (Some(4), true));
        shares.meet(ME, Arc::new((1..=5).map(RobotId).collect()));
        assert_eq!(shares.robots(), Some(4), "one of them says nothing");
    }

    #[test]
    fn for_what_was_named_no_own_sample_goes_of_those_that_stay_whatever_others_send() {
        let goes = |own: usize| {
            // Of 60 twenty own ones stay.
            let (shares, samples) = held(&[(1, ClassId(0), own), (2, ClassId(0), 11), (3, circle(), 15)]);
            let key = shares.in_place_of_young(circle(), &samples, 60).unwrap();
            samples.get(key).unwrap().part
        };
        assert_eq!(goes(20), SetPart::External);
        assert_eq!(goes(21), SetPart::Personal);
        let (shares, samples) = held(&[(1, ClassId(0), 20), (3, circle(), 15)]);
        assert_eq!(shares.in_place_of_young(circle(), &samples, 60), None, "there are no others");
    }
}
