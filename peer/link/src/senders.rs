//! Which of two senders that stream for one robot is heard.

use std::collections::VecDeque;

/// So many earlier ones are known.
const KNOWN: usize = 8;

/// The starts of whatever streams for a robot, each known by its nonce. The latest is heard: who is started again takes its place at once. Who goes on
/// beside it, with the same id by mistake, shows another hand.
#[derive(Debug, Default)]
pub(crate) struct Senders {
    latest: Option<u64>,
    earlier: VecDeque<u64>,
}

impl Senders {
    /// Whether that is the latest, which it is if it was never heard before.
    pub fn is_latest(&mut self, nonce: u64) -> bool {
        if self.earlier.contains(&nonce) {
            return false;
        }
        if let Some(before) = self.latest.replace(nonce).filter(|before| *before != nonce) {
            self.earlier.truncate(KNOWN - 1);
            self.earlier.push_front(before);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_started_again_is_heard_at_once_and_who_goes_on_beside_it_never() {
        let mut senders = Senders::default();
        assert!([1, 1, 2, 2, 3].into_iter().all(|nonce| senders.is_latest(nonce)));
        assert!(![1, 2, 1, 2].into_iter().any(|nonce| senders.is_latest(nonce)));
        assert!(senders.is_latest(3));
    }

    #[test]
    fn what_is_remembered_of_them_is_bounded() {
        let mut senders = Senders::default();
        assert!((0..1000).all(|nonce| senders.is_latest(nonce)));
        assert_eq!(senders.earlier, (991..999).rev().collect::<Vec<u64>>());
    }
}
