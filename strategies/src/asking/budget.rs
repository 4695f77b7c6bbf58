//! How often a swarm may ask.

use std::time::Duration;

use super::config::QuestionsConfig;

/// By how much the ways of two questions through the swarm may differ: one that was asked in time may be heard that much too soon.
const UNDER_WAY: Duration = Duration::from_secs(2);

/// Counts rounds and time since the last question, whoever asked it.
///
/// It begins as if one had just been asked: a robot that starts anew does not know of what was asked before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuestionBudget {
    /// Whether it knows when the last one was asked.
    knows: bool,
    /// Rounds that began since.
    rounds: u32,
    last: Option<Duration>,
}

impl QuestionBudget {
    /// Another round has begun.
    pub fn enter(&mut self, now: Duration) {
        self.last.get_or_insert(now);
        self.rounds = self.rounds.saturating_add(1);
    }

    /// A question was asked, by this robot or another.
    pub fn spend(&mut self, now: Duration) {
        *self = Self { knows: true, rounds: 0, last: Some(now) };
    }

    /// Whether another robot may ask one now, about the latest round. Of the first that it hears a robot that has just started cannot tell.
    #[must_use]
    pub fn allows_another(&self, now: Duration, config: &QuestionsConfig) -> bool {
        !self.knows || self.is_due(now.saturating_add(UNDER_WAY), config)
    }

    fn is_due(&self, now: Duration, config: &QuestionsConfig) -> bool {
        self.last.is_some_and(|last| now >= last.saturating_add(config.apart)) && self.rounds >= config.rounds
    }

    /// Whether one may be asked now, about the latest round.
    #[must_use]
    pub fn allows(&self, now: Duration, config: &QuestionsConfig) -> bool {
        config.ask && self.is_due(now, config)
    }

    /// Since how many rounds no question was asked, in units of those that must lie between two.
    #[must_use]
    pub fn quiet(&self, config: &QuestionsConfig) -> u32 {
        self.rounds / config.rounds.max(1)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn never_two_in_so_many_rounds_nor_closer_than_they_must_be(
            rounds in 1u32..6,
            apart in 0u64..40,
            steps in prop::collection::vec((0u64..15, prop::bool::ANY, prop::bool::ANY), 1..200),
        ) {
            let config = QuestionsConfig { rounds, apart: Duration::from_secs(apart), ..QuestionsConfig::default() };
            let mut budget = QuestionBudget::default();
            let (mut now, mut round) = (Duration::ZERO, 0);
            let mut asked: Vec<(u32, Duration)> = vec![(0, Duration::ZERO)];
            for (seconds, enters, heard) in steps {
                now += Duration::from_secs(seconds);
                if enters {
                    budget.enter(now);
                    round += 1;
                }
                // Another robot's question counts, also one that was asked too soon.
                if heard {
                    budget.spend(now);
                    asked.push((round, now));
                } else if budget.allows(now, &config) {
                    let (last, at) = asked.last().copied().unwrap();
                    prop_assert!(round - last >= rounds, "rounds {last} and {round}");
                    prop_assert!(asked.len() == 1 || now - at >= config.apart, "{at:?} and {now:?}");
                    budget.spend(now);
                    asked.push((round, now));
                }
            }
        }
    }

    #[test]
    fn it_is_there_again_after_as_many_rounds_and_counts_them() {
        let config = QuestionsConfig { apart: Duration::ZERO, ..QuestionsConfig::default() };
        let mut budget = QuestionBudget::default();
        let allowed: Vec<(bool, u32)> = (0..6)
            .map(|_| {
                budget.enter(Duration::ZERO);
                (budget.allows(Duration::ZERO, &config), budget.quiet(&config))
            })
            .collect();
        assert_eq!(allowed, [(false, 0), (false, 0), (true, 1), (true, 1), (true, 1), (true, 2)]);
        let never = QuestionsConfig { ask: false, ..config };
        assert!(!budget.allows(Duration::from_secs(99), &never));
    }
}
