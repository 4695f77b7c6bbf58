//! The rounds: one gesture after the other is shown, decided, and, where the robots learn, said.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gestalt_protocol::{Announcement, ClassId, Decision, Gesture, Instruction, InstructorId, RoundId};
use serde_json::json;

use super::super::Failure;
use super::super::show::{self, Names, line};
use super::{Args, By, SCHEDULE, Swarm, picture};
use crate::config::Config;
use crate::swarm::Tally;
use gestalt_vision::human::Human;

/// The name that the gestures' shower speaks under.
const INSTRUCTOR: &str = "gestalt-swarm";

/// How long to wait for the decision of a gesture: far beyond any deadline, and for some showings.
const PATIENCE: Duration = Duration::from_secs(30);

/// After so many gestures in a row that led to no decision, the swarm is given up.
const MOST_MISSED: u32 = 3;

/// What a round needs to be shown, and what it gives.
pub(super) struct Showing<'a> {
    args: &'a Args,
    configs: &'a [Config],
    names: &'a Names,
    swarm: &'a mut Swarm,
    tally: &'a mut Tally,
    person: Human,
    /// By how many robots the round of the picture was disputed, and one more; 0: there is no picture yet.
    most_disputed: usize,
}

impl<'a> Showing<'a> {
    pub(super) fn new(
        args: &'a Args,
        configs: &'a [Config],
        names: &'a Names,
        swarm: &'a mut Swarm,
        tally: &'a mut Tally,
    ) -> Self {
        Self { args, configs, names, swarm, tally, person: Human::new(args.seed), most_disputed: 0 }
    }

    /// Shows all gestures. What came of each is in the tally at once, so that nothing is lost when this is dropped.
    pub(super) async fn all(&mut self) -> Result<(), Failure> {
        let mut missed = 0;
        for round in 0..self.args.rounds {
            if round > 0 && self.args.by == By::Instructor {
                tokio::time::sleep(self.args.pause).await;
            }
            let Some(announcement) = self.next_decision().await? else {
                missed += 1;
                self.miss()?;
                if missed == MOST_MISSED {
                    return Err(format!(
                        "{missed} gestures in a row were missed: is this machine overloaded?"
                    )
                    .into());
                }
                continue;
            };
            missed = 0;
            self.take(&announcement).await?;
        }
        if let Some(path) = self.args.picture.as_ref().filter(|_| self.most_disputed > 0) {
            let words = format!("what each robot saw: {}", path.display());
            line(self.args.json, &json!({"event": "picture", "file": path}), &words)?;
        }
        Ok(())
    }

    /// Has a round opened, or waits until the robots open one; `None` when none is decided.
    async fn next_decision(&mut self) -> Result<Option<Announcement>, Failure> {
        let Swarm { client, news, .. } = &mut *self.swarm;
        let before = news.newest();
        match self.args.by {
            By::Instructor => {
                let instructor: InstructorId = INSTRUCTOR.parse()?;
                super::super::open_round(client, news, &instructor, before, PATIENCE).await
            }
            By::Motion => super::super::next_decision(news, before, PATIENCE).await,
        }
    }

    /// Counts a gesture that led to no decision.
    fn miss(&mut self) -> Result<(), Failure> {
        self.tally.miss();
        let words = match self.args.by {
            By::Instructor => format!("✗ no decision within {PATIENCE:?}: is this machine overloaded?"),
            By::Motion => {
                format!("✗ no robot detected the gesture within {PATIENCE:?} (no round was opened)")
            }
        };
        line(self.args.json, &json!({"event": "missed", "seconds": PATIENCE.as_secs()}), &words)
    }

    /// Counts, reports and teaches what was decided.
    async fn take(&mut self, announcement: &Announcement) -> Result<(), Failure> {
        let decision = &announcement.decision;
        let shown = match self.args.by {
            By::Instructor => self.person.shows(decision.round).gesture,
            By::Motion => self.person.last_shown(opened(decision), &SCHEDULE),
        };
        let truth = shown.map(|fingers| ClassId(fingers.into())).ok_or("no gesture was shown")?;
        self.tally.record(truth, decision);
        // The others hold it a moment after the first; what was not held by then is said to be so.
        tokio::time::sleep(Duration::from_millis(300)).await;
        let held = self.swarm.news.holding(decision.round);
        let holding = held.iter().filter(|(_, held)| held.class == decision.class).count();
        let right = decision.class == Some(truth);
        line(
            self.args.json,
            &json!({"event": "decision", "shown": truth, "right": right, "holding": holding, "decision": announcement}),
            &format!(
                "{} shown {} · {} · held by {holding} of {}",
                if right { "✓" } else { "✗" },
                self.names.gesture(truth, &decision.certificate),
                show::announced(announcement, self.names),
                self.configs.len()
            ),
        )?;
        if let Some(path) = &self.args.picture {
            let bodies = self.swarm.members.bodies();
            let disputed = 1 + picture::dissenters(bodies, decision);
            if disputed > self.most_disputed {
                self.most_disputed = disputed;
                picture::draw(path, self.configs, bodies, decision, truth)?;
            }
        }
        let was = Instruction::Was { round: decision.round, class: Gesture::Class(truth) };
        if self.args.learn.is_some() {
            self.teach(decision.round, &was).await?;
        } else if self.args.record.is_some() {
            // Nobody learns it, but the recording says what was shown.
            self.swarm.client.instruct(&INSTRUCTOR.parse()?, &was).await?;
        }
        Ok(())
    }

    /// Says what the gesture was, and waits until that is learned.
    async fn teach(&self, round: RoundId, was: &Instruction) -> Result<(), Failure> {
        const PATIENCE: Duration = Duration::from_secs(10);
        let instructor: InstructorId = INSTRUCTOR.parse()?;
        let answer = self.swarm.client.teach(&instructor, was, PATIENCE).await?;
        let answer =
            answer.ok_or_else(|| format!("no robot answered the feedback on round {}", round.counter))?;
        let words = format!("  feedback: {}", answer.outcome.describe());
        line(self.args.json, &json!({"event": "taught", "answer": answer}), &words)
    }
}

/// When the round of a decision that was announced just now was opened, since 1970.
fn opened(decision: &Decision) -> Duration {
    // Decisions are left a while to meet before one is announced.
    const SETTLED: Duration = Duration::from_millis(300);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    now.saturating_sub(SETTLED + Duration::from_millis(decision.certificate.elapsed_ms.into()))
}
