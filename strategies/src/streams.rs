//! The streams of a seed that a robot's chance is drawn from, the same in every simulator: with one seed, a robot of `gestalt emulate`
//! and one of the bindings live the same life.

use gestalt_protocol::RobotId;
use gestalt_rounds::Life;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The first of those by which robots share and forget, one for each life of each robot.
const LEARNING: u64 = 1 << 63;
/// The first of those that lives draw their numbers from. A host has the others for chances of its own.
const LIFE: u64 = 1 << 62;

/// The generator of one stream of a seed: what depends on chance in one place does not change the chances elsewhere.
#[must_use]
pub fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// One of a robot's lives.
#[must_use]
pub fn life(seed: u64, robot: RobotId, boot: u32) -> Life {
    Life { boot, nonce: stream(seed, LIFE | place(robot, boot)).next_u32() }
}

/// How a robot shares and forgets in one of its lives.
#[must_use]
pub fn learning(seed: u64, robot: RobotId, boot: u32) -> ChaCha8Rng {
    stream(seed, LEARNING | place(robot, boot))
}

fn place(robot: RobotId, boot: u32) -> u64 {
    u64::from(boot) << 32 | u64::from(robot.0.wrapping_sub(1))
}
