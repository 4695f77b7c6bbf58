//! What a robot sees, for ROS: the annotated view on `~/view/compressed`.

use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gestalt_link::Robot;
use gestalt_protocol::RobotId;
use gestalt_ros::message::{CompressedImage, Header};
use gestalt_ros::{Node, NodeConfig, NodeName, Publisher, Qos, RosError};
use gestalt_vision::source::encode_jpeg;
use gestalt_vision::steady::caught;
use thiserror::Error;

use crate::config::RosNodeSection;
use crate::eye::window::{Closed, Found, Glimpse, Window};
use crate::opinion::opinion;
use crate::picture::PictureError;
use crate::picture::view::{View, picture};

/// How often it is asked whether anybody subscribes.
const ASKED_EVERY: Duration = Duration::from_millis(250);

/// After how long a router that did not answer is asked again.
const AGAIN: Duration = Duration::from_secs(5);

/// JPEG quality: lines one pixel thick stay visible.
const QUALITY: i32 = 80;

/// Shows a robot's view to ROS, from a thread of its own; until it is dropped.
#[derive(Debug)]
pub(crate) struct RosView(Arc<Window>);

/// Why there is no view.
#[derive(Debug, Error)]
enum ViewError {
    #[error(transparent)]
    Ros(#[from] RosError),
    #[error("the view for ROS cannot be drawn: {0}")]
    Picture(#[from] PictureError),
    #[error("the view for ROS cannot be encoded: {0}")]
    Jpeg(#[from] opencv::Error),
}

impl RosView {
    /// Shows what comes through that window, as what a robot sees. A router that does not answer is asked again and again; the
    /// robot says so among its errors.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub(crate) fn show(
        section: &RosNodeSection,
        name: NodeName,
        (id, robot): (RobotId, &Arc<Robot>),
        title: String,
        window: Arc<Window>,
    ) -> std::io::Result<Self> {
        let config = NodeConfig { router: section.router.clone(), ..NodeConfig::new(name, section.domain) };
        let shower = Shower { config, id, robot: Arc::downgrade(robot), title, window: window.clone() };
        thread::Builder::new().name("ros view".to_owned()).spawn(move || shower.run())?;
        Ok(Self(window))
    }
}

impl Drop for RosView {
    fn drop(&mut self) {
        self.0.close();
    }
}

struct Shower {
    config: NodeConfig,
    id: RobotId,
    robot: Weak<Robot>,
    title: String,
    window: Arc<Window>,
}

impl Shower {
    fn run(&self) {
        let mut said = String::new();
        loop {
            let Err(error) = self.serve() else { return };
            self.window.want(false);
            let error = error.to_string();
            // The same trouble is said once.
            if error != said
                && let Some(robot) = self.robot.upgrade()
            {
                robot.report_error(&error);
            }
            said = error;
            let until = Instant::now() + AGAIN;
            while Instant::now() < until {
                if let Err(Closed) = self.window.next(until.saturating_duration_since(Instant::now())) {
                    return;
                }
            }
        }
    }

    /// Shows what there is to see, until nobody will look any more.
    fn serve(&self) -> Result<(), ViewError> {
        let node = Node::open(self.config.clone())?;
        let publisher = node.publisher::<CompressedImage>("~/view/compressed", Qos::reliable(1))?;
        loop {
            self.window.want(publisher.is_heard()?);
            match self.window.next(ASKED_EVERY) {
                Err(Closed) => return Ok(()),
                Ok(None) => {}
                Ok(Some(glimpse)) => self.publish(&publisher, &glimpse)?,
            }
        }
    }

    fn publish(&self, to: &Publisher<CompressedImage>, glimpse: &Glimpse) -> Result<(), ViewError> {
        // Who leaves the swarm waits for nobody who draws.
        let Some(classifier) = self.robot.upgrade().map(|robot| robot.classifier()) else { return Ok(()) };
        let (hand, judged) = match &glimpse.found {
            Found::Hand { region, mask, features } => {
                let judge = || classifier.and_then(|by| opinion(by.as_ref(), features, Duration::ZERO));
                let judged = match caught(judge) {
                    Ok(Some(opinion)) => Ok((opinion.gesture, f64::from(opinion.probability))),
                    Ok(None) => Err("a hand; no classifier".to_owned()),
                    Err(panic) => Err(format!("a hand; the classifier panicked ({panic})")),
                };
                (Some((*region, mask)), judged)
            }
            Found::NoHand(cause) => (None, Err(cause.clone())),
            Found::Moving => (None, Err("moving".to_owned())),
            Found::NotLooked => (None, Err("no round is open".to_owned())),
        };
        let view = View { title: &self.title, frame: &glimpse.image, hand, opinion: judged };
        let data = encode_jpeg(&picture(&view)?, QUALITY)?;
        let clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let taken = clock.saturating_sub(glimpse.taken.elapsed());
        let header = Header {
            seconds: i32::try_from(taken.as_secs()).unwrap_or(i32::MAX),
            nanoseconds: taken.subsec_nanos(),
            frame: format!("gestalt_camera_{}", self.id),
        };
        to.publish(&CompressedImage { header, format: "jpeg".to_owned(), data }, clock)?;
        if let Some(robot) = self.robot.upgrade() {
            robot.count("views_shown");
        }
        Ok(())
    }
}
