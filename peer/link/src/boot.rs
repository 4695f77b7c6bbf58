//! The number of a robot's life.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
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

/// The same for a robot that signs what it says, and keeps the number of its last start in that file: higher than that one also where the clock is set
/// to one moment at each start, as it is without a battery. Where the file can be neither read nor written the clock has to do, and the log says so.
#[must_use]
pub fn counted_boot(file: &Path, now: SystemTime) -> u32 {
    let last = match fs::read_to_string(file) {
        Ok(text) => text.trim().parse::<u32>().map_err(|error| error.to_string()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error.to_string()),
    };
    let last = last.unwrap_or_else(|error| {
        tracing::warn!("the number of the last start is not known from {}: {error}", file.display());
        0
    });
    let number = boot_number(now).max(last.saturating_add(1));
    if let Err(error) = gestalt_file::replace(file, format!("{number}\n").as_bytes()) {
        tracing::warn!("the number of this start cannot be kept in {}: {error}", file.display());
    }
    number
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

    #[test]
    fn starts_at_one_moment_have_numbers_that_grow_whatever_is_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot-7.starts");
        let (now, of_clock) = (SystemTime::now(), boot_number(SystemTime::now()));
        let first = counted_boot(&file, now);
        assert!(first.abs_diff(of_clock) < 1000);
        assert_eq!([counted_boot(&file, now), counted_boot(&file, UNIX_EPOCH)], [first + 1, first + 2]);
        fs::write(&file, "nonsense").unwrap();
        assert_eq!(counted_boot(&file, now), first);
        assert_eq!(counted_boot(&file, now), first + 1);
        // No folder: the clock has to do.
        assert_eq!(counted_boot(&folder.path().join("none/starts"), now), first);
    }
}
