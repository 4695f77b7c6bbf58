//! What a robot makes of what the others say: of their votes, their decisions, and the rounds that these are about.

use std::cmp::Ordering;

use gestalt_protocol::{Certificate, Decision, Envelope, Message, RobotId, RoundId, Stamp, Vote};

use super::rounds::{Effects, Rounds};
use crate::ballot::{Cast, Scale};
use crate::refusal::Refusal;
use crate::round::Round;

/// A round this many counters ahead of the newest known is refused: nobody shows a million gestures unnoticed.
const MAX_LEAP: u32 = 1_000_000;

impl Rounds {
    pub(super) fn on_received(&mut self, envelope: Envelope, effects: &mut Effects<'_>) {
        let Envelope { author, stamp, message } = envelope;
        if author == self.me {
            // The own words may come back; words never said are another's.
            if stamp.boot != self.stamp.boot || stamp > self.stamp {
                self.meet_duplicate(stamp);
            }
            return;
        }
        match message {
            Message::Vote(vote) => {
                self.hear_vote(author, stamp, vote, effects);
            }
            Message::Have(have) => self.on_have(author, &have, effects),
            Message::Give(give) => self.on_give(author, give, effects),
            // Whoever follows the rounds to learn from them takes these in.
            Message::Samples(_) | Message::Know(_) | Message::Lessons(_) => {}
        }
    }

    pub(super) fn on_heard(&mut self, robot: RobotId, decision: Decision, effects: &mut Effects<'_>) {
        if robot != self.me {
            self.hear_decision(Some(robot), decision, effects);
        }
    }

    pub(super) fn on_announced(&mut self, decision: Decision, effects: &mut Effects<'_>) {
        let (id, class) = (decision.round, decision.class);
        self.hear_decision(None, decision, effects);
        if self.is_this_round(id)
            && let Some(round) = &mut self.round
        {
            round.agreement.note_announced(self.now, class);
        }
    }

    /// Whether that is a name of the newest round known: its own, or that of a round that was opened at the same time, as far as
    /// can be told. Equal counters alone do not say so: where memories were lost or the swarm was cut, they belong to other showings.
    pub(super) fn is_this_round(&self, id: RoundId) -> bool {
        let opened_at_once = |round: &Round| {
            round.id.counter == id.counter && self.now <= round.since.saturating_add(self.config.deadline)
        };
        self.round.as_ref().is_some_and(|round| round.id == id || opened_at_once(round))
    }

    /// Where a round that was heard of stands to the newest one known; refuses one too far ahead. Rounds opened at the same time
    /// merge here, on the smaller name; of others with equal counters, the greater name is the newer, for all alike.
    pub(super) fn place(&mut self, id: RoundId, effects: &mut Effects<'_>) -> Option<Ordering> {
        if self.highest.is_some_and(|highest| id.counter > highest.saturating_add(MAX_LEAP)) {
            self.refusals.add(Refusal::FarAhead);
            return None;
        }
        self.highest = self.highest.max(Some(id.counter));
        let this = self.is_this_round(id);
        let Some(round) = &mut self.round else { return Some(Ordering::Greater) };
        if !this {
            return Some(id.cmp(&round.id));
        }
        if round.id != id {
            effects.follower.merged(round.id, id);
            round.id = round.id.min(id);
        }
        Some(Ordering::Equal)
    }

    /// Counts a robot's vote, by whichever way it came. Says whether it was news.
    pub(super) fn hear_vote(
        &mut self,
        robot: RobotId,
        stamp: Stamp,
        vote: Vote,
        effects: &mut Effects<'_>,
    ) -> bool {
        if robot == self.me {
            // From an earlier life it is merely old.
            if stamp > self.stamp {
                self.meet_duplicate(stamp);
            }
            return false;
        }
        if vote.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return false;
        }
        let scale = Scale { vocabulary: vote.vocabulary, classes: vote.evidence.len() };
        if !vote.evidence.is_empty() && self.is_foreign(scale) {
            self.refusals.add(Refusal::Vocabulary);
            return false;
        }
        match self.place(vote.round, effects) {
            None | Some(Ordering::Less) => return false,
            Some(Ordering::Greater) => self.join(vote.round, effects),
            Some(Ordering::Equal) => {}
        }
        let Some(round) = self.round.as_mut() else { return false };
        match round.ballot.cast(robot, stamp, vote) {
            Cast::Counted => true,
            Cast::Known => false,
            Cast::Full => {
                self.refusals.add(Refusal::BallotFull);
                false
            }
        }
    }

    /// Takes in a decision, by whichever way it came. Says whether it was news.
    pub(super) fn hear_decision(
        &mut self,
        holder: Option<RobotId>,
        decision: Decision,
        effects: &mut Effects<'_>,
    ) -> bool {
        if decision.check().is_err() {
            self.refusals.add(Refusal::Impossible);
            return false;
        }
        if let Err(refusal) = self.would_decide(&decision) {
            self.refusals.add(refusal);
            return false;
        }
        match self.place(decision.round, effects) {
            None | Some(Ordering::Less) => return false,
            // What is decided elsewhere needs no looking; unless it cannot be believed on one robot's word.
            Some(Ordering::Greater) if self.config.liars == 0 => self.enter(decision.round, false, effects),
            Some(Ordering::Greater) => self.join(decision.round, effects),
            Some(Ordering::Equal) => {}
        }
        let Some(round) = self.round.as_mut() else { return false };
        round.agreement.hear(holder, decision, self.config.liars)
    }

    /// Whether that is another scale than this robot's own, if it has one.
    fn is_foreign(&self, scale: Scale) -> bool {
        self.own_scale().is_some_and(|own| own != scale)
    }

    /// Whether this robot would decide so itself, by what the decision says that it rests on.
    fn would_decide(&self, decision: &Decision) -> Result<(), Refusal> {
        /// What a sum may lose on the way through text.
        const TOLERANCE: f64 = 1e-9;
        let Some(class) = decision.class else { return Ok(()) };
        let Certificate { vocabulary, rule, probabilities, votes, .. } = &decision.certificate;
        let scale = Scale { vocabulary: *vocabulary, classes: probabilities.len() };
        if self.is_foreign(scale) {
            return Err(Refusal::Vocabulary);
        }
        let p = probabilities.get(class.index()).copied().unwrap_or_default();
        let founded = *rule == self.config.rule
            && votes.len() >= self.config.quorum as usize
            && (p - decision.confidence).abs() <= TOLERANCE
            && p + TOLERANCE >= 1.0 - self.config.alpha
            && probabilities.iter().all(|other| *other <= p);
        if founded { Ok(()) } else { Err(Refusal::Unfounded) }
    }

    fn meet_duplicate(&mut self, stamp: Stamp) {
        self.refusals.add(Refusal::DuplicateId);
        self.duplicate = Some(stamp);
    }
}
