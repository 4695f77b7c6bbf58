//! What happened in a run, line by line: the same seed writes the same bytes.
//!
//! Of robots that do not learn it holds all that their minds are told, and when: minds elsewhere that are told the same, in the same
//! order, say and hold the same, byte for byte (`bindings/python/examples/emulated.py`).

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Instruction, Outcome, Question, RobotId, RoundId, Stamp};
use serde::Serialize;

use super::scenario::{Event, Scenario};

/// One thing that happened, one JSON object on a line.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "what", rename_all = "snake_case")]
pub enum Happening<'a> {
    /// What is run: the first line.
    Run {
        /// From which all chance follows.
        seed: u64,
        /// What is emulated, with all that its file left out.
        scenario: &'a Scenario,
    },
    /// A robot starts, for the first time or again.
    Start {
        /// Who.
        robot: RobotId,
        /// For the how-manyth time.
        boot: u32,
    },
    /// A robot is told who is alive.
    Alive {
        /// Who is told.
        robot: RobotId,
        /// Who is alive, itself included.
        robots: &'a BTreeSet<RobotId>,
    },
    /// A robot is told whom it is linked to.
    Neighbours {
        /// Who is told.
        robot: RobotId,
        /// To whom.
        robots: &'a BTreeSet<RobotId>,
    },
    /// A robot sees a hand.
    See {
        /// Who.
        robot: RobotId,
        /// What its classifier makes of it; none of a robot that has no classifier yet.
        probabilities: Option<&'a [f64]>,
        /// How far that is to be trusted.
        quality: f32,
    },
    /// A robot is told that time has passed, as it wanted.
    Tick {
        /// Who.
        robot: RobotId,
    },
    /// A robot's message reaches another.
    Hear {
        /// Whom.
        robot: RobotId,
        /// Whose.
        from: RobotId,
        /// Which: what a robot says under one stamp is one message, also where it is said again.
        stamp: Stamp,
    },
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
        /// Which of its messages it is.
        stamp: Stamp,
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
        /// Which of its messages it is.
        stamp: Stamp,
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
        /// Which of its messages it is.
        stamp: Stamp,
        /// What, in short.
        decision: Brief,
    },
}

/// A decision in short.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Brief {
    round: RoundId,
    class: Option<ClassId>,
    confidence: f64,
    author: RobotId,
    voters: Vec<RobotId>,
}

impl From<&Decision> for Brief {
    fn from(decision: &Decision) -> Self {
        Self {
            round: decision.round,
            class: decision.class,
            confidence: decision.confidence,
            author: decision.author,
            voters: decision.certificate.votes.iter().map(|vote| vote.robot).collect(),
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

    /// Whether anybody reads it.
    pub(super) fn is_read(&self) -> bool {
        self.sink.is_some()
    }

    /// Writes a line. After the first failure nothing more is written; [`Trace::finish`] reports it.
    pub(super) fn write(&mut self, at: Duration, happening: &Happening<'_>) {
        #[derive(Serialize)]
        struct Line<'a> {
            at_ns: u64,
            #[serde(flatten)]
            happening: &'a Happening<'a>,
        }
        let Some(sink) = &mut self.sink else { return };
        let at_ns = u64::try_from(at.as_nanos()).unwrap_or(u64::MAX);
        let written = serde_json::to_writer(&mut *sink, &Line { at_ns, happening })
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
