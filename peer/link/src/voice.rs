//! What a robot says to the swarm, none of which waits for a slow link: what finds no room is dropped, and repaired.
//!
//! Votes and decisions go out at once, at priorities at which nobody sends what must not be lost: a link that takes
//! nothing costs a millisecond, and only once. All else goes by way of the [`Outbox`].

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{
    Announcement, Answer, Envelope, InstructorId, Keys, Message, Question, RobotId, RoundId, Signature, Topic,
};
use gestalt_strategies::Mind;
use serde::Serialize;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

use crate::account::Account;
use crate::inbox::Inbox;
use crate::outbox::{Outbox, Parcel};
use crate::presence::Presence;
use crate::words::Vouched;

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
    swarm: Publisher<'static>,
    last: Arc<Last>,
    /// What is still to be published on `robot/<me>/decision`.
    unsaid: Option<Envelope>,
    /// When that is due, and what clients are answered who ask for the last decision.
    due: Option<Instant>,
    /// The round of what is held, and when that was said last.
    said: Option<(u32, Instant)>,
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
        let swarm = session
            .declare_publisher(keys.key(&Topic::Decision))
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .await?;
        let last = Arc::new(Last::default());
        let (of_query, of_inbox, key) = (last.clone(), inbox.clone(), keys.key(&Topic::Decision));
        session
            .declare_queryable(key.clone())
            .callback(move |query| of_query.on_query(&query, &key, &of_inbox))
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
            swarm,
            last,
            unsaid: None,
            due: None,
            said: None,
        })
    }

    /// Says something to all; what it holds when that is due.
    pub fn broadcast(&mut self, envelope: &Envelope) {
        match envelope.message {
            Message::Samples(_) => {
                let (key, bytes) = (self.keys.key(&Topic::Sample(self.me)), envelope.encode());
                self.outbox.send(Parcel { kind: "sample", key, bytes, attachment: None, express: false });
            }
            Message::Holding(_) => {
                self.unsaid = Some(envelope.clone());
                // What it says anew of the decision that it holds already is due at once.
                self.due.get_or_insert_with(Instant::now);
            }
            _ => self.inbox.said(envelope.stamp, &self.presence.vote(envelope)),
        }
    }

    /// Says something to one neighbour.
    pub fn tell(&self, neighbour: RobotId, envelope: &Envelope) {
        let kind = match &envelope.message {
            Message::Have(_) | Message::Know(_) => "have",
            Message::Vote(_)
            | Message::Give(_)
            | Message::Samples(_)
            | Message::Batches(_)
            | Message::Lessons(_)
            | Message::Namings(_)
            | Message::Holding(_)
            | Message::Announced(_)
            | Message::Asked(_) => "give",
        };
        let (key, bytes) = (self.keys.key(&Topic::Repair(neighbour)), envelope.encode());
        // To who is no member any more nothing is said.
        let Ok(tag) = self.inbox.tag(neighbour, &bytes).transpose() else { return };
        let attachment = tag.map(|tag| tag.to_vec());
        self.outbox.send(Parcel { kind, key, bytes, attachment, express: true });
    }

    /// Answers an instructor.
    pub fn answer(&self, instructor: &InstructorId, answer: &Answer) {
        let json = as_json(answer);
        let signature = self.inbox.sign_answer(instructor, json.as_bytes());
        self.account.sent("answer", json.len() + signature.map_or(0, |_| Signature::LENGTH));
        let put = self
            .session
            .put(self.keys.key(&Topic::Answer(instructor.clone())), json)
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop);
        let put = match signature {
            Some(signature) => put.attachment(signature.as_bytes()).wait(),
            None => put.wait(),
        };
        self.account.check(put);
    }

    /// Asks whoever instructs the swarm.
    pub fn ask(&self, question: &Question) {
        let json = as_json(question);
        self.account.sent("question", json.len());
        let put = self
            .session
            .put(self.keys.key(&Topic::Question), json)
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
            self.outbox.send(Parcel { kind: "evidence", key, bytes, attachment: None, express: true });
        }
    }

    /// Says to all what those on this robot's own computer said, signed by it.
    pub fn pass_on(&self) {
        for Vouched { key, word, attachment, .. } in self.inbox.unsaid() {
            self.account.sent("word", word.len() + attachment.len());
            let put = self
                .session
                .put(key, word)
                .encoding(Encoding::APPLICATION_JSON)
                .attachment(attachment)
                .priority(Priority::InteractiveHigh)
                .congestion_control(CongestionControl::Drop)
                .express(true)
                .wait();
            self.account.check(put);
        }
    }

    /// Announces a decision for the swarm.
    pub fn announce(&self, announcement: &Announcement) {
        let json = as_json(announcement);
        self.account.sent("decision", json.len());
        self.account.check(self.swarm.put(json).wait());
    }

    /// Notes that the robot holds another decision of that round now; that is said when it is due. Robots that are just settling
    /// among each other would otherwise each say every step of it to all.
    pub fn hold(&mut self, round: RoundId) {
        let before = self.said.filter(|(said, _)| *said == round.counter);
        self.due = Some(before.map_or_else(Instant::now, |(_, at)| at + HOLD_INTERVAL));
        self.said = Some((round.counter, before.map_or_else(Instant::now, |(_, at)| at)));
    }

    /// When [`publish_hold`](Self::publish_hold) is to be called.
    pub fn due(&self) -> Option<Instant> {
        self.due
    }

    /// Says which decision the robot holds, when it is due.
    pub fn publish_hold(&mut self, mind: &mut Mind) {
        if self.due.take_if(|due| Instant::now() >= *due).is_none() {
            return;
        }
        if let Some(word) = self.unsaid.take() {
            self.presence.hold(&word);
        }
        if let Some((_, at)) = &mut self.said {
            *at = Instant::now();
        }
        if let Some(announcement) = mind.held_aloud() {
            self.last.set(announcement, self.session.new_timestamp());
        }
    }
}

fn as_json(said: &impl Serialize) -> String {
    serde_json::to_string(said)
        .expect("what is said, with string keys and finite numbers, has a place in JSON")
}

/// The decision this robot holds, for the queryable on `decision`: signed and written when it is asked for.
#[derive(Default)]
struct Last(Mutex<Option<(Announcement, Timestamp)>>);

impl Last {
    fn set(&self, announcement: Announcement, at: Timestamp) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((announcement, at));
    }

    /// Answers under the decision's own key, whatever was asked for: of several answers under one key Zenoh keeps the latest.
    fn on_query(&self, query: &Query, key: &str, inbox: &Inbox) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((mut announcement, at)) = last {
            if inbox.is_sealed() {
                let statement = Envelope::from(announcement.clone()).statement();
                announcement.signature = inbox.sign_statement(&statement);
            }
            let json = as_json(&announcement);
            // A client that has gone meanwhile is no error of this robot's.
            let _ = query.reply(key, json).encoding(Encoding::APPLICATION_JSON).timestamp(Some(at)).wait();
        }
    }
}
