//! The number of a robot's life.

use std::fs;
use std::io::{self, ErrorKind};
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

/// How far the number of a start goes beyond that of the last one, where the clock does not: by chance, as what is counted from may be an old copy,
/// which was counted from before: one of thousands. By no more, as numbers that outrun the clock stay ahead of it: two million starts use them
/// up.
pub(crate) fn step() -> u32 {
    1 + (fresh_nonce() >> 52) as u32
}

/// The same where the number cannot be kept: each start goes on from the same one, so it is drawn from as many as there are in three weeks of the
/// clock. Once numbers are kept again, this robot's may be lower for a while than what others heard of it; one that comes twice would convict it for
/// good.
pub(crate) fn leap() -> u32 {
    1 + (fresh_nonce() >> 40) as u32
}

/// The number of a start for a robot that signs what it says, and keeps that of its last start in that file: higher than that one also where the
/// clock is set to one moment at each start, as it is without a battery. Where the file cannot be written chance keeps the numbers of starts apart,
/// and the log says so.
#[must_use]
pub fn counted_boot(file: &Path, now: SystemTime) -> u32 {
    // Of two that start at once the second counts on from the first.
    let alone = gestalt_file::lock(file);
    if alone.is_none() {
        tracing::warn!(
            "{} cannot be kept from another start at the same moment: see that no two robots start with one key",
            file.display()
        );
    }
    let last = match fs::read_to_string(file) {
        Ok(text) => text.trim().parse::<u32>().map_err(|error| error.to_string()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error.to_string()),
    };
    let last = last.unwrap_or_else(|error| {
        tracing::warn!("the number of the last start is not known from {}: {error}", file.display());
        0
    });
    let number = after(last, boot_number(now), |number| {
        let kept = gestalt_file::replace(file, format!("{number}\n").as_bytes());
        kept.inspect_err(|error| {
            tracing::error!(
                "the number of this start cannot be kept in {}: {error}: it is drawn at random, as one that came twice would convict this robot: \
                 let it write to that folder",
                file.display()
            );
        })
    });
    drop(alone);
    number
}

/// The number of a start after that one, by that clock.
fn after(last: u32, clock: u32, keep: impl FnOnce(u32) -> io::Result<()>) -> u32 {
    let number = if clock > last { clock } else { last.saturating_add(step()) };
    match keep(number) {
        Ok(()) => number,
        // A clock that is ahead may be set to one moment at each start; or be right, and is not to be outrun by weeks.
        Err(_) if clock > last => number.saturating_add(leap() >> 8),
        Err(_) => number.saturating_add(leap()),
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

    #[test]
    fn starts_at_one_moment_have_numbers_that_grow_whatever_is_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot-7.starts");
        let (now, of_clock) = (SystemTime::now(), boot_number(SystemTime::now()));
        let first = counted_boot(&file, now);
        assert!(first.abs_diff(of_clock) < 1000);
        let mut last = first;
        for clock in [now, UNIX_EPOCH, now] {
            let number = counted_boot(&file, clock);
            assert!((last + 1..=last + 4096).contains(&number), "{number} after {last}");
            last = number;
        }
        fs::write(&file, "nonsense").unwrap();
        assert_eq!(counted_boot(&file, now), first);
        assert!(counted_boot(&file, now) > first);
    }

    #[test]
    fn of_starts_at_once_no_two_have_one_number() {
        let folder = tempfile::tempdir().unwrap();
        let (file, now) = (folder.path().join("robot-7.starts"), SystemTime::now());
        let start = || counted_boot(&file, now);
        let numbers: Vec<u32> = std::thread::scope(|scope| {
            let starts: Vec<_> = (0..8).map(|_| scope.spawn(start)).collect();
            starts.into_iter().map(|start| start.join().unwrap()).collect()
        });
        let apart: std::collections::BTreeSet<&u32> = numbers.iter().collect();
        assert_eq!(apart.len(), 8, "{numbers:?}");
    }

    #[test]
    fn a_copy_of_the_number_is_not_counted_on_from_alike() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot-7.starts");
        let last = boot_number(SystemTime::now()) + 1_000_000;
        let starts = (0..20).map(|_| {
            fs::write(&file, last.to_string()).unwrap();
            counted_boot(&file, SystemTime::now())
        });
        let drawn: std::collections::BTreeSet<u32> = starts.collect();
        assert!(drawn.len() > 8 && drawn.first() > Some(&last), "{drawn:?}");
    }

    #[test]
    fn starts_that_cannot_be_kept_have_no_number_twice_whatever_the_clock_says() {
        let refused = |_: u32| -> io::Result<()> { Err(ErrorKind::PermissionDenied.into()) };
        for (last, clock) in [(2_000_000, 1_000_000), (0, 1_000_000)] {
            let drawn: std::collections::BTreeSet<u32> =
                (0..20).map(|_| after(last, clock, refused)).collect();
            assert!(drawn.len() > 18 && drawn.first() >= Some(&last.max(clock)), "{drawn:?}");
        }
        // Nor where the folder is not there.
        let folder = tempfile::tempdir().unwrap();
        let (file, now) = (folder.path().join("none/robot-7.starts"), SystemTime::now());
        let drawn: std::collections::BTreeSet<u32> = (0..20).map(|_| counted_boot(&file, now)).collect();
        assert!(drawn.len() > 18 && drawn.first() >= Some(&boot_number(now)), "{drawn:?}");
    }
}
