//! The requests that the page answers.

use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::{Arc, Weak};

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, State};
use axum::http::header::{ACCEPT, CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_util::stream::unfold;
use gestalt_protocol::{Instruction, decode_json};
use serde_json::json;
use tokio::sync::Semaphore;

use super::files::{FILES, answer};
use crate::asks::{Asks, MAX_WORD, Unsaid};
use crate::board::{Board, IN_JSON};
use crate::door::{Door, Gate, Guard, Token, at_the_door, with_token};
use crate::known::Known;
use crate::metrics;

/// The swarm's session has ended.
const LOST: (StatusCode, &str) =
    (StatusCode::SERVICE_UNAVAILABLE, "The page has lost the swarm: start it again.\n");

/// What requests are answered from.
#[derive(Clone, Debug)]
pub(crate) struct Server {
    guard: Guard,
    /// Its readers' streams end when the one that writes it does.
    board: Weak<Board>,
    known: Arc<Known>,
    asks: Asks,
    readers: Arc<Semaphore>,
}

impl Server {
    pub fn new(
        door: &Door,
        listens: SocketAddr,
        token: Option<Token>,
        board: &Arc<Board>,
        known: Arc<Known>,
        asks: Asks,
    ) -> Self {
        let guard = Guard::new(&door.address, listens, token);
        let readers = Arc::new(Semaphore::new(door.limits.readers));
        Self { guard, board: Arc::downgrade(board), known, asks, readers }
    }
}

/// Answers requests until `ended`; the streams of events end with the board.
pub(crate) async fn serve(gate: Gate, server: Server, ended: impl Future<Output = ()> + Send + 'static) {
    let guarded = Router::new()
        .route("/events", get(events))
        .route("/say", post(say))
        .route("/decision.json", get(decision))
        .route("/metrics", get(measured))
        .layer(from_fn_with_state(server.guard.clone(), with_token));
    let open = FILES
        .into_iter()
        .fold(Router::new(), |router, file| router.route(file.0, get(move || async move { answer(file) })));
    let all = open
        .merge(guarded)
        .fallback(async || (StatusCode::NOT_FOUND, "There is no such page.\n"))
        .layer(DefaultBodyLimit::max(MAX_WORD))
        .layer(from_fn_with_state(server.guard.clone(), at_the_door))
        .with_state(server);
    if let Err(error) = axum::serve(gate, all).with_graceful_shutdown(ended).await {
        tracing::warn!("the page: {error}");
    }
}

/// What the page shows, now and whenever it changes.
async fn events(State(server): State<Server>) -> Response {
    let Ok(place) = server.readers.clone().try_acquire_owned() else {
        let words = "Too many pages are open: close one, and this one comes by itself.\n";
        return (StatusCode::SERVICE_UNAVAILABLE, [(CONNECTION, "close")], words).into_response();
    };
    let Some(board) = server.board.upgrade() else { return LOST.into_response() };
    let stream = unfold((board.reader(), place), async |(mut reader, place)| {
        let event = reader.next().await?;
        Some((Ok::<Bytes, Infallible>(event), (reader, place)))
    });
    let headers = [(CONTENT_TYPE, "text/event-stream"), (CACHE_CONTROL, "no-store")];
    (headers, Body::from_stream(stream)).into_response()
}

/// A word to the swarm, in the JSON that any client puts: `{"say": "open"}`.
async fn say(State(server): State<Server>, headers: HeaderMap, body: Bytes) -> Response {
    let fail = |status: StatusCode, words: &str| {
        (status, [(CONTENT_TYPE, "application/json")], json!({"error": words}).to_string()).into_response()
    };
    // A form of another site's page cannot send this type unasked.
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.split(';').next().map(str::trim) != Some("application/json") {
        return fail(StatusCode::UNSUPPORTED_MEDIA_TYPE, "send JSON, with `Content-Type: application/json`");
    }
    let instruction: Instruction = match decode_json(&body) {
        Ok(instruction) => instruction,
        Err(error) => return fail(StatusCode::BAD_REQUEST, &error.to_string()),
    };
    match server.asks.say(instruction).await {
        Ok(answer) => ([(CONTENT_TYPE, "application/json")], answer.to_string()).into_response(),
        Err(unsaid) => {
            let status = match &unsaid {
                Unsaid::TooMuch => StatusCode::TOO_MANY_REQUESTS,
                Unsaid::Lost => StatusCode::SERVICE_UNAVAILABLE,
                Unsaid::Unanswered => StatusCode::GATEWAY_TIMEOUT,
                Unsaid::Failed(_) => StatusCode::BAD_GATEWAY,
            };
            fail(status, &unsaid.to_string())
        }
    }
}

/// The latest decision with all its votes, as it was announced: what `gestalt verify` checks.
async fn decision(State(server): State<Server>) -> Response {
    // Serialised outside of the view's lock: it has all votes in it.
    let Some(announced) = server.known.with(|view, _| view.latest().cloned()) else {
        return (StatusCode::NOT_FOUND, "Nothing was decided yet.\n").into_response();
    };
    let headers = [
        (CONTENT_TYPE, "application/json"),
        (CONTENT_DISPOSITION, "attachment; filename=\"decision.json\""),
        (CACHE_CONTROL, "no-store"),
    ];
    (headers, serde_json::to_vec(&announced).expect(IN_JSON)).into_response()
}

async fn measured(State(server): State<Server>, headers: HeaderMap) -> Response {
    let accept = headers.get(ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or_default();
    let format = metrics::Format::accepted(accept);
    let Some(board) = server.board.upgrade() else { return LOST.into_response() };
    match server.known.with(|view, now| metrics::text(view, now, board.readers(), format)) {
        Ok(text) => ([(CONTENT_TYPE, format.content_type())], text).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response(),
    }
}
