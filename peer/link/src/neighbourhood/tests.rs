//! Robots in a world of their own: whom each hears, and what comes of the links they choose.

use proptest::prelude::*;

use super::*;

type Pair = (RobotId, RobotId);

/// Robots around each other: who hears whom, who has started, which links stand.
struct World {
    now: Duration,
    minds: BTreeMap<RobotId, (Neighbourhood, BTreeMap<RobotId, Duration>)>,
    hears: BTreeSet<Pair>,
    links: BTreeSet<Pair>,
    scouts: usize,
}

fn pair(a: RobotId, b: RobotId) -> Pair {
    (a.min(b), a.max(b))
}

impl World {
    fn new(hears: impl IntoIterator<Item = Pair>) -> Self {
        Self {
            now: Duration::ZERO,
            minds: BTreeMap::new(),
            hears: hears.into_iter().map(|(a, b)| pair(a, b)).collect(),
            links: BTreeSet::new(),
            scouts: 0,
        }
    }

    fn everyone_hears_everyone(ids: &BTreeSet<u32>) -> Self {
        let pairs = ids.iter().flat_map(|a| ids.range(a + 1..).map(|b| (RobotId(*a), RobotId(*b))));
        Self::new(pairs)
    }

    fn start(&mut self, id: RobotId, max_links: usize) {
        self.minds.insert(id, (Neighbourhood::new(id, max_links, false), BTreeMap::new()));
    }

    fn kill(&mut self, id: RobotId) {
        self.minds.remove(&id);
        self.links.retain(|(a, b)| *a != id && *b != id);
    }

    fn linked(&self, id: RobotId) -> BTreeSet<RobotId> {
        let other = |(a, b): &Pair| (*a == id).then_some(*b).or((*b == id).then_some(*a));
        self.links.iter().filter_map(other).collect()
    }

    fn reachable(&self, from: RobotId) -> BTreeSet<RobotId> {
        let mut seen = BTreeSet::from([from]);
        let mut front = vec![from];
        while let Some(id) = front.pop() {
            front.extend(self.linked(id).into_iter().filter(|other| seen.insert(*other)));
        }
        seen.remove(&from);
        seen
    }

    fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now += Duration::from_millis(500);
            let ids: Vec<_> = self.minds.keys().copied().collect();
            for id in ids {
                let linked = self.linked(id);
                let alive = self.reachable(id);
                let (neighbourhood, heard) = self.minds.get_mut(&id).unwrap();
                let plan = neighbourhood.plan(self.now, &View { heard: heard.clone(), linked, alive });
                self.carry_out(id, &plan);
            }
        }
    }

    fn carry_out(&mut self, id: RobotId, plan: &Plan) {
        for other in &plan.dial {
            if self.minds.contains_key(other) {
                self.links.insert(pair(id, *other));
            } else {
                self.minds.get_mut(&id).unwrap().1.remove(other);
            }
        }
        for other in &plan.drop {
            self.links.remove(&pair(id, *other));
        }
        if plan.scout {
            self.scouts += 1;
            let there = self.minds.keys().filter(|other| self.hears.contains(&pair(id, **other)));
            let heard: Vec<_> = there.map(|other| (*other, self.now)).collect();
            self.minds.get_mut(&id).unwrap().1.extend(heard);
        }
    }

    fn is_one_whole(&self) -> bool {
        let first = *self.minds.keys().next().unwrap();
        self.reachable(first).len() + 1 == self.minds.len()
    }

    fn most_links(&self) -> usize {
        self.minds.keys().map(|id| self.linked(*id).len()).max().unwrap()
    }
}

fn ids() -> impl Strategy<Value = BTreeSet<u32>> {
    proptest::collection::btree_set(0_u32..1000, 2..40)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn robots_in_hearing_become_one_whole_within_the_bound(ids in ids(), max_links in 2_usize..7) {
        let mut world = World::everyone_hears_everyone(&ids);
        for (i, id) in ids.iter().enumerate() {
            world.start(RobotId(*id), max_links);
            if i % 5 == 0 {
                world.run(Duration::from_millis(500));
            }
        }
        world.run(Duration::from_secs(10));
        prop_assert!(world.is_one_whole());
        world.run(Duration::from_secs(20));
        prop_assert!(world.is_one_whole());
        prop_assert!(world.most_links() <= max_links);
    }

    #[test]
    fn robots_that_come_and_go_stay_one_whole(
        ids in ids(),
        gone in proptest::collection::vec(any::<prop::sample::Index>(), 1..10),
    ) {
        let mut world = World::everyone_hears_everyone(&ids);
        let ids: Vec<_> = ids.into_iter().map(RobotId).collect();
        ids.iter().for_each(|id| world.start(*id, 4));
        world.run(Duration::from_secs(10));
        for index in &gone {
            world.kill(*index.get(&ids));
        }
        world.run(Duration::from_secs(15));
        prop_assert!(world.minds.is_empty() || world.is_one_whole());
        for index in &gone {
            world.start(*index.get(&ids), 4);
        }
        world.run(Duration::from_secs(40));
        prop_assert!(world.is_one_whole());
        prop_assert!(world.most_links() <= 4);
    }

    /// Out of full hearing no bound can be promised (think of a star), but the swarm holds together.
    #[test]
    fn robots_in_a_chain_of_hearing_become_one_whole(
        n in 2_u32..25,
        more in proptest::collection::vec((0_u32..25, 0_u32..25), 0..60),
    ) {
        let chain = (1..n).map(|i| (RobotId(i), RobotId(i / 2)));
        let more = more.into_iter().filter(|(a, b)| a != b && *a < n && *b < n);
        let mut world = World::new(chain.chain(more.map(|(a, b)| (RobotId(a), RobotId(b)))));
        (0..n).for_each(|i| world.start(RobotId(i), 4));
        world.run(Duration::from_secs(150));
        for _ in 0..10 {
            prop_assert!(world.is_one_whole());
            world.run(Duration::from_secs(2));
        }
    }
}

#[test]
fn a_hundred_robots_are_few_hops_apart_and_rarely_look_around() {
    let ids: BTreeSet<_> = (0..100).collect();
    let mut world = World::everyone_hears_everyone(&ids);
    ids.iter().for_each(|id| world.start(RobotId(*id), 4));
    world.run(Duration::from_secs(10));
    assert!(world.is_one_whole());
    assert!(world.most_links() <= 4);
    let mut front = BTreeSet::from([RobotId(0)]);
    let mut hops = 0;
    while front.len() < 100 {
        front = front.iter().flat_map(|id| world.linked(*id)).chain(front.iter().copied()).collect();
        hops += 1;
    }
    assert!(hops <= 7, "{hops} hops");
    let before = world.scouts;
    world.run(Duration::from_secs(60));
    assert!(world.scouts - before <= 140, "{} looks a minute", world.scouts - before);
}

#[test]
fn two_wholes_merge_where_they_hear_each_other() {
    let ids: BTreeSet<_> = (0..20).collect();
    let mut world = World::everyone_hears_everyone(&ids);
    let all = std::mem::take(&mut world.hears);
    world.hears = all.iter().filter(|(a, b)| (a.0 < 10) == (b.0 < 10)).copied().collect();
    ids.iter().for_each(|id| world.start(RobotId(*id), 4));
    world.run(Duration::from_secs(20));
    assert!(!world.is_one_whole());
    world.hears = all;
    world.run(Duration::from_secs(10));
    assert!(world.is_one_whole());
}
