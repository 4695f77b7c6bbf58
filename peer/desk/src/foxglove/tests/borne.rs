//! Whom it lets in, and what it bears.

use super::*;

#[tokio::test]
async fn only_who_may_is_let_in_and_only_who_speaks_the_protocol() {
    let stage = stage(None, Limits::default()).await;
    for protocol in ["foxglove.websocket.v1", "chat", "foxglove.sdk.v1x"] {
        assert_eq!(
            stage.connect("/", &[("sec-websocket-protocol", protocol)]).await.err(),
            Some(400),
            "{protocol}"
        );
    }
    assert_eq!(stage.connect("/", &[]).await.err(), Some(400), "no protocol");
    assert_eq!(stage.connect("/other", &[SPEAKS]).await.err(), Some(404));
    assert!(stage.connect("/", &[("sec-websocket-protocol", "chat, foxglove.sdk.v1")]).await.is_ok());
    for origin in
        ["http://evil.example", "null", "http://127.0.0.1:1", "https://app.foxglove.dev.evil.example"]
    {
        assert_eq!(stage.connect("/", &[SPEAKS, ("origin", origin)]).await.err(), Some(403), "{origin}");
    }
    let own = format!("http://{}", stage.address);
    for origin in [own.as_str(), "https://app.foxglove.dev", "file://", "http://localhost:8080"] {
        assert!(stage.connect("/", &[SPEAKS, ("origin", origin)]).await.is_ok(), "{origin}");
    }
    for host in ["evil.example", "192.168.1.5:8765"] {
        assert_eq!(stage.connect("/", &[SPEAKS, ("host", host)]).await.err(), Some(403), "{host}");
    }
    assert_eq!(stage.hub.visits().clients, 5);
}

#[tokio::test]
async fn from_elsewhere_a_token_is_needed() {
    const TOKEN: &str = "a-token-of-somebodys-own";
    let stage = stage(Some(TOKEN), Limits::default()).await;
    for path in [
        "/",
        "/?token=",
        "/?token=a-token-of-somebody-else",
        "/layout.json",
        "/?Token=a-token-of-somebodys-own",
    ] {
        assert_eq!(stage.connect(path, &[SPEAKS]).await.err(), Some(401), "{path}");
    }
    assert!(stage.connect(&format!("/?token={TOKEN}"), &[SPEAKS]).await.is_ok());
    assert!(stage.connect("/", &[SPEAKS, ("authorization", &format!("Bearer {TOKEN}"))]).await.is_ok());
}

#[test]
fn channels_are_bounded_whoever_makes_them_up() {
    let keys = Keys::new("gestalt").unwrap();
    let hub = Hub::new(keys.clone());
    for robot in 0..5000 {
        hub.write(&Passing::presence(RobotId(robot), true, 1).entry(&keys).unwrap(), Duration::ZERO);
    }
    let word = |who: u32| Entry {
        kind: Kind::Feedback,
        channel: format!("/gestalt/gestalt/instructor/{who}/feedback"),
        ..decision(8, "{}")
    };
    let taken = (0..5000).filter(|who| hub.write(&word(*who), Duration::ZERO)).count();
    assert!(taken < 2048, "{taken}");
    let (seat, _) = hub.join().unwrap();
    assert!(seat.channels.len() <= 4096);
    assert!(hub.write(&decision(9, "{}"), Duration::ZERO), "what is there stays there");
}

#[tokio::test]
async fn of_pictures_who_reads_slowly_gets_fewer_and_is_not_dropped() {
    let hub = Hub::new(Keys::new("gestalt").unwrap());
    let channel = "/gestalt/gestalt/robot/1/frame".to_owned();
    let picture = Entry { kind: Kind::Frame, channel, at: 1, published: 1, data: vec![7; 60_000] };
    assert!(hub.write(&picture, Duration::ZERO));
    hub.age(Duration::from_secs(9));
    let (mut seat, mut dismissed) = hub.join().unwrap();
    let channel_id = seat.channels.iter().find(|it| it.kind == Kind::Frame).unwrap().id;
    hub.subscribe(seat.id, wire::Subscription { id: 1, channel_id }).unwrap();
    for _ in 0..2000 {
        assert!(hub.write(&picture, Duration::ZERO));
    }
    assert!(dismissed.try_recv().is_err_and(|error| error == oneshot::error::TryRecvError::Empty));
    let mut got = 0;
    while let Ok(Some(_)) = timeout(Duration::from_millis(50), seat.next()).await {
        got += 1;
    }
    assert!((10..30).contains(&got), "{got}");
    assert!(hub.write(&picture, Duration::ZERO));
    assert!(timeout(SOON, seat.next()).await.unwrap().is_some(), "whoever catches up gets them again");
}

#[tokio::test]
async fn nonsense_is_refused_and_counted_and_others_do_not_notice() {
    let stage = stage(None, Limits::default()).await;
    let (mut good, mut bad) = (stage.viewer().await, stage.viewer().await);
    good.subscribe(1, 1).await;
    good.settle().await;
    let before = stage.hub.visits().refused;
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let any = proptest::collection::vec(proptest::num::u8::ANY, 0..300);
    for number in 0..600_u64 {
        use proptest::strategy::{Strategy, ValueTree};
        let mut bytes = any.new_tree(&mut runner).unwrap().current();
        let message = match number % 3 {
            0 => Message::binary(bytes),
            1 => {
                bytes.insert(0, 2);
                Message::binary(bytes)
            }
            _ => Message::text(String::from_utf8_lossy(&bytes).into_owned()),
        };
        bad.0.send(message).await.unwrap();
        if number % 50 == 0 {
            bad.settle().await;
            assert!(stage.say(&decision(number, "{}")));
            assert_eq!(good.data().await.1, number);
        }
    }
    bad.settle().await;
    assert!(stage.hub.visits().refused - before >= 600, "{:?}", stage.hub.visits());
    // A list of mistakes is no list of answers.
    let many: Vec<Value> = (0..5000).map(|id| json!({"id": id, "channelId": 100_000 + id})).collect();
    bad.send(json!({"op": "subscribe", "subscriptions": many})).await;
    let mut answers = 0;
    while !bad.json().await["message"].as_str().unwrap().contains("more mistakes") {
        answers += 1;
    }
    assert!(answers <= 40, "{answers}");
    // What is too long ends the connection, and nobody else's.
    let _ = bad.0.send(Message::text("x".repeat(wire::MAX_REQUEST + 1))).await;
    while !matches!(bad.next().await, None | Some(Message::Close(_))) {}
    assert!(stage.say(&decision(1000, "{}")));
    assert_eq!(good.data().await.1, 1000);
    assert_eq!(stage.hub.visits().dropped, 0);
}

#[tokio::test]
async fn who_never_reads_is_dropped_and_the_others_get_everything_at_once() {
    let limits = Limits { patience: Duration::from_secs(6), ..Limits::default() };
    let stage = stage(None, limits).await;
    let mut good = stage.viewer().await;
    good.subscribe(1, 1).await;
    good.settle().await;
    let mut idle = Vec::new();
    for _ in 0..10 {
        let mut viewer = stage.viewer().await;
        viewer.subscribe(1, 1).await;
        viewer.settle().await;
        idle.push(viewer);
    }
    let data = "y".repeat(60_000);
    let mut slowest = Duration::ZERO;
    for at in 0..1500 {
        let began = Instant::now();
        assert!(stage.say(&decision(at, &data)));
        assert_eq!(good.data().await.1, at);
        slowest = slowest.max(began.elapsed());
    }
    println!("the slowest of 1,500 messages of 60 kB took {slowest:?} beside ten that never read");
    assert!(slowest < Duration::from_secs(3), "{slowest:?}");
    let began = Instant::now();
    while stage.hub.visits().dropped < 10 {
        assert!(began.elapsed() < Duration::from_secs(60), "{:?}", stage.hub.visits());
        good.settle().await;
        sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(stage.hub.visits().dropped, 10);
    good.settle().await;
}

#[tokio::test]
async fn who_gives_no_sign_of_life_is_dropped_though_nothing_waits_for_it() {
    let limits = Limits { patience: Duration::from_secs(2), readers: 1, ..Limits::default() };
    let stage = stage(None, limits).await;
    let _silent = stage.viewer().await;
    assert_eq!(stage.connect("/", &[SPEAKS]).await.err(), Some(503), "there is room for one");
    let began = Instant::now();
    while stage.hub.visits().dropped == 0 {
        assert!(began.elapsed() < SOON, "it is still there");
        sleep(Duration::from_millis(20)).await;
    }
    sleep(Duration::from_millis(500)).await;
    // And one that answers stays.
    let mut good = stage.viewer().await;
    for _ in 0..40 {
        good.settle().await;
        sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(stage.hub.visits().dropped, 1);
}

#[tokio::test]
async fn a_port_in_use_is_named_with_the_way_out() {
    let taken = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let error = Viewing::at(address.parse().unwrap()).door.listen("Foxglove").await.unwrap_err().to_string();
    assert!(error.contains(&address) && error.contains("Foxglove") && error.contains("port 0"), "{error}");
}
