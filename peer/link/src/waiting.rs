//! What waits for the mind, votes apart.

use std::collections::VecDeque;
use std::collections::vec_deque::Drain;

use gestalt_strategies::Input;
use gestalt_trust::Distrust;

use crate::account::Refusal;

/// The most messages that wait, and the most bytes that they came in.
const MAX_INPUTS: usize = 8192;
const MAX_BYTES: usize = 64 * 1024 * 1024;

/// A queue that loses nothing short of its bound; what exceeds it is refused, and repair brings it again.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    inputs: VecDeque<Input>,
    /// In how many bytes those came.
    bytes: usize,
    expulsions: u64,
}

impl Waiting {
    pub fn len(&self) -> usize {
        self.inputs.len()
    }

    pub fn is_full(&self) -> bool {
        self.inputs.len() >= MAX_INPUTS
    }

    /// How often robots were expelled so far.
    pub fn expulsions(&self) -> u64 {
        self.expulsions
    }

    /// Adds what came in so many bytes, and was checked when robots had been expelled that often: had somebody been since, it would be counted after
    /// the word that it counts no more.
    ///
    /// # Errors
    /// [`Refusal::Full`], and [`Distrust::Expelled`] of what may be somebody's who was expelled meanwhile. Others repeat it.
    pub fn add(&mut self, input: Input, bytes: usize, expulsions: u64) -> Result<(), Refusal> {
        if expulsions != self.expulsions {
            return Err(Distrust::Expelled.into());
        }
        let bytes = self.bytes + bytes;
        if self.is_full() || bytes > MAX_BYTES {
            return Err(Refusal::Full);
        }
        self.bytes = bytes;
        self.inputs.push_back(input);
        Ok(())
    }

    /// Adds what this robot's own threads have done. Never refused: they do one thing at a time.
    pub fn deliver(&mut self, input: Input) {
        self.inputs.push_back(input);
    }

    /// Adds that robots were expelled, and what follows from that.
    pub fn expel(&mut self, inputs: impl IntoIterator<Item = Input>) {
        self.expulsions += 1;
        self.inputs.extend(inputs);
    }

    /// Takes all.
    pub fn take(&mut self) -> Drain<'_, Input> {
        self.bytes = 0;
        self.inputs.drain(..)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use gestalt_protocol::RobotId;

    use super::*;

    #[test]
    fn what_was_checked_before_an_expulsion_does_not_wait_behind_it() {
        let mut waiting = Waiting::default();
        let heard = || Input::Neighbours(BTreeSet::new());
        let checked = waiting.expulsions();
        waiting.add(heard(), 1, checked).unwrap();
        waiting.expel([Input::Expelled([RobotId(7)].into())]);
        let refused = waiting.add(heard(), 1, checked);
        assert!(matches!(refused, Err(Refusal::Distrust(Distrust::Expelled))), "{refused:?}");
        waiting.add(heard(), 1, waiting.expulsions()).unwrap();
        assert_eq!(waiting.take().count(), 3);
    }

    #[test]
    fn no_more_waits_than_its_bounds_and_none_of_its_own_is_refused() {
        let mut waiting = Waiting::default();
        let heard = || Input::Neighbours(BTreeSet::new());
        waiting.add(heard(), MAX_BYTES, 0).unwrap();
        assert!(matches!(waiting.add(heard(), 1, 0), Err(Refusal::Full)));
        assert_eq!(waiting.take().count(), 1);
        (0..MAX_INPUTS).for_each(|_| waiting.add(heard(), 1, 0).unwrap());
        assert!(matches!(waiting.add(heard(), 1, 0), Err(Refusal::Full)));
        waiting.deliver(heard());
        assert_eq!(waiting.take().count(), MAX_INPUTS + 1);
    }
}
