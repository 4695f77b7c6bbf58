//! What clients are told, and what becomes of what they say.

use super::*;

#[tokio::test]
async fn a_client_is_told_of_channels_and_gets_what_it_subscribes_to_and_no_more() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.connect("/", &[SPEAKS]).await.unwrap();
    let info = viewer.json().await;
    assert_eq!(info["capabilities"], json!(["services", "connectionGraph"]));
    assert_eq!(info["supportedEncodings"], json!(["json"]));
    let channels = viewer.json().await;
    let ids = advertised(&channels);
    let told = channels["channels"].as_array().unwrap();
    assert!(told.iter().all(|it| it["schema"].as_str().is_some_and(|schema| !schema.is_empty())));
    let log = told.iter().find(|it| it["topic"] == "/gestalt/gestalt/log").unwrap();
    assert_eq!(
        [&log["encoding"], &log["schemaEncoding"], &log["schemaName"]],
        ["protobuf", "protobuf", "foxglove.Log"]
    );
    let decisions = told.iter().find(|it| it["topic"] == "/gestalt/gestalt/decision").unwrap();
    let described: Value = serde_json::from_str(decisions["schema"].as_str().unwrap()).unwrap();
    assert_eq!(Some(described), schema(Kind::Decision));
    let service = viewer.json().await;
    assert_eq!(service["services"][0]["name"], "/gestalt/gestalt/say");
    // Nothing comes before it is asked for; then all of it, in order; and nothing after.
    assert!(stage.say(&decision(1, "before")));
    viewer.subscribe(9, ids["/gestalt/gestalt/decision"]).await;
    viewer.settle().await;
    for at in 2..6 {
        assert!(stage.say(&decision(at, &format!("number {at}"))));
        assert_eq!(viewer.data().await, (9, at, format!("number {at}").into_bytes()));
    }
    for (wrong, why) in [
        (json!({"id": 1, "channelId": 999}), "no channel 999"),
        (json!({"id": 3, "channelId": 1}), "already"),
    ] {
        viewer.send(json!({"op": "subscribe", "subscriptions": [wrong]})).await;
        let status = viewer.json().await;
        assert!(status["op"] == "status" && status["level"] == 2, "{status}");
        assert!(status["message"].as_str().unwrap().contains(why), "{status}");
    }
    viewer.send(json!({"op": "unsubscribe", "subscriptionIds": [9]})).await;
    viewer.settle().await;
    assert!(stage.say(&decision(6, "after")));
    viewer.settle().await;
    assert_eq!(stage.hub.visits().dropped, 0);
}

#[tokio::test]
async fn channels_come_and_go_with_their_robots_and_nothing_of_them_is_missed() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let presence = |alive| Passing::presence(RobotId(7), alive, 5).entry(&stage.keys).unwrap();
    assert!(stage.say(&presence(true)));
    let mut ids = std::collections::BTreeMap::new();
    while ids.len() < 5 {
        let told = viewer.json().await;
        assert_eq!(told["op"], "advertise");
        ids.extend(advertised(&told));
    }
    let names: Vec<&str> =
        ids.keys().map(|topic| topic.strip_prefix("/gestalt/gestalt/robot/7/").unwrap()).collect();
    assert_eq!(names, ["alive", "decision", "sample", "status", "vote"]);
    // Who is there is told to whoever asks late.
    viewer.subscribe(1, ids["/gestalt/gestalt/robot/7/alive"]).await;
    let (_, _, data) = viewer.data().await;
    assert_eq!(serde_json::from_slice::<Value>(&data).unwrap(), json!({"robot": 7, "alive": true}));
    // The first word of somebody new is there for those who subscribe when they are told of it, for a while.
    let word = |who: &str| Entry {
        kind: Kind::Feedback,
        channel: format!("/gestalt/gestalt/instructor/{who}/feedback"),
        ..decision(8, "{}")
    };
    for (who, kept) in [("ada", true), ("bob", false)] {
        assert!(stage.say(&word(who)));
        let told = advertised(&viewer.json().await);
        if !kept {
            stage.hub.age(Duration::from_secs(3));
        }
        viewer.subscribe(if kept { 2 } else { 3 }, *told.values().next().unwrap()).await;
        if kept {
            assert_eq!(viewer.data().await, (2, 8, b"{}".to_vec()));
        }
        viewer.settle().await;
    }
    assert!(stage.say(&presence(false)));
    let (_, _, data) = viewer.data().await;
    assert_eq!(serde_json::from_slice::<Value>(&data).unwrap()["alive"], false);
    let mut gone = Vec::new();
    for _ in 0..5 {
        let told = viewer.json().await;
        assert_eq!(told["op"], "unadvertise");
        gone.extend(told["channelIds"].as_array().unwrap().iter().map(|id| id.as_u64().unwrap()));
    }
    gone.sort_unstable();
    let mut expected: Vec<u64> = ids.values().map(|id| u64::from(*id)).collect();
    expected.sort_unstable();
    assert_eq!(gone, expected);
}

#[tokio::test]
async fn words_are_passed_on_as_they_were_said_and_what_means_nothing_fails() {
    let mut stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let long = format!(r#"{{"say":"new {}"}}"#, "x".repeat(5000));
    for (service, encoding, payload, why) in [
        (9, "json", r#"{"say":"look"}"#, "no service 9"),
        (1, "protobuf", r#"{"say":"look"}"#, "encoding"),
        (1, "json", &long, "too long"),
        (1, "json", "{", "gestalt teach"),
        (1, "json", r#"{"say":"right"}"#, "no round has been decided"),
    ] {
        viewer.call(service, encoding, payload.as_bytes()).await;
        let failure = viewer.json().await;
        assert_eq!([&failure["op"], &failure["callId"]], [&json!("serviceCallFailure"), &json!(77)]);
        assert_eq!(failure["serviceId"], service);
        assert!(failure["message"].as_str().unwrap().contains(why), "{failure}");
    }
    assert!(stage.asked.try_recv().is_err(), "nothing was said to the swarm");
    viewer.call(1, "json", br#"{"say":"look"}"#).await;
    let ask = timeout(SOON, stage.asked.recv()).await.unwrap().unwrap();
    assert_eq!(ask.instruction, Instruction::Open);
    // It is listened to meanwhile.
    viewer.settle().await;
    ask.answer.send(Ok(None)).unwrap();
    let Some(Message::Binary(answer)) = viewer.next().await else { panic!("no answer") };
    let head = [&[3, 1, 0, 0, 0, 77, 0, 0, 0, 4, 0, 0, 0], &b"json"[..]].concat();
    assert_eq!(answer[..head.len()], head);
    let answer: Value = serde_json::from_slice(&answer[head.len()..]).unwrap();
    assert_eq!(answer["words"], "asked all robots to look");
}

#[tokio::test]
async fn links_and_what_is_wrong_are_told_whenever_they_change() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    let show = || stage.known.with(|view, now| stage.easel.show(view, now));
    viewer.send(json!({"op": "subscribeConnectionGraph"})).await;
    assert_eq!(viewer.json().await["op"], "connectionGraphUpdate");
    for (id, links) in [(1, vec![2]), (2, vec![1])] {
        let mut status = gestalt_protocol::Status::new(RobotId(id), String::new(), 1);
        status.neighbours = links.into_iter().map(RobotId).collect();
        status.errors = vec![gestalt_protocol::Reported { at_ms: 1, what: "no camera".to_owned() }];
        stage.known.hear(Input::Came(RobotId(id)));
        stage.known.hear(Input::Status(Box::new(status)));
    }
    show();
    let told = [viewer.json().await, viewer.json().await, viewer.json().await];
    let problems: Vec<&Value> =
        told.iter().filter(|it| it["op"] == "status").map(|it| &it["message"]).collect();
    assert_eq!(problems, ["robot 1: no camera", "robot 2: no camera"]);
    let graph = told.iter().find(|it| it["op"] == "connectionGraphUpdate").unwrap();
    let link = json!({"name": "/gestalt/gestalt/robot/1/vote", "subscriberIds": ["robot/2"]});
    assert!(graph["subscribedTopics"].as_array().unwrap().contains(&link), "{graph}");
    // Nothing new is nothing said; and one who comes late is told all the same.
    show();
    viewer.send(json!({"op": "unsubscribeConnectionGraph"})).await;
    viewer.settle().await;
    let mut late = stage.connect("/", &[SPEAKS]).await.unwrap();
    let all = [late.json().await, late.json().await, late.json().await, late.json().await, late.json().await];
    assert_eq!(all.iter().filter(|it| it["op"] == "status").count(), 2);
    stage.known.hear(Input::Left(RobotId(2)));
    show();
    assert_eq!(viewer.json().await, json!({"op": "removeStatus", "statusIds": ["robot/2"]}));
    viewer.settle().await;
}

#[tokio::test]
async fn all_are_told_when_it_closes() {
    let stage = stage(None, Limits::default()).await;
    let mut viewer = stage.viewer().await;
    stage.hub.close();
    let Some(Message::Close(Some(frame))) = viewer.next().await else { panic!("no goodbye") };
    assert_eq!(u16::from(frame.code), 1001);
    let mut late = stage.connect("/", &[SPEAKS]).await.unwrap();
    assert!(!matches!(late.next().await, Some(Message::Text(_))), "nobody is served any more");
}

#[test]
fn a_recorder_hands_the_hub_what_it_would_write() {
    let hub = Arc::new(Hub::new(Keys::new("gestalt").unwrap()));
    let mut live = Live::new(hub.clone());
    assert!(live.write(&decision(1, "{}")).unwrap());
    live.flush().unwrap();
    live.finish(std::collections::BTreeMap::new()).unwrap();
}
