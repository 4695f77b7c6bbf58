//! Robots at a glance: one aligned line each.

use super::show::{clean, quoted};
use gestalt_protocol::{Camera, CameraState, MotionState, Status};

/// What the columns of [`table`] are.
pub(super) const HEADER: [&str; 9] =
    ["robot", "name", "source", "state", "size", "fps", "latency", "motion", "opinion"];

/// A line for each robot, under the [`HEADER`] if that is asked for: what it sees with, and what it makes of it.
pub(super) fn table(statuses: &[Status], header: bool) -> Vec<String> {
    let head = header.then(|| HEADER.map(str::to_owned));
    let rows: Vec<[String; 9]> = head.into_iter().chain(statuses.iter().map(row)).collect();
    let widths: [usize; 9] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let line = |row: &[String; 9]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

fn row(status: &Status) -> [String; 9] {
    let Camera { source, state, size, fps, delay_ms, motion, opinion, .. } = &status.camera;
    let none = || "-".to_owned();
    let [width, height] = size;
    let delivers = *fps > 0.0;
    [
        status.robot.to_string(),
        clean(&status.name),
        clean(source),
        state_word(*state).to_owned(),
        if *width == 0 { none() } else { format!("{width}×{height}") },
        if delivers { format!("{fps:.1}") } else { none() },
        if delivers { format!("{delay_ms:.0} ms") } else { none() },
        motion.as_ref().map_or_else(none, |motion| {
            format!("{} (detected ≤ {:.0} ms late)", motion_word(motion.state), motion.delay_ms)
        }),
        opinion.as_ref().map_or_else(none, |it| format!("{} p = {:.2}", quoted(&it.gesture), it.probability)),
    ]
}

fn state_word(state: CameraState) -> &'static str {
    match state {
        CameraState::None => "-",
        CameraState::Opening => "opening",
        CameraState::Live => "live",
        CameraState::Frozen => "frozen",
        CameraState::Failing => "failing",
        CameraState::Ended => "ended",
    }
}

fn motion_word(state: MotionState) -> &'static str {
    match state {
        MotionState::Empty => "empty",
        MotionState::Moving => "moving",
        MotionState::Still => "still",
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Motion, Opinion, RobotId};

    use super::*;

    fn status(robot: u32, name: &str, camera: Camera) -> Status {
        Status { camera, ..Status::new(RobotId(robot), name.to_owned(), 1) }
    }

    #[test]
    fn robots_stand_in_columns_whatever_they_have_to_say() {
        let sees = Camera {
            source: "stream".to_owned(),
            state: CameraState::Live,
            size: [640, 360],
            fps: 29.96,
            delay_ms: 12.4,
            motion: Some(Motion { state: MotionState::Still, delay_ms: 300.0 }),
            opinion: Some(Opinion { gesture: "three".to_owned(), probability: 0.875, at_ms: 7 }),
            ..Camera::default()
        };
        let blind = Camera { source: "none".to_owned(), ..Camera::default() };
        let lines = table(&[status(7, "parrot-7", sees), status(100, "ce\u{1b}", blind)], true);
        assert_eq!(
            lines,
            [
                "robot  name      source  state  size     fps   latency  motion                          opinion",
                "7      parrot-7  stream  live   640×360  30.0  12 ms    still (detected ≤ 300 ms late)  \"three\" p = 0.88",
                "100    ce\\u{1b}  none    -      -        -     -        -                               -",
            ]
        );
    }
}
