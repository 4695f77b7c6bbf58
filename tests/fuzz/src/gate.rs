//! Who lets in what the members of a sealed swarm said: what `gestalt-link`, which needs Zenoh, does with real signatures.

use std::time::Duration;

use gestalt_protocol::{Announcement, Decision, Envelope, Give, Message, Signature};
use gestalt_strategies::{Sign, is_refuted};
use gestalt_trust::{Budget, Distrust, Evidence, Fake, Lie, Verifier};

use crate::swarm;

/// A robot's door.
#[derive(Debug)]
pub struct Gate(Verifier<Fake>);

impl Default for Gate {
    fn default() -> Self {
        Self(Verifier::new(swarm::roster().clone(), Budget::default()))
    }
}

impl Gate {
    /// What of a message between robots is let in: votes and words on what they hold that their authors signed, and all else.
    ///
    /// # Errors
    /// Why one is not believed.
    pub fn message(&mut self, now: Duration, mut envelope: Envelope) -> Result<Envelope, Distrust> {
        match &mut envelope.message {
            Message::Vote(_) | Message::Holding(_) => self.envelope(now, &envelope)?,
            Message::Give(_) => self.give(now, &mut envelope),
            _ => {}
        }
        Ok(envelope)
    }

    /// Whether a member announced it so, and all the votes that it rests on were cast.
    ///
    /// # Errors
    /// Why it or one of them is not believed.
    pub fn announcement(&mut self, now: Duration, announcement: &Announcement) -> Result<(), Distrust> {
        let said = Envelope::from(announcement.clone());
        self.envelope(now, &said)?;
        self.stands_by(&said, &announcement.decision)?;
        self.decision(now, &announcement.decision)
    }

    /// Whether a member that was believed says what follows from the votes that it brings: if not, whoever is shown that convicts it.
    fn stands_by(&self, said: &Envelope, decision: &Decision) -> Result<(), Distrust> {
        let Some(signature) = said.signature.filter(|_| is_refuted(decision)) else { return Ok(()) };
        let evidence = Evidence::of_decision(said.statement(), signature);
        let evidence = Evidence::decode(&evidence.encode()).expect("it travels");
        let convicted = evidence.check(swarm::roster(), is_refuted).expect("it was believed");
        assert_eq!((convicted.robot, convicted.lie), (said.author, Lie::Unfounded));
        Err(Distrust::Convicted)
    }

    /// Whether all the votes that a decision rests on were cast.
    ///
    /// # Errors
    /// Why one is not believed.
    pub fn decision(&mut self, now: Duration, decision: &Decision) -> Result<(), Distrust> {
        decision.certificate.held_votes().try_for_each(|held| self.envelope(now, &held.into()))
    }

    fn envelope(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref();
        let believed = self.0.check(now, &statement, signature);
        let signed = signature.is_some_and(|signature| self.0.roster().check(&statement, signature).is_ok());
        assert!(signed || believed.is_err(), "believed, and not its author's: {envelope:?}");
        believed
    }

    fn give(&mut self, now: Duration, said: &mut Envelope) {
        let stands = match &said.message {
            Message::Give(Give { decision: Some(decision), .. }) => self
                .envelope(now, said)
                .and_then(|()| self.stands_by(said, decision))
                .and_then(|()| self.decision(now, decision)),
            _ => Ok(()),
        };
        let Message::Give(give) = &mut said.message else { return };
        give.votes.retain(|held| self.envelope(now, &held.clone().into()).is_ok());
        give.holders.retain(|holder| self.envelope(now, &holder.clone().into()).is_ok());
        give.decision.take_if(|_| stands.is_err());
    }
}

/// Signs for a member.
#[derive(Debug)]
pub struct Signer(pub gestalt_protocol::RobotId);

impl Sign for Signer {
    fn sign(&self, statement: &[u8]) -> Signature {
        swarm::sign(self.0, statement)
    }
}
