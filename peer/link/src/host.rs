//! The one task that owns a robot's mind: what arrives goes in, what comes out is carried out.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{Answer, Decision, Envelope, InstructorId, Keys, Message, RobotId, Topic};
use gestalt_strategies::mind::Mind;
use gestalt_strategies::{Classify, Input, Output, Vocabulary};
use tokio::sync::{broadcast, mpsc};
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::sample::Locality;
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

use super::account::Account;
use super::apprentice::Apprentice;
use super::census::take_census;
use super::guest::Guests;
use super::inbox::Inbox;
use super::keeper::Keeper;
use super::presence::Presence;
use super::session::Node;
use super::{Announcement, Event, LinkError};

/// A robot that draws another decision of the same round within this time says so only once.
const OWN_HOLD_INTERVAL: Duration = Duration::from_millis(50);

/// How long a robot holds another's decision before it says so: all have heard it from its author.
const ADOPTED_HOLD_DELAY: Duration = Duration::from_millis(300);

/// Everything the task needs; [`Host::declare`] makes it known to the swarm.
pub(super) struct Host {
    pub(super) me: RobotId,
    pub(super) mind: Mind,
    pub(super) started: Instant,
    pub(super) node: Node,
    pub(super) keys: Keys,
    pub(super) inbox: Arc<Inbox>,
    pub(super) account: Arc<Account>,
    pub(super) commands: mpsc::Receiver<Input>,
    pub(super) guests: Arc<Guests>,
    pub(super) events: broadcast::Sender<Event>,
    pub(super) vocabulary: Option<Vocabulary>,
    pub(super) apprentice: Option<Apprentice>,
    /// For the program around the robot to look at.
    pub(super) classifier: Arc<Mutex<Option<Arc<dyn Classify>>>>,
}

/// A host with its keys declared.
pub(super) struct Declared {
    host: Host,
    presence: Presence,
    sample: Publisher<'static>,
    held: Publisher<'static>,
    swarm: Publisher<'static>,
    last: Arc<Last>,
    /// The decision still to be published on `robot/<me>/decision`, and when.
    unsaid: Option<(Announcement, Instant)>,
    /// The round of the decision published last, and when.
    said: Option<(u32, Instant)>,
}

/// The decision this robot holds, as the queryable on `decision` gives it.
#[derive(Default)]
struct Last(Mutex<Option<(String, Option<Timestamp>)>>);

impl Host {
    pub(super) async fn declare(self) -> Result<Declared, LinkError> {
        let last = Arc::new(Last::default());
        // Not of `self`: a mind is not to be shared between threads, and this future may move between them.
        let (session, keys) = (self.node.session().clone(), self.keys.clone());
        listen(&session, &keys, self.me, &self.inbox.clone(), &last)
            .await
            .map_err(|error| LinkError::open(&*error))?;
        self.announce_itself(last).await.map_err(|error| LinkError::open(&*error))
    }

    async fn announce_itself(self, last: Arc<Last>) -> zenoh::Result<Declared> {
        let session = self.node.session();
        let sample = session
            .declare_publisher(self.keys.key(&Topic::Sample(self.me)))
            .priority(Priority::Data)
            .congestion_control(CongestionControl::Block)
            .await?;
        let decision = |topic| {
            session
                .declare_publisher(self.keys.key(&topic))
                .encoding(Encoding::APPLICATION_JSON)
                .priority(Priority::InteractiveHigh)
                .congestion_control(CongestionControl::Block)
                .express(true)
        };
        let held = decision(Topic::RobotDecision(self.me)).await?;
        let swarm = decision(Topic::Decision).await?;
        let (account, lost_links) = (self.account.clone(), self.inbox.lost_links());
        let presence = Presence::declare(session, &self.keys, self.me, account, lost_links).await?;
        Ok(Declared { host: self, presence, sample, held, swarm, last, unsaid: None, said: None })
    }
}

/// Takes in everything that concerns a robot.
async fn listen(
    session: &Session,
    keys: &Keys,
    me: RobotId,
    inbox: &Arc<Inbox>,
    last: &Arc<Last>,
) -> zenoh::Result<()> {
    let of_interest = [
        keys.every_robot("vote"),
        keys.every_robot("sample"),
        keys.key(&Topic::Repair(me)),
        keys.every_robot("decision"),
        keys.key(&Topic::Decision),
        keys.every_instructor("feedback"),
        keys.every_instructor("answer"),
    ];
    for key in of_interest {
        let inbox = inbox.clone();
        session
            .declare_subscriber(key)
            .allowed_origin(Locality::Remote)
            .callback(move |sample| inbox.on_sample(&sample))
            .background()
            .await?;
    }
    let inbox = inbox.clone();
    session
        .liveliness()
        .declare_subscriber(keys.every_robot("alive"))
        .history(true)
        .callback(move |sample| inbox.on_liveliness(&sample))
        .background()
        .await?;
    let last = last.clone();
    session
        .declare_queryable(keys.key(&Topic::Decision))
        .callback(move |query| last.on_query(&query))
        .background()
        .await?;
    Ok(())
}

impl Declared {
    /// Serves the mind until the robot's handle is gone, then leaves the swarm.
    pub(super) async fn run(mut self, keeper: Option<Keeper>) {
        let keeper = keeper.map(|keeper| tokio::spawn(keeper.run()));
        let census = tokio::spawn(take_census(
            self.host.node.clone(),
            self.host.keys.clone(),
            self.host.inbox.clone(),
        ));
        let (inbox, guests) = (self.host.inbox.clone(), self.host.guests.clone());
        loop {
            let wake = self.host.mind.next_wake().map(|wake| self.host.started + wake);
            let wake = wake.into_iter().chain(self.unsaid.as_ref().map(|(_, due)| *due)).min();
            tokio::select! {
                () = inbox.ready() => {
                    for input in inbox.take() {
                        self.step(input);
                    }
                }
                command = self.host.commands.recv() => match command {
                    Some(input) => self.step(input),
                    None => break,
                },
                () = guests.changed() => self.step(Input::Guests(guests.present())),
                () = sleep_until(wake) => self.step(Input::Tick),
            }
        }
        census.abort();
        if let Some(keeper) = keeper {
            keeper.abort();
        }
        drop(self.presence);
        // What is still to be written is written before the robot is gone.
        tokio::task::block_in_place(|| drop(self.host.apprentice.take()));
        self.host.node.close().await;
    }

    fn step(&mut self, input: Input) {
        match &input {
            Input::Alive(alive) => {
                self.tell_alive(alive | &self.host.guests.present());
            }
            Input::Guests(guests) => {
                let tokens = self.host.inbox.tokens();
                self.tell_alive(&tokens | guests);
            }
            Input::Neighbours(neighbours) => {
                self.host.account.lock().neighbours = neighbours.iter().copied().collect();
                self.tell(Event::Neighbours(neighbours.clone()));
            }
            Input::Announced(decision) => self.tell(Event::Announced(self.announcement(decision))),
            Input::Learned(classifier) => {
                self.host.vocabulary = Some(classifier.vocabulary().clone());
                *self.host.classifier.lock().unwrap_or_else(PoisonError::into_inner) =
                    Some(classifier.clone());
            }
            Input::Remembered(revision) => self.tell(Event::Remembered(*revision)),
            _ => {}
        }
        let now = self.host.started.elapsed();
        for output in self.host.mind.handle(now, input) {
            self.carry_out(output);
        }
        self.publish_hold();
        self.report_learning();
        for (refusal, count) in self.host.mind.refusals().iter() {
            if count > 0 {
                self.host.account.set(refusal.name(), count);
            }
        }
    }

    fn tell_alive(&self, mut alive: BTreeSet<RobotId>) {
        alive.remove(&self.host.me);
        self.host.account.lock().alive = alive.iter().copied().chain([self.host.me]).collect();
        self.tell(Event::Alive(alive));
    }

    /// Puts what was learned into the status, when it has changed.
    fn report_learning(&mut self) {
        if let Some(apprentice) = &mut self.host.apprentice
            && apprentice.has_news(&self.host.mind)
        {
            let learning = apprentice.status(&self.host.mind);
            self.host.account.lock().learning = learning;
        }
    }

    fn carry_out(&mut self, output: Output) {
        match output {
            Output::Broadcast(envelope) => self.broadcast(&envelope),
            Output::Tell(neighbour, envelope) => self.repair(neighbour, &envelope),
            Output::Hold(decision) => {
                let mut status = self.host.account.lock();
                status.round = status.round.max(Some(decision.round));
                drop(status);
                self.unsaid = Some((self.announcement(&decision), self.hold_due(&decision)));
                self.tell(Event::Held(decision));
            }
            Output::Announce(decision) => {
                let announcement = self.announcement(&decision);
                self.publish("decision", &self.swarm, &announcement);
                self.tell(Event::Announced(announcement));
            }
            Output::Opened(round) => {
                let mut status = self.host.account.lock();
                (status.round, status.open) = (Some(round), true);
                drop(status);
                self.tell(Event::Opened(round));
            }
            Output::Closed(round) => {
                // Under the name it ended with: it may have merged with one of a smaller opener meanwhile.
                let mut status = self.host.account.lock();
                (status.round, status.open) = (Some(round), false);
                drop(status);
                self.tell(Event::Closed(round));
            }
            Output::Answer(instructor, answer) => self.answer(instructor, answer),
            Output::Train(changes) => {
                if let Some(apprentice) = &self.host.apprentice {
                    apprentice.train(changes);
                }
            }
            Output::Remember { revision, changes } => {
                if let Some(apprentice) = &self.host.apprentice {
                    apprentice.remember(revision, changes);
                }
            }
        }
    }

    fn broadcast(&self, envelope: &Envelope) {
        if let Message::Samples(samples) = &envelope.message {
            let bytes = envelope.encode();
            self.host.account.sent("sample", bytes.len());
            self.host.account.check(self.sample.put(bytes).wait());
            return self.tell(Event::Shared(samples.samples.iter().map(|sample| sample.id).collect()));
        }
        let bytes = self.presence.vote(envelope);
        self.host.inbox.said(&bytes);
    }

    fn answer(&self, instructor: InstructorId, answer: Answer) {
        let json = serde_json::to_string(&answer).expect("an answer has a place in JSON");
        self.host.account.sent("answer", json.len());
        let put = self
            .host
            .node
            .session()
            .put(self.host.keys.key(&Topic::Answer(instructor.clone())), json)
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Block)
            .wait();
        self.host.account.check(put);
        self.tell(Event::Answered(instructor, answer));
    }

    /// When a decision now held is to be published. Robots that are just settling among each other would otherwise
    /// each say every step of it to all.
    fn hold_due(&self, decision: &Decision) -> Instant {
        let now = Instant::now();
        if decision.author != self.host.me {
            return now + ADOPTED_HOLD_DELAY;
        }
        let before = self.said.filter(|(round, _)| *round == decision.round.counter);
        before.map_or(now, |(_, at)| at + OWN_HOLD_INTERVAL)
    }

    fn publish_hold(&mut self) {
        if let Some((announcement, _)) = self.unsaid.take_if(|(_, due)| Instant::now() >= *due) {
            let json = self.publish("robot_decision", &self.held, &announcement);
            self.last.set(json, self.host.node.session().new_timestamp());
            self.said = Some((announcement.decision.round.counter, Instant::now()));
        }
    }

    fn repair(&self, neighbour: RobotId, envelope: &Envelope) {
        let bytes = envelope.encode();
        let kind = match &envelope.message {
            Message::Have(_) | Message::Know(_) => "have",
            Message::Vote(_) | Message::Give(_) | Message::Samples(_) | Message::Lessons(_) => "give",
        };
        self.host.account.sent(kind, bytes.len());
        let key = self.host.keys.key(&Topic::Repair(neighbour));
        let put = self
            .host
            .node
            .session()
            .put(key, bytes)
            .priority(Priority::Data)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait();
        self.host.account.check(put);
    }

    fn publish(&self, kind: &str, publisher: &Publisher<'_>, announcement: &Announcement) -> String {
        let json = serde_json::to_string(announcement)
            .expect("every field of a decision, with string keys and finite numbers, has a place in JSON");
        self.host.account.sent(kind, json.len());
        self.host.account.check(publisher.put(json.as_str()).wait());
        json
    }

    fn announcement(&self, decision: &Decision) -> Announcement {
        let vocabulary = self.host.vocabulary.as_ref().filter(|v| v.id() == decision.certificate.vocabulary);
        let label = decision.class.and_then(|class| vocabulary?.label(class)).map(str::to_owned);
        Announcement { decision: decision.clone(), label }
    }

    fn tell(&self, event: Event) {
        // An error says that nobody listens, which is fine.
        let _ = self.host.events.send(event);
    }
}

pub(super) async fn sleep_until(wake: Option<Instant>) {
    match wake {
        Some(wake) => tokio::time::sleep_until(wake.into()).await,
        None => std::future::pending().await,
    }
}

impl Last {
    fn set(&self, json: String, at: Timestamp) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((json, Some(at)));
    }

    fn on_query(&self, query: &Query) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((json, at)) = last {
            let key = query.key_expr().clone();
            // A client that has gone meanwhile is no error of this robot's.
            let _ = query.reply(key, json).encoding(Encoding::APPLICATION_JSON).timestamp(at).wait();
        }
    }
}
