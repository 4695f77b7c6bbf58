//! Along which ways messages run.

use std::collections::VecDeque;

/// A link between two robots by their index, the smaller first.
pub type Link = (usize, usize);

/// The link between two robots.
#[must_use]
pub fn link(a: usize, b: usize) -> Link {
    (a.min(b), a.max(b))
}

/// The shortest ways from one robot to all it can reach: hops `(from, to)` in the order of distance, each `to` once.
#[must_use]
pub fn shortest_ways(origin: usize, size: usize, neighbours: impl Fn(usize) -> Vec<usize>) -> Vec<Link> {
    let mut seen = vec![false; size];
    seen[origin] = true;
    let mut queue = VecDeque::from([origin]);
    let mut hops = Vec::new();
    while let Some(from) = queue.pop_front() {
        for to in neighbours(from) {
            if !std::mem::replace(&mut seen[to], true) {
                hops.push((from, to));
                queue.push_back(to);
            }
        }
    }
    hops
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_are_shortest_and_reach_each_once() {
        let ring = |i: usize| vec![(i + 1) % 6, (i + 5) % 6];
        assert_eq!(shortest_ways(0, 6, ring), [(0, 1), (0, 5), (1, 2), (5, 4), (2, 3)]);
    }

    #[test]
    fn what_is_not_connected_is_not_reached() {
        let pairs = |i: usize| vec![i ^ 1];
        assert_eq!(shortest_ways(2, 4, pairs), [(2, 3)]);
    }
}
