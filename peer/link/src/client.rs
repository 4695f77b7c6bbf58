//! A client of a swarm: no robot, no vote; it hears decisions, asks robots how they are, and instructs them.

use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, DecodeError, Instruction, InstructorId, Keys, MAX_ROBOTS, RobotId, Status, Topic,
    decode_json,
};
use gestalt_trust::{Roster, Speaker, WordHeading, word};
use serde::de::DeserializeOwned;
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::Sample;

use super::attach::Attached;
use super::identity::{robot_of, swarm_checksum};
use super::tls::{Bearer, Credentials};
use super::word_count::WordCount;
use super::{LinkConfig, LinkError, News};

/// How many decisions wait for a slow reader before the oldest gives way.
const MAX_WAITING: usize = 1024;

/// The most bytes of answers to one question that are read.
const MAX_ANSWERS: usize = 64 << 20;

/// A session in client mode, attached to any one robot; it attaches again when that robot goes and comes back.
#[derive(Debug)]
pub struct Client {
    pub(super) session: Session,
    pub(super) keys: Keys,
    /// Whoever speaks through it, in a sealed swarm, and the count of their words.
    speaker: Option<(Credentials, WordCount)>,
    /// Holds the session to robots of the swarm.
    attached: Attached,
}

/// The swarm's decisions, as they are announced.
#[derive(Debug)]
pub struct Decisions(Subscriber<RingChannelHandler<Sample>>);

/// The swarm's answers to all instructors, as they are given.
#[derive(Debug)]
pub struct Answers {
    heard: Subscriber<RingChannelHandler<Sample>>,
    keys: Keys,
}

impl Client {
    /// Attaches to a robot at one of `link.connect`, or to one of that swarm found by `link.scouting`; where none answers, to a router of another kind through which
    /// one does. With `link.credentials` to no other than a robot
    /// on their roster, with the key that it has there, by TLS; or to whoever is at an endpoint of this computer that is named.
    ///
    /// # Errors
    /// [`LinkError::Config`] names what Zenoh cannot take, and an endpoint at which anybody could be; [`LinkError::Unreached`] says that no
    /// robot could be reached.
    pub async fn open(swarm: &str, link: &LinkConfig) -> Result<Self, LinkError> {
        let keys = Keys::new(swarm)?;
        let attached = Attached::open(&keys, link).await?;
        let session = attached.session().clone();
        let speaker = link.credentials.clone().map(|who| {
            let count = WordCount::new(who.words.clone());
            (who, count)
        });
        Ok(Self { session, keys, speaker, attached })
    }

    /// Every decision from now on: one message each; where a spokesrobot died while speaking, its successor may
    /// repeat it, which the round tells.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn decisions(&self) -> Result<Decisions, LinkError> {
        let subscriber = self
            .session
            .declare_subscriber(self.keys.key(&Topic::Decision))
            .with(RingChannel::new(MAX_WAITING))
            .await
            .map_err(|error| LinkError::open(&*error))?;
        Ok(Decisions(subscriber))
    }

    /// Every answer to an instructor, whoever it is, from now on.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn answers(&self) -> Result<Answers, LinkError> {
        let heard = self
            .session
            .declare_subscriber(self.keys.every_instructor("answer"))
            .with(RingChannel::new(MAX_WAITING))
            .await
            .map_err(|error| LinkError::open(&*error))?;
        Ok(Answers { heard, keys: self.keys.clone() })
    }

    /// Everything that happens in the swarm from now on: decisions, who holds which, robots that come and go.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn news(&self) -> Result<News, LinkError> {
        News::listen(&self.session, self.keys.clone()).await.map_err(|error| LinkError::open(&*error))
    }

    /// The account of every robot that answers within `patience`, by robot.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn statuses(&self, patience: Duration) -> Result<Vec<Status>, LinkError> {
        let mut statuses: Vec<Status> = self.ask(&self.keys.every_robot("status"), patience).await?;
        statuses.sort_by_key(|status| status.robot);
        Ok(statuses)
    }

    /// The robot it is attached to; `None` while it is to none of this swarm.
    pub async fn attached(&self) -> Option<RobotId> {
        let swarm = swarm_checksum(self.keys.swarm());
        // One in a cell is a client itself, of a relay.
        self.session.info().transports().await.find_map(|transport| robot_of(*transport.zid(), swarm))
    }

    /// The last decision of the swarm; `None` when nobody who answers within `patience` knows of one.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn last_decision(&self, patience: Duration) -> Result<Option<Announcement>, LinkError> {
        let known: Vec<Announcement> = self.ask(&self.keys.key(&Topic::Decision), patience).await?;
        Ok(known.into_iter().max_by_key(|known| (known.decision.round.counter, known.decision.rank())))
    }

    async fn ask<T: DeserializeOwned>(&self, key: &str, patience: Duration) -> Result<Vec<T>, LinkError> {
        let replies = self
            .session
            .get(key)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            // Replies go at the query's priority, and must not be lost: on their own, they hold up nothing else.
            .priority(Priority::DataLow)
            .timeout(patience)
            .await
            .map_err(|error| LinkError::open(&*error))?;
        let (mut answers, mut room) = (Vec::new(), MAX_ANSWERS);
        while answers.len() < MAX_ROBOTS
            && let Ok(reply) = replies.recv_async().await
        {
            // An error is a robot that left meanwhile; what is no answer is another program's on the same key.
            let Ok(sample) = reply.result() else { continue };
            let Some(left) = room.checked_sub(sample.payload().len()) else { break };
            if let Ok(answer) = decode_json(&sample.payload().to_bytes()) {
                room = left;
                answers.push(answer);
            }
        }
        Ok(answers)
    }

    /// Says something to all robots, in the name of an instructor.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn instruct(&self, as_whom: &InstructorId, say: &Instruction) -> Result<(), LinkError> {
        let as_whom = self.name(as_whom);
        let json = serde_json::to_string(say).expect("an instruction has a place in JSON");
        let attachment = self.speaker.as_ref().and_then(|(who, count)| signed(who, count, as_whom, &json));
        let topic = match &attachment {
            Some(_) => Topic::Word(as_whom.clone()),
            None => Topic::Feedback(as_whom.clone()),
        };
        self.session
            .put(self.keys.key(&topic), json)
            .encoding(Encoding::APPLICATION_JSON)
            .attachment(attachment)
            // On its own: a link that takes nothing must hold up no decision because of a word that is not to be lost.
            .priority(Priority::InteractiveLow)
            .congestion_control(CongestionControl::Block)
            .await
            .map_err(|error| LinkError::open(&*error))
    }

    /// Who speaks: whoever has a key speaks in its name alone.
    fn name<'a>(&'a self, as_whom: &'a InstructorId) -> &'a InstructorId {
        match self.speaker.as_ref().map(|(who, _)| &who.holder) {
            Some(Bearer::Client(name)) => name,
            _ => as_whom,
        }
    }

    /// Tells all robots of a roster: each goes by it if it follows the one that it holds.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn tell_roster(&self, roster: &Roster) -> Result<(), LinkError> {
        self.session
            .put(self.keys.key(&Topic::Roster), roster.to_json())
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::InteractiveLow)
            .congestion_control(CongestionControl::Block)
            .await
            .map_err(|error| LinkError::open(&*error))
    }

    /// Says something about a round, and waits for the swarm's answer; `None` when none comes within `patience`.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn teach(
        &self,
        as_whom: &InstructorId,
        say: &Instruction,
        patience: Duration,
    ) -> Result<Option<Answer>, LinkError> {
        let answers = self
            .session
            .declare_subscriber(self.keys.key(&Topic::Answer(self.name(as_whom).clone())))
            .with(RingChannel::new(MAX_WAITING))
            .await
            .map_err(|error| LinkError::open(&*error))?;
        self.instruct(as_whom, say).await?;
        let answer = async {
            loop {
                let sample = answers.recv_async().await.ok()?;
                let answer = decode_json::<Answer>(&sample.payload().to_bytes()).ok();
                if let Some(answer) = answer.filter(|answer| answer.to == *say) {
                    return Some(answer);
                }
            }
        };
        Ok(tokio::time::timeout(patience, answer).await.ok().flatten())
    }

    /// Detaches.
    pub async fn close(self) {
        if let Err(error) = self.session.close().await {
            tracing::debug!("closing the client's session: {error}");
        }
        self.attached.close().await;
    }
}

/// The attachment of a word, by whoever has a key to sign it with.
fn signed(who: &Credentials, count: &WordCount, by: &InstructorId, word: &str) -> Option<Vec<u8>> {
    let speaker = match &who.holder {
        Bearer::Client(_) => Speaker::Own(by.clone()),
        Bearer::Robot(robot) => Speaker::For(*robot),
        Bearer::Authority => return None,
    };
    let heading = WordHeading { speaker, count: count.next() };
    Some(word::sign(&who.identity, &who.swarm, by, &heading, word.as_bytes()))
}

impl Decisions {
    /// Waits for the next decision; `None` once the client is closed. An error is a message on the swarm's key
    /// that is no decision.
    pub async fn next(&mut self) -> Option<Result<Announcement, DecodeError>> {
        let sample = self.0.recv_async().await.ok()?;
        Some(decode_json(&sample.payload().to_bytes()))
    }
}

impl Answers {
    /// Waits for the next answer, and says to whom it is; `None` once the client is closed. What is no answer is passed over.
    pub async fn next(&mut self) -> Option<(InstructorId, Answer)> {
        loop {
            let sample = self.heard.recv_async().await.ok()?;
            match (self.keys.parse(sample.key_expr()), decode_json(&sample.payload().to_bytes())) {
                (Some(Topic::Answer(to)), Ok(answer)) => return Some((to, answer)),
                (_, Err(error)) => tracing::warn!("{}: {error}", sample.key_expr()),
                (_, Ok(_)) => {}
            }
        }
    }
}
