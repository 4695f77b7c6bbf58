//! What tells one life of a robot from another.

/// One life of a robot, from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Life {
    /// Grows at every start, or the robot's votes are taken for old ones.
    pub boot: u32,
    /// Drawn at random at every start. It is part of the name of every round that the robot opens: whatever became of the disk that
    /// counted, and of the clock, no other life names a round the same.
    pub nonce: u32,
}
