//! What is accepted at most, whoever says it, and of which version.

/// The version byte in front of every envelope. Another version is refused, not guessed at.
pub const PROTOCOL_VERSION: u8 = 3;

/// The longest envelope accepted, in bytes.
pub const MAX_MESSAGE: usize = 512 * 1024;

/// The longest JSON document accepted, in bytes: a decision of the largest swarm, with all its votes.
pub const MAX_JSON: usize = 2 * 1024 * 1024;

/// The most memory that reading one message can allocate, in bytes, whatever the message claims: a message of
/// [`MAX_MESSAGE`] bytes, each element of which is larger in memory than on the wire.
pub const MAX_ALLOCATION: usize = 64 * MAX_MESSAGE;

/// The largest vocabulary: more classes than this are refused at both ends.
pub const MAX_CLASSES: usize = 64;

/// The largest swarm one ballot can hold.
pub const MAX_ROBOTS: usize = 4096;
