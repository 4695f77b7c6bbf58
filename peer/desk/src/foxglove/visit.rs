//! One client: what it asks for, and what it is sent.

use std::collections::HashMap;
use std::error::Error as _;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use gestalt_protocol::RoundId;
use serde_json::json;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::channel::advertise;
use super::graph::{Graph, Picture, Problems, news};
use super::hub::{Dismissal, Hub, Out, Seat};
use super::say::{self, ENCODING, SERVICE};
use super::wire::{Call, Level, Malformed, Request, message_data, status, text, unadvertise};
use crate::asks::{Asks, MAX_WORD};
use crate::known::Known;

/// How many answers to a client may wait until it is not listened to meanwhile.
const MAX_ANSWERS: usize = 64;

/// How many calls of a client may wait for the swarm.
const MAX_CALLS: usize = 8;

/// How long a client may take to hear why it is closed.
const GOODBYE: Duration = Duration::from_millis(300);

/// What all clients have to do with.
#[derive(Clone, Debug)]
pub(super) struct Host {
    pub hub: Arc<Hub>,
    pub pictures: watch::Receiver<Arc<Picture>>,
    pub known: Arc<Known>,
    pub asks: Asks,
    /// What the server says of itself.
    pub info: Arc<Info>,
    pub patience: Duration,
}

/// What the server says of itself.
#[derive(Debug)]
pub(super) struct Info {
    pub swarm: String,
    /// Another for each start: a client that comes back learns whether it is the same server.
    pub session: String,
    /// The name of the service.
    pub service: String,
}

/// What is to be sent in answer to what a client says.
#[derive(Debug)]
enum Answer {
    Send(Message),
    /// It wants the connection graph, or no more of it.
    Graph(bool),
}

/// Why a visit is over.
#[derive(Debug, PartialEq, Eq)]
enum End {
    /// The client has left.
    Left,
    /// It said what no WebSocket says, or too much at once.
    Broken(String),
    /// It gave no sign of life, or took nothing, for too long.
    Silent,
    /// It was sent away.
    Dismissed(Dismissal),
}

impl End {
    /// A connection that broke is no fault of what came through it.
    fn of(error: &axum::Error) -> Self {
        let (mut cause, words) = (error.source(), error.to_string());
        let mut has_left = words.contains("reset without closing");
        while let Some(it) = cause {
            has_left |= it.is::<std::io::Error>();
            cause = it.source();
        }
        if has_left { Self::Left } else { Self::Broken(words) }
    }
}

impl Info {
    fn message(&self) -> Message {
        text(&json!({
            "op": "serverInfo",
            "name": format!("Gestalt swarm {}", self.swarm),
            "capabilities": ["services", "connectionGraph"],
            "supportedEncodings": [ENCODING],
            "metadata": {"swarm": self.swarm, "gestalt": env!("CARGO_PKG_VERSION")},
            "sessionId": self.session,
        }))
    }
}

impl Host {
    /// Serves a client until it leaves, or is sent away.
    pub async fn receive(self, socket: WebSocket) {
        let (mut to, from) = socket.split();
        let Some((seat, dismissed)) = self.hub.join() else { return };
        let (id, (answers, answered)) = (seat.id, mpsc::channel(MAX_ANSWERS));
        let listener = Listener { host: &self, id, answers, calls: JoinSet::new(), said: None };
        let end = tokio::select! {
            // An error says that the hub is gone.
            why = dismissed => End::Dismissed(why.unwrap_or(Dismissal::Closing)),
            end = listener.listen(from) => end,
            end = self.speak(seat, answered, &mut to) => end,
        };
        let dropped = matches!(end, End::Silent | End::Dismissed(Dismissal::Slow));
        self.hub.leave(id, dropped);
        if dropped {
            tracing::warn!("Foxglove: a client was dropped that took nothing of what it asked for");
        } else {
            tracing::debug!("Foxglove: a client has gone: {end:?}");
        }
        let (code, reason) = match end {
            End::Left => return,
            End::Broken(why) => {
                self.hub.refuse();
                (close_code::POLICY, why.chars().take(100).collect())
            }
            End::Silent => (close_code::POLICY, "gave no sign of life".to_owned()),
            End::Dismissed(Dismissal::Slow) => (close_code::AGAIN, "too slow: come again".to_owned()),
            End::Dismissed(Dismissal::Closing) => (close_code::AWAY, "the server closes".to_owned()),
        };
        let frame = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
        // Whoever takes nothing does not take this either.
        let _ = timeout(GOODBYE, to.send(frame)).await;
    }

    /// Sends what there is. A client that takes nothing gives no sign of life either, which the listener sees.
    async fn speak(
        &self,
        mut seat: Seat,
        mut answers: mpsc::Receiver<Answer>,
        to: &mut SplitSink<WebSocket, Message>,
    ) -> End {
        let mut told = Told { graph: None, problems: Problems::new() };
        let mut pictures = self.pictures.clone();
        let mut alive = interval(self.patience / 3);
        alive.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut messages = vec![self.info.message()];
        messages.extend(advertise(&std::mem::take(&mut seat.channels)));
        messages.push(say::advertise(&self.info.service));
        messages.extend(told.of(&pictures.borrow_and_update()));
        loop {
            for message in messages.drain(..) {
                if to.send(message).await.is_err() {
                    return End::Left;
                }
            }
            tokio::select! {
                out = seat.next() => match out {
                    Some(Out::Data { subscription, at, data }) => {
                        messages.push(message_data(subscription, at, &data));
                    }
                    Some(Out::Advertise(channel)) => messages.extend(advertise(&[channel])),
                    Some(Out::Unadvertise(channel)) => messages.push(unadvertise(channel)),
                    // Why it was sent away is on its way.
                    None => std::future::pending().await,
                },
                answer = answers.recv() => match answer {
                    Some(Answer::Send(message)) => messages.push(message),
                    Some(Answer::Graph(true)) => messages.extend(told.begin(&pictures.borrow())),
                    Some(Answer::Graph(false)) => told.graph = None,
                    None => return End::Left,
                },
                changed = pictures.changed() => match changed {
                    Ok(()) => messages.extend(told.of(&pictures.borrow_and_update())),
                    Err(_) => return End::Dismissed(Dismissal::Closing),
                },
                _ = alive.tick() => messages.push(Message::Ping(Default::default())),
            }
        }
    }
}

/// What a client was told of the swarm's state.
struct Told {
    /// `None`: it does not want it.
    graph: Option<Graph>,
    problems: Problems,
}

impl Told {
    /// What has changed.
    fn of(&mut self, picture: &Picture) -> Vec<Message> {
        let mut messages = news(&picture.problems, &self.problems);
        self.problems = picture.problems.clone();
        if let Some(graph) = &mut self.graph {
            messages.extend(picture.graph.since(graph));
            *graph = picture.graph.clone();
        }
        messages
    }

    /// It wants the graph; who has it already is told nothing new.
    fn begin(&mut self, picture: &Picture) -> Option<Message> {
        if self.graph.is_some() {
            return None;
        }
        self.graph = Some(picture.graph.clone());
        Some(picture.graph.whole())
    }
}

/// Hears a client out.
struct Listener<'h> {
    host: &'h Host,
    id: u64,
    answers: mpsc::Sender<Answer>,
    calls: JoinSet<()>,
    /// The round of which the client said something last.
    said: Option<RoundId>,
}

impl Listener<'_> {
    async fn listen(mut self, mut from: SplitStream<WebSocket>) -> End {
        let patience = self.host.patience;
        loop {
            let heard = match timeout(patience, from.next()).await {
                Ok(Some(Ok(heard))) => heard,
                Ok(Some(Err(error))) => return End::of(&error),
                Ok(None) => return End::Left,
                Err(_) => return End::Silent,
            };
            let request = match heard {
                Message::Text(text) => Request::of_text(&text),
                Message::Binary(bytes) => Request::of_bytes(&bytes),
                Message::Ping(_) | Message::Pong(_) => continue,
                Message::Close(_) => return End::Left,
            };
            let answered = timeout(patience, self.answer(request)).await;
            if !answered.unwrap_or(false) {
                return End::Silent;
            }
        }
    }

    /// Does what is asked; `false` when its answers go nowhere any more.
    async fn answer(&mut self, request: Result<Request, Malformed>) -> bool {
        let (hub, id) = (self.host.hub.clone(), self.id);
        let refused = |why: String| {
            hub.refuse();
            why
        };
        let wrong: Vec<String> = match request {
            Ok(Request::Subscribe(all)) => all
                .into_iter()
                .filter_map(|one| hub.subscribe(id, one).err())
                .map(|it| refused(it.to_string()))
                .collect(),
            Ok(Request::Unsubscribe(all)) => all
                .into_iter()
                .filter_map(|one| hub.unsubscribe(id, one).err())
                .map(|it| refused(it.to_string()))
                .collect(),
            Ok(Request::Graph(wanted)) => return self.answers.send(Answer::Graph(wanted)).await.is_ok(),
            Ok(Request::Call(call)) => return self.call(call).await,
            Err(error) => vec![refused(error.to_string())],
        };
        // A list of a thousand mistakes is one mistake.
        let mut counted: HashMap<String, usize> = HashMap::new();
        for why in wrong.iter().take(MAX_ANSWERS / 2) {
            *counted.entry(why.clone()).or_default() += 1;
        }
        for why in counted.keys() {
            if self.answers.send(Answer::Send(status(Level::Error, why, None))).await.is_err() {
                return false;
            }
        }
        if wrong.len() > MAX_ANSWERS / 2 {
            let more = format!("and {} more mistakes in the same message", wrong.len() - MAX_ANSWERS / 2);
            return self.answers.send(Answer::Send(status(Level::Warning, &more, None))).await.is_ok();
        }
        true
    }

    /// Says it to the swarm; the client is listened to meanwhile.
    async fn call(&mut self, call: Call) -> bool {
        while self.calls.try_join_next().is_some() {}
        let told = if call.service != SERVICE {
            Err(format!("there is no service {}", call.service))
        } else if call.encoding != ENCODING {
            Err(format!(
                "the encoding '{}' is not spoken here: use {ENCODING}",
                call.encoding.chars().take(40).collect::<String>()
            ))
        } else if call.payload.len() > MAX_WORD {
            Err(format!("{} bytes are too long for a word: {MAX_WORD} fit", call.payload.len()))
        } else if self.calls.len() >= MAX_CALLS {
            Err("too much is being said at a time: wait for an answer".to_owned())
        } else {
            let last = self
                .host
                .known
                .with(|view, _| view.latest().map(|latest| (latest.decision.round, latest.decision.class)));
            say::instruction(&call.payload, last, self.said)
        };
        let instruction = match told {
            Ok(instruction) => instruction,
            Err(why) => {
                self.host.hub.refuse();
                return self.answers.send(Answer::Send(call.failure(&why))).await.is_ok();
            }
        };
        self.said = instruction.round().or(self.said);
        let (asks, answers) = (self.host.asks.clone(), self.answers.clone());
        self.calls.spawn(async move {
            let message = match asks.say(instruction).await {
                Ok(said) => call.response(said.to_string().as_bytes()),
                Err(unsaid) => call.failure(&unsaid.to_string()),
            };
            // An error says that the client has gone.
            let _ = answers.send(Answer::Send(message)).await;
        });
        true
    }
}
