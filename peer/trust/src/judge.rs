//! What a robot of a sealed swarm lets in, message by message.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Batches, CountedVote, Decision, Envelope, Give, Instruction, InstructorId, Message, RobotId,
};

use crate::budget::Budget;
use crate::distrust::Distrust;
use crate::evidence::{Evidence, EvidenceError};
use crate::precedence::Precedence;
use crate::roles::Roles;
use crate::roster::Roster;
use crate::roster_error::RosterError;
use crate::scheme::{Ed25519, Scheme};
use crate::verify::Verifier;
use crate::witness::Witness;
use crate::word::{Attention, WordHeading};

/// How many batches of samples of one author are checked: a late joiner is given all that a swarm knows.
const OF_SAMPLES: Budget = {
    const fn number(of: u32) -> NonZeroU32 {
        NonZeroU32::new(of).expect("not zero")
    }
    Budget { burst: number(512), per_second: number(64), spare: number(1000) }
};

/// Lets in what members of the swarm signed, and finds out who of them says two things. Pure: time is an argument.
#[derive(Clone, Debug)]
pub struct Judge<S: Scheme = Ed25519> {
    /// For samples, and for all else that is signed: neither keeps the other waiting.
    verifier: Verifier<S>,
    of_samples: Verifier<S>,
    of_words: Attention<S>,
    precedence: Precedence,
    witness: Witness,
    /// Against whom, as it is told to others; those found here are yet to be.
    evidence: BTreeMap<RobotId, Evidence>,
    untold: Vec<RobotId>,
}

impl<S: Scheme> Judge<S> {
    /// One that goes by that roster.
    #[must_use]
    pub fn new(roster: Roster<S>) -> Self {
        Self {
            witness: Witness::new(&roster),
            verifier: Verifier::new(roster.clone(), Budget::default()),
            of_samples: Verifier::new(roster, OF_SAMPLES),
            of_words: Attention::default(),
            precedence: Precedence::default(),
            evidence: BTreeMap::new(),
            untold: Vec::new(),
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
        self.witness.follow(&before, &roster);
        self.evidence.retain(|robot, _| roster.keeps_key(&before, *robot));
        self.untold.retain(|robot| roster.keeps_key(&before, *robot));
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
        self.of_words.heed(now, self.verifier.roster(), by, word, attachment)
    }

    /// Whether somebody with these roles may say that.
    pub fn permits(&mut self, by: &InstructorId, roles: Roles, said: &Instruction) -> bool {
        let instructors = &self.verifier.roster().members().instructors;
        self.precedence.permits(by, roles, said, |name| instructors.contains_key(name))
    }

    /// Whether that robot is a member that is believed.
    #[must_use]
    pub fn is_member(&self, robot: RobotId) -> bool {
        self.verifier.roster().members().robots.contains_key(&robot)
    }

    /// Whether the author said that: a vote, what it holds, samples or what it passes on of instructors.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets. Who has just been found to say two things is [`Distrust::Convicted`], and the evidence is
    /// [`untold`](Self::untold).
    pub fn envelope(&mut self, now: Duration, envelope: &Envelope) -> Result<(), Distrust> {
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref().ok_or(Distrust::Unsigned)?;
        let samples = matches!(envelope.message, Message::Samples(_));
        let verifier = if samples { &mut self.of_samples } else { &mut self.verifier };
        verifier.check(now, &statement, Some(signature))?;
        let Some(evidence) = self.witness.observe(&statement, signature) else { return Ok(()) };
        // What proves nothing is no reason to refuse it.
        let Ok(Some(liar)) = self.evidence(now, evidence) else { return Ok(()) };
        self.untold.push(liar);
        Err(Distrust::Convicted)
    }

    /// Whether all the votes that a decision rests on were cast.
    ///
    /// # Errors
    /// The [`Distrust`] that the first of them meets which was not.
    pub fn decision(&mut self, now: Duration, decision: &Decision) -> Result<(), Distrust> {
        let certificate = &decision.certificate;
        let votes = certificate.votes.iter().map(CountedVote::held);
        votes.chain(certificate.others.iter().cloned()).try_for_each(|held| self.envelope(now, &held.into()))
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
        self.envelope(now, &announcement.clone().into())?;
        self.decision(now, &announcement.decision)
    }

    /// Leaves of a gift what was really said; says why the rest is not believed. What is left may be true: who passes on what it was
    /// told is no liar.
    pub fn give(&mut self, now: Duration, give: &mut Give) -> Option<Distrust> {
        let of_holders = self.retain(now, &mut give.holders);
        let mut refused = self.retain(now, &mut give.votes).or(of_holders);
        if let Some(Err(distrust)) = give.decision.as_ref().map(|decision| self.decision(now, decision)) {
            give.decision = None;
            refused = Some(distrust);
        }
        refused
    }

    /// The same of samples.
    pub fn batches(&mut self, now: Duration, batches: &mut Batches) -> Option<Distrust> {
        self.retain(now, &mut batches.batches)
    }

    fn retain<T: Clone + Into<Envelope>>(&mut self, now: Duration, held: &mut Vec<T>) -> Option<Distrust> {
        let mut refused = None;
        held.retain(|held| match self.envelope(now, &held.clone().into()) {
            Ok(()) => true,
            Err(distrust) => {
                refused = Some(distrust);
                false
            }
        });
        refused
    }

    /// Takes in evidence; says against whom, if that is news.
    ///
    /// # Errors
    /// [`EvidenceError`] for evidence that proves nothing against any member.
    pub fn evidence(&mut self, now: Duration, evidence: Evidence) -> Result<Option<RobotId>, EvidenceError> {
        let liar = self.verifier.convict(now, &evidence)?.robot;
        self.of_samples.convict(now, &evidence)?;
        let is_news = !self.evidence.contains_key(&liar);
        self.evidence.entry(liar).or_insert(evidence);
        Ok(is_news.then_some(liar))
    }

    /// The evidence that is to be told to all, each once.
    pub fn untold(&mut self) -> Vec<(RobotId, Evidence)> {
        let untold = std::mem::take(&mut self.untold).into_iter();
        untold.filter_map(|liar| Some((liar, self.evidence.get(&liar)?.clone()))).collect()
    }

    /// Somebody is here who was not: all evidence is to be told again.
    pub fn tell_again(&mut self) {
        self.untold = self.evidence.keys().copied().collect();
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::Signature;

    use super::*;
    use crate::statement;
    use crate::testing::{robot, roster, vote};

    const NOW: Duration = Duration::from_secs(1000);

    fn said(author: u32, sequence: u32, evidence: f32) -> Envelope {
        let unsigned = vote(author, sequence, evidence);
        let signature: Signature = statement::sign(&robot(author), &roster(5).swarm_id(), &unsigned);
        Envelope { signature: Some(signature), ..Envelope::decode(&unsigned).unwrap() }
    }

    #[test]
    fn who_says_two_things_is_told_of_once_and_again_to_those_who_come() {
        let (mut here, mut there) = (Judge::new(roster(5)), Judge::new(roster(5)));
        assert_eq!(here.envelope(NOW, &said(1, 1, 1.0)), Ok(()));
        assert_eq!(here.envelope(NOW, &said(1, 1, -1.0)), Err(Distrust::Convicted));
        let told = here.untold();
        assert_eq!((told.len(), here.untold().len()), (1, 0));
        assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(Some(RobotId(1))));
        assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(None), "no news");
        assert_eq!(there.envelope(NOW, &said(1, 2, 1.0)), Err(Distrust::Convicted));
        assert_eq!(there.envelope(NOW, &said(2, 2, 1.0)), Ok(()));
        assert!(there.untold().is_empty(), "who found it tells it");
        there.tell_again();
        assert_eq!(there.untold(), told);
    }

    /// That robot's word that it holds something, signed by that one.
    fn word(author: u32, by: u32) -> Envelope {
        let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
        let rank = gestalt_protocol::Rank {
            decided: true,
            robots: 1,
            looks: 1.0,
            confidence: 1.0,
            author: RobotId(0),
        };
        let message =
            Message::Holding(gestalt_protocol::Holding { round, class: None, rank, changed: false });
        signed(author, 9, message, by)
    }

    fn signed(author: u32, sequence: u32, message: Message, by: u32) -> Envelope {
        let stamp = gestalt_protocol::Stamp { boot: 1, sequence };
        let said = Envelope { author: RobotId(author), stamp, message, signature: None };
        let signature = statement::sign(&robot(by), &roster(5).swarm_id(), &said.statement());
        Envelope { signature: Some(signature), ..said }
    }

    #[test]
    fn what_a_robot_holds_is_its_own_word() {
        let mut judge = Judge::new(roster(5));
        assert_eq!(judge.envelope(NOW, &word(1, 1)), Ok(()));
        assert_eq!(judge.envelope(NOW, &word(2, 1)), Err(Distrust::Forged));
        let holder = |said: Envelope| {
            let Envelope { author: robot, stamp, message: Message::Holding(holding), signature } = said
            else {
                unreachable!()
            };
            gestalt_protocol::Holder { robot, stamp, holding, signature }
        };
        let (mine, forged) = (holder(word(1, 1)), holder(word(2, 1)));
        let mut give = Give { decision: None, votes: vec![], holders: vec![forged, mine.clone()] };
        assert_eq!(judge.give(NOW, &mut give), Some(Distrust::Forged));
        assert_eq!(give.holders, [mine]);
    }

    #[test]
    fn an_announcement_is_its_announcers_to_the_last_word() {
        let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
        let decision = Decision {
            round,
            class: None,
            confidence: 0.5,
            author: RobotId(0),
            is_final: true,
            certificate: gestalt_protocol::Certificate {
                vocabulary: gestalt_protocol::VocabularyId(9),
                rule: gestalt_protocol::FusionRule::LogPool,
                pool: None,
                probabilities: vec![],
                unknown: None,
                votes: vec![],
                others: vec![],
                robots: 1,
                quorum: 1,
                elapsed_ms: 1,
                named: vec![],
            },
        };
        let message = |decision| {
            Message::Announced(gestalt_protocol::Announced { decision, label: Some("palm".to_owned()) })
        };
        let said = |by| Announcement::of(signed(1, 5, message(decision.clone()), by)).unwrap();
        let heard = |announcement: &Announcement| Judge::new(roster(5)).announcement(NOW, announcement);
        assert_eq!(heard(&said(1)), Ok(()));
        assert_eq!(heard(&said(2)), Err(Distrust::Forged));
        assert_eq!(heard(&Announcement { signature: None, ..said(1) }), Err(Distrust::Unsigned));
        assert_eq!(heard(&Announcement { announcer: RobotId(9), ..said(1) }), Err(Distrust::Stranger));
        type Change = fn(&mut Announcement);
        let changes: [Change; 8] = [
            |it| it.decision.is_final = false,
            |it| it.label = None,
            |it| it.decision.round.life = 8,
            |it| it.decision.author = RobotId(1),
            |it| it.decision.certificate.robots = 2,
            |it| it.decision.certificate.elapsed_ms = 2,
            |it| it.stamp.sequence = 6,
            |it| it.announcer = RobotId(2),
        ];
        for change in changes {
            let mut changed = said(1);
            change(&mut changed);
            assert_eq!(heard(&changed), Err(Distrust::Forged), "{changed:?}");
        }
        let unsigned = gestalt_protocol::HeldVote {
            robot: RobotId(2),
            stamp: gestalt_protocol::Stamp { boot: 1, sequence: 1 },
            vote: gestalt_protocol::Vote {
                round,
                vocabulary: gestalt_protocol::VocabularyId(9),
                evidence: vec![],
                looks: 0.0,
                unknown: None,
                named: vec![],
            },
            signature: None,
        };
        let mut of_no_vote = decision.clone();
        of_no_vote.certificate.others = vec![unsigned];
        let announcement = Announcement::of(signed(1, 5, message(of_no_vote), 1)).unwrap();
        assert_eq!(heard(&announcement), Err(Distrust::Unsigned), "its votes have to be true, too");
    }

    #[test]
    fn of_a_gift_stays_what_was_said() {
        let mut judge = Judge::new(roster(5));
        let held = |envelope: Envelope| {
            let Envelope { author: robot, stamp, message: Message::Vote(vote), signature } = envelope else {
                unreachable!()
            };
            gestalt_protocol::HeldVote { robot, stamp, vote, signature }
        };
        let forged = Envelope { signature: said(2, 1, 1.0).signature, ..said(1, 1, 1.0) };
        let votes = vec![held(forged), held(said(2, 1, 1.0))];
        let mut give = Give { decision: None, votes, holders: Vec::new() };
        assert_eq!(judge.give(NOW, &mut give), Some(Distrust::Forged));
        assert_eq!(give.votes, [held(said(2, 1, 1.0))]);
        assert_eq!(judge.give(NOW, &mut give), None);
    }
}
