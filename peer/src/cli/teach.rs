//! `gestalt teach`: a human at a keyboard teaches a running swarm.

use std::io::BufRead;
use std::time::Duration;

use gestalt_protocol::{ClassId, Gesture, Instruction, InstructorId, RoundId};
use serde_json::json;
use tokio::sync::mpsc;

use super::config_args::ConfigArgs;
use super::show::{self, line};
use super::{Failure, interrupted};
use gestalt_link::{Client, News};

/// Teaches a swarm what its last gesture was.
///
/// With a word, says it and ends. Without, reads words from the keyboard, one a line, until `quit`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// `open`: look now. `was GESTURE`: it was that one. `right`, `wrong`: about the decision. `undo`: I said nothing
    #[arg(value_name = "WORD")]
    words: Vec<String>,

    /// The round it is about, as `5@2`; the last decided one if left out
    #[arg(long)]
    round: Option<RoundId>,

    /// The name to speak under
    #[arg(long, default_value = "console")]
    instructor: InstructorId,

    /// How long to wait for a decision or an answer
    #[arg(long, default_value = "15s", value_parser = super::duration)]
    patience: Duration,

    /// Print decisions and answers as one JSON object a line
    #[arg(long)]
    json: bool,
}

/// What a line from the keyboard says.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Word {
    Open,
    Was(Gesture),
    Right,
    Wrong,
    Undo,
    Quit,
}

impl Word {
    fn read(words: &[&str]) -> Result<Self, String> {
        match words {
            ["open"] => Ok(Self::Open),
            ["right"] => Ok(Self::Right),
            ["wrong"] => Ok(Self::Wrong),
            ["undo"] => Ok(Self::Undo),
            ["quit" | "exit"] => Ok(Self::Quit),
            // A bare number may be the label of a gesture, and mostly is.
            ["was", gesture] => Ok(Self::Was(Gesture::Label((*gesture).to_owned()))),
            ["class", number] => number
                .parse()
                .map(|class| Self::Was(Gesture::Class(ClassId(class))))
                .map_err(|_| format!("'{number}' is no class: write its number, like 'class 3'")),
            other => Err(format!(
                "'{}' means nothing here: say 'open', 'was GESTURE', 'class NUMBER', 'right', 'wrong', 'undo' or 'quit'",
                other.join(" ")
            )),
        }
    }

    fn about(self, round: RoundId) -> Option<Instruction> {
        match self {
            Self::Was(class) => Some(Instruction::Was { round, class }),
            Self::Right => Some(Instruction::Right { round }),
            Self::Wrong => Some(Instruction::Wrong { round }),
            Self::Undo => Some(Instruction::Retract { round }),
            Self::Open | Self::Quit => None,
        }
    }
}

/// Runs the verb.
///
/// # Errors
/// When no robot is reached, none answers, or a word means nothing.
pub fn run(args: &Args) -> Result<(), Failure> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    let word = if words.is_empty() { None } else { Some(Word::read(&words)?) };
    let (swarm, link) = args.config.client()?;
    super::runtime()?.block_on(async {
        let client = Client::open(&swarm, &link).await?;
        let news = client.news().await?;
        let last = client.last_decision(super::ANSWER).await?.map(|last| last.decision.round);
        let mut lesson = Lesson { args, client, news, last: args.round.or(last) };
        let said = match word {
            Some(word) => lesson.say(word).await,
            None => lesson.converse().await,
        };
        lesson.client.close().await;
        said
    })
}

struct Lesson<'a> {
    args: &'a Args,
    client: Client,
    news: News,
    /// The round that words are about.
    last: Option<RoundId>,
}

impl Lesson<'_> {
    /// Takes words from the keyboard until there are no more.
    async fn converse(&mut self) -> Result<(), Failure> {
        let (lines, mut keyboard) = mpsc::channel(16);
        // Reading from a terminal cannot be broken off, so it has a thread that ends with the program.
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if lines.blocking_send(line).is_err() {
                    break;
                }
            }
        });
        loop {
            let typed = tokio::select! {
                () = interrupted() => return Ok(()),
                typed = keyboard.recv() => match typed {
                    Some(typed) => typed,
                    None => return Ok(()),
                },
            };
            let words: Vec<&str> = typed.split_whitespace().collect();
            if words.is_empty() {
                continue;
            }
            let said = match Word::read(&words) {
                Ok(Word::Quit) => return Ok(()),
                Ok(word) => self.say(word).await,
                Err(error) => Err(error.into()),
            };
            if let Err(error) = said {
                eprintln!("{error}");
            }
        }
    }

    async fn say(&mut self, word: Word) -> Result<(), Failure> {
        if word == Word::Open {
            return self.open().await;
        }
        let round =
            self.last.ok_or("no round was decided yet: say 'open' first, or name one with --round")?;
        let Some(instruction) = word.about(round) else { return Ok(()) };
        let patience = self.args.patience;
        let answer = self.client.teach(&self.args.instructor, &instruction, patience).await?;
        let answer = answer.ok_or_else(|| format!("no answer within {patience:?}: is a robot alive?"))?;
        let samples = match (&instruction, answer.samples) {
            (Instruction::Retract { .. }, 0) => "what was seen in it counts for nothing now".to_owned(),
            (_, samples) => format!("robot {} learns from {samples} samples of it", answer.robot),
        };
        let words = format!("round {round}: {}; {samples}", answer.outcome.describe());
        line(self.args.json, &json!({"event": "answer", "answer": answer}), &words)
    }

    async fn open(&mut self) -> Result<(), Failure> {
        let before = self.news.newest().max(self.last.map(|round| round.counter));
        let (instructor, patience) = (&self.args.instructor, self.args.patience);
        let decided = super::open_round(&self.client, &mut self.news, instructor, before, patience).await?;
        let decided = decided.ok_or_else(|| format!("no decision within {patience:?}: is a robot alive?"))?;
        self.last = Some(decided.decision.round);
        line(
            self.args.json,
            &json!({"event": "decision", "decision": decided}),
            &show::decision(&decided.decision, decided.label.as_deref()),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_people_type_them() {
        let read = |text: &str| Word::read(&text.split_whitespace().collect::<Vec<_>>());
        assert_eq!(read("was 3"), Ok(Word::Was(Gesture::Label("3".to_owned()))));
        assert_eq!(read("class 3"), Ok(Word::Was(Gesture::Class(ClassId(3)))));
        assert_eq!(read(" undo "), Ok(Word::Undo));
        for wrong in ["it was 3", "class x", "was", "class 300"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
