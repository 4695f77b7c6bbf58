//! How much checking one author is worth.

use std::num::NonZeroU32;
use std::time::Duration;

use gestalt_protocol::RobotId;
use serde::{Deserialize, Serialize};

/// How many signatures are checked in the name of one author, of those that come by one way: as it says them itself, as others pass them on, as
/// evidence against it. What is known already costs nothing.
///
/// The default, 16 at once and 8 a second, is twice what an honest robot says at its fastest. A hundred authors who all use theirs
/// up cost a desktop core 4 % of its time for each way, and what is spared for those who are flooded as much again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Budget {
    /// How many at once, after a while without any. At least 1.
    pub burst: NonZeroU32,
    /// How many more every second. At least 1.
    pub per_second: NonZeroU32,
    /// How many every second in all names together by one way, beyond those, for authors whose own are used up: somebody may flood the swarm in
    /// the name of one that has something to say, and a slower flood than this does not silence it. Of what others pass on a quarter at once, and a sixteenth
    /// every second, for each that passes something on. At least 1.
    pub spare: NonZeroU32,
}

impl Default for Budget {
    fn default() -> Self {
        const { Self::of(16, 8, 1000) }
    }
}

impl Budget {
    /// For constants: a number that is 0 does not compile.
    pub(crate) const fn of(burst: u32, per_second: u32, spare: u32) -> Self {
        const fn number(of: u32) -> NonZeroU32 {
            NonZeroU32::new(of).expect("not zero")
        }
        Self { burst: number(burst), per_second: number(per_second), spare: number(spare) }
    }

    /// That of all authors together, once their own are used up: a second's worth at once.
    pub(crate) fn of_all(&self) -> Self {
        Self { burst: self.spare, per_second: self.spare, ..*self }
    }

    /// That of one robot for what it passes on of others whose own are used up: enough at once for the votes of a committee and their decision.
    pub(crate) fn of_one_that_passes_on(&self) -> Self {
        let part = |of: u32| NonZeroU32::new(self.spare.get() / of).unwrap_or(NonZeroU32::MIN);
        Self { burst: part(4), per_second: part(16), ..*self }
    }
}

/// What is left of one author's [`Budget`].
#[derive(Clone, Debug)]
pub(crate) struct Bucket {
    /// In nanoseconds of waiting.
    credit: u64,
    last: Duration,
}

impl Bucket {
    /// A full one.
    pub(crate) fn new(budget: &Budget, now: Duration) -> Self {
        Self { credit: full(budget), last: now }
    }

    /// Takes one check out, if there is one.
    pub(crate) fn take(&mut self, budget: &Budget, now: Duration) -> bool {
        // A clock that was set back fills nothing, and must not stop the filling until it has caught up.
        let waited = now.saturating_sub(self.last).as_nanos();
        self.last = now;
        let waited = u64::try_from(waited).unwrap_or(u64::MAX);
        self.credit = self.credit.saturating_add(waited).min(full(budget));
        let left = self.credit.checked_sub(cost(budget));
        self.credit = left.unwrap_or(self.credit);
        left.is_some()
    }
}

/// By which way something comes to be checked. A flood on one leaves the others as they are: so what is said in the midst of a flood in its author's
/// name comes by repair, from whoever heard it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Under its author's own key.
    Said,
    /// Passed on by that robot, or in a decision of its that rests on it.
    PassedOn(RobotId),
    /// In evidence against its author.
    Evidence,
}

/// What is left of a [`Budget`] by each way.
#[derive(Clone, Debug)]
pub(crate) struct Ways {
    said: Bucket,
    passed_on: Bucket,
    evidence: Bucket,
}

impl Ways {
    /// Full ones.
    pub(crate) fn new(budget: &Budget, now: Duration) -> Self {
        let full = Bucket::new(budget, now);
        Self { said: full.clone(), passed_on: full.clone(), evidence: full }
    }

    /// Takes one check out by that way, if there is one.
    pub(crate) fn take(&mut self, way: Way, budget: &Budget, now: Duration) -> bool {
        let bucket = match way {
            Way::Said => &mut self.said,
            Way::PassedOn(_) => &mut self.passed_on,
            Way::Evidence => &mut self.evidence,
        };
        bucket.take(budget, now)
    }
}

/// How long one check takes to come back, in nanoseconds.
fn cost(budget: &Budget) -> u64 {
    (1_000_000_000 / u64::from(budget.per_second.get())).max(1)
}

fn full(budget: &Budget) -> u64 {
    // At most 2³² s, which 64 bits of nanoseconds hold.
    cost(budget) * u64::from(budget.burst.get())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn taken(bucket: &mut Bucket, now: Duration) -> u32 {
        (0..1000).filter(|_| bucket.take(&Budget::default(), now)).count() as u32
    }

    #[test]
    fn what_is_spared_is_a_second_of_all_and_less_of_one_that_passes_on() {
        let rates = |budget: Budget| (budget.burst.get(), budget.per_second.get());
        assert_eq!(rates(Budget::of(16, 8, 1000).of_all()), (1000, 1000));
        assert_eq!(rates(Budget::of(16, 8, 1000).of_one_that_passes_on()), (250, 62));
        assert_eq!(rates(Budget::of(16, 8, 3).of_one_that_passes_on()), (1, 1), "nobody is spared nothing");
    }

    #[test]
    fn a_clock_that_stands_still_gives_one_burst() {
        for now in [Duration::ZERO, Duration::from_secs(1_700_000_000), Duration::MAX] {
            let mut bucket = Bucket::new(&Budget::default(), now);
            assert_eq!(taken(&mut bucket, now), 16);
            assert_eq!(taken(&mut bucket, now), 0);
        }
    }

    #[test]
    fn it_fills_at_its_rate_and_never_over_the_brim() {
        let mut bucket = Bucket::new(&Budget::default(), Duration::ZERO);
        taken(&mut bucket, Duration::ZERO);
        assert_eq!(taken(&mut bucket, Duration::from_millis(124)), 0);
        assert_eq!(taken(&mut bucket, Duration::from_millis(125)), 1);
        assert_eq!(taken(&mut bucket, Duration::from_millis(1125)), 8);
        assert_eq!(taken(&mut bucket, Duration::MAX), 16);
    }

    #[test]
    fn a_clock_that_is_set_back_goes_on_filling_from_there() {
        let mut bucket = Bucket::new(&Budget::default(), Duration::from_secs(1_700_000_000));
        taken(&mut bucket, Duration::from_secs(1_700_000_000));
        assert_eq!(taken(&mut bucket, Duration::ZERO), 0);
        assert_eq!(taken(&mut bucket, Duration::from_secs(1)), 8);
    }

    proptest! {
        #[test]
        fn no_rate_and_no_clock_overflow(
            burst in 1..=u32::MAX, per_second in 1..=u32::MAX, times in prop::collection::vec(any::<u64>(), 1..20),
        ) {
            let number = |of| NonZeroU32::new(of).unwrap();
            let budget = Budget { burst: number(burst), per_second: number(per_second), ..Budget::default() };
            let mut bucket = Bucket::new(&budget, Duration::ZERO);
            prop_assert!(bucket.take(&budget, Duration::ZERO));
            for time in times {
                bucket.take(&budget, Duration::from_nanos(time));
                prop_assert!(bucket.credit <= full(&budget));
            }
        }
    }
}
