//! What arrives signed in a sealed swarm alone: words and answers, words of those on this computer, and rosters.

use std::collections::BTreeSet;
use std::sync::{Arc, PoisonError};

use gestalt_protocol::{
    Answer, Envelope, FrameChallenge, HeldBatch, Instruction, InstructorId, MAX_ATTACHMENT, MAX_JSON,
    MAX_WORD, RobotId, Signature, SignedWord, decode_json,
};
use gestalt_strategies::{Believe, Input, Instructed};
use gestalt_trust::{Distrust, Judge, MAX_ROSTER, Tag};
use zenoh::sample::Sample;

use crate::account::Refusal;
use crate::believer::Believer;
use crate::inbox::{Inbox, payload};
use crate::seal::Seal;
use crate::words::{Vouched, next_count};

/// The most words of those on this computer that wait to be passed on.
const MAX_VOUCHED: usize = 64;

impl Inbox {
    /// A word that came without a signature in a sealed swarm: links to members carry none, so it was said on this computer.
    pub(super) fn on_local_word(
        &self,
        by: InstructorId,
        instruction: Instruction,
        sample: &Sample,
    ) -> Result<(), Refusal> {
        let sealed = self.sealed.as_ref().ok_or(Refusal::Kind)?;
        let (roles, has_key) = sealed.roll.local_roles(&by);
        if has_key {
            // Whoever has a key may have forgotten to say so; and nobody signs in the name of one.
            let said = Instructed { by: by.clone(), at: next_count(0), instruction, said: None };
            self.queue_word(Input::Disallowed(said), sample)?;
            self.ready.notify_one();
            return Err(Refusal::HasKey(by));
        }
        let mut words = sealed.words.lock().unwrap_or_else(PoisonError::into_inner);
        let vouched = words.vouch(&by, payload(sample, MAX_WORD)?.into_owned());
        let said = Instructed { by, at: vouched.count, instruction, said: None };
        if !roles.permit(&said.instruction) {
            return self.queue_word(Input::Disallowed(said), sample);
        }
        let signed = SignedWord { word: vouched.word.clone(), attachment: vouched.attachment.clone() };
        let said = Instructed { said: Some(signed), ..said };
        let mut state = self.lock();
        if state.waiting.is_full() || state.vouched.len() >= MAX_VOUCHED {
            return Err(Refusal::Full);
        }
        state.vouched.push(vouched);
        state.waiting.deliver(Input::Instructed(said));
        Ok(())
    }

    /// Words that this robot signed for those on its own computer, and that are to be said to all.
    pub(super) fn unsaid(&self) -> Vec<Vouched> {
        std::mem::take(&mut self.lock().vouched)
    }

    /// This robot's signature under its answer, in a sealed swarm.
    pub(super) fn sign_answer(&self, to: &InstructorId, answer: &[u8]) -> Option<Signature> {
        let words = self.sealed.as_ref()?.words.lock().unwrap_or_else(PoisonError::into_inner);
        Some(words.answer(to, answer))
    }

    /// This robot's signature under what it says to whoever asks, in a sealed swarm.
    pub(super) fn sign_statement(&self, statement: &[u8]) -> Option<Signature> {
        let words = self.sealed.as_ref()?.words.lock().unwrap_or_else(PoisonError::into_inner);
        Some(words.statement(statement))
    }

    /// What this robot asks the camera of another one, in a sealed swarm.
    pub(super) fn sign_challenge(&self, to: RobotId, challenge: u64) -> Option<FrameChallenge> {
        let words = self.sealed.as_ref()?.words.lock().unwrap_or_else(PoisonError::into_inner);
        Some(words.challenge(to, challenge))
    }

    /// What shows that robot that it was told this by this one, in a sealed swarm.
    pub(super) fn tag(&self, to: RobotId, message: &[u8]) -> Option<Result<Tag, Distrust>> {
        let sealed = self.sealed.as_ref()?;
        let mut channels = sealed.channels.lock().unwrap_or_else(PoisonError::into_inner);
        self.judged(|judge, _| channels.tag(judge.roster(), to, message))
    }

    /// Whether its author told this robot that, and is a member that is believed; in an open swarm everybody is.
    pub(super) fn was_told(
        &self,
        envelope: &Envelope,
        message: &[u8],
        sample: &Sample,
    ) -> Result<(), Distrust> {
        let Some(sealed) = &self.sealed else { return Ok(()) };
        let tag = sample.attachment().filter(|it| it.len() == size_of::<Tag>()).map(|it| it.to_bytes());
        let mut channels = sealed.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let (author, stamp) = (envelope.author, envelope.stamp);
        let checked = self.judged(|judge, _| {
            judge.key(author)?;
            channels.check(judge.roster(), (author, stamp), message, tag.as_deref())
        });
        checked.unwrap_or(Ok(()))
    }

    pub(super) fn on_answer(&self, to: InstructorId, sample: &Sample) -> Result<(), Refusal> {
        let json = payload(sample, MAX_JSON)?;
        let answer: Answer = decode_json(&json)?;
        let attachment =
            sample.attachment().filter(|it| it.len() <= Signature::LENGTH).map(|it| it.to_bytes());
        self.judged(|judge, now| judge.answer(now, answer.robot, &to, &json, attachment.as_deref()))
            .unwrap_or(Ok(()))?;
        self.queue_word(Input::Answered(to, answer.at, answer.robot), sample)
    }

    pub(super) fn on_word(&self, by: InstructorId, sample: &Sample) -> Result<(), Refusal> {
        let word = payload(sample, MAX_WORD)?;
        let instruction: Instruction = decode_json(&word)?;
        let attachment = sample.attachment().filter(|it| it.len() <= MAX_ATTACHMENT);
        let attachment = attachment.map(|it| it.to_bytes());
        let heeded = self.judged(|judge, now| judge.word(now, &by, &word, attachment.as_deref()));
        let (heading, roles) = heeded.ok_or(Refusal::Kind)??;
        let allowed = roles.permit(&instruction);
        let attachment = attachment.unwrap_or_default().into_owned();
        let signed = SignedWord { word: word.into_owned(), attachment };
        let said = Instructed { by, at: heading.count, instruction, said: Some(signed) };
        self.queue_word(if allowed { Input::Instructed(said) } else { Input::Disallowed(said) }, sample)
    }

    /// Whether that robot is a member that is believed, with the key that it has here; in an open swarm, where there is no seal, always.
    pub(super) fn enrols(&self, robot: RobotId, seal: Option<&Seal>) -> bool {
        let Some(seal) = seal else { return true };
        let has_key = |judge: &mut Judge, _| {
            let held = judge.roster().members().robots.get(&robot);
            held == Some(&seal.identity.public_key()) && judge.is_member(robot)
        };
        self.judged(has_key) == Some(true)
    }

    /// Who knows by the roster of today whose words count.
    pub(super) fn believer(&self) -> Option<Arc<dyn Believe>> {
        let words = &self.sealed.as_ref()?.words;
        let returned = words.lock().unwrap_or_else(PoisonError::into_inner).returned();
        self.judged(|judge, _| -> Arc<dyn Believe> {
            let roster = judge.roster().clone();
            let robots = roster.members().robots.keys().copied();
            let convicted = robots.filter(|robot| judge.convicts(*robot)).collect();
            Arc::new(Believer { convicted, me: self.me, roster, returned })
        })
    }

    pub(super) fn on_roster(&self, sample: &Sample) -> Result<(), Refusal> {
        let sealed = self.sealed.as_ref().ok_or(Refusal::Kind)?;
        let json = payload(sample, MAX_ROSTER)?;
        if sealed.roll.is_held(&json) {
            return Ok(());
        }
        if !sealed.roll.may_read(json.len()) {
            return Err(Refusal::TooOften);
        }
        let taken_up = self.judged(|judge, _| sealed.roll.take_up(judge, &json));
        if let Some(gone) = taken_up.ok_or(Refusal::Kind)?? {
            self.expel(gone);
        }
        Ok(())
    }

    /// What the mind has found that convicts an author of samples.
    pub(super) fn note_contradictions(&self, found: Vec<(HeldBatch, HeldBatch)>) {
        if found.is_empty() {
            return;
        }
        for (one, other) in found {
            self.judged(|judge, _| judge.two_samples(one, other));
        }
        self.expel_fallen();
        self.ready.notify_one();
    }

    /// Whoever was convicted meanwhile counts no more.
    pub(super) fn expel_fallen(&self) {
        // While the judge is held: a roster that is taken up meanwhile may acquit them, and is to come after.
        let fallen = self.judged(|judge, _| {
            let fallen = judge.fallen();
            fallen.iter().for_each(|(robot, lie)| self.account.convicted(*robot, *lie));
            fallen
        });
        let fallen = fallen.unwrap_or_default();
        let others: BTreeSet<RobotId> = fallen.into_iter().map(|(robot, _)| robot).collect();
        if !others.is_empty() {
            self.expel(others);
            if let Some(sealed) = &self.sealed {
                sealed.roll.meet();
            }
        }
    }

    /// Hands in again what evidence was kept, so that nobody is believed again who lied before this robot started.
    pub(super) fn recall(&self) {
        let Some(sealed) = &self.sealed else { return };
        for evidence in sealed.roll.kept_evidence() {
            // It proves nothing against whoever has another key since.
            let _ = self.judged(|judge, now| judge.evidence(now, evidence));
        }
        // It is kept already.
        self.unkept();
        self.expel_fallen();
    }

    /// Nothing counts that these said, in the midst of a round; nor are they there, unless they are members under another key.
    fn expel(&self, gone: BTreeSet<RobotId>) {
        // Of two threads with a roster each the one whose believer is older would otherwise come last.
        let _in_turn = self.expelling.lock().unwrap_or_else(PoisonError::into_inner);
        // Before the state is held: whoever vouches for a word comes to that with the words held, which this asks for.
        let believer = self.believer();
        let mut state = self.lock();
        state.votes.retain(|robot, _| !gone.contains(robot));
        let left = |robot: &RobotId| !gone.contains(robot) || !self.is_stranger(*robot);
        state.alive.retain(left);
        state.alive_changed = true;
        // Before anything that it may be asked to believe from now on.
        state.waiting.expel([Input::Expelled(gone)].into_iter().chain(believer.map(Input::Believe)));
        drop(state);
        // Who is new was refused until now, its token too.
        self.unrest.notify_one();
    }
}
