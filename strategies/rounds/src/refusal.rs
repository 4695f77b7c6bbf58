//! What a robot refused, counted by cause: of votes, decisions and rounds, and of what it is to learn from.

/// Why something was refused. The robot is unchanged by what it refuses, but for the count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A message with this robot's own id that this robot never sent: two robots share the id.
    DuplicateId,
    /// A round so far ahead of all rounds known that its counter is taken for a mistake or a lie.
    FarAhead,
    /// A round that would end the open one before that had its time.
    TooSoon,
    /// A vote or decision over another vocabulary, or with another number of classes, than this robot's classifier has.
    Vocabulary,
    /// A decision that is none by this robot's own rule, quorum and alpha: all robots need the same.
    Unfounded,
    /// A decision that is announced under another label than its gesture has here.
    Label,
    /// A vote or decision with a value that no robot may say.
    Impossible,
    /// A vote of one robot more than a ballot can hold.
    BallotFull,
    /// A frame seen while there is no classifier to judge it.
    NoClassifier,
    /// A frame that the classifier could not judge, or judged with something that is no distribution.
    Unclassified,
    /// A sample of another feature space than this robot learns in.
    OtherSpace,
    /// A sample whose vector has another length, or a component that is not finite or lies far out.
    BadVector,
    /// A sample of a class that the vocabulary does not have.
    UnknownClass,
    /// A sample with an author or number beyond the bounds of what one robot remembers.
    SampleNumber,
    /// A lesson on a round of which as many instructors spoke as are kept, or on one older than all that are kept.
    LessonFull,
    /// A lesson on a round, or with a count, so far ahead of all known that it is taken for a mistake or a lie.
    LessonFarAhead,
    /// A lesson that nothing shows to be its instructor's word, or of one who may not teach.
    LessonUnproven,
    /// A word on a gesture's name where as many gestures that go before it were named as are kept.
    NamingFull,
    /// A word on a gesture's name with a count so far ahead of all known that it is taken for a mistake or a lie.
    NamingFarAhead,
    /// A word on a gesture's name that nothing shows to be whoever's it is said to be, or of one who may not teach.
    NamingUnproven,
    /// A question about what this robot knows, of one that is no neighbour.
    Stranger,
    /// A question about what this robot knows, of a neighbour that was told much just now.
    TooOften,
    /// What another robot asks whoever instructs the swarm, of a round that is not the newest, not over or was spoken of, or sooner than the swarm may ask.
    Untimely,
    /// A decision beyond the rate at which one robot may give them, or all together announce them.
    DecisionTooOften,
    /// A comparison of what is known of a round, beyond the rate at which one robot may ask for it.
    HaveTooOften,
    /// A round could not be opened: the counters are used up.
    CountersUsedUp,
    /// What its instructor may not say, or not where somebody else has.
    WordNotAllowed,
}

impl Refusal {
    /// All causes.
    pub const ALL: [Self; 27] = [
        Self::DuplicateId,
        Self::FarAhead,
        Self::TooSoon,
        Self::Vocabulary,
        Self::Unfounded,
        Self::Label,
        Self::Impossible,
        Self::BallotFull,
        Self::NoClassifier,
        Self::Unclassified,
        Self::OtherSpace,
        Self::BadVector,
        Self::UnknownClass,
        Self::SampleNumber,
        Self::LessonFull,
        Self::LessonFarAhead,
        Self::LessonUnproven,
        Self::NamingFull,
        Self::NamingFarAhead,
        Self::NamingUnproven,
        Self::Stranger,
        Self::TooOften,
        Self::Untimely,
        Self::DecisionTooOften,
        Self::HaveTooOften,
        Self::CountersUsedUp,
        Self::WordNotAllowed,
    ];

    /// The cause in words, as the status names its counter.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DuplicateId => "refused_duplicate_id",
            Self::FarAhead => "refused_round_far_ahead",
            Self::TooSoon => "refused_round_too_soon",
            Self::Vocabulary => "refused_other_vocabulary",
            Self::Unfounded => "refused_unfounded_decision",
            Self::Label => "refused_decision_label",
            Self::Impossible => "refused_impossible_value",
            Self::BallotFull => "refused_ballot_full",
            Self::NoClassifier => "refused_no_classifier",
            Self::Unclassified => "refused_unclassified_frame",
            Self::OtherSpace => "refused_sample_of_other_space",
            Self::BadVector => "refused_sample_with_bad_vector",
            Self::UnknownClass => "refused_sample_of_unknown_class",
            Self::SampleNumber => "refused_sample_number",
            Self::LessonFull => "refused_lesson_full",
            Self::LessonFarAhead => "refused_lesson_far_ahead",
            Self::LessonUnproven => "refused_lesson_unproven",
            Self::NamingFull => "refused_naming_full",
            Self::NamingFarAhead => "refused_naming_far_ahead",
            Self::NamingUnproven => "refused_naming_unproven",
            Self::Stranger => "refused_question_of_stranger",
            Self::TooOften => "refused_question_too_often",
            Self::Untimely => "refused_question_untimely",
            Self::DecisionTooOften => "refused_decision_too_often",
            Self::HaveTooOften => "refused_have_too_often",
            Self::CountersUsedUp => "refused_counters_used_up",
            Self::WordNotAllowed => "refused_word_not_allowed",
        }
    }
}

/// How often each [`Refusal`] happened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refusals([u64; Refusal::ALL.len()]);

impl Refusals {
    /// How often this one happened.
    #[must_use]
    pub fn count(&self, refusal: Refusal) -> u64 {
        self.0[refusal as usize]
    }

    /// Every cause with its count, in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = (Refusal, u64)> + '_ {
        Refusal::ALL.into_iter().map(|refusal| (refusal, self.count(refusal)))
    }

    pub(crate) fn add(&mut self, refusal: Refusal) {
        self.0[refusal as usize] += 1;
    }
}
