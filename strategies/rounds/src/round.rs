//! One showing of a gesture, as one robot lives through it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{
    Certificate, ClassId, Decision, Envelope, HeldVote, Message, Pool, RobotId, RoundId, Stamp, VocabularyId,
    Vote,
};

use crate::agreement::Agreement;
use crate::ballot::{Ballot, Scale};
use crate::classify::{Classify, Judgement};
use crate::columns::Columns;
use crate::config::RoundsConfig;
use crate::electorate::Expected;
use crate::evidence::{Evidence, JudgedFrame};
use crate::fuse::Fuse;
use crate::fusion::Fusion;
use crate::names::Names;
use crate::observation::Observation;
use crate::rows::Rows;
use crate::sign::Sign;
use crate::vocabulary::Vocabulary;

/// A round: what this robot has seen, what it knows of the others' votes and decisions, and what it said.
#[derive(Clone, Debug)]
pub(crate) struct Round {
    pub id: RoundId,
    /// When this robot first heard of it.
    pub since: Duration,
    /// Whether this robot still takes part by looking and voting; and, once it does not, whether it was long enough to say something.
    pub open: bool,
    pub lasted: bool,
    pub ballot: Ballot,
    pub agreement: Agreement,
    evidence: Option<Evidence>,
    said: Option<Said>,
    voice: Voice,
    /// Whether this robot has drawn its own conclusion.
    concluded: bool,
    /// What it last tried to conclude from, in vain.
    tried: Option<Tried>,
    /// When it ends undecided, if before its deadline.
    ends: Option<Duration>,
    /// Whether others go on to the next one: then nothing more is waited for.
    pub hurried: bool,
    /// Its names, under which robots opened it at the same time.
    names: Names,
}

/// What a robot says in a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Voice {
    /// What it sees.
    Votes,
    /// Only that there is a round, which it opened: others vote.
    Opens,
    /// Nothing: others vote.
    Silent,
}

/// All that a conclusion depends on which may change while robots come and go no more.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tried {
    /// How often the ballot has changed.
    votes: u64,
    robots: u32,
    scale: Option<Scale>,
    pool: Option<Pool>,
    /// Whether there is a decision for a gesture already, and of how many votes.
    best: Option<usize>,
    hurried: bool,
    waits: bool,
    late: bool,
}

/// This robot's vote as it was last said.
#[derive(Clone, Debug)]
struct Said {
    at: Duration,
    envelope: Envelope,
    /// Whether there is newer evidence.
    outdated: bool,
}

impl Round {
    pub fn new(id: RoundId, since: Duration, open: bool) -> Self {
        Self {
            id,
            since,
            open,
            lasted: false,
            ballot: Ballot::default(),
            agreement: Agreement::default(),
            evidence: None,
            said: None,
            voice: Voice::Votes,
            concluded: false,
            tried: None,
            ends: None,
            hurried: false,
            names: Names::new(id),
        }
    }

    /// Whether that is its name, or was found to be one while it began: a vote is passed on under the name that it was cast under, however late.
    pub fn is_named(&self, id: RoundId) -> bool {
        self.names.contains(id)
    }

    /// Whether a decision for a gesture is held.
    pub fn has_decided(&self) -> bool {
        self.agreement.held().is_some_and(|held| held.class.is_some())
    }

    /// All its names that are remembered.
    pub fn names(&self) -> impl Iterator<Item = RoundId> + '_ {
        self.names.iter()
    }

    /// Takes in another name, brought by that robot, if it is known; whether it was news. The smallest is its own.
    pub fn merge(&mut self, other: RoundId, by: Option<RobotId>) -> bool {
        let is_news = self.names.add(other, by);
        if is_news {
            self.id = self.id.min(other);
        }
        is_news
    }

    /// Judges a frame and counts it; `false` when the classifier could not judge it, or gave no distribution.
    pub fn observe(
        &mut self,
        now: Duration,
        observation: &Observation,
        classifier: &dyn Classify,
        config: &RoundsConfig,
    ) -> bool {
        let classes = classifier.vocabulary().classes();
        match classifier.judge_seen(observation) {
            Ok(Judgement { probabilities, unknown, view })
                if probabilities.len() == classes
                    && probabilities.iter().all(|p| (0.0..=1.0).contains(p)) =>
            {
                let quality = f64::from(observation.quality.clamp(0.0, 1.0));
                let view = view.filter(|_| config.discount_repeats).unwrap_or_default();
                let unknown = unknown.filter(|p| p.is_finite() && *p >= 0.0);
                let probabilities = probabilities.as_slice();
                self.add(JudgedFrame { at: now, probabilities, unknown, quality, view: &view }, config);
                true
            }
            Ok(_) | Err(_) => false,
        }
    }

    /// Counts a frame.
    fn add(&mut self, frame: JudgedFrame<'_>, config: &RoundsConfig) {
        let classes = frame.probabilities.len();
        let evidence = self.evidence.get_or_insert_with(|| Evidence::new(classes));
        if evidence.classes() != classes {
            *evidence = Evidence::new(classes);
        }
        if evidence.add(frame, config.decorrelation)
            && self.voice == Voice::Votes
            && let Some(said) = &mut self.said
        {
            said.outdated = true;
        }
    }

    /// What this robot says in it from now on.
    pub fn speak_as(&mut self, voice: Voice) {
        if std::mem::replace(&mut self.voice, voice) != voice {
            self.tried = None;
            self.outdate();
        }
    }

    pub fn voice(&self) -> Voice {
        self.voice
    }

    /// This robot's vote has to be said anew, though it saw nothing new.
    pub fn outdate(&mut self) {
        if let Some(said) = &mut self.said {
            said.outdated = true;
        }
    }

    /// Takes out what these robots said, and what was concluded with them.
    pub fn expel(&mut self, robots: &BTreeSet<RobotId>) {
        self.ballot.strike(robots);
        if self.agreement.expel(robots) {
            self.concluded = false;
        }
    }

    /// Forgets what was seen so far: it was judged by another vocabulary.
    pub fn look_afresh(&mut self) {
        self.evidence = None;
    }

    /// Whether this robot has seen anything.
    fn has_evidence(&self) -> bool {
        self.evidence.is_some()
    }

    /// This robot's evidence as a vote.
    fn vote(&self, vocabulary: Option<&Vocabulary>, clip: f64) -> Vote {
        let own = self.evidence.as_ref().filter(|_| self.voice == Voice::Votes);
        let (mut evidence, unknown, looks) = match own {
            Some(evidence) => {
                let (clipped, unknown) = evidence.clipped_with_unknown(clip);
                (clipped, unknown, evidence.looks() as f32)
            }
            None => (Vec::new(), None, 0.0),
        };
        let mut named = Vec::new();
        if let Some(vocabulary) = vocabulary.filter(|vocabulary| vocabulary.classes() == evidence.len()) {
            let beyond = evidence.split_off(evidence.len() - vocabulary.named().len());
            let by_number: BTreeMap<ClassId, f32> = vocabulary.named().iter().copied().zip(beyond).collect();
            evidence.extend(by_number.values());
            named.extend(by_number.keys());
        }
        let vocabulary = vocabulary.map_or(VocabularyId::NONE, Vocabulary::id);
        Vote { round: self.id, vocabulary, evidence, looks, unknown, named }
    }

    /// This robot's vote, when it is due: the one said last, when nothing was seen since, or the next.
    pub fn speak(
        &mut self,
        now: Duration,
        speaker: &mut Speaker<'_>,
        config: &RoundsConfig,
    ) -> Option<Envelope> {
        if self.vote_due(config).is_none_or(|due| now < due) {
            return None;
        }
        if let Some(repeated) = self.repeat(now) {
            return Some(repeated);
        }
        let vocabulary = speaker.vocabulary.filter(|_| !speaker.blind || self.has_evidence());
        let vote = self.vote(vocabulary, config.clip);
        speaker.stamp.sequence = speaker.stamp.sequence.saturating_add(1);
        let (author, stamp) = (speaker.me, *speaker.stamp);
        let mut envelope = Envelope { author, stamp, message: Message::Vote(vote.clone()), signature: None };
        envelope.signature = speaker.signer.map(|signer| signer.sign(&envelope.statement()));
        self.ballot.cast(HeldVote { robot: author, stamp, vote, signature: envelope.signature });
        self.said = Some(Said { at: now, envelope: envelope.clone(), outdated: false });
        Some(envelope)
    }

    /// When this robot's vote is to be said (again).
    pub fn vote_due(&self, config: &RoundsConfig) -> Option<Duration> {
        match &self.said {
            _ if !self.open || self.voice == Voice::Silent => None,
            None => Some(self.since),
            Some(said) if said.outdated => Some(said.at + config.vote_interval),
            Some(said) => Some(said.at + config.vote_repeat),
        }
    }

    /// What to say again: the vote said last, when nothing was seen since.
    fn repeat(&mut self, now: Duration) -> Option<Envelope> {
        let said = self.said.as_mut().filter(|said| !said.outdated)?;
        said.at = now;
        Some(said.envelope.clone())
    }

    /// When this robot stops waiting for live robots that have not seen anything, and when it gives up.
    pub fn patience_and_deadline(&self, config: &RoundsConfig) -> (Duration, Duration) {
        let deadline = self.since + config.deadline;
        (self.since + config.patience, self.ends.map_or(deadline, |ends| ends.min(deadline)))
    }

    /// Nothing more can be seen of the gesture: what is still to be heard of it is on its way.
    pub fn end_early(&mut self, now: Duration, config: &RoundsConfig) {
        self.ends.get_or_insert(now + config.patience);
    }

    /// Whether nothing is to be waited for any more. A robot that has not seen anything yet may be about to: its camera may take a frame in half a
    /// second.
    fn has_heard_all(&self, now: Duration, view: &View<'_>, config: &RoundsConfig) -> bool {
        let own = Some(view.me).filter(|_| self.voice == Voice::Votes);
        let spoke = |robot| self.ballot.has_spoken(robot);
        self.hurried
            || now >= self.since + config.patience
            || own.is_none_or(spoke) && view.expected.all(spoke)
    }

    /// Whether what this robot knows of the votes, those of the decision among them, speaks for it too, whichever of them lie. Where liars are
    /// expected they may have chosen what it rests on, and decided before the others had a say.
    pub fn bears_out(
        &self,
        now: Duration,
        decision: &Decision,
        view: &View<'_>,
        rule: &dyn Fuse,
        config: &RoundsConfig,
    ) -> bool {
        let certificate = &decision.certificate;
        let scale = Scale { vocabulary: certificate.vocabulary, classes: certificate.listed() };
        let likeliest = || {
            let columns = self.ballot.columns(scale);
            let rows = self.ballot.rows(&columns, config.clip, scale);
            let fusion = rows.fuse(rule, config.clip)?;
            let leads_always = rows.withstands(rule, config.clip, &fusion, config.liars) > 0.0;
            columns.class(fusion.top.index()).filter(|_| leads_always)
        };
        (!self.open || self.has_heard_all(now, view, config)) && likeliest() == decision.class
    }

    /// Whether it is still to be concluded.
    pub fn is_unconcluded(&self) -> bool {
        self.open && !self.concluded
    }

    /// Robots have come or gone: what was tried in vain is tried again.
    pub fn look_again(&mut self) {
        self.tried = None;
    }

    /// Draws this robot's own conclusion, once: a class when the votes suffice, none at the deadline. Who holds the decision of
    /// another goes on to conclude when it knows of more evidence than that rests on.
    pub fn conclude(&mut self, now: Duration, view: &View<'_>, rule: &dyn Fuse, config: &RoundsConfig) {
        if !self.open || self.concluded {
            return;
        }
        let (patience, deadline) = self.patience_and_deadline(config);
        let late = now >= deadline;
        // Asked at every input: with a thousand robots, counting their votes each time would be most of the work.
        if now < patience && self.ballot.len() < view.expected.len() && !self.hurried {
            return;
        }
        let scale = view.scale.or_else(|| self.ballot.prevailing_scale());
        let best = self.agreement.best().filter(|best| best.class.is_some());
        let tried = Tried {
            votes: self.ballot.changes(),
            robots: view.robots,
            scale,
            pool: rule.pool(),
            best: best.map(|best| best.certificate.votes.len()),
            hurried: self.hurried,
            waits: now < patience,
            late,
        };
        if self.tried.replace(tried) == Some(tried) {
            return;
        }
        let contributors = scale.map_or(0, |scale| self.ballot.contributors(scale));
        if self
            .agreement
            .best()
            .is_some_and(|best| best.class.is_some() && best.certificate.votes.len() >= contributors)
        {
            return;
        }
        if !(late || self.has_heard_all(now, view, config)) {
            return;
        }
        // At most, where a committee votes: who of it did is looked up for a gesture that convinces.
        let may_suffice = contributors > 0 && config.suffice(self.ballot.len(), contributors, view.robots);
        if !(late || may_suffice) {
            return;
        }
        let columns = scale.map(|scale| self.ballot.columns(scale));
        let rows = scale.zip(columns.as_ref());
        let rows = rows.map(|(scale, columns)| self.ballot.rows(columns, config.clip, scale));
        let fusion = rows.as_ref().and_then(|rows| rows.fuse(rule, config.clip));
        // Of fewer robots all count, as the certificate states how many there are.
        let drawn = view.committee.filter(|_| config.committee_of(view.robots).is_some());
        let suffice = || {
            may_suffice
                && drawn.zip(scale).is_none_or(|(members, scale)| {
                    let (reached, contributors) = self.ballot.turnout(members, scale);
                    config.suffice(reached, contributors, view.robots)
                })
        };
        let convinces = |fusion: &&Fusion| {
            // Where nobody is expected to lie nothing withstands that is not as likely at first: of most votes that is all that is asked.
            let may = config.liars > 0 || config.convinces(fusion.greatest());
            let withstands = |rows: &Rows<'_>| rows.withstands(rule, config.clip, fusion, config.liars);
            may && rows.as_ref().is_some_and(|rows| config.convinces(withstands(rows))) && suffice()
        };
        let of_place = |place: usize| columns.as_ref().and_then(|columns| columns.class(place));
        let class = fusion.as_ref().filter(convinces).and_then(|fusion| of_place(fusion.top.index()));
        if class.is_none() && (!late || self.agreement.best().is_some_and(|best| best.class.is_some())) {
            return;
        }
        // Where nothing was fused nothing was counted.
        let counted = scale.filter(|_| fusion.is_some());
        let votes = counted.map_or(Vec::new(), |scale| self.ballot.counted(rule, config.clip, scale));
        let (mut probabilities, confidence) = fusion.map_or((Vec::new(), 0.0), |fusion| {
            let confidence = fusion.greatest();
            (fusion.probabilities, confidence)
        });
        let gestures = columns.as_ref().map_or(0, Columns::len);
        let unknown = if probabilities.len() > gestures { probabilities.pop() } else { None };
        let named = columns
            .filter(|_| !probabilities.is_empty())
            .map_or(Vec::new(), |columns| columns.named().to_vec());
        self.concluded = true;
        self.agreement.believe(Decision {
            round: self.id,
            class,
            confidence,
            author: view.me,
            is_final: false,
            certificate: Certificate {
                vocabulary: scale.map_or(VocabularyId::NONE, |scale| scale.vocabulary),
                rule: rule.rule(),
                pool: rule.pool(),
                probabilities,
                unknown,
                named,
                votes,
                others: self.ballot.uncounted(counted),
                robots: view.robots,
                quorum: config.needs(view.robots),
                elapsed_ms: u32::try_from(now.saturating_sub(self.since).as_millis()).unwrap_or(u32::MAX),
                terms: config.terms(),
            },
        });
    }
}

/// In whose name a vote is said.
pub(crate) struct Speaker<'a> {
    pub me: RobotId,
    /// That of the last message said.
    pub stamp: &'a mut Stamp,
    /// The classifier's.
    pub vocabulary: Option<&'a Vocabulary>,
    /// Who is blind and has seen nothing says that it cannot see.
    pub blind: bool,
    pub signer: Option<&'a dyn Sign>,
}

/// What a robot knows of the swarm when it concludes.
pub(crate) struct View<'a> {
    pub me: RobotId,
    /// The other robots that are alive and may yet say something.
    pub expected: Expected<'a>,
    /// How many robots there are.
    pub robots: u32,
    /// Who was drawn to vote, where not all are.
    pub committee: Option<&'a BTreeSet<RobotId>>,
    /// The scale of this robot's own classifier.
    pub scale: Option<Scale>,
}
