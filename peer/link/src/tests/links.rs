//! Which links a session has.

use serde_json::json;
use tokio::time::{Instant, sleep};
use zenoh::session::ZenohId;

use super::*;
use crate::session::Node;

async fn node(mode: &str, listen: &[&str], told: impl Fn(ZenohId, bool) + Send + Sync + 'static) -> Node {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", json!(mode)),
        ("listen/endpoints", json!(listen)),
        ("connect/endpoints", json!([])),
        ("scouting/multicast/enabled", json!(false)),
    ] {
        config.insert_json5(key, &value.to_string()).unwrap();
    }
    Node::open(config, None, None, move |far, stands| told(far.id, stands)).await.unwrap()
}

/// Zenoh tells of a second link of a client, refuses it then, and says nothing of its end.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_link_that_is_refused_after_it_was_told_of_is_none() {
    let listen = ["tcp/127.0.0.1:0"];
    let (one, other) = (node("router", &listen, |_, _| {}).await, node("router", &listen, |_, _| {}).await);
    let (tell, mut told) = tokio::sync::mpsc::unbounded_channel();
    let client = node("client", &[], move |id, stands| tell.send((id, stands)).unwrap()).await;
    assert!(client.dial(one.id(), &one.locators()).await);
    client.dial(other.id(), &other.locators()).await;
    let end = Instant::now() + PATIENCE;
    let mut linked = std::collections::BTreeSet::new();
    while linked.is_empty() || linked.contains(&other.id()) {
        assert!(Instant::now() < end, "{linked:?}");
        while let Ok((id, stands)) = told.try_recv() {
            if stands {
                linked.insert(id)
            } else {
                linked.remove(&id)
            };
        }
        sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(linked, [one.id()].into());
    // Once it has left the one, it links to the other.
    client.leave(one.id()).await;
    assert!(client.dial(other.id(), &other.locators()).await && client.is_linked());
    for node in [client, one, other] {
        timeout(PATIENCE, node.close()).await.expect("it closes");
    }
}
