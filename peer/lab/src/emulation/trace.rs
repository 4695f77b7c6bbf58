//! What happened in a run, line by line: the same seed writes the same bytes.

use std::io::{self, Write};
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Instruction, Outcome, Question, RobotId, RoundId};
use serde::Serialize;

use super::scenario::Event;

/// One thing that happened, one JSON object on a line.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "what", rename_all = "snake_case")]
pub enum Happening<'a> {
    /// A gesture is shown to all robots.
    Shown {
        /// Which.
        class: ClassId,
        /// The robot whose motion detector notices.
        opener: RobotId,
    },
    /// The scenario makes something go wrong, or mends it.
    Fault {
        /// What.
        event: &'a Event,
    },
    /// A robot takes part in a round.
    Opened {
        /// Who.
        robot: RobotId,
        /// In which.
        round: RoundId,
    },
    /// A round is over for a robot.
    Closed {
        /// For whom.
        robot: RobotId,
        /// Which.
        round: RoundId,
    },
    /// A robot says something to all.
    Broadcast {
        /// Who.
        robot: RobotId,
        /// How long the message is.
        bytes: usize,
        /// How many robots it reaches.
        reaches: usize,
    },
    /// A robot tells a neighbour something.
    Tell {
        /// Who.
        robot: RobotId,
        /// Whom.
        to: RobotId,
        /// How long the message is.
        bytes: usize,
        /// Whether it arrives.
        arrives: bool,
    },
    /// A robot holds a decision.
    Hold {
        /// Who.
        robot: RobotId,
        /// What, in short.
        decision: Brief,
    },
    /// An instructor says something.
    Instruct {
        /// Through which robot.
        robot: RobotId,
        /// What.
        instruction: &'a Instruction,
    },
    /// A robot asks.
    Ask {
        /// Who.
        robot: RobotId,
        /// What.
        question: &'a Question,
    },
    /// A robot answers.
    Answer {
        /// Who.
        robot: RobotId,
        /// What became of the instructor's word.
        outcome: Outcome,
        /// How many samples of that round it holds.
        samples: u32,
    },
    /// A robot has learned from what has changed since the last time.
    Learn {
        /// Who.
        robot: RobotId,
        /// How many samples it holds.
        samples: usize,
    },
    /// A decision is announced for the swarm.
    Announce {
        /// By whom.
        robot: RobotId,
        /// What, in short.
        decision: Brief,
    },
}

/// A decision in short.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Brief {
    round: RoundId,
    class: Option<ClassId>,
    confidence: f64,
    author: RobotId,
    robots: usize,
}

impl From<&Decision> for Brief {
    fn from(decision: &Decision) -> Self {
        Self {
            round: decision.round,
            class: decision.class,
            confidence: decision.confidence,
            author: decision.author,
            robots: decision.certificate.votes.len(),
        }
    }
}

/// Where the lines go.
pub struct Trace<'a> {
    sink: Option<&'a mut dyn Write>,
    failed: Option<io::Error>,
}

impl<'a> Trace<'a> {
    /// A trace that nobody reads.
    #[must_use]
    pub fn none() -> Self {
        Self { sink: None, failed: None }
    }

    /// A trace into that sink.
    pub fn to(sink: &'a mut dyn Write) -> Self {
        Self { sink: Some(sink), failed: None }
    }

    /// Writes a line. After the first failure nothing more is written; [`Trace::finish`] reports it.
    pub(super) fn write(&mut self, at: Duration, happening: &Happening<'_>) {
        #[derive(Serialize)]
        struct Line<'a> {
            at_us: u64,
            #[serde(flatten)]
            happening: &'a Happening<'a>,
        }
        let Some(sink) = &mut self.sink else { return };
        let at_us = u64::try_from(at.as_micros()).unwrap_or(u64::MAX);
        let written = serde_json::to_writer(&mut *sink, &Line { at_us, happening })
            .map_err(io::Error::from)
            .and_then(|()| sink.write_all(b"\n"));
        if let Err(error) = written {
            self.sink = None;
            self.failed = Some(error);
        }
    }

    /// Flushes the lines.
    ///
    /// # Errors
    /// The first error met in writing; what was written before it is in the sink.
    pub fn finish(self) -> io::Result<()> {
        match (self.failed, self.sink) {
            (Some(error), _) => Err(error),
            (None, Some(sink)) => sink.flush(),
            (None, None) => Ok(()),
        }
    }
}
