//! What the mind wants said, until the host takes it.

use std::collections::VecDeque;

use gestalt_protocol::RobotId;

/// The most messages that wait. A host that takes none loses the oldest, as a radio would; repair makes up for it.
const MAX_WAITING: usize = 4096;

/// A message for the host to carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutgoingMessage {
    /// The key it belongs under, `gestalt/<swarm>/…`: what any Zenoh client publishes it on.
    pub key: String,
    /// To whom: one neighbour, or all robots of the swarm.
    pub to: Option<RobotId>,
    /// Whether the payload is JSON; else it is a postcard envelope, which names its author itself.
    pub json: bool,
    /// The bytes that travel.
    pub payload: Vec<u8>,
}

/// The messages that wait, oldest first.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    waiting: VecDeque<OutgoingMessage>,
    dropped: u64,
}

impl Outbox {
    pub(crate) fn put(&mut self, message: OutgoingMessage) {
        if self.waiting.len() == MAX_WAITING {
            self.waiting.pop_front();
            self.dropped += 1;
        }
        self.waiting.push_back(message);
    }

    pub(crate) fn first(&self) -> Option<&OutgoingMessage> {
        self.waiting.front()
    }

    pub(crate) fn take(&mut self) -> Option<OutgoingMessage> {
        self.waiting.pop_front()
    }

    /// How many were lost because nobody took them.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_that_takes_nothing_costs_bounded_memory_and_loses_the_oldest() {
        let mut outbox = Outbox::default();
        for n in 0..MAX_WAITING + 3 {
            outbox.put(OutgoingMessage { key: n.to_string(), to: None, json: false, payload: Vec::new() });
        }
        assert_eq!((outbox.waiting.len(), outbox.dropped()), (MAX_WAITING, 3));
        assert_eq!(outbox.take().unwrap().key, "3");
    }
}
