//! The camera that a configuration describes, opened; and who stands in front of it, if it is a rendered one.

use std::time::Duration;

use gestalt_protocol::RobotId;
use gestalt_vision::human::Human;
use gestalt_vision::source::{
    Device, ImageFolder, Pipe, RenderedSource, ScheduledSource, Source, SourceError, Video,
};

use crate::config::{CameraSection, SourceSection};
use crate::ros_camera::RosCamera;

/// Who stands in front of the camera of a configuration, if it is a rendered one.
#[must_use]
pub fn human_before(camera: &CameraSection) -> Human {
    match &camera.source {
        SourceSection::Rendered(rendered) => Human::new(rendered.seed),
        _ => Human::new(0),
    }
}

/// The camera of a configuration, in words.
pub(crate) fn describe(camera: &CameraSection) -> String {
    match &camera.source {
        SourceSection::None => "none".to_owned(),
        SourceSection::Stream(_) => "stream".to_owned(),
        SourceSection::Ros(ros) => format!("ros {}", ros.topic),
        SourceSection::Rendered(_) => "rendered".to_owned(),
        SourceSection::Device(device) => format!("device {}", device.path.display()),
        SourceSection::Images(files) => format!("images {}", files.path.display()),
        SourceSection::Video(files) => format!("video {}", files.path.display()),
    }
}

/// Opens the source of frames on this machine that a configuration describes. `clock` is the time since 1970 now.
///
/// # Errors
/// See [`SourceError`]; [`SourceError::Ended`] for a configuration without one.
pub fn open_source(
    camera: &CameraSection,
    robot: RobotId,
    clock: Duration,
) -> Result<Box<dyn Source>, SourceError> {
    let properties = camera.model.properties();
    Ok(match &camera.source {
        SourceSection::None | SourceSection::Stream(_) => return Err(SourceError::Ended("none".to_owned())),
        SourceSection::Rendered(rendered) => {
            // Every robot has a noise of its own, of the same scene.
            let noise = rendered.seed.rotate_left(32) ^ u64::from(robot.0);
            let source = RenderedSource::new(properties, rendered.pose, rendered.glove, noise)?;
            match rendered.schedule {
                Some(schedule) => {
                    Box::new(ScheduledSource::new(source, Human::new(rendered.seed), schedule, clock))
                }
                None => Box::new(source),
            }
        }
        SourceSection::Ros(ros) => Box::new(RosCamera::open(ros, robot, properties.period())?),
        SourceSection::Device(device) => {
            Box::new(Device::open_with(&device.path, &properties, &device.v4l2)?)
        }
        SourceSection::Images(files) => {
            Box::new(ImageFolder::open(&files.path, properties.period(), files.repeat)?)
        }
        SourceSection::Video(files) if Pipe::is_at(&files.path) => Box::new(Pipe::open(&files.path)?),
        SourceSection::Video(files) => Box::new(Video::open(&files.path, files.repeat)?),
    })
}
