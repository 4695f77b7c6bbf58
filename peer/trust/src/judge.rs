//! What a robot of a sealed swarm lets in, message by message.

use std::num::NonZeroU32;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Batches, CountedVote, Decision, Envelope, Give, Instruction, InstructorId, Message, RobotId,
};

use crate::answer::Answers;
use crate::budget::Budget;
use crate::distrust::Distrust;
use crate::docket::Docket;
use crate::evidence::{Evidence, EvidenceError, Lie, Refutes};
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

/// Lets in what members of the swarm signed, and finds out who of them lies: who says two things, and who gives a decision that does not follow from its
/// votes. Pure: time is an argument.
#[derive(Clone, Debug)]
pub struct Judge<S: Scheme = Ed25519> {
    /// For samples, and for all else that is signed: neither keeps the other waiting.
    verifier: Verifier<S>,
    of_samples: Verifier<S>,
    of_words: Attention<S>,
    of_answers: Answers<S>,
    precedence: Precedence,
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
            precedence: Precedence::default(),
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
        self.of_words.heed(now, self.verifier.roster(), by, word, attachment)
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
        self.of_answers.check(now, self.verifier.roster(), robot, to, answer, attachment)
    }

    /// Whether somebody with these roles may say that.
    pub fn permits(&mut self, by: &InstructorId, roles: Roles, said: &Instruction) -> bool {
        let instructors = &self.verifier.roster().members().instructors;
        self.precedence.permits(by, roles, said, |name| instructors.contains_key(name))
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
        let statement = envelope.statement();
        let signature = envelope.signature.as_ref().ok_or(Distrust::Unsigned)?;
        let samples = matches!(envelope.message, Message::Samples(_));
        let verifier = if samples { &mut self.of_samples } else { &mut self.verifier };
        verifier.check(now, &statement, Some(signature))?;
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

    /// Whether that member stands by a decision that it gave or announced, which is looked into before the votes that it rests on: their signatures are
    /// more work, and prove nothing of who gave it.
    fn stands_by(&mut self, said: &Envelope, decision: &Decision) -> Result<(), Distrust> {
        let Some(signature) = said.signature.filter(|_| (self.refutes)(decision)) else { return Ok(()) };
        let proven = self.found(Evidence::of_decision(said.statement(), signature));
        if proven { Err(Distrust::Convicted) } else { Ok(()) }
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
        let said = Envelope::from(announcement.clone());
        self.envelope(now, &said)?;
        self.stands_by(&said, &announcement.decision)?;
        self.decision(now, &announcement.decision)
    }

    /// Leaves of what one robot passes on to another what was really said; says why the rest is not believed. What is left may be true: who passes on votes,
    /// words and samples as it was told them is no liar. By a decision it stands itself.
    pub fn passed_on(&mut self, now: Duration, envelope: &mut Envelope) -> Option<Distrust> {
        let given = self.given(now, envelope);
        match &mut envelope.message {
            Message::Give(give) => {
                let of_holders = self.retain(now, &mut give.holders);
                let of_votes = self.retain(now, &mut give.votes);
                if given.is_err() {
                    give.decision = None;
                }
                given.err().or(of_votes).or(of_holders)
            }
            Message::Batches(Batches { batches }) => self.retain(now, batches),
            _ => None,
        }
    }

    /// Whether its author gave that decision, if it gives any, and all the votes that it rests on were cast.
    fn given(&mut self, now: Duration, said: &Envelope) -> Result<(), Distrust> {
        let Message::Give(Give { decision: Some(decision), .. }) = &said.message else { return Ok(()) };
        // Not for the witness, who remembers what is said to all.
        self.verifier.check(now, &said.statement(), said.signature.as_ref())?;
        self.stands_by(said, decision)?;
        self.decision(now, decision)
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
mod tests {
    use gestalt_protocol::Signature;

    use super::*;
    use crate::statement;
    use crate::testing::{decision, robot, roster, vote};

    const NOW: Duration = Duration::from_secs(1000);

    fn said(author: u32, sequence: u32, evidence: f32) -> Envelope {
        let unsigned = vote(author, sequence, evidence);
        let signature: Signature = statement::sign(&robot(author), &roster(5).swarm_id(), &unsigned);
        Envelope { signature: Some(signature), ..Envelope::decode(&unsigned).unwrap() }
    }

    #[test]
    fn who_says_two_things_is_told_of_once_and_again_to_those_who_come() {
        let (mut here, mut there) = (Judge::new(roster(5), |_| false), Judge::new(roster(5), |_| false));
        assert_eq!(here.envelope(NOW, &said(1, 1, 1.0)), Ok(()));
        assert_eq!(here.envelope(NOW, &said(1, 1, -1.0)), Err(Distrust::Convicted));
        let told = here.untold(NOW);
        assert_eq!((told.len(), here.untold(NOW).len()), (1, 0));
        assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
        assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
        assert_eq!(there.fallen(), [(RobotId(1), Lie::TwoThings)], "no news the second time");
        assert!(there.fallen().is_empty() && !there.is_member(RobotId(1)));
        assert_eq!(there.envelope(NOW, &said(1, 2, 1.0)), Err(Distrust::Convicted));
        assert_eq!(there.envelope(NOW, &said(2, 2, 1.0)), Ok(()));
        assert!(there.untold(NOW).is_empty(), "who found it tells it");
        there.tell_again();
        assert_eq!(there.untold(NOW), told);
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

    /// What a robot passes on and does not sign.
    fn hint(give: Give) -> Envelope {
        let stamp = gestalt_protocol::Stamp { boot: 1, sequence: 12 };
        Envelope { author: RobotId(4), stamp, message: Message::Give(give), signature: None }
    }

    #[test]
    fn what_a_robot_holds_is_its_own_word() {
        let mut judge = Judge::new(roster(5), |_| false);
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
        let mut given = hint(Give { decision: None, votes: vec![], holders: vec![forged, mine.clone()] });
        assert_eq!(judge.passed_on(NOW, &mut given), Some(Distrust::Forged));
        assert_eq!(given, hint(Give { decision: None, votes: vec![], holders: vec![mine] }));
    }

    #[test]
    fn an_announcement_is_its_announcers_to_the_last_word() {
        let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
        let decision = decision(1);
        let message = |decision| {
            Message::Announced(gestalt_protocol::Announced { decision, label: Some("palm".to_owned()) })
        };
        let said = |by| Announcement::of(signed(1, 5, message(decision.clone()), by)).unwrap();
        let heard =
            |announcement: &Announcement| Judge::new(roster(5), |_| false).announcement(NOW, announcement);
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
    fn who_gives_what_does_not_follow_is_convicted_whatever_is_said_against_it_before() {
        let refutes: Refutes = |decision| decision.certificate.elapsed_ms == 13;
        let judge = || Judge::new(roster(5), refutes);
        let give = |decision| {
            Message::Give(Give { decision: Some(decision), votes: Vec::new(), holders: Vec::new() })
        };
        let (mut here, mut there) = (judge(), judge());
        let mut honest = signed(1, 3, give(decision(12)), 1);
        assert_eq!(here.passed_on(NOW, &mut honest), None);
        let mut unsigned = Envelope { signature: None, ..honest.clone() };
        assert_eq!(here.passed_on(NOW, &mut unsigned), Some(Distrust::Unsigned));
        assert_eq!(unsigned.message, Message::Give(Give { decision: None, votes: vec![], holders: vec![] }));
        let mut forged = signed(1, 4, give(decision(13)), 2);
        assert_eq!(here.passed_on(NOW, &mut forged), Some(Distrust::Forged));
        // Its budget for evidence is used up by others.
        let false_evidence = Evidence::of_decision(honest.statement(), honest.signature.unwrap());
        let made_up = (0..3000).map(|_| here.evidence(NOW, false_evidence.clone()));
        let answers: Vec<_> = made_up.collect();
        assert_eq!(answers[0], Err(EvidenceError::Founded));
        assert_eq!(answers[2999], Err(EvidenceError::TooFast(RobotId(1))));
        assert!(here.fallen().is_empty() && here.untold(NOW).is_empty() && !here.convicts(RobotId(1)));
        let mut lie = signed(1, 5, give(decision(13)), 1);
        // A signature that was believed before costs nothing, and one more is spared a second later.
        let later = NOW + Duration::from_secs(2);
        assert_eq!(here.passed_on(later, &mut lie), Some(Distrust::Convicted));
        assert_eq!(here.fallen(), [(RobotId(1), Lie::Unfounded)]);
        let told = here.untold(later);
        assert_eq!((told.len(), here.untold(later).len()), (1, 0));
        assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
        assert!(there.convicts(RobotId(1)) && !there.is_member(RobotId(1)));
        assert_eq!(there.envelope(NOW, &said(1, 6, 1.0)), Err(Distrust::Convicted));
        // Whoever comes hears of it, and whoever comes and goes makes nobody repeat it all the time.
        here.tell_again();
        assert_eq!(here.untold(later).len(), 1);
        here.tell_again();
        assert_eq!(here.untold(later + Duration::from_secs(4)).len(), 0);
        assert_eq!(here.untold(later + Duration::from_secs(5)).len(), 1);
    }

    #[test]
    fn of_a_gift_stays_what_was_said() {
        let mut judge = Judge::new(roster(5), |_| false);
        let held = |envelope: Envelope| {
            let Envelope { author: robot, stamp, message: Message::Vote(vote), signature } = envelope else {
                unreachable!()
            };
            gestalt_protocol::HeldVote { robot, stamp, vote, signature }
        };
        let forged = Envelope { signature: said(2, 1, 1.0).signature, ..said(1, 1, 1.0) };
        let votes = vec![held(forged), held(said(2, 1, 1.0))];
        let mut given = hint(Give { decision: None, votes, holders: Vec::new() });
        assert_eq!(judge.passed_on(NOW, &mut given), Some(Distrust::Forged));
        let left = Give { decision: None, votes: vec![held(said(2, 1, 1.0))], holders: Vec::new() };
        assert_eq!(given, hint(left));
        assert_eq!(judge.passed_on(NOW, &mut given), None);
    }
}
