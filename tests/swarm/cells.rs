//! Robots that form cells: few of them relay, the others are clients of a relay.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_link::{Cells, Client, Event, LinkConfig, RobotConfig};
use gestalt_protocol::{ClassId, Instruction, RobotId};
use gestalt_strategies::MindConfig;
use gestalt_tests::{
    Process, Watched, config, in_crowd, processor_time, sealed, start, sums, unique, with_eve,
};
use serde_json::json;

/// Far above what any of this takes: who is not there by then is stuck.
const PATIENCE: Duration = Duration::from_secs(90);

/// The robot that is killed.
const DOOMED: u32 = 1000;

fn in_cells(plain: RobotConfig, size: usize) -> RobotConfig {
    let plain = in_crowd(plain);
    RobotConfig { link: LinkConfig { cells: Some(Cells { size }), ..plain.link }, ..plain }
}

/// Waits until each robot knows all of them to be alive, and `others` more.
async fn all_know(robots: &[Watched], others: &[u32]) -> Duration {
    let began = Instant::now();
    let there = robots.iter().map(|robot| robot.robot.status().robot);
    let there: BTreeSet<RobotId> = there.chain(others.iter().copied().map(RobotId)).collect();
    loop {
        let knows = |robot: &&Watched| there.is_subset(&robot.robot.status().alive.into_iter().collect());
        let Some(ignorant) = robots.iter().find(|robot| !knows(robot)) else { return began.elapsed() };
        // Of who does not know all, and of those it does not know.
        let statuses = || {
            let heard = ignorant.robot.status().alive;
            let unheard = robots.iter().filter(|robot| !heard.contains(&robot.robot.status().robot));
            let all = std::iter::once(ignorant).chain(unheard).map(|robot| robot.robot.status());
            all.map(|status| (status.robot, status.neighbours, status.alive.len(), status.counters))
                .collect::<Vec<_>>()
        };
        assert!(
            began.elapsed() < PATIENCE,
            "{} are there; {:?}; {:?}",
            there.len(),
            sums(robots),
            statuses()
        );
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// A round that one of them opens; all decide it alike, and rightly.
async fn round(robots: &mut [Watched], counter: u32) -> Duration {
    let opened = Instant::now();
    let opener = counter as usize * 7 % robots.len();
    robots[opener].robot.open_round();
    decided(robots, counter).await;
    let took = opened.elapsed();
    tokio::time::sleep(MindConfig::default().refractory).await;
    took
}

async fn decided(robots: &mut [Watched], counter: u32) {
    for robot in robots {
        let decided = |event| match event {
            Event::Held(decision) if decision.round.counter == counter => {
                decision.class.map(|class| (decision, class))
            }
            _ => None,
        };
        let decided = robot.wait(PATIENCE, decided).await;
        let (decision, class) =
            decided.unwrap_or_else(|| panic!("round {counter}: {:?}", robot.robot.status()));
        assert_eq!(class, ClassId(1), "{decision:?}");
    }
}

/// A client of the robot, at the endpoint that it has for those on its computer.
async fn client(swarm: &str, robot: &Watched) -> Client {
    let endpoint = robot.robot.for_clients().expect("a place for clients").to_owned();
    let link = LinkConfig { connect: vec![endpoint], ..LinkConfig::default() };
    let client = Client::open(swarm, &link).await.expect("it attaches to a robot that relays for nobody");
    assert_eq!(client.attached().await, Some(robot.robot.status().robot));
    client
}

/// One that runs no relay.
fn member(robots: &[Watched]) -> &Watched {
    let is_member = |robot: &&Watched| robot.robot.status().counters["relays_run"] == 0;
    robots.iter().find(is_member).expect("not all relay")
}

pub async fn robots_form_cells_by_themselves_and_mend_when_a_relay_is_killed() {
    let long = std::env::var_os("GESTALT_LONG").is_some();
    let (number, size, rounds) = if long { (300_u32, 32, 10) } else { (40, 8, 3) };
    let swarm = unique("cells");
    let began = Instant::now();
    // The first there is founds a relay, and is in a process of its own, to be killed.
    let first = in_cells(config(DOOMED, &swarm, &[]), size);
    let orders = json!({"id": DOOMED, "swarm": swarm, "link": first.link, "rounds": first.mind});
    let mut doomed = Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), None, &orders);
    tokio::time::sleep(Duration::from_secs(4)).await;
    let mut robots = Vec::new();
    for id in 0..number {
        let sees = id.is_multiple_of(3).then_some(ClassId(1));
        robots.push(start(in_cells(config(id, &swarm, &[]), size), sees).await);
    }
    let started = began.elapsed();
    let everyone = robots.len() + 1;
    all_know(&robots, &[DOOMED]).await;
    let counts = sums(&robots);
    let relays = counts["relays_run"] as usize + 1;
    eprintln!(
        "{everyone} robots in cells: started in {started:?}, all know all after {:?}; {relays} relays; {counts:?}",
        began.elapsed()
    );
    // Few relay, though more than there must be, where many start at once on a busy machine; none is too full, and each has few links.
    assert!((everyone.div_ceil(size + 1)..=everyone / 2).contains(&relays), "{relays} relays");
    for robot in &robots {
        let status = robot.robot.status();
        let members = status.counters["cell_members"] as usize;
        assert!(members <= size && status.neighbours.len() <= members + 12, "{status:?}");
    }

    for counter in 1..=rounds {
        let took = round(&mut robots, counter).await;
        eprintln!("{everyone} robots in cells: round {counter} took {took:?}");
    }

    // Who hangs on the relay of another is there for clients as any robot is.
    let client = client(&swarm, member(&robots)).await;
    let statuses = client.statuses(Duration::from_secs(10)).await.expect("the robots answer");
    assert_eq!(statuses.len(), everyone);
    client.close().await;

    if long {
        tokio::time::sleep(Duration::from_secs(60)).await;
        let (before, since) = (processor_time(), Instant::now());
        tokio::time::sleep(Duration::from_secs(10)).await;
        let load = (processor_time() - before) / since.elapsed().as_secs_f64();
        eprintln!("{everyone} robots in cells: idle load {:.1} % of a core", load * 100.0);
    }

    let bereft = |robots: &[Watched]| {
        let hangs = |robot: &&Watched| robot.robot.status().neighbours.contains(&RobotId(DOOMED));
        robots.iter().filter(hangs).count()
    };
    assert!(bereft(&robots) > 0, "nobody hangs on the relay that is killed");
    doomed.kill();
    let killed = Instant::now();
    // The others go on at once, and those whose relay it was have another soon.
    robots[0].robot.open_round();
    while bereft(&robots) > 0 {
        assert!(killed.elapsed() < PATIENCE, "who hung on the relay does not see that it is gone");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    all_know(&robots, &[]).await;
    let back = killed.elapsed();
    decided(&mut robots, rounds + 1).await;
    eprintln!(
        "{everyone} robots in cells: a relay was killed with a round to be opened at once; its cell is back after {back:?}, the round over after {:?}; {:?}",
        killed.elapsed(),
        sums(&robots)
    );
    tokio::time::sleep(MindConfig::default().refractory).await;
    round(&mut robots, rounds + 2).await;
    let lists_it = |robot: &&Watched| robot.robot.status().alive.contains(&RobotId(DOOMED));
    let number = robots.iter().filter(lists_it).count();
    eprintln!(
        "{everyone} robots in cells: {number} robots were not told that the one that was killed is gone"
    );
    for robot in robots {
        robot.stop().await;
    }
}

pub async fn a_sealed_swarm_forms_cells_too() {
    let (number, size) = (10, 3);
    let members = with_eve(&unique("sealed-cells"), number);
    let mut robots = Vec::new();
    for id in 0..number {
        let sees = id.is_multiple_of(2).then_some(ClassId(1));
        robots.push(start(in_cells(sealed(id, &members, &[]), size), sees).await);
    }
    all_know(&robots, &[]).await;
    assert!(sums(&robots)["relays_run"] >= 3, "{:?}", sums(&robots));
    round(&mut robots, 1).await;
    // Without a key a client speaks through the robot on whose computer it is, also if that relays for nobody.
    let client = client(&members.swarm, member(&robots)).await;
    let mut heard = client.decisions().await.unwrap();
    client.instruct(&"ada".parse().unwrap(), &Instruction::Open).await.unwrap();
    decided(&mut robots, 2).await;
    let told = tokio::time::timeout(PATIENCE, heard.next()).await.expect("in time").unwrap().unwrap();
    assert_eq!((told.decision.round.counter, told.decision.class), (2, Some(ClassId(1))));
    client.close().await;
    let refused: Vec<_> = sums(&robots).into_iter().filter(|(name, _)| name.starts_with("refused")).collect();
    assert!(refused.is_empty(), "{refused:?}");
    for robot in robots {
        robot.stop().await;
    }
}

/// A Zenoh router as `zenohd` is one, which knows nothing of swarms.
async fn router(connect: &[String]) -> (zenoh::Session, Vec<String>) {
    let mut config = zenoh::Config::default();
    let endpoints = serde_json::to_string(connect).unwrap();
    for (key, value) in [
        ("mode", "\"router\""),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]"),
        ("connect/endpoints", &endpoints),
        ("scouting/multicast/enabled", "false"),
    ] {
        config.insert_json5(key, value).unwrap();
    }
    let session = zenoh::open(config).await.unwrap();
    let locators = session.info().locators().await.iter().map(ToString::to_string).collect();
    (session, locators)
}

pub async fn robots_hang_on_routers_that_are_there_as_they_are() {
    let swarm = unique("routers");
    let (first, here) = router(&[]).await;
    let (second, there) = router(&here).await;
    let hangs_on = |id: u32, router: &[String]| {
        let plain = config(id, &swarm, router);
        let zenoh = json!({"mode": "client"}).as_object().unwrap().clone();
        RobotConfig { link: LinkConfig { zenoh, ..plain.link }, ..plain }
    };
    let mut robots = Vec::new();
    for id in 0..4 {
        let router = if id < 2 { &here } else { &there };
        robots.push(start(hangs_on(id, router), Some(ClassId(1))).await);
    }
    all_know(&robots, &[]).await;
    round(&mut robots, 1).await;
    // Whoever comes later is told of it by one of those who were there, none of which is its neighbour.
    let mut late = start(hangs_on(4, &there), None).await;
    decided(std::slice::from_mut(&mut late), 1).await;
    robots.push(late);
    tokio::time::sleep(MindConfig::default().refractory).await;
    round(&mut robots, 2).await;
    for robot in robots {
        robot.stop().await;
    }
    for router in [first, second] {
        router.close().await.unwrap();
    }
}
