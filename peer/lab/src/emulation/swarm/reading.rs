//! What a mind may be told later than it comes, at the time that it came.
//!
//! A sample that its author shares makes nobody speak, and wakes nobody: what a mind does with it shows when it is asked for something else. Told one by one as
//! they arrive, each of a thousand minds comes to a thousand samples with all that it knows out of the processor's caches; told together it does not, and many
//! minds are told at once. What comes of it is the same.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Envelope, Message};
use gestalt_strategies::{Input, Mind, Output};

use super::Swarm;
use super::robot::Robot;
use crate::emulation::pupil::Pupil;

/// How much waits for a robot, on the average, when all are told.
pub(super) const MANY: usize = 32;

impl Swarm<'_> {
    /// One more thing waits to be told.
    pub(super) fn leave(&mut self) {
        self.unread += 1;
        if self.unread >= self.most_unread {
            self.read_all();
        }
    }

    /// Tells all minds what they were not told yet, on as many threads as there are: what each makes of it depends on no other.
    pub(super) fn read_all(&mut self) {
        if std::mem::take(&mut self.unread) == 0 {
            return;
        }
        let readers = self.robots.iter_mut().filter_map(Robot::reader).collect();
        self.crew.on_each(readers, Reader::read);
    }
}

impl Robot {
    /// Whether its mind may be told later. One that writes down what it hears answers for it, so that is told at once.
    pub fn may_read_later(&self, envelope: &Envelope) -> bool {
        matches!(envelope.message, Message::Samples(_))
            && envelope.author != self.id
            && self.pupil.as_ref().is_some_and(|pupil| !pupil.writes)
    }

    /// Tells its mind what it was not told yet: before anything else, and before anybody looks what it holds.
    pub fn read(&mut self) {
        if let Some(reader) = self.reader() {
            reader.read();
        }
    }

    fn reader(&mut self) -> Option<Reader<'_>> {
        let Self { mind, pupil, unread, .. } = self;
        let (mind, pupil) = (mind.as_mut()?, pupil.as_mut()?);
        (!unread.is_empty()).then_some(Reader { mind, pupil, unread })
    }
}

/// A mind, and what it was not told yet.
struct Reader<'a> {
    mind: &'a mut Mind,
    pupil: &'a mut Pupil,
    unread: &'a mut Vec<(Duration, Arc<Envelope>)>,
}

impl Reader<'_> {
    fn read(self) {
        for (at, envelope) in self.unread.drain(..) {
            for output in self.mind.handle(at, Input::Received((*envelope).clone())) {
                match output {
                    Output::Train(changes) => self.pupil.train_later(changes),
                    other => unreachable!("a sample from its author makes no robot do this: {other:?}"),
                }
            }
        }
    }
}
