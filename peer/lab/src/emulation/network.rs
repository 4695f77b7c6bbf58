//! The links between emulated robots: what is connected, who knows it, and what a message costs on its way.

use std::collections::{BTreeMap, BTreeSet};
use std::iter::Sum;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::RobotId;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::route::{Link, link, shortest_ways};
use super::scenario::LinkModel;

/// The state of a robot as far as the network is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Presence {
    Up,
    /// Reachable, but it passes nothing on.
    Frozen,
    Down,
}

/// A change that robots notice some time after it happened.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    Link(Link, bool),
    Robot(usize, bool),
}

/// Bytes a robot has put on its links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Its own votes.
    pub votes: u64,
    /// What it tells its neighbours for repair, but samples.
    pub repair: u64,
    /// The decisions it holds or announces.
    pub decisions: u64,
    /// What instructors said through it, and its answers.
    pub words: u64,
    /// What it passed on for others, but samples.
    pub relayed: u64,
    /// Its own samples, once for each link they left it by.
    pub samples: u64,
    /// Samples it passed on for others.
    pub relayed_samples: u64,
    /// Samples it told its neighbours for repair.
    pub repair_samples: u64,
    /// Its own samples, counted once however many links they left it by: what it published.
    pub published_samples: u64,
}

impl Traffic {
    /// All samples it put on its links: its own, those of others, and again for repair.
    #[must_use]
    pub fn samples_on_links(&self) -> u64 {
        self.samples + self.relayed_samples + self.repair_samples
    }
}

impl Sum for Traffic {
    fn sum<I: Iterator<Item = Self>>(robots: I) -> Self {
        robots.fold(Self::default(), |sum, robot| Self {
            votes: sum.votes + robot.votes,
            repair: sum.repair + robot.repair,
            decisions: sum.decisions + robot.decisions,
            words: sum.words + robot.words,
            relayed: sum.relayed + robot.relayed,
            samples: sum.samples + robot.samples,
            relayed_samples: sum.relayed_samples + robot.relayed_samples,
            repair_samples: sum.repair_samples + robot.repair_samples,
            published_samples: sum.published_samples + robot.published_samples,
        })
    }
}

/// What a broadcast carries, for the accounts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Vote,
    Decision,
    Words,
    Samples,
}

/// From whom to whom a broadcast goes on, by their index: half as large as a [`Link`], for each robot may have as many as there are robots.
type Hop = (u32, u32);

/// Robots that can reach each other.
struct Parts {
    /// Which part each robot belongs to, of those that are believed alive.
    of: Vec<Option<u32>>,
    members: Vec<Arc<BTreeSet<RobotId>>>,
}

/// The name of the robot of that index.
fn name(robot: usize) -> RobotId {
    RobotId(robot as u32 + 1)
}

/// Links, what robots believe of them, and the routes that follow.
pub(super) struct Network {
    model: LinkModel,
    rng: ChaCha8Rng,
    /// Every link there is, and whether it carries anything now.
    links: BTreeMap<Link, bool>,
    /// Those that the scenario cut by name: chance leaves them alone.
    cut: BTreeSet<Link>,
    /// Who has a link to whom, working or not.
    adjacent: Vec<Vec<usize>>,
    presence: Vec<Presence>,
    /// Links and robots that are believed to work: what routing goes by.
    believed_links: BTreeSet<Link>,
    believed_robots: Vec<bool>,
    routes: Vec<Option<Arc<[Hop]>>>,
    /// Who is alive to whom; worked out when somebody asks.
    parts: Option<Parts>,
    pub traffic: Vec<Traffic>,
}

impl Network {
    pub fn new(size: usize, links: Vec<Link>, model: LinkModel, rng: ChaCha8Rng) -> Self {
        let mut adjacent = vec![Vec::new(); size];
        for &(a, b) in &links {
            adjacent[a].push(b);
            adjacent[b].push(a);
        }
        adjacent.iter_mut().for_each(|others| others.sort_unstable());
        Self {
            model,
            rng,
            adjacent,
            links: links.iter().map(|link| (*link, true)).collect(),
            cut: BTreeSet::new(),
            presence: vec![Presence::Up; size],
            believed_links: links.into_iter().collect(),
            believed_robots: vec![true; size],
            routes: vec![None; size],
            parts: None,
            traffic: vec![Traffic::default(); size],
        }
    }

    pub fn size(&self) -> usize {
        self.presence.len()
    }

    pub fn presence(&self, robot: usize) -> Presence {
        self.presence[robot]
    }

    /// The robots that are up.
    pub fn up(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.size()).filter(|robot| self.presence[*robot] == Presence::Up)
    }

    pub fn set_presence(&mut self, robot: usize, presence: Presence) {
        self.presence[robot] = presence;
    }

    /// Cuts a link until it is healed by name, or heals it; says whether that changed anything.
    pub fn set_link(&mut self, link: Link, up: bool) -> bool {
        let Some(state) = self.links.get_mut(&link) else { return false };
        if up {
            self.cut.remove(&link);
        } else {
            self.cut.insert(link);
        }
        std::mem::replace(state, up) != up
    }

    /// Cuts or heals the link that the chance falls on.
    pub fn flip_any_link(&mut self) -> Option<(Link, bool)> {
        let left_to_chance = (self.links.len() - self.cut.len()).max(1) as u64;
        let n = self.rng.random_range(0..left_to_chance) as usize;
        let Self { links, cut, .. } = self;
        let (link, up) = links.iter_mut().filter(|(link, _)| !cut.contains(link)).nth(n)?;
        *up = !*up;
        Some((*link, *up))
    }

    /// Heals the links that chance cut, and says which.
    pub fn heal_flipped_links(&mut self) -> Vec<Link> {
        let mut healed = Vec::new();
        for (link, up) in self.links.iter_mut().filter(|(link, _)| !self.cut.contains(link)) {
            if !std::mem::replace(up, true) {
                healed.push(*link);
            }
        }
        healed
    }

    /// The robots notice a change: from now on they route by it.
    pub fn notice(&mut self, change: Change) {
        match change {
            Change::Link(link, true) => {
                self.believed_links.insert(link);
            }
            Change::Link(link, false) => {
                self.believed_links.remove(&link);
            }
            Change::Robot(robot, up) => self.believed_robots[robot] = up,
        }
        self.routes.iter_mut().for_each(|route| *route = None);
        self.parts = None;
    }

    /// The robots that this one believes itself linked to.
    pub fn neighbours(&self, robot: usize) -> Vec<usize> {
        let believed = |other: &usize| {
            self.believed_robots[*other] && self.believed_links.contains(&link(robot, *other))
        };
        self.adjacent[robot].iter().copied().filter(believed).collect()
    }

    /// The robots that this one believes alive: those it can reach, itself included. All of one part share the list.
    pub fn reachable(&mut self, robot: usize) -> Arc<BTreeSet<RobotId>> {
        let parts = self.parts.take().unwrap_or_else(|| self.find_parts());
        let reachable = match parts.of[robot] {
            Some(part) => parts.members[part as usize].clone(),
            // It is up, and not believed to be: it hears, and nobody counts on it yet.
            None => {
                let near: BTreeSet<u32> =
                    self.neighbours(robot).into_iter().filter_map(|other| parts.of[other]).collect();
                let all = near.iter().flat_map(|part| parts.members[*part as usize].iter().copied());
                Arc::new(all.chain([name(robot)]).collect())
            }
        };
        self.parts = Some(parts);
        reachable
    }

    /// The robots believed alive, in parts that are linked.
    fn find_parts(&self) -> Parts {
        let mut parts = Parts { of: vec![None; self.size()], members: Vec::new() };
        for first in 0..self.size() {
            if parts.of[first].is_some() || !self.believed_robots[first] {
                continue;
            }
            let part = parts.members.len() as u32;
            parts.of[first] = Some(part);
            let (mut members, mut next) = (vec![name(first)], vec![first]);
            while let Some(robot) = next.pop() {
                for other in self.neighbours(robot) {
                    if parts.of[other].is_none() {
                        parts.of[other] = Some(part);
                        members.push(name(other));
                        next.push(other);
                    }
                }
            }
            parts.members.push(Arc::new(members.into_iter().collect()));
        }
        parts
    }

    fn route(&mut self, origin: usize) -> Arc<[Hop]> {
        if let Some(route) = &self.routes[origin] {
            return route.clone();
        }
        let ways = shortest_ways(origin, self.size(), |robot| self.neighbours(robot));
        let route: Arc<[Hop]> = ways.into_iter().map(|(from, to)| (from as u32, to as u32)).collect();
        self.routes[origin] = Some(route.clone());
        route
    }

    /// Sends something to all along the shortest ways believed to work: whom it reaches, and how long it takes.
    /// What is lost on a hop is lost for all behind it.
    pub fn broadcast(&mut self, origin: usize, bytes: usize, kind: Kind) -> Vec<(usize, Duration)> {
        let mut taken = vec![None; self.size()];
        taken[origin] = Some(Duration::ZERO);
        let mut arrivals = Vec::new();
        if kind == Kind::Samples {
            self.traffic[origin].published_samples += bytes as u64;
        }
        for &(from, to) in self.route(origin).iter() {
            let (from, to) = (from as usize, to as usize);
            let Some(so_far) = taken[from] else { continue };
            let traffic = &mut self.traffic[from];
            let account = match kind {
                Kind::Samples if from != origin => &mut traffic.relayed_samples,
                _ if from != origin => &mut traffic.relayed,
                Kind::Vote => &mut traffic.votes,
                Kind::Decision => &mut traffic.decisions,
                Kind::Words => &mut traffic.words,
                Kind::Samples => &mut traffic.samples,
            };
            *account += bytes as u64;
            let Some(hop) = self.hop(from, to) else { continue };
            arrivals.push((to, so_far + hop));
            if self.presence[to] == Presence::Up {
                taken[to] = Some(so_far + hop);
            }
        }
        arrivals
    }

    /// Sends something to one neighbour: how long it takes, if it arrives.
    pub fn tell(&mut self, from: usize, to: usize, bytes: usize, samples: bool) -> Option<Duration> {
        if !self.believed_links.contains(&link(from, to)) {
            return None;
        }
        let traffic = &mut self.traffic[from];
        *(if samples { &mut traffic.repair_samples } else { &mut traffic.repair }) += bytes as u64;
        self.hop(from, to)
    }

    fn hop(&mut self, from: usize, to: usize) -> Option<Duration> {
        // The same number of draws whatever happens, so that one cut does not change all chances after it.
        let (luck, lateness): (f64, f64) = (self.rng.random(), self.rng.random());
        let works = self.links.get(&link(from, to)) == Some(&true) && self.presence[to] != Presence::Down;
        (works && luck >= self.model.loss).then(|| self.model.latency + self.model.jitter.mul_f64(lateness))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::shape::NetworkShape;

    fn network(topology: NetworkShape, size: usize, loss: f64) -> Network {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let links = topology.links(size, &mut rng);
        Network::new(size, links, LinkModel { loss, ..LinkModel::default() }, rng)
    }

    fn reached(network: &mut Network, origin: usize) -> Vec<usize> {
        network.broadcast(origin, 10, Kind::Vote).into_iter().map(|(to, _)| to).collect()
    }

    #[test]
    fn a_broadcast_reaches_all_and_each_hop_is_paid_by_who_makes_it() {
        let mut line = network(NetworkShape::Line, 4, 0.0);
        assert_eq!(reached(&mut line, 1), [0, 2, 3]);
        let spent: Vec<_> = line.traffic.iter().map(|t| (t.votes, t.relayed)).collect();
        assert_eq!(spent, [(0, 0), (20, 0), (0, 10), (0, 0)]);
    }

    #[test]
    fn samples_have_an_account_of_their_own() {
        let mut line = network(NetworkShape::Line, 3, 0.0);
        line.broadcast(1, 10, Kind::Samples);
        line.broadcast(0, 1, Kind::Samples);
        line.tell(1, 2, 100, true);
        let middle = line.traffic[1];
        assert_eq!((middle.samples, middle.relayed_samples, middle.repair_samples), (20, 1, 100));
        assert_eq!((middle.published_samples, middle.samples_on_links()), (10, 121));
        assert_eq!(Traffic { votes: 0, relayed: 0, repair: 0, ..middle }, middle);
    }

    #[test]
    fn what_a_silent_cut_swallows_is_lost_until_it_is_noticed() {
        let mut ring = network(NetworkShape::Ring, 4, 0.0);
        ring.set_link((0, 1), false);
        assert_eq!(reached(&mut ring, 0), [3], "1 and, on the way of routing, 2 lie behind the cut");
        ring.notice(Change::Link((0, 1), false));
        assert_eq!(reached(&mut ring, 0), [3, 2, 1], "round the other way");
    }

    #[test]
    fn chance_leaves_alone_what_was_cut_by_name() {
        let mut ring = network(NetworkShape::Ring, 6, 0.0);
        assert!(ring.set_link((2, 3), false) && !ring.set_link((2, 3), false));
        let flipped: BTreeSet<Link> =
            (0..200).filter_map(|_| ring.flip_any_link()).map(|(link, _)| link).collect();
        assert_eq!(flipped.into_iter().collect::<Vec<_>>(), [(0, 1), (0, 5), (1, 2), (3, 4), (4, 5)]);
        ring.heal_flipped_links();
        assert_eq!(
            ring.links.iter().filter(|(_, up)| !**up).map(|(link, _)| *link).collect::<Vec<_>>(),
            [(2, 3)]
        );
        assert!(ring.set_link((2, 3), true));
        assert!(
            (0..200).filter_map(|_| ring.flip_any_link()).any(|(link, _)| link == (2, 3)),
            "it is well again"
        );
        let mut pair = network(NetworkShape::Line, 2, 0.0);
        pair.set_link((0, 1), false);
        assert_eq!(pair.flip_any_link(), None);
    }

    #[test]
    fn a_frozen_relay_hears_and_passes_nothing_on() {
        let mut line = network(NetworkShape::Line, 4, 0.0);
        line.set_presence(1, Presence::Frozen);
        assert_eq!(reached(&mut line, 0), [1]);
        line.set_presence(1, Presence::Down);
        assert!(reached(&mut line, 0).is_empty());
    }

    #[test]
    fn loss_falls_on_each_hop() {
        let mut line = network(NetworkShape::Line, 3, 0.3);
        let mut counts = [0.0_f64; 3];
        for _ in 0..4000 {
            reached(&mut line, 0).into_iter().for_each(|to| counts[to] += 1.0 / 4000.0);
        }
        assert!((counts[1] - 0.7).abs() < 0.03 && (counts[2] - 0.49).abs() < 0.03, "{counts:?}");
    }

    #[test]
    fn only_a_direct_neighbour_can_be_told() {
        let mut line = network(NetworkShape::Line, 3, 0.0);
        assert!(line.tell(0, 1, 10, false).is_some());
        assert_eq!(line.tell(0, 2, 10, false), None);
    }
}
