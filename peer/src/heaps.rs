//! Where the program's memory comes from, into how many heaps it is divided, and what is kept of memory that was let go of.
//!
//! Rust's memory is mimalloc's, in small pages, and goes back to the system when nobody wants it for a moment; without OpenCV, where the program needs no compiler
//! but Rust's, it is the system's. OpenCV's is glibc's, which makes a heap for each thread, up to eight for each core, and what is free in one is of no use to
//! the others.

// The allocator of the program `gestalt`.
#[cfg(feature = "opencv")]
pub use mimalloc::MiMalloc as Allocator;
#[cfg(not(feature = "opencv"))]
pub use std::alloc::System as Allocator;

/// mimalloc's own number for it, `mi_option_purge_delay`, which its crate does not name: how long it keeps what was let go of, in milliseconds.
#[cfg(feature = "opencv")]
const KEEP: libmimalloc_sys::mi_option_t = 15;

/// What a thousand robots let go of they want again within a round.
#[cfg(feature = "opencv")]
const LONG: std::ffi::c_long = 500;

/// From now on memory that was let go of is kept for long, and in huge pages where the system has them: for an emulation, which is over soon. To be called before
/// there is a second thread.
pub fn keep() {
    #[cfg(feature = "opencv")]
    #[expect(
        unsafe_code,
        reason = "mimalloc has no other way to say it but the environment, which is read before `main`"
    )]
    // SAFETY: it takes two numbers and no pointer, and no other thread is there to read them.
    unsafe {
        libmimalloc_sys::mi_option_set(KEEP, LONG);
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::thread::disable_transparent_huge_pages(false) {
        tracing::debug!("small pages remain: {error}");
    }
}

/// As many as a robot's few busy threads hardly wait for.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const HEAPS: libc::c_int = 2;

/// From now on threads share two heaps; to be called before there is a second one. Where `MALLOC_ARENA_MAX` is set, that holds.
pub fn share() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if std::env::var_os("MALLOC_ARENA_MAX").is_none() {
        #[expect(
            unsafe_code,
            reason = "glibc has no other way to say it but the environment, which is read before `main`"
        )]
        // SAFETY: it takes two numbers and no pointer, may be called at any time, and refuses what it does not know.
        let taken = unsafe { libc::mallopt(libc::M_ARENA_MAX, HEAPS) };
        if taken == 0 {
            tracing::info!("glibc keeps a heap for each thread");
        }
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    use std::process::Command;
    use std::sync::Barrier;

    /// What mimalloc is told by a number that its crate does not name.
    #[cfg(feature = "opencv")]
    #[test]
    fn memory_is_kept_for_long_where_that_is_said() {
        if std::env::var_os(ALONE).is_none() {
            return alone("heaps::tests::memory_is_kept_for_long_where_that_is_said");
        }
        #[expect(unsafe_code, reason = "as above")]
        // SAFETY: it takes and gives a number.
        let kept = || unsafe { libmimalloc_sys::mi_option_get(super::KEEP) };
        assert_eq!(kept(), 10, "mimalloc's own time");
        super::keep();
        assert_eq!(kept(), super::LONG);
    }

    /// Runs that test in a process of its own.
    fn alone(test: &str) {
        let mut alone = Command::new(std::env::current_exe().unwrap());
        let alone = alone.args(["--exact", test]).env(ALONE, "1").env_remove("MALLOC_ARENA_MAX");
        let alone = alone.env_remove("MIMALLOC_PURGE_DELAY").output().unwrap();
        assert!(alone.status.success(), "{}", String::from_utf8_lossy(&alone.stdout));
    }

    /// Set in a process in which no other test has heaps.
    const ALONE: &str = "GESTALT_HEAPS_ALONE";

    /// The heaps beside the first: of so many bytes each, of which the first part is used, and aligned.
    fn heaps() -> usize {
        const SIZE: u64 = 64 << 20;
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        let regions = maps.lines().filter_map(|line| {
            let (range, rest) = line.split_once(' ')?;
            let (from, to) = range.split_once('-')?;
            let [from, to] = [from, to].map(|end| u64::from_str_radix(end, 16).unwrap());
            Some((from, to, rest.starts_with("rw-p") && rest.ends_with(" 0 ") || rest.starts_with("---p")))
        });
        let regions: Vec<_> = regions.collect();
        let is_heap = |pair: &[(u64, u64, bool)]| {
            let [(from, middle, first), (next, to, second)] = pair else { return false };
            *first && *second && from % SIZE == 0 && middle == next && to - from == SIZE
        };
        regions.windows(2).filter(|pair| is_heap(pair)).count()
    }

    #[test]
    fn many_threads_share_two_heaps() {
        if std::env::var_os(ALONE).is_none() {
            return alone("heaps::tests::many_threads_share_two_heaps");
        }
        super::share();
        let (began, counted) = (Barrier::new(17), Barrier::new(17));
        let during = std::thread::scope(|scope| {
            for _ in 0..16 {
                scope.spawn(|| {
                    let held = vec![1_u8; 1000];
                    began.wait();
                    counted.wait();
                    drop(held);
                });
            }
            began.wait();
            let during = heaps();
            counted.wait();
            during
        });
        assert_eq!(during, 1, "beside the first");
    }
}
