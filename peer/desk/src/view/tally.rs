//! What was heard, counted: for metrics.

use gestalt_protocol::{Ask, Decision, Outcome};

/// Upper bounds of the histogram of decision times, in seconds; the last bucket is everything above.
pub const SECONDS: [f64; 8] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// Totals since the view began. They only grow.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Rounds that ended with a gesture, as first heard.
    pub decided: u64,
    /// Rounds that ended without one.
    pub undecided: u64,
    /// Robots for which there was no room.
    pub refused: u64,
    /// Answers to instructors, by [`Tally::OUTCOMES`].
    pub answers: [u64; 8],
    /// Questions of the swarm, by [`Tally::KINDS`].
    pub questions: [u64; 3],
    /// Rounds by how long they took: one for each of [`SECONDS`] and one for all above, each counted once.
    pub seconds: [u64; SECONDS.len() + 1],
    /// The sum of these times, in seconds.
    pub total_seconds: f64,
}

impl Tally {
    /// The outcomes in the order of `answers`, by their names in messages.
    pub const OUTCOMES: [&'static str; 8] = [
        "learned",
        "known",
        "nothing_seen",
        "unknown_round",
        "unknown_gesture",
        "not_learning",
        "not_allowed",
        "no_room",
    ];

    pub(super) fn count_decision(&mut self, decision: &Decision) {
        if decision.class.is_some() {
            self.decided += 1;
        } else {
            self.undecided += 1;
        }
        let seconds = f64::from(decision.certificate.elapsed_ms) / 1000.0;
        let bucket = SECONDS.iter().position(|most| seconds <= *most).unwrap_or(SECONDS.len());
        self.seconds[bucket] += 1;
        self.total_seconds += seconds;
    }

    /// The kinds of questions in the order of `questions`, by their names in messages.
    pub const KINDS: [&'static str; 3] = ["between", "again", "name"];

    pub(super) fn count_question(&mut self, ask: &Ask) {
        let place = match ask {
            Ask::Between { .. } => 0,
            Ask::Again { .. } => 1,
            Ask::Name { .. } => 2,
        };
        self.questions[place] += 1;
    }

    pub(super) fn count_answer(&mut self, outcome: Outcome) {
        let place = match outcome {
            Outcome::Learned => 0,
            Outcome::Known => 1,
            Outcome::NothingSeen => 2,
            Outcome::UnknownRound => 3,
            Outcome::UnknownGesture => 4,
            Outcome::NotLearning => 5,
            Outcome::NotAllowed => 6,
            Outcome::NoRoom => 7,
        };
        self.answers[place] += 1;
    }
}
