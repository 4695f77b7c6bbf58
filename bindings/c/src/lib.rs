//! The mind of a Gestalt robot for C and C++: whoever has a radio or a simulator of their own carries the messages.
//!
//! [`include/gestalt.h`](../include/gestalt.h) is made of this crate by cbindgen; `bindings/README.md` shows how it is used.
//! What is done is done by [`gestalt_mind`], without a line of `unsafe`; here, pointers become values and values become
//! buffers of the caller. A panic never leaves: it becomes [`Status::Panicked`].

mod border;
mod last_error;
mod mind;
mod pointers;
mod refused;
mod status;

pub use last_error::gestalt_last_error;
pub use mind::*;
pub use status::Status;
