//! Counts votes as a robot does when it concludes.

use gestalt_protocol::{Certificate, ClassId, CountedVote, HeldVote, Pool};
use gestalt_rounds::fusion::Fusion;
use gestalt_rounds::{Ballot, Fuse, RoundsConfig, Scale};

/// What votes come to.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Count {
    /// All evidence as one distribution; `None` where there is none.
    pub fusion: Option<Fusion>,
    /// The votes that it is made of, as a certificate lists them.
    pub counted: Vec<CountedVote>,
    /// The gesture, if enough robots voted and it is sure enough.
    pub class: Option<ClassId>,
}

/// Counts the votes that are on that scale, of so many robots, by that configuration.
/// A correlated pool knows of its robots what `pool` says.
pub(crate) fn count(
    ballot: &Ballot,
    scale: Option<Scale>,
    robots: u32,
    config: &RoundsConfig,
    pool: Option<Pool>,
) -> Count {
    let Some(scale) = scale else { return Count::default() };
    let fitted = pool.and_then(|pool| config.rule.with(pool));
    let (rule, clip) = (fitted.as_deref().unwrap_or(&config.rule), config.clip);
    let Some(fusion) = ballot.fuse(rule, clip, scale) else { return Count::default() };
    let counted = ballot.counted(rule, clip, scale);
    let counter = counted.first().map_or(0, |counted| counted.vote.round.counter);
    let reached = ballot.stamps().map(|(robot, _)| robot);
    let contributors = counted.iter().map(|counted| counted.robot);
    let decides = config.suffice_of(counter, reached, contributors, robots)
        && config.convinces(ballot.withstands(rule, config, scale, &fusion));
    // At the place behind all gestures stands "unknown", which is none.
    let class = ballot.columns(scale).class(fusion.top.index()).filter(|_| decides);
    Count { fusion: Some(fusion), counted, class }
}

/// All votes of a certificate.
pub(crate) fn votes(certificate: &Certificate) -> impl Iterator<Item = HeldVote> + '_ {
    certificate.votes.iter().map(CountedVote::held).chain(certificate.others.iter().cloned())
}

/// The scale that the author of a certificate counted on; `None` where no vote was on it.
pub(crate) fn scale(certificate: &Certificate) -> Option<Scale> {
    let vocabulary = certificate.vocabulary;
    let on_it =
        votes(certificate).find(|held| held.vote.vocabulary == vocabulary && held.vote.listed() > 0)?;
    // What was named since stands beside the list, and not all who vote on one scale know of it.
    let classes = certificate.votes.first().map_or(on_it.vote.listed(), |counted| counted.vote.listed());
    Some(Scale { vocabulary, classes })
}

/// A ballot with these votes.
pub(crate) fn ballot(votes: impl IntoIterator<Item = HeldVote>) -> Ballot {
    let mut ballot = Ballot::default();
    for held in votes {
        ballot.cast(held);
    }
    ballot
}
