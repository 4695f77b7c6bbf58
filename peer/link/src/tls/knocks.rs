//! How long those wait who knock again and again and are not let in.

use std::collections::BTreeMap;
use std::time::Duration;

/// The wait after the second knock; it doubles with each one.
const FIRST: Duration = Duration::from_millis(50);
const LONGEST: Duration = Duration::from_secs(2);

/// Who has not knocked for so long begins anew.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// How many names are kept; who has none of its own shares one.
const NAMES: usize = 256;

/// Counts the knocks of each name that was turned away. Pure: time is an argument.
#[derive(Debug, Default)]
pub(crate) struct Knocks(BTreeMap<String, (u32, Duration)>);

impl Knocks {
    /// How long the one of that name is kept waiting, with its link mute, before it is hung up.
    pub fn pause(&mut self, name: &str, now: Duration) -> Duration {
        self.0.retain(|_, (_, last)| now.saturating_sub(*last) < FORGOTTEN);
        let shared = self.0.len() >= NAMES && !self.0.contains_key(name);
        let (times, last) = self.0.entry(if shared { String::new() } else { name.to_owned() }).or_default();
        *times = times.saturating_add(1);
        *last = now;
        match times.checked_sub(2) {
            None => Duration::ZERO,
            Some(again) => FIRST.saturating_mul(2_u32.saturating_pow(again)).min(LONGEST),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn who_knocks_on_waits_ever_longer_and_no_longer_than_the_longest() {
        let mut knocks = Knocks::default();
        let pauses: Vec<u64> =
            (0..9).map(|n| knocks.pause("robot 7", seconds(n)).as_millis() as u64).collect();
        assert_eq!(pauses, [0, 50, 100, 200, 400, 800, 1600, 2000, 2000]);
        assert_eq!(knocks.pause("robot 8", seconds(9)), Duration::ZERO, "another one begins anew");
        assert_eq!(knocks.pause("robot 7", seconds(200)), Duration::ZERO, "forgotten");
    }

    #[test]
    fn names_are_bounded_and_those_beyond_share_one() {
        let mut knocks = Knocks::default();
        (0..NAMES).for_each(|n| assert_eq!(knocks.pause(&n.to_string(), seconds(1)), Duration::ZERO));
        let pauses = (0..100).map(|n| knocks.pause(&format!("more {n}"), seconds(2)));
        assert_eq!(pauses.last(), Some(LONGEST));
        assert!(knocks.0.len() <= NAMES + 1);
    }
}
