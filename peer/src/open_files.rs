//! How many files and connections this process may have open at once.
//!
//! Whoever reaches a port can hold connections open without a word, each for as long as a handshake may take, and each takes a file of the
//! process. Of the 1,024 that a shell and systemd give, a few thousand strangers leave none for cameras, memories and members.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Far more than strangers can hold for two seconds from one computer; a table of so many costs the kernel little.
const ENOUGH: u64 = 65_536;

/// Raises the limit as far as it may be without a privilege, and no further than is enough. Where that is refused it stays as it is.
pub fn raise_limit() {
    let limit = getrlimit(Resource::Nofile);
    let most = limit.maximum.map_or(ENOUGH, |most| most.min(ENOUGH));
    if limit.current.is_none_or(|now| now >= most) {
        return;
    }
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: Some(most), maximum: limit.maximum }) {
        tracing::info!("at most {:?} files may be open: {error}", limit.current);
    }
}
