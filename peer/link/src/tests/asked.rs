//! What robots answer any Zenoh client, which asks as Zenoh does by itself.

use std::collections::BTreeSet;

use gestalt_protocol::{Keys, RobotId, Topic};

use super::*;

#[tokio::test(flavor = "multi_thread")]
async fn who_asks_all_robots_at_once_is_answered_by_each_under_its_own_key() {
    let name = unique();
    let mut robots = swarm(&name, 2, config(1, &name, &[])).await;
    robots[0].decide(0).await;
    let connect = robots[0].robot.locators().to_vec();
    let link = LinkConfig { connect, ..LinkConfig::default() };
    let client = zenoh::open(link.client().unwrap()).await.unwrap();
    let keys = Keys::new(&name).unwrap();
    let statuses = [1, 2].map(|robot| keys.key(&Topic::Status(RobotId(robot))));
    let all = statuses.iter().cloned().chain([keys.key(&Topic::Decision)]).collect();
    for (asked, expected) in
        [(keys.every_robot("status"), BTreeSet::from(statuses)), (format!("gestalt/{name}/**"), all)]
    {
        let end = Instant::now() + PATIENCE;
        loop {
            // What is asked before the client knows of them all is asked again.
            let replies = client.get(&asked).await.unwrap();
            let mut answered = BTreeSet::new();
            while let Ok(reply) = replies.recv_async().await {
                answered.extend(reply.result().ok().map(|sample| sample.key_expr().to_string()));
            }
            if answered == expected {
                break;
            }
            assert!(Instant::now() < end, "{asked}: {answered:?}");
        }
    }
    client.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}
