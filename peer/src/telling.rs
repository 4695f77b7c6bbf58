//! From an eye to its robot.

use std::time::Instant;

use gestalt_link::Robot;
use gestalt_protocol::{CameraState, Motion};
use gestalt_vision::motion::Change;
use gestalt_vision::sight::Taken;

use crate::camera_report::CameraReport;

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

/// Writes to a robot's status how its camera goes, and tells the robot when that makes it blind or lets it see again.
pub(crate) fn tell_camera(
    report: &mut CameraReport,
    robot: &Robot,
    source: &str,
    motion: Option<Motion>,
    zero: Instant,
) {
    let classifier = robot.classifier();
    let (mut camera, news) = report.write(zero.elapsed(), source, motion, classifier.as_deref());
    if let Some(opinion) = &mut camera.opinion {
        // The eye was open before the robot started.
        let before = robot.started().saturating_duration_since(zero).as_millis();
        opinion.at_ms = opinion.at_ms.saturating_sub(u64::try_from(before).unwrap_or(u64::MAX));
    }
    if let Some(blind) = news.blind {
        robot.blind(blind);
    }
    // What came over a camera is told once, and stays among the errors when it is over.
    if news.state && matches!(camera.state, CameraState::Frozen | CameraState::Failing) {
        robot.report_error(&camera.trouble);
    }
    robot.update_camera(|before| *before = camera);
}
