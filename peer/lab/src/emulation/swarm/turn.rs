//! What is due for one robot, and what it did of it.

use std::collections::VecDeque;
use std::time::Duration;

use gestalt_protocol::RoundId;
use gestalt_strategies::Output;

use super::parcel::Parcel;

/// What a robot did or wants done, in the order of it.
#[expect(clippy::large_enum_variant, reason = "nearly all are what a mind wants")]
pub(super) enum Deed {
    /// It is to be woken then.
    Wakes(Duration),
    /// It takes part in a round: its first frame comes then, of its `n`th look.
    Looks(RoundId, Duration, u32),
    /// Its next frame comes then, of the same look.
    LooksOn(Duration, u32),
    /// It judged its first frame of what is shown so.
    Judges(Vec<f64>),
    /// It learned from so many samples.
    Learns(usize),
    /// What it is to remember up to that revision is on its way to its disk.
    Remembers(u64),
    /// Its mind wants that done, and it concerns others.
    Wants(Output),
}

/// What is due for one robot.
pub(super) enum Turn {
    Wakes,
    /// It looks at the next frame of its `n`th look.
    Looks(u32),
    Hears(Parcel),
    /// What it was to remember in that life, up to that revision, is on its disk.
    Has(u32, u64),
}

impl Turn {
    /// Whether that is the same, if it is due for the same robot at the same time, at which it hears nothing else.
    pub fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Wakes, Self::Wakes) | (Self::Hears(_), Self::Hears(_)) => true,
            (Self::Looks(n), Self::Looks(m)) => n == m,
            (Self::Has(boot, n), Self::Has(life, m)) => (boot, n) == (life, m),
            _ => false,
        }
    }
}

/// What one robot is to do ahead, and has done.
#[derive(Default)]
pub(super) struct Ahead {
    pub due: Vec<(Duration, Turn)>,
    /// The first first.
    pub done: VecDeque<(Duration, Turn, Vec<Deed>)>,
}

impl Ahead {
    /// What was done ahead when that was due; nothing if that comes to nothing, as when it wakes though it wanted to be woken at another time.
    /// `None` where nothing is left that was done ahead: it is to be done now.
    pub fn recall(&mut self, now: Duration, turn: &Turn) -> Option<Vec<Deed>> {
        let (at, next, _) = self.done.front()?;
        debug_assert!(*at >= now, "what was done ahead was never due");
        if *at > now || !next.is(turn) {
            return Some(Vec::new());
        }
        self.done.pop_front().map(|(.., deeds)| deeds)
    }

    pub fn is_over(&self) -> bool {
        self.done.is_empty()
    }
}
