//! A camera that a ROS driver owns: its topic, as a source of frames.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use gestalt_ros::message::{CompressedImage, Image};
use gestalt_ros::{Node, NodeConfig, NodeName, Qos, Received, RosError, Subscription};
use gestalt_vision::source::{Frame, Scene, Source, SourceError, decode};
use opencv::core::Mat;

use crate::config::RosSection;
use crate::stream::MAX_MEGAPIXELS;

/// How long the next picture is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// image_transport names the topic of a camera's JPEG pictures so.
const COMPRESSED: &str = "/compressed";

/// A camera topic.
pub(crate) struct RosCamera {
    topic: String,
    period: Duration,
    newest: Arc<Newest>,
    _subscription: Subscription,
}

/// Where the newest picture waits.
#[derive(Default)]
struct Newest {
    picture: Mutex<Option<Result<Picture, String>>>,
    arrived: Condvar,
}

enum Picture {
    Encoded(Vec<u8>),
    Pixels(Image),
}

impl RosCamera {
    /// The topic as `robot` hears it, whose pictures come every `period` or so.
    ///
    /// # Errors
    /// [`SourceError::Own`] when no ROS router answers, or the topic's name cannot be.
    pub(crate) fn open(section: &RosSection, robot: RobotId, period: Duration) -> Result<Self, SourceError> {
        let newest = Arc::new(Newest::default());
        let subscription =
            subscribe(section, robot, &newest).map_err(|error| SourceError::Own(error.to_string()))?;
        Ok(Self { topic: section.topic.clone(), period, newest, _subscription: subscription })
    }
}

fn subscribe(section: &RosSection, robot: RobotId, newest: &Arc<Newest>) -> Result<Subscription, RosError> {
    let RosSection { topic, router, domain } = section;
    let name = NodeName::new("/", &format!("gestalt_camera_{robot}"))?;
    let node = Node::open(NodeConfig { router: router.clone(), ..NodeConfig::new(name, *domain) })?;
    let newest = newest.clone();
    if topic.ends_with(COMPRESSED) {
        node.subscription(topic, Qos::sensor_data(), move |heard: Received<CompressedImage>| {
            newest.put(heard.message.map(|picture| Picture::Encoded(picture.data)));
        })
    } else {
        node.subscription(topic, Qos::sensor_data(), move |heard: Received<Image>| {
            newest.put(heard.message.map(Picture::Pixels));
        })
    }
}

impl Newest {
    fn put<E: ToString>(&self, picture: Result<Picture, E>) {
        let picture = picture.map_err(|error| error.to_string());
        *self.picture.lock().unwrap_or_else(PoisonError::into_inner) = Some(picture);
        self.arrived.notify_one();
    }

    fn take(&self) -> Option<Result<Picture, String>> {
        let picture = self.picture.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut picture, _) = self
            .arrived
            .wait_timeout_while(picture, PATIENCE, |picture| picture.is_none())
            .unwrap_or_else(PoisonError::into_inner);
        picture.take()
    }
}

impl Source for RosCamera {
    fn describe(&self) -> String {
        format!("ros {}", self.topic)
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn is_live(&self) -> bool {
        true
    }

    fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
        let asked = Instant::now();
        let topic = &self.topic;
        let picture = self.newest.take().ok_or_else(|| {
            SourceError::Own(format!(
                "nothing is published on {topic}: `ros2 topic hz {topic}` shows whether its driver runs, with rmw_zenoh, in this domain"
            ))
        })?;
        // As late as it was waited for.
        frame(topic, picture, now + asked.elapsed())
    }
}

/// What was published on that topic, as a frame of that time. What is no picture costs itself alone: the topic is as good as before.
fn frame(topic: &str, picture: Result<Picture, String>, at: Duration) -> Result<Frame, SourceError> {
    let no_picture = |cause: String| {
        SourceError::Own(format!("what is published on {topic} is no picture: {cause}")).of_one_file()
    };
    match picture.map_err(no_picture)? {
        Picture::Encoded(bytes) => {
            let mut image = Mat::default();
            decode(&bytes, MAX_MEGAPIXELS, &mut image).map_err(|cause| no_picture(cause.to_string()))?;
            Ok(Frame { image, at })
        }
        Picture::Pixels(image) => {
            let megapixels = f64::from(image.width) * f64::from(image.height) / 1e6;
            if megapixels > MAX_MEGAPIXELS {
                return Err(no_picture(format!(
                    "{megapixels:.1} million pixels, at most {MAX_MEGAPIXELS} are looked at"
                )));
            }
            let pixels = image.to_bgr().map_err(|cause| no_picture(cause.to_string()))?;
            Frame::from_bgr(image.width, image.height, &pixels, at).map_err(SourceError::of_one_file)
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_ros::message::Header;
    use opencv::prelude::*;

    use super::*;

    fn pixels(encoding: &str, width: u32, height: u32, data: Vec<u8>) -> Picture {
        let (header, encoding) = (Header::default(), encoding.to_owned());
        Picture::Pixels(Image { header, height, width, encoding, big_endian: false, step: 3 * width, data })
    }

    #[test]
    fn what_is_no_picture_says_nothing_of_the_next() {
        let frame = |picture| frame("/camera", picture, Duration::ZERO);
        let good = frame(Ok(pixels("bgr8", 3, 2, vec![7; 18]))).unwrap();
        assert_eq!((good.image.cols(), good.image.rows()), (3, 2));
        for bad in [
            Err("a message of 3 bytes".to_owned()),
            Ok(Picture::Encoded(Vec::new())),
            Ok(Picture::Encoded(b"a shopping list".to_vec())),
            Ok(pixels("yuv422", 3, 2, vec![7; 18])),
            Ok(pixels("bgr8", 3, 2, vec![7; 17])),
            Ok(pixels("bgr8", 60_000, 60_000, Vec::new())),
        ] {
            let error = frame(bad).unwrap_err();
            assert!(error.is_of_one_picture() && error.to_string().contains("/camera"), "{error}");
        }
    }
}
