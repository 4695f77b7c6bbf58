//! The server that viewers connect to.

use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::any;
use tokio::sync::Semaphore;

use super::visit::Host;
use super::wire::{MAX_REQUEST, SUBPROTOCOL};
use crate::door::{Gate, Guard, at_the_door, with_token};

/// The layout that ships, for the swarm called `gestalt`.
pub(super) const LAYOUT: &str = include_str!("../../web/foxglove.json");

/// The most that is written for a client at a time: the longest message has room.
const MAX_UNSENT: usize = 64 << 20;

/// What requests are answered from.
#[derive(Clone, Debug)]
pub(super) struct Server {
    pub guard: Guard,
    pub host: Host,
    /// A place for each client.
    pub places: Arc<Semaphore>,
}

/// Answers requests until `ended`.
pub(super) async fn serve(gate: Gate, server: Server, ended: impl Future<Output = ()> + Send + 'static) {
    let all = Router::new()
        .route("/", any(connect))
        .route("/layout.json", any(layout))
        .layer(from_fn_with_state(server.guard.clone(), with_token))
        .fallback(async || (StatusCode::NOT_FOUND, "There is nothing here.\n"))
        .layer(from_fn_with_state(server.guard.clone(), at_the_door))
        .with_state(server);
    if let Err(error) = axum::serve(gate, all).with_graceful_shutdown(ended).await {
        tracing::warn!("Foxglove: {error}");
    }
}

/// A client that speaks the protocol is let in; any other is told which one it is.
async fn connect(
    State(server): State<Server>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let fail = |status: StatusCode, words: String| {
        server.host.hub.refuse();
        (status, words).into_response()
    };
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade.protocols([SUBPROTOCOL]),
        Err(rejection) => {
            let words = "This is a WebSocket for Foxglove and other viewers: open it there as a Foxglove WebSocket. \
                         /layout.json is a layout for it.\n";
            return fail(rejection.into_response().status(), words.to_owned());
        }
    };
    if upgrade.selected_protocol().is_none() {
        let words = format!("Offer the WebSocket subprotocol {SUBPROTOCOL}: no other is spoken here.\n");
        return fail(StatusCode::BAD_REQUEST, words);
    }
    let Ok(place) = server.places.clone().try_acquire_owned() else {
        return fail(
            StatusCode::SERVICE_UNAVAILABLE,
            "Too many viewers are connected: close one.\n".to_owned(),
        );
    };
    upgrade
        .max_message_size(MAX_REQUEST)
        .max_frame_size(MAX_REQUEST)
        .write_buffer_size(0)
        .max_write_buffer_size(MAX_UNSENT)
        .on_upgrade(async move |socket| {
            server.host.receive(socket).await;
            drop(place);
        })
}

/// The layout, with the topics of this swarm.
async fn layout(State(server): State<Server>) -> Response {
    let headers = [
        (CONTENT_TYPE, "application/json"),
        (CONTENT_DISPOSITION, "attachment; filename=\"gestalt.foxglove.json\""),
    ];
    (headers, of_swarm(LAYOUT, &server.host.info.swarm)).into_response()
}

fn of_swarm(layout: &str, swarm: &str) -> String {
    layout.replace("/gestalt/gestalt/", &format!("/gestalt/{swarm}/"))
}
