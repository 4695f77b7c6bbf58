//! How much memory reading takes.

use gestalt_protocol::{MAX_ALLOCATION, MAX_MESSAGE};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// What an error, a name or a table of no elements may take.
const SLACK: usize = 64 * 1024;

/// Reads bytes, and says so if that takes more memory than is promised: [`MAX_ALLOCATION`] in all, and as much less as the message
/// is shorter than the longest. One thread at a time: memory is that of the whole program.
///
/// # Panics
/// If it does.
pub fn bounded<T>(bytes: &[u8], read: impl FnOnce() -> T) -> T {
    ALLOCATOR.reset_peak_usage();
    let before = ALLOCATOR.current_usage();
    let value = read();
    let taken = ALLOCATOR.peak_usage().saturating_sub(before);
    let most = (SLACK + MAX_ALLOCATION / MAX_MESSAGE * bytes.len()).min(MAX_ALLOCATION);
    assert!(taken <= most, "reading {} bytes took {taken} bytes of memory, more than {most}", bytes.len());
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_takes_more_than_is_promised_is_found() {
        assert_eq!(bounded(b"1234", || vec![0_u8; SLACK]).len(), SLACK);
        assert!(std::panic::catch_unwind(|| bounded(b"1234", || vec![0_u8; SLACK + 257])).is_err());
    }
}
