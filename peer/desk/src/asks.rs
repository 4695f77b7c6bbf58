//! Words of readers on their way to the swarm, and its answers on their way back.

use std::sync::Arc;

use gestalt_protocol::{Answer, Instruction};
use serde_json::{Value, json};
use thiserror::Error;
use tokio::sync::{Semaphore, mpsc, oneshot};

/// The longest word to the swarm, in bytes.
pub(crate) const MAX_WORD: usize = 4096;

/// How many words may wait for their answers.
const MAX_ASKING: usize = 8;

/// A word to the swarm, and where its answer goes: `None` when none came in time.
pub(crate) struct Ask {
    pub instruction: Instruction,
    pub answer: oneshot::Sender<Result<Option<Answer>, String>>,
}

/// Where words are handed in.
#[derive(Clone, Debug)]
pub(crate) struct Asks {
    queue: mpsc::Sender<Ask>,
    places: Arc<Semaphore>,
}

/// Why a word came to nothing.
#[derive(Debug, Error)]
pub(crate) enum Unsaid {
    #[error("too much is being said at a time: wait for an answer")]
    TooMuch,
    #[error("the session with the swarm has ended: start it again")]
    Lost,
    #[error("no robot has answered: see that one is running")]
    Unanswered,
    #[error("{0}")]
    Failed(String),
}

impl Asks {
    /// Where words are handed in, and where they come out.
    pub fn new() -> (Self, mpsc::Receiver<Ask>) {
        let (queue, asked) = mpsc::channel(MAX_ASKING);
        (Self { queue, places: Arc::new(Semaphore::new(MAX_ASKING)) }, asked)
    }

    /// Says it to the swarm. What comes of it, in words and as the swarm answered.
    pub async fn say(&self, instruction: Instruction) -> Result<Value, Unsaid> {
        let Ok(_place) = self.places.try_acquire() else { return Err(Unsaid::TooMuch) };
        let opens = instruction == Instruction::Open;
        let (answer, answered) = oneshot::channel();
        self.queue.send(Ask { instruction, answer }).await.map_err(|_| Unsaid::Lost)?;
        match answered.await.map_err(|_| Unsaid::Lost)? {
            Ok(Some(answer)) => Ok(json!({"words": answer.outcome.describe(), "answer": answer})),
            Ok(None) if opens => Ok(json!({"words": "asked all robots to look"})),
            Ok(None) => Err(Unsaid::Unanswered),
            Err(error) => Err(Unsaid::Failed(error)),
        }
    }
}
