//! What was wrong, in words, of the thread's latest call that failed.

use std::cell::RefCell;
use std::ffi::c_char;

use crate::pointers::write_out;

thread_local! {
    static LAST_ERROR: RefCell<String> = const { RefCell::new(String::new()) };
}

pub(crate) fn set(error: impl Into<String>) {
    // While a thread ends, there may be nobody left to tell.
    let _ = LAST_ERROR.try_with(|last| *last.borrow_mut() = error.into());
}

pub(crate) fn get() -> String {
    LAST_ERROR.try_with(|last| last.borrow().clone()).unwrap_or_default()
}

/// Writes what was wrong with this thread's latest call that failed, as UTF-8 that ends with a zero byte, cut to
/// `capacity`. Gives its whole length in bytes, without the zero; 0 before the first error.
///
/// # Safety
/// `buffer` is null, or has room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_last_error(buffer: *mut c_char, capacity: usize) -> usize {
    let text = get();
    let mut cut = text.len().min(capacity.saturating_sub(1));
    while !text.is_char_boundary(cut) {
        cut -= 1;
    }
    if !buffer.is_null() && capacity > 0 {
        // SAFETY: the caller promises room for `capacity` bytes, of which these are at most as many.
        unsafe { write_out(buffer.cast(), &[&text.as_bytes()[..cut], b"\0"].concat()) };
    }
    text.len()
}
