//! One robot: its mind, its eyes, and what waits for it.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Envelope, RobotId};
use gestalt_strategies::Mind;
use rand_chacha::ChaCha8Rng;

use super::parcel::Parcel;
use super::poisoning::Poisoner;
use super::seed::stream;
use super::turn::Ahead;
use crate::emulation::observer::Observer;
use crate::emulation::pupil::Pupil;
use crate::emulation::scenario::Lies;

pub(super) struct Robot {
    pub id: RobotId,
    pub boot: u32,
    /// None while it is dead, and of a liar.
    pub mind: Option<Mind>,
    pub observer: Box<dyn Observer>,
    pub rng: ChaCha8Rng,
    /// Which part of the time between two frames passes until its first frame of what is shown, and whether that is still to come.
    pub phase: f64,
    pub is_first: bool,
    pub wake: Option<Duration>,
    /// Whether it looks, and for the how-manyth time.
    pub looking: bool,
    pub looks: u32,
    pub waiting: VecDeque<Parcel>,
    /// What has arrived, and when, that its mind may be told later.
    pub unread: Vec<(Duration, Arc<Envelope>)>,
    pub ahead: Ahead,
    /// None of a robot that does not learn.
    pub pupil: Option<Pupil>,
    /// Whom it believes alive, and whom it believes itself linked to.
    pub knows: (Arc<BTreeSet<RobotId>>, Vec<usize>),
    pub lies: Option<Lies>,
    pub poison: Option<Poisoner>,
}

impl Robot {
    /// A robot that was never started. If it learns: whether it may ever be started again.
    pub fn new(
        id: RobotId,
        observer: Box<dyn Observer>,
        seed: u64,
        learns: Option<bool>,
        (lies, poison): (Option<Lies>, Option<Poisoner>),
    ) -> Self {
        Self {
            id,
            boot: 0,
            mind: None,
            observer,
            rng: stream(seed, 0),
            phase: 0.0,
            is_first: false,
            wake: None,
            looking: false,
            looks: 0,
            waiting: VecDeque::new(),
            unread: Vec::new(),
            ahead: Ahead::default(),
            pupil: learns.map(Pupil::new),
            knows: Default::default(),
            lies,
            poison,
        }
    }
}
