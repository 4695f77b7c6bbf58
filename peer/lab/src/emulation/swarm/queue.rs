//! What is still to happen, in the order of time; of one instant, in the order in which it was planned.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use gestalt_protocol::{Ask, RoundId};

use super::parcel::Parcel;
use crate::emulation::network::Change;
use crate::emulation::scenario::Event;

/// What is to happen at some time.
pub(super) enum Due {
    Show(u32),
    Fault(Event),
    Churn,
    /// Links fail and heal at random no more.
    Calm,
    Notice(Change),
    Wake(usize),
    /// The next frame of that robot, as long as it looks for the `n`th time.
    Frame(usize, u32),
    Arrive(usize, Parcel),
    /// One parcel on its way to many: when it arrives at whom, the next first.
    Spread(VecDeque<(Duration, usize)>, Parcel),
    /// The instructor speaks of that showing, through that robot if it is up.
    Teach(u32, usize),
    /// The instructor answers that question about that round, through that robot.
    Reply(usize, RoundId, Ask),
    /// What that robot was to remember in that life, up to that revision, is on its disk.
    Remembered(usize, u32, u64),
}

impl Due {
    /// Whether it may change what any robot does at once.
    pub fn is_for_all(&self) -> bool {
        match self {
            Self::Show(_)
            | Self::Fault(_)
            | Self::Churn
            | Self::Calm
            | Self::Notice(_)
            | Self::Teach(..)
            | Self::Reply(..) => true,
            Self::Wake(_) | Self::Frame(..) | Self::Arrive(..) | Self::Spread(..) | Self::Remembered(..) => {
                false
            }
        }
    }

    /// How many robots have something to do for it before that time.
    pub fn turns_before(&self, end: Duration) -> usize {
        match self {
            Self::Spread(arrivals, _) => arrivals.iter().take_while(|(at, _)| *at < end).count(),
            _ => 1,
        }
    }
}

/// All that is planned.
#[derive(Default)]
pub(super) struct Queue {
    due: BTreeMap<(Duration, u64), Due>,
    planned: u64,
}

impl Queue {
    pub fn at(&mut self, at: Duration, due: Due) {
        self.due.insert((at, self.planned), due);
        self.planned += 1;
    }

    /// When the next is due.
    pub fn next(&self) -> Option<Duration> {
        self.due.first_key_value().map(|((at, _), _)| *at)
    }

    /// All that is due before that time, in its order.
    pub fn before(&self, end: Duration) -> impl Iterator<Item = (Duration, &Due)> {
        self.due.range(..(end, 0)).map(|((at, _), due)| (*at, due))
    }

    /// Takes what is next, if it is due before that time.
    pub fn next_before(&mut self, until: Duration) -> Option<(Duration, Due)> {
        let next = self.due.first_entry().filter(|next| next.key().0 < until)?;
        let ((at, _), due) = next.remove_entry();
        Some((at, due))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_due_at_one_instant_happens_in_the_order_it_was_planned() {
        let second = Duration::from_secs;
        let mut queue = Queue::default();
        for (at, n) in [(2, 0), (1, 1), (2, 2), (1, 3), (3, 4)] {
            queue.at(second(at), Due::Show(n));
        }
        let mut seen = Vec::new();
        while let Some((at, Due::Show(n))) = queue.next_before(second(3)) {
            seen.push((at.as_secs(), n));
        }
        assert_eq!(seen, [(1, 1), (1, 3), (2, 0), (2, 2)]);
    }
}
