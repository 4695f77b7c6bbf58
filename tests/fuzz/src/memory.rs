//! How much memory reading takes.

use gestalt_protocol::{MAX_ALLOCATION, MAX_MESSAGE};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// What an error, a name or a table of no elements may take.
const SLACK: usize = 64 * 1024;

/// Reads bytes, and says so if that takes more memory than is promised: [`MAX_ALLOCATION`] in all, and as much less as the message
/// is shorter than the longest.
///
/// # Panics
/// If it does.
pub fn bounded<T>(bytes: &[u8], read: impl Fn() -> T) -> T {
    let most = (SLACK + MAX_ALLOCATION / MAX_MESSAGE * bytes.len()).min(MAX_ALLOCATION);
    let mut least = usize::MAX;
    // Memory is that of the whole program: what another thread took meanwhile, it does not take each time.
    for _ in 0..3 {
        ALLOCATOR.reset_peak_usage();
        let before = ALLOCATOR.current_usage();
        let value = read();
        let taken = ALLOCATOR.peak_usage().saturating_sub(before);
        if taken <= most {
            return value;
        }
        least = least.min(taken);
    }
    panic!("reading {} bytes took {least} bytes of memory, more than {most}", bytes.len());
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
