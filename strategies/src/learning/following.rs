//! What learning is told of the rounds, and tells them.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::{Decision, Digest, HeldVote, Pool, RoundId};
use gestalt_rounds::{Follow, Testimony};

use super::state::Learning;
use crate::lessons::Verdict;

impl Follow for Learning {
    fn entered(&mut self, round: RoundId) {
        self.note_counter(round.counter);
        if self.recent.enter(round) {
            self.apply_to_round(round);
        }
    }

    fn merged(&mut self, round: RoundId, other: RoundId) {
        self.note_counter(round.counter);
        if self.recent.merge(round, other) {
            self.apply_to_round(round);
        }
    }

    fn taught(&self, counter: u32) -> BTreeSet<RoundId> {
        // As after a restart, what an instructor with a key spoke of was shown, whenever that was heard.
        let is_signed = |round| self.believer.is_some() && self.lessons.is_signed(round);
        self.lessons.under(counter).filter(|round| !self.ahead.contains(round) || is_signed(*round)).collect()
    }

    fn settled(&mut self, decision: &Decision, clip: f64) {
        let own = decision.certificate.vocabulary == self.vocabulary.id();
        if own && let Some(testimony) = Testimony::of(decision, clip) {
            let testimony = self.shelf.testimony(decision.round, testimony);
            self.judged.note(decision.round, self.recent.names(decision.round), testimony);
        }
    }

    fn pool(&mut self) -> Option<Pool> {
        let Self { judged, lessons, recent, gestures, shelf, .. } = self;
        let verdict = |round| match lessons.verdict_by_names(recent.names(round), gestures) {
            Verdict::Class(class) => Verdict::Among(gestures.all_names_of(class)),
            Verdict::Among(candidates) => Verdict::Among(candidates.by_all_names()),
            verdict @ (Verdict::Unsaid | Verdict::Retracted) => verdict,
        };
        Some(judged.pool(shelf, verdict))
    }

    fn keep(&mut self, vote: HeldVote) -> Arc<HeldVote> {
        self.shelf.vote(vote)
    }

    fn wants_more(&self, round: RoundId) -> bool {
        (1..self.config.keep).contains(&self.recent.looks(round))
    }

    fn learns(&self) -> bool {
        true
    }

    fn knowledge(&self) -> Option<Digest> {
        Some(self.digest())
    }
}
