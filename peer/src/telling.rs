//! From an eye to its robot.

use std::time::Instant;

use gestalt_link::Robot;
use gestalt_vision::motion::Change;
use gestalt_vision::sight::Taken;

/// Tells a robot what a frame said. `zero` is the moment from which the frame's time counts.
pub(crate) fn tell(taken: Taken, robot: &Robot, zero: Instant) {
    if let Some(trouble) = &taken.trouble {
        robot.report_error(trouble);
    }
    match taken.change {
        Some(Change::Shown { began }) => robot.shown(zero + began),
        Some(Change::Left) => robot.left(),
        None => {}
    }
    match taken.observation {
        Some(Ok(observation)) => {
            robot.count("frames_with_a_hand");
            robot.observe(observation);
        }
        Some(Err(none)) => {
            robot.count("frames_without_a_hand");
            tracing::debug!("{none}");
        }
        None => {}
    }
}
