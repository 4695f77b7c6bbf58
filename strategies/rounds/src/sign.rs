//! Who stands by what a robot says.

use std::fmt::Debug;

use gestalt_protocol::Signature;

/// Signs what a robot says, in its name; `gestalt-trust` has one. Who hears of it by others can then tell that it was said.
pub trait Sign: Debug + Send + Sync {
    /// The signature under a statement, which is [`Envelope::statement`](gestalt_protocol::Envelope::statement).
    fn sign(&self, statement: &[u8]) -> Signature;
}
