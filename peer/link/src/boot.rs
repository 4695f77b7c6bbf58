//! The number of a robot's life.

use std::time::{SystemTime, UNIX_EPOCH};

/// A boot number for a robot that keeps no count of its starts: tenths of a second since 2026, which grows from
/// start to start as long as the clock does, and lasts for thirteen years.
#[must_use]
pub fn boot_number(now: SystemTime) -> u32 {
    const YEAR_2026: u64 = 1_767_225_600;
    let since_1970 = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    let tenths = since_1970.as_millis() / 100;
    tenths.saturating_sub(u128::from(YEAR_2026) * 10).try_into().unwrap_or(u32::MAX)
}
