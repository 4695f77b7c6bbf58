//! The number of a robot's life.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::identity::fresh_nonce;

/// A boot number for a robot that keeps no count of its starts: tenths of a second since 2026, which grows from
/// start to start as long as the clock does, and lasts for thirteen years. By a clock that shows no time of those, a number below
/// that of a month, drawn at random: who said two things under one stamp would be taken for a liar.
#[must_use]
pub fn boot_number(now: SystemTime) -> u32 {
    const YEAR_2026: u64 = 1_767_225_600;
    let since_1970 = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    let tenths = since_1970.as_millis() / 100;
    match tenths.saturating_sub(u128::from(YEAR_2026) * 10).try_into() {
        Ok(tenths) if tenths > 0 => tenths,
        _ => (fresh_nonce() >> 40) as u32,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn it_grows_with_the_clock_and_no_clock_gives_it_twice() {
        let year = Duration::from_secs(31_557_600);
        let at = |years| boot_number(UNIX_EPOCH + years * year);
        assert!(at(57) < at(58) && at(58) == at(58));
        for years in [0, 30, 200] {
            let drawn: std::collections::BTreeSet<u32> = (0..20).map(|_| at(years)).collect();
            assert!(drawn.len() > 18 && drawn.last() < Some(&at(57)), "{drawn:?}");
        }
    }
}
