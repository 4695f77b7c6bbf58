//! Keeps a view true: asks the robots how they are, and hears what happens.

use std::sync::Arc;
use std::time::Duration;

use gestalt_link::{Answers, Client, LinkError, News};
use gestalt_protocol::{Announcement, Instruction, InstructorId, Status};
use tokio::sync::mpsc;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until};

use crate::asks::Ask;
use crate::known::Known;
use crate::view::{Input, View};

/// Robots are asked for their status this often; who takes longer to answer is asked again with the others.
const ASKED: Duration = Duration::from_secs(1);

/// Readers hear that the page is live this often.
const BEAT: Duration = Duration::from_secs(1);

/// What came within this time is shown together.
const TOGETHER: Duration = Duration::from_millis(60);

/// How long the swarm has to answer an instructor.
const ANSWER: Duration = Duration::from_secs(5);

/// How long it has to say that somebody may open no round: nothing else answers that.
const REFUSED: Duration = Duration::from_millis(500);

/// What is shown of a view, wherever that is.
pub(crate) trait Show {
    /// Something has changed.
    fn show(&self, view: &View, now: Duration);

    /// What is shown is live.
    fn beat(&self, now: Duration);
}

/// The ears of a desk.
pub(crate) struct Ears {
    pub client: Arc<Client>,
    pub news: News,
    pub answers: Answers,
}

impl Ears {
    pub async fn new(client: Client) -> Result<Self, LinkError> {
        let (news, answers) = (client.news().await?, client.answers().await?);
        Ok(Self { client: Arc::new(client), news, answers })
    }

    /// Follows the swarm until its session ends. Never waits for a reader, nor for an answer to one.
    pub async fn follow(
        mut self,
        known: &Known,
        board: &(impl Show + Sync),
        mut asks: mpsc::Receiver<Ask>,
        instructor: InstructorId,
    ) {
        let mut asked = Instant::now();
        let mut asking = Box::pin(ask(self.client.clone(), true));
        let mut resting = false;
        let mut beat = interval(BEAT);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut show_at: Option<Instant> = None;
        loop {
            let mut news = false;
            tokio::select! {
                heard = self.news.next() => match heard {
                    Some(heard) => news = known.hear(heard.into()),
                    None => break,
                },
                answered = self.answers.next() => match answered {
                    Some((by, answer)) => news = known.hear(Input::Answered(by, Box::new(answer))),
                    None => break,
                },
                answers = &mut asking, if !resting => {
                    let Ok((answers, last)) = answers else { break };
                    if let Some(last) = last {
                        known.hear(Input::Decided(Box::new(last)));
                    }
                    let count = answers.len();
                    for status in answers {
                        known.hear(Input::Status(Box::new(status)));
                    }
                    known.hear(Input::Asked(count));
                    (resting, news) = (true, true);
                }
                () = sleep_until(asked + ASKED), if resting => {
                    asked = Instant::now();
                    asking = Box::pin(ask(self.client.clone(), false));
                    resting = false;
                }
                ask = asks.recv() => match ask {
                    Some(ask) => drop(tokio::spawn(pass_on(self.client.clone(), instructor.clone(), ask))),
                    None => break,
                },
                _ = beat.tick() => board.beat(known.now()),
                () = sleep_until(show_at.unwrap_or_else(Instant::now)), if show_at.is_some() => {
                    show_at = None;
                    known.with(|view, now| board.show(view, now));
                }
            }
            if news {
                show_at.get_or_insert_with(|| Instant::now() + TOGETHER);
            }
        }
        tracing::warn!("the Zenoh session has ended: what is shown is no longer live");
    }
}

/// How all robots are; the first time, also what was decided last.
async fn ask(client: Arc<Client>, first: bool) -> Result<(Vec<Status>, Option<Announcement>), LinkError> {
    if first {
        tokio::try_join!(client.statuses(ASKED), client.last_decision(ASKED))
    } else {
        Ok((client.statuses(ASKED).await?, None))
    }
}

/// Says to the swarm what a reader said, and brings the answer back: of a request to open a round, a refusal.
async fn pass_on(client: Arc<Client>, instructor: InstructorId, ask: Ask) {
    let Ask { instruction, answer } = ask;
    let said = match instruction {
        Instruction::Open => {
            let answer = client.teach(&instructor, &instruction, REFUSED).await;
            answer.map(|answer| answer.filter(|answer| answer.outcome.is_refusal()))
        }
        _ => client.teach(&instructor, &instruction, ANSWER).await,
    };
    // An error says that the reader has gone, which is the reader's own business.
    let _ = answer.send(said.map_err(|error| error.to_string()));
}
