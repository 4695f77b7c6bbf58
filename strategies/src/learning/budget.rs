//! A bound on what the whole swarm shares in a round, that robots keep to without a word between them.

use gestalt_protocol::RobotId;
use gestalt_rounds::{Lottery, lot};

/// How many samples of a swarm's budget are this robot's in the round of that counter: `budget / robots`, and for as many as that
/// leaves over, drawn by [`lot`], one more. Over the rounds each robot has its turn.
fn quota(budget: u32, robots: usize, counter: u32, me: RobotId) -> usize {
    let (budget, robots) = (budget as usize, robots.max(1));
    let (each, left) = (budget / robots, budget % robots);
    let place = (u128::from(lot(Lottery::Sharing, counter, me)) * robots as u128) >> 64;
    each + usize::from(place < left as u128)
}

/// What this robot has shared in the newest round.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SharedSoFar {
    counter: u32,
    samples: usize,
    bytes: usize,
}

impl SharedSoFar {
    /// The same of the round of that counter: of another than that which it is of, nothing yet.
    pub fn in_round(self, counter: u32) -> Self {
        if self.counter == counter { self } else { Self { counter, ..Self::default() } }
    }

    /// How many samples may still be shared of the swarm's budget.
    pub fn left_of_swarm(&self, budget: u32, robots: usize, me: RobotId) -> usize {
        quota(budget, robots, self.counter, me).saturating_sub(self.samples)
    }

    /// How many samples may still be shared where that is the most.
    pub fn samples_left(&self, most: u32) -> usize {
        (most as usize).saturating_sub(self.samples)
    }

    /// The same of bytes.
    pub fn bytes_left(&self, most: u32) -> usize {
        (most as usize).saturating_sub(self.bytes)
    }

    /// So many samples are shared, in so many bytes.
    pub fn add(&mut self, samples: usize, bytes: usize) {
        self.samples += samples;
        self.bytes += bytes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quotas(budget: u32, robots: u32, counter: u32) -> Vec<usize> {
        (1..=robots).map(|robot| quota(budget, robots as usize, counter, RobotId(robot))).collect()
    }

    #[test]
    fn where_the_budget_is_enough_all_share_alike() {
        assert_eq!(quotas(100, 20, 7), [5; 20]);
        assert!(quotas(100, 33, 7).iter().all(|quota| *quota >= 3));
    }

    #[test]
    fn a_thousand_robots_share_about_as_much_as_the_budget_and_each_has_its_turn() {
        let mut of_each = vec![0; 1000];
        for counter in 0..100 {
            let quotas = quotas(100, 1000, counter);
            // A binomial of standard deviation 9.5.
            let sum: usize = quotas.iter().sum();
            assert!((60..=140).contains(&sum), "{sum} in round {counter}");
            of_each.iter_mut().zip(quotas).for_each(|(sum, quota)| *sum += quota);
        }
        // Ten of a hundred rounds: a binomial of standard deviation 3.
        assert!(of_each.iter().all(|sum| (1..=25).contains(sum)), "{:?}", of_each.iter().max());
    }

    #[test]
    fn what_was_shared_in_a_round_counts_in_that_round_alone() {
        let me = RobotId(3);
        let mut so_far = SharedSoFar::default().in_round(1);
        assert_eq!(so_far.left_of_swarm(10, 2, me), 5);
        so_far.add(3, 90);
        so_far.add(1, 30);
        let left = |so_far: SharedSoFar| {
            (so_far.left_of_swarm(10, 2, me), so_far.samples_left(6), so_far.bytes_left(200))
        };
        assert_eq!((left(so_far.in_round(1)), left(so_far.in_round(2))), ((1, 2, 80), (5, 6, 200)));
        so_far = so_far.in_round(2);
        so_far.add(9, 300);
        assert_eq!(left(so_far), (0, 0, 0));
    }
}
