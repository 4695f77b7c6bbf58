//! What goes along with the rounds of a robot without deciding any of them: its learning.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{Decision, Digest, HeldVote, Pool, RoundId};

/// How far beyond the newest round known one may lie of which an instructor spoke: names of rounds to come can be guessed.
pub const TAUGHT_AHEAD: u32 = 64;

/// Follows the rounds that a robot lives through: is told of them, and asked for the little they need to know of it.
///
/// `()` follows nothing: a robot that decides and does not learn. Calls come in the order in which things happen, within
/// [`Rounds::handle_with`](crate::Rounds::handle_with).
pub trait Follow {
    /// This robot knows of a round that it did not know of.
    fn entered(&mut self, round: RoundId) {
        let _ = round;
    }

    /// A round that it knows of has another name: robots that open at once merge their rounds.
    fn merged(&mut self, round: RoundId, other: RoundId) {
        let _ = (round, other);
    }

    /// The names under that count of which an instructor spoke: their gestures were shown before.
    fn taught(&self, counter: u32) -> BTreeSet<RoundId> {
        let _ = counter;
        BTreeSet::new()
    }

    /// Whether it wants to see more of a round that is decided. The robot then goes on looking until the round's deadline
    /// at the latest.
    fn wants_more(&self, round: RoundId) -> bool {
        let _ = round;
        false
    }

    /// This robot holds that decision of its round now, which may be for nothing; evidence counts up to ±`clip`.
    fn settled(&mut self, decision: &Decision, clip: f64) {
        let _ = (decision, clip);
    }

    /// Where a vote that counts is to be kept: robots that live in one process may keep one copy of each.
    fn keep(&mut self, vote: HeldVote) -> Arc<HeldVote> {
        Arc::new(vote)
    }

    /// How alike robots are, by the rounds that instructors confirmed. `None`: it does not know.
    fn pool(&mut self) -> Option<Pool> {
        None
    }

    /// Whether the robot learns: asked at every input, and so without working out what it knows.
    fn learns(&self) -> bool {
        self.knowledge().is_some()
    }

    /// All it knows, in two numbers, which neighbours are told with what is known of the round. `None`: it does not learn.
    fn knowledge(&self) -> Option<Digest> {
        None
    }
}

impl Follow for () {}
