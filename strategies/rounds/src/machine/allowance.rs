//! How often the others may ask something of a robot.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::RobotId;

/// Token buckets, one for each robot that is known, and one for all others together: names cost nothing.
///
/// Each is kept as the time until which it is spent (the generic cell rate algorithm, ITU-T I.371): it gives a token every `period`, and holds
/// `burst` of them.
#[derive(Clone, Debug)]
pub(super) struct Allowance {
    period: Duration,
    burst: u32,
    spent: BTreeMap<Option<RobotId>, Duration>,
}

impl Allowance {
    pub fn new(period: Duration, burst: u32) -> Self {
        Self { period, burst, spent: BTreeMap::new() }
    }

    /// Takes a token of a known robot, or of all the others, if there is one.
    pub fn take(&mut self, now: Duration, known: Option<RobotId>) -> bool {
        let until = self.spent.get(&known).map_or(now, |until| now.max(*until)) + self.period;
        let left = until <= now + self.period * self.burst;
        if left {
            self.spent.insert(known, until);
        }
        left
    }

    /// Forgets the buckets of those who are known no more, and those that are full.
    pub fn forget(&mut self, now: Duration, known: impl Fn(RobotId) -> bool) {
        self.spent.retain(|robot, until| *until > now && robot.is_none_or(&known));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn taken(allowance: &mut Allowance, robot: Option<u32>, times: impl IntoIterator<Item = u64>) -> usize {
        times.into_iter().filter(|at| allowance.take(ms(*at), robot.map(RobotId))).count()
    }

    #[test]
    fn there_is_a_burst_and_then_the_rate() {
        let mut allowance = Allowance::new(ms(250), 4);
        assert_eq!(taken(&mut allowance, Some(1), [0; 100]), 4);
        assert_eq!(taken(&mut allowance, Some(1), 1..=10_000), 40);
        assert_eq!(taken(&mut allowance, Some(1), [20_000; 100]), 4, "no more than a burst was saved");
    }

    #[test]
    fn who_is_known_has_one_of_its_own_and_all_others_have_one_together() {
        let mut allowance = Allowance::new(ms(250), 4);
        assert_eq!(taken(&mut allowance, None, [0; 100]), 4);
        assert_eq!(taken(&mut allowance, Some(2), [0; 100]), 4);
        assert_eq!(taken(&mut allowance, None, [0; 100]), 0);
        allowance.forget(ms(0), |robot| robot != RobotId(2));
        assert_eq!(allowance.spent.len(), 1);
        allowance.forget(ms(1000), |_| true);
        assert!(allowance.spent.is_empty());
    }
}
