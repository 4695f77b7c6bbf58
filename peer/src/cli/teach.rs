//! `gestalt teach`: a person at a keyboard teaches a running swarm.

mod about;

use std::io::BufRead;
use std::pin::pin;
use std::time::{Duration, Instant};

use gestalt_protocol::{
    Answer, Ask, ClassId, Decision, Gesture, Instruction, InstructorId, MAX_LABEL, Question, RoundId,
};
use serde_json::json;
use tokio::sync::mpsc;

use self::about::{About, Typed};
use super::config_args::ConfigArgs;
use super::show::{self, Names, line};
use super::{Failure, interrupted};
use gestalt_desk::Word;
use gestalt_link::{Client, Heard, News};
use gestalt_vision::vocabulary::GestureBook;

/// The time to hold the hand otherwise, and longer than robots take requests for copies of one.
const BETWEEN_SHOWS: Duration = Duration::from_secs(1);

/// Give a swarm feedback on its decisions
///
/// With a command, sends it and exits. Without one, reads commands from the keyboard, one per line, until `quit`, and shows what the swarm asks: a line that
/// is no command, but a gesture's name, answers it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt teach open -e tcp/192.168.1.5:7447
  gestalt teach new circle --shows 5")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// `open`: start a round. `was GESTURE`: it was that gesture. `right`, `wrong`: the decision was. `undo`: withdraw my
    /// last feedback. `new LABEL`: name a gesture that the swarm does not know yet. `same GESTURE as GESTURE`: the first is the
    /// second. `retire GESTURE`, `restore GESTURE`: it is shown no more, or again
    #[arg(value_name = "COMMAND")]
    words: Vec<String>,

    /// Round the feedback is about, such as `5@2-3f9a01c7` (counter@opener-life) [default: the last one decided]
    #[arg(long)]
    round: Option<RoundId>,

    /// After `new`: show it so many times now, each in a round of its own
    #[arg(long, default_value_t = 0, value_name = "TIMES", value_parser = clap::value_parser!(u32).range(0..=100))]
    shows: u32,

    /// After `new`, in place of a label: name each gesture of a ready vocabulary (spatial, rescue), or of one in a file
    #[arg(long, value_name = "NAME|FILE")]
    vocabulary: Option<String>,

    /// Instructor name
    #[arg(long, default_value = "console")]
    instructor: InstructorId,

    /// How long to wait for a decision or an answer
    #[arg(long, alias = "patience", default_value = "15s", value_name = "DURATION", value_parser = super::duration)]
    timeout: Duration,

    /// Print decisions and answers as JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When no robot is reached, none answers, a word means nothing, or it is refused.
pub fn run(args: &Args) -> Result<(), Failure> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    let book = match &args.vocabulary {
        Some(name) if words == ["new"] => Some(GestureBook::find(name)?),
        Some(_) => return Err("--vocabulary goes with 'new', and without a label".into()),
        None => None,
    };
    let word = if words.is_empty() || book.is_some() { None } else { Some(Word::read(&words)?) };
    if args.shows > 0 && book.is_none() && !matches!(word, Some(Word::New(_))) {
        return Err("--shows goes with 'new LABEL'".into());
    }
    let (swarm, link) = args.config.client()?;
    super::runtime()?.block_on(async {
        let client = Client::open(&swarm, &link).await?;
        let news = client.news().await?;
        let last = client.last_decision(super::ANSWER).await?;
        if let Some(last) = &last {
            news.know(last.decision.round);
        }
        let about = About::new(args.round, last.as_ref().map(|last| &last.decision));
        let mut lesson = Lesson { args, client, news, about, names: Names::default() };
        let said = match (word, book) {
            (_, Some(book)) => lesson.name_all(book).await,
            (Some(Word::New(label)), _) => lesson.name(label).await,
            (Some(word), _) => lesson.say(word).await,
            (None, None) => lesson.converse().await,
        };
        lesson.client.close().await;
        said
    })
}

struct Lesson<'a> {
    args: &'a Args,
    client: Client,
    news: News,
    about: About,
    names: Names,
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
        let mut interrupted = pin!(interrupted());
        loop {
            let typed = tokio::select! {
                // What was heard before a line was typed is what the line is about.
                biased;
                () = &mut interrupted => return Ok(()),
                heard = self.news.next() => match heard {
                    Some(Heard::Asked(question)) => {
                        self.hear_question(question)?;
                        continue;
                    }
                    Some(Heard::Decided(decided)) => {
                        self.hear(&decided.decision);
                        continue;
                    }
                    Some(_) => continue,
                    None => return Err("the session with the swarm has ended".into()),
                },
                typed = keyboard.recv() => match typed {
                    Some(typed) => typed,
                    None => return Ok(()),
                },
            };
            let words: Vec<&str> = typed.split_whitespace().collect();
            if words.is_empty() {
                continue;
            }
            let said = match self.about.read(Instant::now(), &words) {
                Ok(Typed::Word(Word::Quit)) => return Ok(()),
                Ok(Typed::Word(word)) => self.say(word).await,
                Ok(Typed::Answer(question, label)) => {
                    self.say_of(question.round, None, Word::Was(Gesture::Label(label))).await
                }
                Ok(Typed::Neither) => {
                    line(self.args.json, &json!({"event": "neither"}), "which one, then? Or nothing.")
                }
                Err(error) => Err(error.into()),
            };
            if let Err(error) = said {
                eprintln!("{}", show::clean(&error.to_string()));
            }
        }
    }

    /// Names the gestures of a vocabulary one by one.
    async fn name_all(&mut self, book: GestureBook) -> Result<(), Failure> {
        for gesture in book.gestures {
            if !self.args.json {
                let [name, meaning, show] =
                    [&gesture.name, &gesture.meaning, &gesture.show].map(|words| show::clean(words));
                eprintln!("{name}: {meaning} {show}");
            }
            self.name(gesture.name).await?;
        }
        Ok(())
    }

    /// Names a gesture, and has it shown as often as wished.
    async fn name(&mut self, label: String) -> Result<(), Failure> {
        if !(1..=MAX_LABEL).contains(&label.len()) || label.chars().any(char::is_control) {
            return Err(
                format!("a gesture's name has 1 to {MAX_LABEL} bytes, and no control characters").into()
            );
        }
        let named = self.ask(&Instruction::New { label: label.clone(), round: self.args.round }).await?;
        let Some(class) = named.class else { return Err(named.outcome.describe().into()) };
        if named.outcome.is_refusal() {
            eprintln!("{} is named, but of that round: {}", show::quoted(&label), named.outcome.describe());
        }
        for show in 1..=self.args.shows {
            if !self.args.json {
                eprintln!(
                    "Show {} now, {show} of {}, a little otherwise each time.",
                    show::quoted(&label),
                    self.args.shows
                );
            }
            let round = self.open().await?;
            self.tell(&Instruction::Was { round, class: Gesture::Class(class) }).await?;
            tokio::time::sleep(BETWEEN_SHOWS).await;
        }
        Ok(())
    }

    fn hear(&mut self, decision: &Decision) {
        self.about.hear(decision, self.news.is_newest(decision.round));
    }

    fn hear_question(&mut self, question: Question) -> Result<(), Failure> {
        if !self.about.ask(Instant::now(), &question) {
            return Ok(());
        }
        let words = format!("{}\n{}", show::question(&question), how_to_answer(&question.ask));
        line(self.args.json, &json!({"event": "question", "question": question}), &words)
    }

    async fn say(&mut self, word: Word) -> Result<(), Failure> {
        if word == Word::Open {
            return self.open().await.map(|_| ());
        }
        if let Some(instruction) = word.of_names(self.args.round) {
            return self.tell(&instruction).await.map(|_| ());
        }
        let (round, decided) = self
            .about
            .of(&word)
            .ok_or("no round has been decided yet: open one with 'open', or name one with --round")?;
        self.say_of(round, decided, word).await
    }

    async fn say_of(&mut self, round: RoundId, decided: Option<ClassId>, word: Word) -> Result<(), Failure> {
        let Some(instruction) = word.about(round, decided)? else { return Ok(()) };
        self.tell(&instruction).await.map(|_| ())
    }

    /// Says it to the swarm, and prints the answer. A refusal is an error.
    async fn tell(&mut self, instruction: &Instruction) -> Result<Answer, Failure> {
        let answer = self.ask(instruction).await?;
        if answer.outcome.is_refusal() {
            return Err(show::answer(&answer, &self.names).into());
        }
        Ok(answer)
    }

    /// Says it to the swarm, and prints the answer, unless it is a refusal in words.
    async fn ask(&mut self, instruction: &Instruction) -> Result<Answer, Failure> {
        let timeout = self.args.timeout;
        // Also what nobody answers may have arrived.
        self.about.say(instruction);
        let answer = self.client.teach(&self.args.instructor, instruction, timeout).await?;
        let answer = answer.ok_or_else(|| format!("no answer within {timeout:?}: is a robot running?"))?;
        if answer.looks_like.is_some() && !self.args.json {
            self.names = Names::reported(&self.client.statuses(super::ANSWER).await?);
        }
        if self.args.json || !answer.outcome.is_refusal() {
            let words = show::answer(&answer, &self.names);
            line(self.args.json, &json!({"event": "answer", "answer": answer}), &words)?;
        }
        Ok(answer)
    }

    /// Has a round opened, and shows what is decided; says which it was.
    async fn open(&mut self) -> Result<RoundId, Failure> {
        let before = self.news.newest();
        let (instructor, timeout) = (&self.args.instructor, self.args.timeout);
        let decided = super::open_round(&self.client, &mut self.news, instructor, before, timeout).await?;
        let decided = decided.ok_or_else(|| {
            format!("no decision within {timeout:?}: is a robot running? (gestalt watch --status)")
        })?;
        self.hear(&decided.decision);
        if !self.args.json && !self.names.cover(&decided.decision) {
            self.names = Names::reported(&self.client.statuses(super::ANSWER).await?);
        }
        line(
            self.args.json,
            &json!({"event": "decision", "decision": decided}),
            &show::announced(&decided, &self.names),
        )?;
        Ok(decided.decision.round)
    }
}

/// What to type.
fn how_to_answer(ask: &Ask) -> &'static str {
    match ask {
        Ask::Between { .. } => "type the gesture, or neither; or nothing",
        Ask::Again { .. } => "type open and show it again, or its name; or nothing",
        Ask::Name { .. } => "type its name, or nothing",
    }
}
