//! `gestalt teach`: a person at a keyboard teaches a running swarm.

mod about;

use std::io::BufRead;
use std::pin::pin;
use std::time::{Duration, Instant};

use gestalt_protocol::{
    Answer, Ask, ClassId, Decision, Gesture, Instruction, InstructorId, MAX_LABEL, Outcome, Question, RoundId,
};
use serde_json::json;
use tokio::sync::mpsc;

use self::about::{About, Typed};
use super::config_args::ConfigArgs;
use super::show::{self, Names, line};
use super::{Failure, interrupted};
use gestalt_desk::Word;
use gestalt_link::{Client, Heard, News};
use gestalt_vision::vocabulary::{GestureBook, ReadyGesture};

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
        Some(_) if args.round.is_some() => {
            return Err("--round goes with one gesture, not with --vocabulary".into());
        }
        Some(name) if words == ["new"] => Some(GestureBook::find(name)?),
        Some(_) => return Err("--vocabulary goes with 'new', and without a label".into()),
        None => None,
    };
    if let Some(book) = &book {
        check_names(book)?;
    }
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
            // Of a line in another encoding the words can be read that are in this one.
            for line in std::io::stdin().lock().split(b'\n').map_while(Result::ok) {
                if lines.blocking_send(String::from_utf8_lossy(&line).into_owned()).is_err() {
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
                Ok(Typed::Answer(question, gesture)) => self.answer(&question, gesture).await,
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

    /// Says which gesture the swarm asked for. Where it asked for the name of a new one, and knows none of that name, it is named so.
    async fn answer(&mut self, question: &Question, gesture: Gesture) -> Result<(), Failure> {
        let round = question.round;
        let answer = self.ask(&Instruction::Was { round, class: gesture.clone() }).await?;
        match (&question.ask, gesture) {
            (Ask::Name { .. }, Gesture::Label(label)) if answer.outcome == Outcome::UnknownGesture => {
                self.name(&label, Some(round)).await?;
            }
            _ => self.heeded(&answer)?,
        }
        self.about.settle(round);
        Ok(())
    }

    /// Names the gestures of a vocabulary one by one, and then has each shown as often as wished: what fails is said, and the next is shown.
    async fn name_all(&mut self, book: GestureBook) -> Result<(), Failure> {
        let mut named = Vec::new();
        for gesture in book.gestures {
            if self.args.shows == 0 {
                self.explain(&gesture);
            }
            let class = self.name(&gesture.name, None).await?;
            named.push((gesture, class));
        }
        if self.args.shows == 0 {
            return Ok(());
        }
        let (all, mut missed) = (named.len(), 0);
        for (gesture, class) in named {
            self.explain(&gesture);
            if let Err(error) = self.show(&gesture.name, class).await {
                eprintln!("{}: {}", show::quoted(&gesture.name), show::clean(&error.to_string()));
                missed += 1;
            }
        }
        if missed > 0 {
            return Err(format!("all are named, but {missed} of {all} were not shown to the end").into());
        }
        Ok(())
    }

    fn explain(&self, gesture: &ReadyGesture) {
        if !self.args.json {
            let [name, meaning, show] =
                [&gesture.name, &gesture.meaning, &gesture.show].map(|words| show::clean(words));
            eprintln!("{name}: {meaning} {show}");
        }
    }

    /// Names a gesture, and gives its class; then says that a round showed it, if one did. In this order: of that round somebody else may have
    /// the first word, or nobody know it, and the gesture is named all the same.
    async fn name(&mut self, label: &str, round: Option<RoundId>) -> Result<ClassId, Failure> {
        if !(1..=MAX_LABEL).contains(&label.len()) || label.chars().any(char::is_control) {
            return Err(
                format!("a gesture's name has 1 to {MAX_LABEL} bytes, and no control characters").into()
            );
        }
        let named = self.tell(&Instruction::New { label: label.to_owned(), round: None }).await?;
        let class = named.class.ok_or_else(|| named.outcome.describe())?;
        if round.is_some() {
            let shown = self.tell(&Instruction::New { label: label.to_owned(), round }).await;
            shown.map_err(|error| format!("{} is named, but {error}", show::quoted(label)))?;
        }
        Ok(class)
    }

    /// Has a gesture shown as often as wished.
    async fn show(&mut self, label: &str, class: ClassId) -> Result<(), Failure> {
        for show in 1..=self.args.shows {
            if !self.args.json {
                eprintln!(
                    "Show {} now, {show} of {}, a little otherwise each time.",
                    show::quoted(label),
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
        if let Word::New(label) = &word {
            let class = self.name(label, self.args.round).await?;
            return self.show(label, class).await;
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
        self.heeded(&answer)?;
        Ok(answer)
    }

    /// An error says why a word changed nothing that was to change something.
    fn heeded(&self, answer: &Answer) -> Result<(), Failure> {
        match why_not(answer) {
            Some(why) => Err(why.into()),
            None if answer.outcome.is_refusal() => Err(show::answer(answer, &self.names).into()),
            None => Ok(()),
        }
    }

    /// Says it to the swarm, and prints the answer, unless it is in words and says that nothing came of it.
    async fn ask(&mut self, instruction: &Instruction) -> Result<Answer, Failure> {
        let timeout = self.args.timeout;
        // Also what nobody answers may have arrived.
        self.about.say(instruction);
        let answer = self.client.teach(&self.args.instructor, instruction, timeout).await?;
        let answer = answer.ok_or_else(|| unanswered("answer", timeout))?;
        if answer.looks_like.is_some() && !self.args.json {
            self.names = Names::reported(&self.client.statuses(super::ANSWER).await?);
        }
        if self.args.json || !answer.outcome.is_refusal() && why_not(&answer).is_none() {
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
        let decided = decided.ok_or_else(|| unanswered("decision", timeout))?;
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

/// What a word comes to that nobody answers. Of a word whose count is not above the last one's of its key robots say nothing.
pub(super) fn unanswered(what: &str, within: Duration) -> String {
    format!(
        "no {what} within {within:?}: is a robot running? (gestalt watch --status) In a sealed swarm it may be that this key was last used by a clock \
         that is ahead of this one's (refused_word_repeated)"
    )
}

/// Why a word changed nothing, where an answer in short says something else.
fn why_not(answer: &Answer) -> Option<String> {
    match (&answer.to, answer.outcome) {
        (Instruction::Retract { round }, Outcome::Known) => {
            Some(format!("round {}: you have said nothing of it, or have taken that back", round.counter))
        }
        (
            Instruction::Same { class, .. } | Instruction::Retire { class } | Instruction::Restore { class },
            Outcome::NotAllowed,
        ) => Some(format!(
            "{class}: {}; or somebody whose clock is ahead has spoken of it, whose word stands until yours is later",
            answer.outcome.describe()
        )),
        _ => None,
    }
}

/// An error names the gesture of a vocabulary that a swarm would not name so, before any is named.
fn check_names(book: &GestureBook) -> Result<(), Failure> {
    let is_somebodys = |name: &str| {
        let whose = name.strip_suffix(')').and_then(|name| name.rsplit_once(" ("));
        whose.is_some_and(|(_, whose)| whose.parse::<InstructorId>().is_ok())
    };
    match book.gestures.iter().find(|gesture| is_somebodys(&gesture.name)) {
        Some(gesture) => Err(format!(
            "{} ends as the name of somebody's gesture does: choose one that does not end in '(INSTRUCTOR)'; nothing was named",
            show::quoted(&gesture.name)
        )
        .into()),
        None => Ok(()),
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

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;

    #[test]
    fn what_changed_nothing_is_said_as_what_it_is() {
        let answer = |to, outcome| Answer {
            robot: RobotId(1),
            at: 1,
            to,
            outcome,
            class: None,
            looks_like: None,
            samples: 0,
        };
        let round: RoundId = "3@2-3f9a01c7".parse().unwrap();
        let undo = Instruction::Retract { round };
        assert_eq!(why_not(&answer(undo.clone(), Outcome::Learned)), None);
        let nothing = why_not(&answer(undo, Outcome::Known)).unwrap();
        assert!(nothing.starts_with("round 3: you have said nothing of it"), "{nothing}");
        let retire = Instruction::Retire { class: Gesture::Label("square".to_owned()) };
        assert_eq!(why_not(&answer(retire.clone(), Outcome::Known)), None);
        let outranked = why_not(&answer(retire, Outcome::NotAllowed)).unwrap();
        assert!(outranked.contains("'square'") && outranked.contains("clock is ahead"), "{outranked}");
    }

    #[test]
    fn a_vocabulary_with_a_name_that_the_swarm_refuses_is_refused_before_anything_is_named() {
        let book = |name: &str| {
            let gesture = |name: &str| format!("{{name: '{name}', meaning: 'm', show: 's'}}");
            let text = format!("{{title: 't', gestures: [{}, {}]}}", gesture("fist"), gesture(name));
            GestureBook::parse(&text, "mine").unwrap()
        };
        let refused = check_names(&book("ok (left)")).unwrap_err().to_string();
        assert!(refused.contains("\"ok (left)\""), "{refused}");
        for fine in ["ok", "(left)", "ok (by the left)"] {
            assert!(check_names(&book(fine)).is_ok(), "{fine}");
        }
    }
}
