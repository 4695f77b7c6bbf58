//! Asks robots that say nothing whether they are there.
//!
//! The news that a robot is gone can be lost in Zenoh for good, at one router and so at all that hang on it: its liveliness
//! token is then found by every query (of 301 robots in cells the 12 or 33 of one cell, in two runs of six). Only who is there answers.

use std::time::{Duration, Instant};

use gestalt_protocol::{Keys, RobotId, Topic};
use tokio::task::JoinSet;
use tokio::time::sleep;
use zenoh::Session;
use zenoh::sample::Locality;

use crate::inbox::Inbox;
use crate::presence::BRIEFLY;
use crate::session::Node;

/// How often it is looked who says nothing.
const LOOK: Duration = Duration::from_secs(10);

/// Who said nothing for twice as long, though others spoke within it, is asked also where nobody is known to be lost.
const LULL: Duration = Duration::from_secs(60);

/// How many are asked at a time, and how long after their answers the next; in a swarm of so many robots more, the same time later.
const AT_A_TIME: usize = 4;
const NEXT: Duration = Duration::from_millis(500);
const MANY: u32 = 100;

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Asks those who say nothing, twice: who does not answer counts no more as alive. Never returns.
pub(crate) async fn ask_the_silent(node: &Node, keys: &Keys, inbox: &Inbox) {
    let mut since = Instant::now();
    loop {
        sleep(LOOK).await;
        let began = Instant::now();
        let mut silent = inbox.suspects(since, LULL);
        since = began;
        let robots = u32::try_from(inbox.tokens().len()).unwrap_or(u32::MAX);
        let next = NEXT + NEXT * (robots / MANY);
        for _ in 0..2 {
            for some in silent.chunks(AT_A_TIME) {
                let mut asked: JoinSet<Option<RobotId>> =
                    some.iter().map(|robot| ask(node.session().clone(), keys, *robot)).collect();
                while let Some(answered) = asked.join_next().await {
                    answered.ok().flatten().into_iter().for_each(|robot| inbox.on_sign(robot));
                }
                sleep(next).await;
            }
            silent.retain(|robot| !inbox.was_heard(*robot, began));
        }
        silent.into_iter().for_each(|robot| inbox.on_silence(robot, began));
    }
}

/// The robot, if it answers, or cannot be asked.
fn ask(
    session: Session,
    keys: &Keys,
    robot: RobotId,
) -> impl Future<Output = Option<RobotId>> + Send + 'static {
    let key = format!("{}?{BRIEFLY}", keys.key(&Topic::Status(robot)));
    async move {
        let asked = session.get(key).timeout(PATIENCE).allowed_destination(Locality::Remote).await;
        let Ok(answers) = asked else { return Some(robot) };
        while let Ok(answer) = answers.recv_async().await {
            if answer.result().is_ok() {
                return Some(robot);
            }
        }
        None
    }
}
