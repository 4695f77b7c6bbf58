//! A recording said again on Zenoh.

use std::time::Duration;

use gestalt_link::Stage;
use gestalt_tape::{Condition, Line, ReadError, SWARM, read};
use serde_json::json;
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::super::show::{counted, line};
use super::super::{Failure, interrupted};
use super::{Args, open};

/// How many lines are read ahead.
const AHEAD: usize = 256;

/// At `--speed 0`, and after the last line, clients still have this long to take in what was said.
const LAST: Duration = Duration::from_millis(500);

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let (recorded, first) = beginning(args)?;
    let name = args.name.clone().unwrap_or_else(|| format!("{recorded}-replay"));
    if name == recorded {
        return Err(format!(
            "the recording is of swarm \"{recorded}\": robots of it would hear their own past; give --as another name"
        )
        .into());
    }
    let link = args.config.load()?.link();
    super::super::runtime()?.block_on(async {
        let mut stage = Stage::open(&name, &link).await?;
        let words = format!("swarm \"{name}\" plays at {}; Ctrl-C ends it", stage.locators().join(" "));
        let object = json!({"event": "playing", "swarm": name, "endpoints": stage.locators()});
        line(args.json, &object, &words)?;
        let said = tokio::select! {
            said = say_all(args, &mut stage, first) => said,
            () = interrupted() => Ok(()),
        };
        stage.close().await;
        said
    })
}

/// The swarm of a recording, and the time of its first message.
fn beginning(args: &Args) -> Result<(String, u64), Failure> {
    let (mut first, mut swarm) = (None, None);
    let condition = read(&mut open(&args.file)?, |recorded| {
        if Line::of(&recorded).is_some() {
            first.get_or_insert(recorded.at);
            swarm = swarm.take().or_else(|| recorded.channel.split('/').nth(2).map(str::to_owned));
        }
    })?;
    let swarm = condition.about.get(SWARM).cloned().or(swarm);
    match (swarm, first) {
        (Some(swarm), Some(first)) => Ok((swarm, first)),
        _ => Err(format!("{} holds nothing that a swarm said", args.file.display()).into()),
    }
}

/// Says line by line, each as long after the first as it was heard.
async fn say_all(args: &Args, stage: &mut Stage, first: u64) -> Result<(), Failure> {
    let (ahead, mut lines) = mpsc::channel(AHEAD);
    let mut file = open(&args.file)?;
    let reading = tokio::task::spawn_blocking(move || -> Result<Condition, ReadError> {
        read(&mut file, |recorded| {
            if let Some(line) = Line::of(&recorded) {
                // An error says that nothing more is to be said.
                let _ = ahead.blocking_send((recorded.at.saturating_sub(first), line));
            }
        })
    });
    let began = Instant::now();
    let mut said = 0_usize;
    while let Some((after, next)) = lines.recv().await {
        if args.speed > 0.0 {
            let after = Duration::from_nanos(after).as_secs_f64() / args.speed;
            // What is too far away for a timer is never reached.
            let after = Duration::try_from_secs_f64(after).unwrap_or(Duration::MAX);
            tokio::time::sleep_until(began.checked_add(after).unwrap_or(began + Duration::from_secs(86_400)))
                .await;
        }
        match next {
            Line::Say(topic, bytes) => stage.say(&topic, bytes).await?,
            Line::Present(robot, is_there) => stage.present(robot, is_there).await?,
        }
        said += 1;
    }
    tokio::time::sleep(LAST).await;
    let condition = reading.await??;
    let mut words = format!("{} said again", counted(said, "message"));
    words.extend(condition.remarks().iter().map(|remark| format!("; {remark}")));
    line(args.json, &json!({"event": "played", "messages": said}), &words)
}
