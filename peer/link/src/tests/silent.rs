//! Who is said to be there, and is not.

use std::collections::BTreeSet;

use gestalt_protocol::{Keys, RobotId, Topic};

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
