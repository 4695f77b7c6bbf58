//! The border: errors become codes, and panics stay on this side.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::last_error;
use crate::refused::Refused;
use crate::status::Status;

/// Runs what a call does. An error becomes its code and the thread's last error; so does a panic.
pub(crate) fn guarded(call: impl FnOnce() -> Result<Status, Refused>) -> Status {
    // What a panic left half done is not used again: the mind that it met refuses all further calls.
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(status)) => status,
        Ok(Err(Refused::Argument(text))) => {
            last_error::set(text);
            Status::Argument
        }
        Ok(Err(Refused::Io(text))) => {
            last_error::set(text);
            Status::Model
        }
        Ok(Err(Refused::Mind(error))) => {
            last_error::set(error.to_string());
            Status::from(&error)
        }
        Err(panic) => {
            last_error::set(format!("gestalt panicked: {}", words(&*panic)));
            Status::Panicked
        }
    }
}

/// What a panic said.
fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a word")
}

#[cfg(test)]
mod tests {
    use std::ptr::null_mut;

    use super::*;
    use crate::last_error::gestalt_last_error;

    fn last_error(capacity: usize) -> (usize, String) {
        let mut buffer = vec![b'x'; 100];
        // SAFETY: the buffer has room for 100 bytes, which no test exceeds.
        let length = unsafe { gestalt_last_error(buffer.as_mut_ptr().cast(), capacity) };
        let end = buffer.iter().position(|byte| *byte == 0).expect("a zero byte");
        assert!(buffer[end + 1..].iter().all(|byte| *byte == b'x'), "nothing is written after it");
        (length, String::from_utf8(buffer[..end].to_vec()).expect("UTF-8"))
    }

    #[test]
    fn a_panic_becomes_a_code_and_its_words_the_last_error() {
        assert_eq!(guarded(|| panic!("the sky fell")), Status::Panicked);
        let text = "gestalt panicked: the sky fell";
        assert_eq!(last_error(100), (text.len(), text.to_owned()));
        assert_eq!(guarded(|| Ok(Status::Nothing)), Status::Nothing);
        assert_eq!(last_error(8), (text.len(), "gestalt".to_owned()));
        // SAFETY: null is allowed.
        assert_eq!(unsafe { gestalt_last_error(null_mut(), 100) }, text.len());
    }

    #[test]
    fn a_cut_error_is_still_utf_8() {
        guarded(|| Err(Refused::Argument("naïve".to_owned())));
        assert_eq!(last_error(4), (6, "na".to_owned()));
    }
}
