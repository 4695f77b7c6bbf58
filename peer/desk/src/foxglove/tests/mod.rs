//! The server without a swarm, and real clients.

mod borne;
mod layout;
mod served;

use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use gestalt_protocol::{Instruction, RobotId};
use gestalt_tape::{Entry, Kind, Passing, Sink as _, schema};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

use super::*;
use crate::asks::Ask;
use crate::follow::Show;
use crate::view::Input;

const SOON: Duration = Duration::from_secs(10);

struct Stage {
    address: SocketAddr,
    hub: Arc<Hub>,
    easel: Arc<Easel>,
    known: Arc<Known>,
    asked: mpsc::Receiver<Ask>,
    keys: Keys,
}

/// Serves a swarm that is not there; with a token it behaves as one that can be reached from elsewhere.
async fn stage(token: Option<&str>, limits: Limits) -> Stage {
    let Viewing { door, mut origins, .. } = Viewing::at("0".parse().unwrap());
    let door = Door { limits, ..door };
    origins.push("http://localhost:8080".to_owned());
    let (listener, address, _) = door.listen("Foxglove").await.unwrap();
    let keys = Keys::new("gestalt").unwrap();
    let hub = Arc::new(Hub::new(keys.clone()));
    let easel = Arc::new(Easel::new(keys.clone(), service(&keys)));
    let known = Arc::new(Known::new());
    let (asks, asked) = Asks::new();
    let info = Info { swarm: "gestalt".to_owned(), session: "1".to_owned(), service: service(&keys) };
    let host = Host {
        hub: hub.clone(),
        pictures: easel.pictures(),
        known: known.clone(),
        asks,
        info: Arc::new(info),
        patience: limits.patience,
    };
    let token = token.map(|token| Token::new(token).unwrap());
    let guard = Guard::new(&door.address, address, token).for_viewers(origins);
    let server = Server { guard, host, places: Arc::new(Semaphore::new(limits.readers)) };
    let gate = Gate::new(listener, limits.connections, limits.patience);
    tokio::spawn(serve(gate, server, std::future::pending()));
    Stage { address, hub, easel, known, asked, keys }
}

/// A viewer.
struct Viewer(WebSocketStream<TcpStream>);

impl Stage {
    /// Asks to be let in with these headers; the status where it is not.
    async fn connect(&self, path: &str, headers: &[(&'static str, &str)]) -> Result<Viewer, u16> {
        let mut request = format!("ws://{}{path}", self.address).into_client_request().unwrap();
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().unwrap());
        }
        let stream = TcpStream::connect(self.address).await.unwrap();
        match timeout(SOON, client_async(request, stream)).await.expect("an answer") {
            Ok((socket, response)) => {
                assert_eq!(response.headers()["sec-websocket-protocol"], wire::SUBPROTOCOL);
                Ok(Viewer(socket))
            }
            Err(Error::Http(response)) => Err(response.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    async fn viewer(&self) -> Viewer {
        let mut viewer = self.connect("/", &[SPEAKS]).await.unwrap();
        for op in ["serverInfo", "advertise", "advertiseServices"] {
            assert_eq!(viewer.json().await["op"], op);
        }
        viewer
    }

    fn say(&self, entry: &Entry) -> bool {
        self.hub.write(entry, Duration::ZERO)
    }
}

const SPEAKS: (&str, &str) = ("sec-websocket-protocol", "foxglove.sdk.v1");

impl Viewer {
    /// The next message; pings are answered on the way.
    async fn next(&mut self) -> Option<Message> {
        loop {
            match timeout(SOON, self.0.next()).await.expect("a message")? {
                Ok(Message::Ping(_)) => {}
                Ok(message) => return Some(message),
                Err(_) => return None,
            }
        }
    }

    async fn json(&mut self) -> Value {
        match self.next().await {
            Some(Message::Text(text)) => serde_json::from_str(&text).unwrap(),
            other => panic!("{other:?} is no text"),
        }
    }

    async fn data(&mut self) -> (u32, u64, Vec<u8>) {
        match self.next().await {
            Some(Message::Binary(bytes)) if bytes[0] == 1 => (
                u32::from_le_bytes(bytes[1..5].try_into().unwrap()),
                u64::from_le_bytes(bytes[5..13].try_into().unwrap()),
                bytes[13..].to_vec(),
            ),
            other => panic!("{other:?} is no message data"),
        }
    }

    async fn send(&mut self, value: Value) {
        self.0.send(Message::text(value.to_string())).await.unwrap();
    }

    async fn subscribe(&mut self, id: u32, channel: u32) {
        self.send(json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]})).await;
    }

    /// Waits until everything that was sent before is done.
    async fn settle(&mut self) {
        self.send(json!({"op": "unsubscribe", "subscriptionIds": [4_000_000]})).await;
        while let Some(message) = self.next().await {
            if message.into_text().is_ok_and(|text| text.contains("4000000")) {
                return;
            }
        }
        panic!("closed");
    }

    async fn call(&mut self, service: u32, encoding: &str, payload: &[u8]) {
        let mut bytes = vec![2];
        for number in [service, 77, u32::try_from(encoding.len()).unwrap()] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([encoding.as_bytes(), payload].concat());
        self.0.send(Message::binary(bytes)).await.unwrap();
    }
}

fn decision(at: u64, data: &str) -> Entry {
    let channel = "/gestalt/gestalt/decision".to_owned();
    Entry { kind: Kind::Decision, channel, at, published: at, data: data.as_bytes().to_vec() }
}

/// The numbers of all channels that are advertised, by topic.
fn advertised(message: &Value) -> std::collections::BTreeMap<String, u32> {
    let channels = message["channels"].as_array().unwrap().iter();
    channels
        .map(|it| (it["topic"].as_str().unwrap().to_owned(), it["id"].as_u64().unwrap().try_into().unwrap()))
        .collect()
}
