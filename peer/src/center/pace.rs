//! How often a camera is asked for a frame: as often as frames count, and no more.
//!
//! In a round frames within τ are one look, so a few of them tell what all would. Between rounds they are asked for what moves, and
//! where that is not watched, for whether the camera still lives. A camera is asked by the acknowledgement of its last frame,
//! which is held back until the next is wanted; one that hears nothing sends by itself once a second.

use std::time::{Duration, Instant};

use gestalt_protocol::RoundId;

use crate::config::Config;

/// Frames in the time for which a hand must be at rest: enough to see that it is.
const FRAMES_OF_REST: u32 = 5;

/// The longest time between two frames: less than a camera that hears nothing waits.
const SLOWEST: Duration = Duration::from_millis(500);

/// The times between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Paces {
    /// While a hand is looked for.
    pub looking: Duration,
    /// Else.
    pub watching: Duration,
}

impl Paces {
    /// Those of a centre's configuration.
    pub fn new(config: &Config) -> Self {
        let Some(frames) = config.center.frames_per_look else {
            // Every frame that a camera takes.
            return Self { looking: Duration::ZERO, watching: Duration::ZERO };
        };
        // A robot that sends so seldom must not pass for silent.
        let slowest = SLOWEST.min(config.center.frozen_after / 4);
        let motion = &config.camera.motion;
        let watching = if motion.enabled { motion.hold / FRAMES_OF_REST } else { slowest };
        let looking = config.mind().decorrelation / frames.max(1);
        Self { looking: looking.min(slowest), watching: watching.min(slowest) }
    }
}

/// When one camera is asked next.
#[derive(Debug)]
pub(super) struct Pace {
    paces: Paces,
    /// The round that is open, and when that was noticed.
    round: Option<(RoundId, Instant)>,
    moving: bool,
}

impl Pace {
    pub fn new(paces: Paces) -> Self {
        Self { paces, round: None, moving: false }
    }

    /// That round is open now, or none.
    pub fn follow(&mut self, round: Option<RoundId>, now: Instant) {
        if round != self.round.map(|(round, _)| round) {
            self.round = round.map(|round| (round, now));
        }
    }

    /// Something moves before the camera, or has come to rest.
    pub fn moves(&mut self, moving: bool) {
        self.moving = moving;
    }

    /// When the next frame is due, the last having been asked for at that time: at once when a round has opened since.
    pub fn due(&self, asked: Instant) -> Instant {
        match self.round {
            Some((_, opened)) if opened > asked => opened,
            Some(_) if !self.moving => asked + self.paces.looking,
            _ => asked + self.paces.watching,
        }
    }

    /// Whether a frame taken at that time counts in the round that is open. What was taken before it opened may show the gesture of
    /// the round before; a camera that takes one every `period` may have been about to take its next.
    pub fn counts(&self, taken: Instant, period: Duration) -> bool {
        self.round.is_some_and(|(_, opened)| taken + period >= opened)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn round(counter: u32) -> Option<RoundId> {
        Some(RoundId { counter, opener: RobotId(1), life: 0 })
    }

    #[test]
    fn a_camera_is_asked_at_once_when_a_round_opens_and_then_as_often_as_looks_count() {
        let start = Instant::now();
        let mut pace = Pace::new(Paces { looking: 160 * MS, watching: 100 * MS });
        pace.follow(None, start);
        assert_eq!(pace.due(start), start + 100 * MS);
        pace.follow(round(1), start + 30 * MS);
        assert_eq!(pace.due(start), start + 30 * MS, "asked before it opened");
        pace.follow(round(1), start + 50 * MS);
        assert_eq!(pace.due(start + 31 * MS), start + 191 * MS);
        pace.moves(true);
        assert_eq!(pace.due(start + 31 * MS), start + 131 * MS, "what moves is watched");
        pace.follow(round(2), start + 60 * MS);
        assert_eq!(pace.due(start + 31 * MS), start + 60 * MS);
        pace.follow(None, start + 70 * MS);
        assert_eq!(pace.due(start + 61 * MS), start + 161 * MS);
    }

    #[test]
    fn frames_from_before_a_round_do_not_count() {
        let start = Instant::now();
        let mut pace = Pace::new(Paces { looking: 160 * MS, watching: 100 * MS });
        assert!(!pace.counts(start, 33 * MS), "no round");
        pace.follow(round(1), start + 100 * MS);
        assert!(!pace.counts(start + 60 * MS, 33 * MS));
        assert!(pace.counts(start + 70 * MS, 33 * MS), "it was about to take its next");
    }

    #[test]
    fn the_paces_are_those_of_evidence_and_of_motion() {
        let mut config = Config::default();
        assert_eq!(Paces::new(&config), Paces { looking: 500 * MS / 3, watching: 500 * MS });
        config.camera.motion.enabled = true;
        assert_eq!(Paces::new(&config).watching, 100 * MS);
        config.center.frozen_after = 200 * MS;
        assert_eq!(Paces::new(&config), Paces { looking: 50 * MS, watching: 50 * MS });
        config.camera.layer.time = false;
        assert!(Paces::new(&config).looking < MS, "every frame is a look");
        config.center.frames_per_look = None;
        assert_eq!(Paces::new(&config), Paces { looking: Duration::ZERO, watching: Duration::ZERO });
    }
}
