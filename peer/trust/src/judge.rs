//! What a robot of a sealed swarm lets in, message by message.

use std::time::Duration;

use gestalt_protocol::{
    Announcement, Batches, Decision, Envelope, Give, HeldBatch, InstructorId, Message, RobotId, Signature,
};

use crate::answer::Answers;
use crate::budget::Budget;
use crate::distrust::Distrust;
use crate::docket::Docket;
use crate::evidence::{Evidence, EvidenceError, Lie, Refutes};
use crate::roles::Roles;
use crate::roster::Roster;
use crate::roster_error::RosterError;
use crate::scheme::{Ed25519, Scheme};
use crate::verify::Verifier;
use crate::witness::Witness;
use crate::word::{Attention, Speaker, WordHeading};

/// How many batches of samples of one author are checked: a late joiner is given all that a swarm knows.
const OF_SAMPLES: Budget = Budget::of(512, 64, 1000);

/// Lets in what members of the swarm signed, and finds out who of them lies: who says two things, and who gives a decision that does not follow from its
/// votes. Pure: time is an argument.
#[derive(Clone, Debug)]
pub struct Judge<S: Scheme = Ed25519> {
    /// For samples, and for all else that is signed: neither keeps the other waiting.
    verifier: Verifier<S>,
    of_samples: Verifier<S>,
    of_words: Attention<S>,
    of_answers: Answers<S>,
    witness: Witness,
    refutes: Refutes,
    docket: Docket,
}

impl<S: Scheme> Judge<S> {
    /// One that goes by that roster, and by that on which decisions do not follow from their votes.
    #[must_use]
    pub fn new(roster: Roster<S>, refutes: Refutes) -> Self {
        Self {
            witness: Witness::new(&roster),
            verifier: Verifier::new(roster.clone(), Budget::default()),
            of_samples: Verifier::new(roster, OF_SAMPLES),
            of_words: Attention::default(),
            of_answers: Answers::default(),
            refutes,
            docket: Docket::default(),
        }
    }

    /// The roster that it goes by.
    #[must_use]
    pub fn roster(&self) -> &Roster<S> {
        self.verifier.roster()
    }

    /// Goes by that roster from now on, if it is newer than the one held; whether it is. Who has no key on it, or another one than
    /// before, is forgotten: nothing that the old key signed counts any more, and the new one begins anew.
    ///
    /// # Errors
    /// As [`Verifier::adopt`].
    pub fn adopt(&mut self, roster: Roster<S>) -> Result<bool, RosterError> {
        let before = self.roster().clone();
        if !self.verifier.adopt(roster.clone())? {
            return Ok(false);
        }
        self.of_samples.adopt(roster.clone())?;
        self.of_words.follow(&before, &roster);
        self.of_answers.follow(&before, &roster);
        self.witness.follow(&before, &roster);
        self.docket.retain(|robot| roster.keeps_key(&before, robot));
        Ok(true)
    }

    /// Whether to heed an instructor's word; who signed it, and what they may do.
    ///
    /// # Errors
    /// As [`Attention::heed`].
    pub fn word(
        &mut self,
        now: Duration,
        by: &InstructorId,
        word: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(WordHeading, Roles), Distrust> {
        let heeded = self.of_words.heed(now, self.verifier.roster(), by, word, attachment)?;
        match heeded.0.speaker {
            Speaker::For(robot) if self.convicts(robot) => Err(Distrust::Convicted),
            _ => Ok(heeded),
        }
    }

    /// Whether that robot gave this answer to that instructor.
    ///
    /// # Errors
    /// As [`Answers::check`].
    pub fn answer(
        &mut self,
        now: Duration,
        robot: RobotId,
        to: &InstructorId,
        answer: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(), Distrust> {
        if self.convicts(robot) {
            return Err(Distrust::Convicted);
        }
        self.of_answers.check(now, self.verifier.roster(), robot, to, answer, attachment)
    }

    /// The key of a member that is believed.
    ///
    /// # Errors
    /// [`Distrust::Stranger`], [`Distrust::Expelled`], [`Distrust::Convicted`].
    pub fn key(&self, robot: RobotId) -> Result<&S::Key, Distrust> {
        if self.convicts(robot) { Err(Distrust::Convicted) } else { self.roster().key(robot) }
    }

    /// Whether that robot was proven to lie, with the key that it has.
    #[must_use]
    pub fn convicts(&self, robot: RobotId) -> bool {
        self.verifier.is_convicted(robot)
    }

    /// Whether that robot is a member that is believed.
    #[must_use]
    pub fn is_member(&self, robot: RobotId) -> bool {
        self.roster().members().robots.contains_key(&robot) && !self.convicts(robot)
    }

    /// Whether the author said that: a vote, what it holds, samples or what it passes on of instructors.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets. Who has just been found to say two things is [`Distrust::Convicted`], and the evidence is
    /// [`untold`](Self::untold).
    pub fn envelope(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        self.check(envelope, |verifier, said, signature| verifier.check(now, said, signature))
    }

    /// The same of what somebody passes on, or a decision rests on: a flood under the author's own key does not keep it from being heard.
    fn relayed(&mut self, by: RobotId, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        self.check(envelope, |verifier, said, signature| verifier.check_passed_on(by, now, said, signature))
    }

    fn check(
        &mut self,
        envelope: &Envelope,
        by: impl FnOnce(&mut Verifier<S>, &[u8], Option<&Signature>) -> Result<(), Distrust>,
    ) -> Result<(), Distrust> {
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref().ok_or(Distrust::Unsigned)?;
        let samples = matches!(envelope.message, Message::Samples(_));
        let verifier = if samples { &mut self.of_samples } else { &mut self.verifier };
        by(verifier, &statement, Some(signature))?;
        let evidence = self.witness.observe(&statement, signature);
        // What proves nothing is no reason to refuse it.
        if evidence.is_some_and(|evidence| self.found(evidence)) { Err(Distrust::Convicted) } else { Ok(()) }
    }

    /// Convicts who was found here to lie; whether it is proven.
    fn found(&mut self, evidence: Evidence) -> bool {
        let Ok(conviction) = evidence.check(self.roster(), self.refutes) else { return false };
        self.verifier.believe_no_more(conviction.robot);
        self.of_samples.believe_no_more(conviction.robot);
        self.docket.enter(conviction, evidence, true);
        true
    }

    /// Takes in two batches of one author that give different samples one number, as they were met; whether it is proven that it did.
    pub fn two_samples(&mut self, one: HeldBatch, other: HeldBatch) -> bool {
        Evidence::of_batches(one, other).is_some_and(|evidence| self.found(evidence))
    }

    /// Whether that member stands by a decision that it gave or announced, which is looked into before the votes that it rests on: their signatures are
    /// more work, and prove nothing of who gave it.
    fn stands_by(&mut self, said: &Envelope, decision: &Decision) -> Result<(), Distrust> {
        let Some(signature) = said.signature.filter(|_| (self.refutes)(decision)) else { return Ok(()) };
        let proven = self.found(Evidence::of_decision(said.statement(), signature));
        if proven { Err(Distrust::Convicted) } else { Ok(()) }
    }

    /// Whether all the votes were cast that a decision rests on, which that robot gave or announced.
    fn decision(&mut self, by: RobotId, now: Duration, decision: &Decision) -> Result<(), Distrust> {
        decision.certificate.held_votes().try_for_each(|held| self.relayed(by, now, &held.into()))
    }

    /// Whether its announcer said it, to the last word, and all the votes that it rests on were cast.
    ///
    /// # Errors
    /// The [`Distrust`] that its announcer meets, or the first of the votes which was not.
    pub fn announcement(&mut self, now: Duration, announcement: &Announcement) -> Result<(), Distrust> {
        // One who is no member costs no more than that.
        if announcement.signature.is_none() {
            return Err(Distrust::Unsigned);
        }
        let said = Envelope::from(announcement.clone());
        self.envelope(now, &said)?;
        self.stands_by(&said, &announcement.decision)?;
        self.decision(announcement.announcer, now, &announcement.decision)
    }

    /// Leaves of what one robot passes on to another what was really said; says why the rest is not believed. What is left may be true: who passes on votes,
    /// words and samples as it was told them is no liar. By a decision it stands itself.
    ///
    /// That it was this robot [has been shown](crate::Channels::check): what it passes on is bounded, and in nobody else's name.
    pub fn passed_on(&mut self, now: Duration, envelope: &mut Envelope) -> Option<Distrust> {
        let (by, given) = (envelope.author, self.given(now, envelope));
        match &mut envelope.message {
            Message::Give(give) => {
                let of_holders = self.retain(by, now, &mut give.holders);
                let of_votes = self.retain(by, now, &mut give.votes);
                if given.is_err() {
                    give.decision = None;
                }
                given.err().or(of_votes).or(of_holders)
            }
            Message::Batches(Batches { batches }) => self.retain(by, now, batches),
            _ => None,
        }
    }

    /// Whether its author gave that decision, if it gives any, and all the votes that it rests on were cast.
    fn given(&mut self, now: Duration, said: &Envelope) -> Result<(), Distrust> {
        let Message::Give(Give { decision: Some(decision), .. }) = &said.message else { return Ok(()) };
        // Not for the witness, who remembers what is said to all.
        self.verifier.check_passed_on(said.author, now, &said.statement(), said.signature.as_ref())?;
        self.stands_by(said, decision)?;
        self.decision(said.author, now, decision)
    }

    fn retain<T: Clone + Into<Envelope>>(
        &mut self,
        by: RobotId,
        now: Duration,
        held: &mut Vec<T>,
    ) -> Option<Distrust> {
        let mut refused = None;
        held.retain(|held| match self.relayed(by, now, &held.clone().into()) {
            Ok(()) => true,
            Err(distrust) => {
                refused = Some(distrust);
                false
            }
        });
        refused
    }

    /// Takes in evidence.
    ///
    /// # Errors
    /// [`EvidenceError`] for evidence that proves nothing against any member.
    pub fn evidence(&mut self, now: Duration, evidence: Evidence) -> Result<(), EvidenceError> {
        let before = evidence.heading().is_ok_and(|heading| self.verifier.is_convicted(heading.author));
        let conviction = self.verifier.convict(now, &evidence, self.refutes)?;
        self.of_samples.believe_no_more(conviction.robot);
        if !before {
            self.docket.enter(conviction, evidence, false);
        }
        Ok(())
    }

    /// Who was convicted since this was last asked, and of what: nothing that they said counts any more.
    pub fn fallen(&mut self) -> Vec<(RobotId, Lie)> {
        self.docket.fallen()
    }

    /// The evidence that came in since this was last asked: whoever starts again hands it in again, or forgets who lied.
    pub fn unkept(&mut self) -> Vec<(RobotId, Evidence)> {
        self.docket.unkept()
    }

    /// The evidence that is to be told to all now: once what was found here, and once more for those who came since, every five seconds at most.
    pub fn untold(&mut self, now: Duration) -> Vec<(RobotId, Evidence)> {
        self.docket.untold(now)
    }

    /// Somebody is here who was not: all evidence is to be told again.
    pub fn tell_again(&mut self) {
        self.docket.tell_again();
    }
}

#[cfg(test)]
mod tests;
