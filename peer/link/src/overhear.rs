//! Everything that is said to all in a swarm, as it travels: for whoever records it.

use std::time::SystemTime;

use gestalt_protocol::{Keys, RobotId, Topic};
use zenoh::sample::{Sample, SampleKind};

use super::{Client, LinkError};

/// One thing that was overheard.
#[derive(Clone, Debug, PartialEq)]
pub enum Overheard {
    /// A message, as it travelled.
    Said {
        /// What it is about.
        topic: Topic,
        /// Its bytes, of whatever length; whether they are a message is not looked into.
        payload: Vec<u8>,
        /// What travelled beside them.
        attachment: Option<Vec<u8>>,
        /// When it was said, by its author's clock, if its message tells.
        published: Option<SystemTime>,
    },
    /// A robot came, or left.
    Present(RobotId, bool),
}

impl Client {
    /// Hears all that is said to all from now on: votes, samples, decisions, questions, feedback, answers and evidence, and robots that come and
    /// go; with `frames` also what cameras stream, which then travels to this client as well. What one neighbour tells another is not
    /// heard. `take` is called on Zenoh's threads, which must not wait.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn overhear(
        &self,
        frames: bool,
        take: impl Fn(Overheard) + Clone + Send + Sync + 'static,
    ) -> Result<(), LinkError> {
        let of_all = [
            self.keys.every_robot("vote"),
            self.keys.every_robot("sample"),
            self.keys.every_robot("decision"),
            self.keys.key(&Topic::Decision),
            self.keys.key(&Topic::Question),
            self.keys.key(&Topic::Evidence),
            self.keys.every_instructor("feedback"),
            self.keys.every_instructor("word"),
            self.keys.every_instructor("answer"),
        ];
        for key in of_all.into_iter().chain(frames.then(|| self.keys.every_robot("frame"))) {
            let (keys, take) = (self.keys.clone(), take.clone());
            self.session
                .declare_subscriber(key)
                .callback(move |sample| said(&keys, &sample).into_iter().for_each(&take))
                .background()
                .await
                .map_err(|error| LinkError::open(&*error))?;
        }
        let keys = self.keys.clone();
        self.session
            .liveliness()
            .declare_subscriber(self.keys.every_robot("alive"))
            .history(true)
            .callback(move |sample| {
                if let Some(Topic::Alive(robot)) = keys.parse(sample.key_expr()) {
                    take(Overheard::Present(robot, sample.kind() == SampleKind::Put));
                }
            })
            .background()
            .await
            .map_err(|error| LinkError::open(&*error))
    }
}

fn said(keys: &Keys, sample: &Sample) -> Option<Overheard> {
    let topic = keys.parse(sample.key_expr()).filter(|_| sample.kind() == SampleKind::Put)?;
    // In a sealed swarm, what an instructor says travels with its signature beside it.
    let topic = if let Topic::Word(by) = topic { Topic::Feedback(by) } else { topic };
    let payload = sample.payload().to_bytes().into_owned();
    let attachment = sample.attachment().map(|attachment| attachment.to_bytes().into_owned());
    let published = sample.timestamp().map(|stamp| stamp.get_time().to_system_time());
    Some(Overheard::Said { topic, payload, attachment, published })
}
