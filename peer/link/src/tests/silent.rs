//! Who is said to be there, and is not.

use std::collections::BTreeSet;

use gestalt_protocol::{Keys, MAX_ROBOTS, RobotId, Topic};

use super::*;

/// The token of a robot that is gone, as a router keeps it that lost the news; and robots that say nothing, which are there.
#[tokio::test(flavor = "multi_thread")]
async fn who_does_not_answer_is_not_alive_whatever_zenoh_says() {
    let name = unique();
    let mut robots = swarm(&name, 3, config(1, &name, &[])).await;
    let keys = Keys::new(&name).unwrap();
    let client = async |of: &Watched| {
        let link = LinkConfig { connect: of.robot.locators().to_vec(), ..LinkConfig::default() };
        zenoh::open(link.client().unwrap()).await.unwrap()
    };
    let ghost = client(&robots[0]).await;
    let token = ghost.liveliness().declare_token(keys.key(&Topic::Alive(RobotId(9)))).await.unwrap();
    robots[0].status("the ghost is alive", |status| status.alive.contains(&RobotId(9))).await;
    // Another robot goes, and says so: what else has gone with it is looked into.
    robots.pop().unwrap().stop().await;
    let living = BTreeSet::from([RobotId(1), RobotId(2)]);
    let alive = |status: &Status| status.alive.iter().copied().collect::<BTreeSet<_>>();
    for watched in &robots {
        watched.status("the ghost is gone", |status| alive(status) == living).await;
    }
    // Nor does its token bring it back, which every query still finds, though a new one does.
    robots[1].decide(0).await;
    assert_eq!(alive(&robots[0].robot.status()), living);
    token.undeclare().await.unwrap();
    let _token = ghost.liveliness().declare_token(keys.key(&Topic::Alive(RobotId(9)))).await.unwrap();
    robots[0].status("it is back", |status| status.alive.contains(&RobotId(9))).await;
    ghost.close().await.unwrap();
    for robot in robots {
        robot.stop().await;
    }
}

/// What is no message, and more robots than there can be.
#[tokio::test(flavor = "multi_thread")]
async fn deletions_and_robots_beyond_all_that_a_swarm_has_are_refused_by_name() {
    let name = unique();
    let robot = start(config(1, &name, &[])).await;
    let keys = Keys::new(&name).unwrap();
    let link = LinkConfig { connect: robot.robot.locators().to_vec(), ..LinkConfig::default() };
    let crowd = zenoh::open(link.client().unwrap()).await.unwrap();
    crowd.delete(keys.key(&Topic::Vote(RobotId(2)))).await.unwrap();
    robot.status("it is counted", |status| status.counters.contains_key("refused_deletion_kind")).await;
    let mut tokens = Vec::new();
    for id in 2..=MAX_ROBOTS as u32 + 1 {
        tokens.push(crowd.liveliness().declare_token(keys.key(&Topic::Alive(RobotId(id)))).await.unwrap());
    }
    let refused = |status: &Status| status.counters.get("refused_alive_too_many") == Some(&1);
    robot.status("one is too many, with this robot itself", refused).await;
    assert!(robot.robot.status().errors.iter().any(|error| error.what.contains("at most")));
    crowd.close().await.unwrap();
    robot.stop().await;
}
