//! Zenoh's configuration in a sealed swarm: what every value is for.

use gestalt_protocol::{Keys, MAX_FRAME, MAX_JSON, Topic};
use serde_json::{Value, json};

use super::credentials::Credentials;

/// The longest message that a link takes, in bytes: a frame with what is beside it.
const MAX_MESSAGE: usize = MAX_FRAME + 64 * 1024;

/// How long a TLS handshake may take: a stranger who does not go on holds a file of this process as long.
const HANDSHAKE: &str = "#tls_handshake_timeout_ms=2000";

/// How many links Zenoh makes before anything is known of who is at the other end, at the same time.
pub(super) const PENDING: usize = 32;

/// The most sessions that a robot has: those that find a [`Seat`](super::Seat), and those that are being hung up again.
pub(super) const MAX_SESSIONS: usize = 576;

/// That of a robot.
pub(crate) fn robot(credentials: &Credentials, keys: &Keys) -> Value {
    let mut config = links(credentials);
    let extra = json!({
        "transport/unicast/accept_pending": PENDING,
        "transport/unicast/max_sessions": MAX_SESSIONS,
        "access_control": planes(keys),
        "low_pass_filter": [{
            "id": "small",
            "messages": ["put"],
            "flows": ["ingress"],
            "size_limit": MAX_JSON,
            "key_exprs": [keys.every_instructor("feedback"), keys.every_instructor("word"), keys.every_instructor("answer")],
        }],
    });
    merge(&mut config, extra);
    config
}

/// That of a client. Whom it dials is chosen by the rules of its swarm, and not by who is first to answer; nobody dials it.
pub(crate) fn client(credentials: &Credentials) -> Value {
    let mut config = links(credentials);
    let extra = json!({ "mode": "client", "listen/endpoints": [], "scouting/multicast/enabled": false });
    merge(&mut config, extra);
    config
}

fn links(credentials: &Credentials) -> Value {
    json!({
        "transport/link/protocols": ["tls", "tcp"],
        "transport/link/rx/max_message_size": MAX_MESSAGE,
        "transport/link/tls": credentials.tls(),
    })
}

fn merge(config: &mut Value, extra: Value) {
    if let (Value::Object(config), Value::Object(extra)) = (config, extra) {
        config.extend(extra);
    }
}

/// Which plane of the swarm a link may use. It cannot say *whose* messages a link carries, since robots relay for each other, so what is
/// believed is settled by signatures; and it does not change when a robot is enrolled or expelled. Not listed is not allowed: a put to a
/// wider key than these is dropped too, and nothing is ever deleted. What Zenoh lets through whatever stands here is the link state.
fn planes(keys: &Keys) -> Value {
    let all = format!("gestalt/{}/**", keys.swarm());
    let robots = format!("gestalt/{}/robot/**", keys.swarm());
    let of_swarm = [Topic::Decision, Topic::Question, Topic::Evidence, Topic::Roster];
    let swarm = [robots].into_iter().chain(of_swarm.iter().map(|topic| keys.key(topic)));
    let of_members: Vec<String> =
        swarm.chain([keys.every_instructor("word"), keys.every_instructor("answer")]).collect();
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": [
            // Words without a signature are not among it: they end at the robot on whose computer they were said.
            { "id": "speak", "permission": "allow", "flows": ["ingress", "egress"],
              "messages": ["put", "reply"], "key_exprs": of_members },
            { "id": "listen", "permission": "allow", "flows": ["ingress", "egress"],
              "messages": ["query", "declare_subscriber", "declare_queryable", "liveliness_token", "liveliness_query",
                           "declare_liveliness_subscriber"],
              "key_exprs": [all] },
            { "id": "ask", "permission": "allow", "flows": ["ingress"],
              "messages": ["put"], "key_exprs": [keys.every_instructor("feedback"), keys.every_instructor("word"), keys.key(&Topic::Roster)] },
            { "id": "watch", "permission": "allow", "flows": ["ingress"],
              "messages": ["query", "declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"],
              "key_exprs": [all] },
            { "id": "tell", "permission": "allow", "flows": ["egress"],
              "messages": ["put", "reply"], "key_exprs": of_members },
            // Also what robots listen to: a client sends nothing that nobody says they want.
            { "id": "show", "permission": "allow", "flows": ["egress"],
              "messages": ["declare_subscriber", "declare_queryable", "liveliness_token"], "key_exprs": [all] },
        ],
        "subjects": [
            { "id": "members", "link_protocols": ["tls"] },
            // A sealed robot listens without TLS on its own computer alone.
            { "id": "local", "link_protocols": ["tcp"] },
        ],
        "policies": [
            { "rules": ["speak", "listen"], "subjects": ["members"] },
            { "rules": ["ask", "watch", "tell", "show"], "subjects": ["local"] },
        ],
    })
}

/// An endpoint to listen on, as it is handed to Zenoh.
pub(crate) fn bounded(endpoint: &str) -> String {
    if endpoint.starts_with("tls/") && !endpoint.contains('#') {
        format!("{endpoint}{HANDSHAKE}")
    } else {
        endpoint.to_owned()
    }
}
