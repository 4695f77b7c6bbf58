//! How a robot of a sealed swarm judges what it hears: what the gate of `gestalt-link` does, with the same crate.

use std::time::Duration;

use gestalt_protocol::{CountedVote, Decision, Envelope, Give, HeldVote};
use gestalt_trust::{Budget, Distrust, Roster, Verifier};

/// Lets in what members of the swarm signed.
#[derive(Debug)]
pub struct Gate(Verifier);

impl Gate {
    /// One that goes by that roster.
    pub fn new(roster: Roster) -> Self {
        Self(Verifier::new(roster, Budget::default()))
    }

    /// Whether the author said that.
    pub fn envelope(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        self.0.check(now, &envelope.statement(), envelope.signature.as_ref())
    }

    /// Whether all the votes that a decision rests on were cast.
    pub fn decision(&mut self, now: Duration, decision: &Decision) -> Result<(), Distrust> {
        let certificate = &decision.certificate;
        let votes = certificate.votes.iter().map(CountedVote::held);
        votes.chain(certificate.others.iter().cloned()).try_for_each(|held| self.held(now, held))
    }

    /// What of a gift was really said, and why the rest is not believed.
    pub fn give(&mut self, now: Duration, give: &mut Give) -> Option<Distrust> {
        let mut refused = None;
        give.votes.retain(|held| match self.held(now, held.clone()) {
            Ok(()) => true,
            Err(distrust) => {
                refused = Some(distrust);
                false
            }
        });
        if let Some(Err(distrust)) = give.decision.as_ref().map(|decision| self.decision(now, decision)) {
            give.decision = None;
            refused = Some(distrust);
        }
        refused
    }

    fn held(&mut self, now: Duration, held: HeldVote) -> Result<(), Distrust> {
        self.envelope(now, &held.into())
    }
}
