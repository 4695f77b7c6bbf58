//! Pointers from C become slices and texts.

use std::ffi::{CStr, c_char};

use crate::refused::Refused;

/// The caller's array; a null pointer is one of no elements.
///
/// # Safety
/// `data` is null, or points to `length` initialised elements that nobody changes meanwhile.
pub(crate) unsafe fn slice<'a, T>(data: *const T, length: usize) -> Result<&'a [T], Refused> {
    if length == 0 {
        return Ok(&[]);
    }
    if data.is_null() {
        return Err(Refused::Argument(format!("a null pointer to {length} elements")));
    }
    if !data.is_aligned() || length > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Refused::Argument("a misaligned pointer, or more elements than memory has".to_owned()));
    }
    // SAFETY: the caller promises so many elements; it is aligned, not null, and not longer than memory.
    Ok(unsafe { std::slice::from_raw_parts(data, length) })
}

/// The caller's text, which ends with a zero byte.
///
/// # Safety
/// `text` is null, or points to a string that ends with a zero byte and that nobody changes meanwhile.
pub(crate) unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str, Refused> {
    if text.is_null() {
        return Err(Refused::Argument(format!("{name} is null")));
    }
    // SAFETY: it is not null, and the caller promises the zero byte.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Refused::Argument(format!("{name} is not UTF-8")))
}

/// Writes bytes into the caller's buffer.
///
/// # Safety
/// `buffer` has room for all of them, or there are none.
pub(crate) unsafe fn write_out(buffer: *mut u8, bytes: &[u8]) {
    if !bytes.is_empty() {
        // SAFETY: the caller promises the room; what is ours and what is theirs do not overlap.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer, bytes.len()) };
    }
}

#[cfg(test)]
mod tests {
    use std::ptr::null;

    use super::*;

    #[test]
    fn a_null_pointer_is_an_empty_array_or_an_error_and_never_read() {
        // SAFETY: null is allowed.
        unsafe {
            assert!(slice::<f32>(null(), 0).is_ok_and(<[f32]>::is_empty));
            assert!(matches!(slice::<f32>(null(), 3), Err(Refused::Argument(_))));
            assert!(matches!(text(null(), "key"), Err(Refused::Argument(_))));
        }
    }
}
