//! Whether a decision follows from the votes in its certificate.

use gestalt_protocol::{Certificate, CountedVote, Decision, FusionRule, Pool, RobotId, Stamp, Vote};

use crate::ballot::{Scale, weight};
use crate::columns::Columns;
use crate::config::RoundsConfig;
use crate::fuse::Fuse;
use crate::fusion::Fusion;
use crate::rows::Rows;

/// How closely a decision is compared with what its votes come to.
#[derive(Clone, Copy)]
struct Standard {
    /// What a probability may differ by.
    tolerance: f64,
    /// Whether of two classes that are equally likely either may lead.
    either_of_equals: bool,
}

/// What the exponentials of two platforms may differ by, in a probability: a decision that is one at its author is one everywhere.
const BELIEVED: Standard = Standard { tolerance: 1e-9, either_of_equals: false };

/// What no platform makes of votes that another makes a decision of: nobody can have an honest robot pass on what convicts it elsewhere.
const EVIDENT: Standard = Standard { tolerance: 1e-6, either_of_equals: true };

/// Whether robots of that configuration, so many of them, decide so on the votes that the decision brings with it, fused by that
/// rule. Whether the votes were cast is another question, for `gestalt-trust`.
///
/// How alike robots are is taken from the certificate, for robots learn that from what instructors confirmed, and not all have heard all of it. Where
/// liars are expected it must be what is believed beforehand.
///
/// A decision without a class follows from votes that do not suffice for any. Its probabilities may be others than those found here by
/// 1e-9, as exponentials of different platforms are; nothing else may, but for what no vote speaks of: who drew it, when, and of how many robots, where its
/// quorum is that of as many.
#[must_use]
pub fn follows(decision: &Decision, rule: &dyn Fuse, config: &RoundsConfig, robots: u32) -> bool {
    let certificate = &decision.certificate;
    let suffice =
        || config.suffice_of(decision.round.counter, reached(certificate), voters(certificate), robots);
    decision.check().is_ok()
        && certificate.rule == rule.rule()
        && certificate.terms == config.terms()
        && certificate.quorum == config.needs(certificate.robots)
        && holds(decision, Some(rule), Some(suffice()), BELIEVED)
}

/// Whether a decision contradicts the votes that it brings, by the terms that it states itself: no honest robot concludes it, or passes it on, whatever it is
/// configured to and whatever it knows of the swarm. So it is evidence against whoever gives it.
///
/// Nothing is asked that depends on who asks. Of a rule of somebody's own it is not asked what it makes of the votes; of a committee not who was in it; and
/// probabilities have to be others by 1e-6 than those found here.
#[must_use]
pub fn is_refuted(decision: &Decision) -> bool {
    decision.check().is_ok() && !holds(decision, own(&decision.certificate.rule), None, EVIDENT)
}

/// Whether a decision that is none for any gesture says what its votes come to. Who passes it on stands by that.
pub(crate) fn is_consistent(decision: &Decision) -> bool {
    holds(decision, own(&decision.certificate.rule), None, BELIEVED)
}

/// A rule that comes with Gestalt.
fn own(rule: &FusionRule) -> Option<&dyn Fuse> {
    (!matches!(rule, FusionRule::Other(_))).then_some(rule as &dyn Fuse)
}

fn voters(certificate: &Certificate) -> impl Iterator<Item = RobotId> + '_ {
    certificate.votes.iter().map(|counted| counted.robot)
}

fn reached(certificate: &Certificate) -> impl Iterator<Item = RobotId> + '_ {
    said(certificate).map(|(robot, ..)| robot)
}

/// All votes of a certificate, those that are counted first: whose, which of its votes, and what it said.
pub(crate) fn said(certificate: &Certificate) -> impl Iterator<Item = (RobotId, Stamp, &Vote)> {
    let counted = certificate.votes.iter().map(|counted| (counted.robot, counted.stamp, &counted.vote));
    counted.chain(certificate.others.iter().map(|held| (held.robot, held.stamp, &held.vote)))
}

/// Whether all that it claims holds, by its own terms, of its votes: fused by that rule, if that is to be asked. `suffice`: whether they are enough, where the
/// one who asks can tell.
fn holds(decision: &Decision, rule: Option<&dyn Fuse>, suffice: Option<bool>, standard: Standard) -> bool {
    let certificate = &decision.certificate;
    let Certificate { vocabulary, votes, others, terms, robots, quorum, .. } = certificate;
    let scale = Scale { vocabulary: *vocabulary, classes: certificate.listed() };
    let columns = Columns::of(scale.classes, votes.iter().map(|counted| &counted.vote));
    let of_the_round = |vote: &Vote| vote.round.counter == decision.round.counter;
    let counts = |CountedVote { vote, class, .. }: &CountedVote| {
        scale.is_of(vote) && of_the_round(vote) && *class == columns.top(vote)
    };
    // What could be counted with the others is.
    let is_other = |vote: &Vote| of_the_round(vote) && (votes.is_empty() || !scale.is_of(vote));
    let config = RoundsConfig::stated(certificate);
    let sound = columns == Columns::of_certificate(certificate)
        && votes.iter().all(counts)
        && others.iter().all(|held| is_other(&held.vote))
        && *quorum == config.needs(*robots);
    let enough = [suffice, suffice_as_stated(certificate, &config)];
    if !sound || (decision.class.is_some() && enough.contains(&Some(false))) {
        return false;
    }
    let Some(rule) = rule else { return true };
    let said;
    let rule = match (rule.pool(), certificate.pool) {
        (None, None) => rule,
        (Some(_), Some(pool)) if terms.liars == 0 || pool == Pool::PRIOR => {
            let Some(by_its_pool) = rule.with(pool) else { return false };
            said = by_its_pool;
            &*said
        }
        _ => return false,
    };
    let close = |a: f64, b: f64| (a - b).abs() <= standard.tolerance;
    let weighs =
        |counted: &CountedVote| close(weight(rule, terms.clip, &counted.vote).into(), counted.weight.into());
    let rows = Rows::of(&columns, terms.clip, votes.iter().map(|counted| &counted.vote));
    let Some(fusion) = rows.fuse(rule, terms.clip) else { return is_empty(decision) };
    if !votes.iter().all(weighs) || !is_of(certificate, &fusion, close) {
        return false;
    }
    let greatest = fusion.greatest();
    let withstands = || rows.withstands(rule, terms.clip, &fusion, terms.liars);
    let claimed = decision.class.map(|class| {
        let place = certificate.place(class);
        place.and_then(|place| fusion.probabilities.get(place).copied()).unwrap_or_default()
    });
    close(greatest, decision.confidence)
        && match claimed {
            Some(likeliest) => {
                let convinces = |probability: f64| config.convinces(probability + standard.tolerance);
                let either = standard.either_of_equals && config.convinces(0.5 + standard.tolerance);
                close(likeliest, greatest) && convinces(likeliest) && (either || convinces(withstands()))
            }
            None => {
                let known = fusion.top.index() < columns.len();
                let decides = || known && config.convinces(withstands() - standard.tolerance);
                !(enough.contains(&Some(true)) && decides())
            }
        }
}

/// Whether the votes are enough of as many robots as the certificate states. Where a committee votes, only that they are not: who was in it, its author knew.
fn suffice_as_stated(certificate: &Certificate, config: &RoundsConfig) -> Option<bool> {
    let suffice = config.suffice(certificate.reached(), certificate.votes.len(), certificate.robots);
    Some(suffice).filter(|suffice| !suffice || config.committee_of(certificate.robots).is_none())
}

/// Whether the probabilities of the certificate are those of that fusion.
fn is_of(certificate: &Certificate, fusion: &Fusion, close: impl Fn(f64, f64) -> bool) -> bool {
    let said = || certificate.probabilities.iter().chain(&certificate.unknown);
    said().count() == fusion.probabilities.len()
        && fusion.probabilities.iter().zip(said()).all(|(found, said)| close(*found, *said))
}

/// Whether it counts no vote, and claims nothing.
fn is_empty(decision: &Decision) -> bool {
    let Certificate { votes, probabilities, unknown, .. } = &decision.certificate;
    decision.class.is_none()
        && decision.confidence == 0.0
        && votes.is_empty()
        && probabilities.is_empty()
        && unknown.is_none()
}
