//! Who lets in what the members of a sealed swarm said: what `gestalt-link`, which needs Zenoh, does with real signatures.

use std::time::Duration;

use gestalt_protocol::{Announcement, CountedVote, Decision, Envelope, Give, HeldVote, Message, Signature};
use gestalt_strategies::Sign;
use gestalt_trust::{Budget, Distrust, Fake, Verifier};

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
            Message::Give(give) => self.give(now, give),
            _ => {}
        }
        Ok(envelope)
    }

    /// Whether a member announced it so, and all the votes that it rests on were cast.
    ///
    /// # Errors
    /// Why it or one of them is not believed.
    pub fn announcement(&mut self, now: Duration, announcement: &Announcement) -> Result<(), Distrust> {
        self.envelope(now, &announcement.clone().into())?;
        self.decision(now, &announcement.decision)
    }

    /// Whether all the votes that a decision rests on were cast.
    ///
    /// # Errors
    /// Why one is not believed.
    pub fn decision(&mut self, now: Duration, decision: &Decision) -> Result<(), Distrust> {
        votes(decision).into_iter().try_for_each(|held| self.envelope(now, &held.into()))
    }

    fn envelope(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref();
        let believed = self.0.check(now, &statement, signature);
        let signed = signature.is_some_and(|signature| self.0.roster().check(&statement, signature).is_ok());
        assert!(signed || believed.is_err(), "believed, and not its author's: {envelope:?}");
        believed
    }

    fn give(&mut self, now: Duration, give: &mut Give) {
        give.votes.retain(|held| self.envelope(now, &held.clone().into()).is_ok());
        give.holders.retain(|holder| self.envelope(now, &holder.clone().into()).is_ok());
        give.decision.take_if(|decision| self.decision(now, decision).is_err());
    }
}

/// All votes that a decision brings with it.
pub fn votes(decision: &Decision) -> Vec<HeldVote> {
    let certificate = &decision.certificate;
    certificate.votes.iter().map(CountedVote::held).chain(certificate.others.iter().cloned()).collect()
}

/// Signs for a member.
#[derive(Debug)]
pub struct Signer(pub gestalt_protocol::RobotId);

impl Sign for Signer {
    fn sign(&self, statement: &[u8]) -> Signature {
        swarm::sign(self.0, statement)
    }
}
