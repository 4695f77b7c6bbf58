//! What a robot says to the swarm, none of which waits for a slow link: what finds no room is dropped, and repaired.
//!
//! Votes and decisions go out at once, at priorities at which nobody sends what must not be lost: a link that takes
//! nothing costs a millisecond, and only once. All else goes by way of the [`Outbox`].

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{Answer, ClassId, Envelope, Holding, InstructorId, Keys, Message, RobotId, Topic};
use serde::Serialize;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

use crate::account::Account;
use crate::announcement::Announcement;
use crate::inbox::Inbox;
use crate::outbox::{Outbox, Parcel};
use crate::presence::Presence;

/// A robot that comes to hold another decision of the same round within this time says so only once.
const HOLD_INTERVAL: Duration = Duration::from_millis(50);

/// What a robot says.
pub(crate) struct Voice {
    me: RobotId,
    session: Session,
    keys: Keys,
    account: Arc<Account>,
    inbox: Arc<Inbox>,
    outbox: Outbox,
    presence: Presence,
    held: Publisher<'static>,
    swarm: Publisher<'static>,
    last: Arc<Last>,
    /// What is still to be published on `robot/<me>/decision`, and when.
    unsaid: Option<(Announcement, Holding, Instant)>,
    /// The round and the gesture of what was said last, and when.
    said: Option<(u32, Option<ClassId>, Instant)>,
}

impl Voice {
    pub async fn declare(
        me: RobotId,
        session: &Session,
        keys: &Keys,
        inbox: Arc<Inbox>,
        outbox: Outbox,
        presence: Presence,
        account: Arc<Account>,
    ) -> zenoh::Result<Self> {
        let decision = |topic| {
            session
                .declare_publisher(keys.key(&topic))
                .encoding(Encoding::APPLICATION_JSON)
                .priority(Priority::InteractiveHigh)
                .congestion_control(CongestionControl::Drop)
                .express(true)
        };
        let held = decision(Topic::RobotDecision(me)).await?;
        let swarm = decision(Topic::Decision).await?;
        let last = Arc::new(Last::default());
        let of_query = last.clone();
        session
            .declare_queryable(keys.key(&Topic::Decision))
            .callback(move |query| of_query.on_query(&query))
            .background()
            .await?;
        let (session, keys) = (session.clone(), keys.clone());
        Ok(Self {
            me,
            session,
            keys,
            account,
            inbox,
            outbox,
            presence,
            held,
            swarm,
            last,
            unsaid: None,
            said: None,
        })
    }

    /// Says something to all.
    pub fn broadcast(&self, envelope: &Envelope) {
        if matches!(envelope.message, Message::Samples(_)) {
            let key = self.keys.key(&Topic::Sample(self.me));
            return self.outbox.send(Parcel {
                kind: "sample",
                key,
                bytes: envelope.encode(),
                express: false,
            });
        }
        let bytes = self.presence.vote(envelope);
        self.inbox.said(&bytes);
    }

    /// Says something to one neighbour.
    pub fn tell(&self, neighbour: RobotId, envelope: &Envelope) {
        let kind = match &envelope.message {
            Message::Have(_) | Message::Know(_) => "have",
            Message::Vote(_)
            | Message::Give(_)
            | Message::Samples(_)
            | Message::Batches(_)
            | Message::Lessons(_) => "give",
        };
        let key = self.keys.key(&Topic::Repair(neighbour));
        self.outbox.send(Parcel { kind, key, bytes: envelope.encode(), express: true });
    }

    /// Answers an instructor.
    pub fn answer(&self, instructor: &InstructorId, answer: &Answer) {
        let json = as_json(answer);
        self.account.sent("answer", json.len());
        let put = self
            .session
            .put(self.keys.key(&Topic::Answer(instructor.clone())), json)
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .wait();
        self.account.check(put);
    }

    /// Tells all of who was found to lie.
    pub fn accuse(&self) {
        for evidence in self.inbox.untold() {
            let (key, bytes) = (self.keys.key(&Topic::Evidence), evidence.encode());
            self.outbox.send(Parcel { kind: "evidence", key, bytes, express: true });
        }
    }

    /// Announces a decision for the swarm.
    pub fn announce(&self, announcement: &Announcement) {
        self.publish("decision", &self.swarm, announcement);
    }

    /// Notes the decision that the robot and its guests hold now; that is said when it is due. Robots that are just settling
    /// among each other would otherwise each say every step of it to all.
    pub fn hold(&mut self, announcement: Announcement, holding: Holding) {
        let round = announcement.decision.round.counter;
        let before = self.said.filter(|(said, ..)| *said == round);
        let due = before.map_or_else(Instant::now, |(.., at)| at + HOLD_INTERVAL);
        self.unsaid = Some((announcement, holding, due));
    }

    /// When [`publish_hold`](Self::publish_hold) is to be called.
    pub fn due(&self) -> Option<Instant> {
        self.unsaid.as_ref().map(|(_, _, due)| *due)
    }

    /// Says which decision the robot holds, when it is due.
    pub fn publish_hold(&mut self) {
        if let Some((announcement, holding, _)) = self.unsaid.take_if(|(_, _, due)| Instant::now() >= *due) {
            let (round, class) = (announcement.decision.round.counter, announcement.decision.class);
            // A greater decision for the same gesture is news to nobody.
            if self.said.is_none_or(|(said, of, _)| (said, of) != (round, class)) {
                self.publish("robot_decision", &self.held, &holding);
            }
            self.last.set(announcement, self.session.new_timestamp());
            self.said = Some((round, class, Instant::now()));
        }
    }

    fn publish(&self, kind: &str, publisher: &Publisher<'_>, said: &impl Serialize) {
        let json = as_json(said);
        self.account.sent(kind, json.len());
        self.account.check(publisher.put(json).wait());
    }
}

fn as_json(said: &impl Serialize) -> String {
    serde_json::to_string(said)
        .expect("what is said, with string keys and finite numbers, has a place in JSON")
}

/// The decision this robot holds, for the queryable on `decision`: written when it is asked for.
#[derive(Default)]
struct Last(Mutex<Option<(Announcement, Timestamp)>>);

impl Last {
    fn set(&self, announcement: Announcement, at: Timestamp) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((announcement, at));
    }

    fn on_query(&self, query: &Query) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((announcement, at)) = last {
            let (key, json) = (query.key_expr().clone(), as_json(&announcement));
            // A client that has gone meanwhile is no error of this robot's.
            let _ = query.reply(key, json).encoding(Encoding::APPLICATION_JSON).timestamp(Some(at)).wait();
        }
    }
}
