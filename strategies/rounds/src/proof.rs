//! Whether a decision follows from the votes in its certificate.

use gestalt_protocol::{Certificate, Decision, Pool};

use crate::ballot::Scale;
use crate::columns::Columns;
use crate::config::RoundsConfig;
use crate::fuse::Fuse;
use crate::fusion::Fusion;
use crate::rows::Rows;

/// What the exponentials of two platforms may differ by, in a probability: a decision that is one at its author is one everywhere.
const TOLERANCE: f64 = 1e-9;

/// Whether robots of that configuration, so many of them, decide so on the votes that the decision brings with it, fused by that
/// rule. What it says of itself counts for nothing. Whether the votes were cast is another question, for `gestalt-trust`.
///
/// How alike robots are is taken from the certificate, for robots learn that from what instructors confirmed, and not all have heard all of it. Where
/// liars are expected it must be what is believed beforehand.
///
/// A decision without a class follows from votes that do not suffice for any. Its probabilities may be others than those found here by
/// 1e-9, as exponentials of different platforms are; nothing else may.
#[must_use]
pub fn follows(decision: &Decision, rule: &dyn Fuse, config: &RoundsConfig, robots: u32) -> bool {
    if decision.check().is_err() {
        return false;
    }
    let certificate = &decision.certificate;
    let Certificate { vocabulary, probabilities, unknown, votes, others, .. } = certificate;
    let scale = Scale { vocabulary: *vocabulary, classes: certificate.listed() };
    let columns = Columns::of(scale.classes, votes.iter().map(|counted| &counted.vote));
    let of_the_round = |counter| counter == decision.round.counter;
    let sound = certificate.rule == rule.rule()
        && columns == Columns::of_certificate(certificate)
        && votes.iter().all(|counted| scale.is_of(&counted.vote) && of_the_round(counted.vote.round.counter))
        && others.iter().all(|held| of_the_round(held.vote.round.counter));
    let contributors = votes.iter().map(|counted| counted.robot);
    let reached = contributors.clone().chain(others.iter().map(|held| held.robot));
    let suffice = config.suffice_of(decision.round.counter, reached, contributors, robots);
    let said;
    let rule = match (rule.pool(), certificate.pool) {
        (None, None) => rule,
        (Some(_), Some(pool)) if config.liars == 0 || pool == Pool::PRIOR => {
            let Some(by_its_pool) = rule.with(pool) else { return false };
            said = by_its_pool;
            &*said
        }
        _ => return false,
    };
    let rows = Rows::of(&columns, config.clip, votes.iter().map(|counted| &counted.vote));
    let fusion = rows.fuse(rule, config.clip);
    let withstands = |fusion: &Fusion| rows.withstands(rule, config.clip, fusion, config.liars);
    let Some(class) = decision.class else {
        let known = |fusion: &&Fusion| fusion.top.index() < columns.len();
        let decides = |fusion: &Fusion| config.convinces(withstands(fusion) - TOLERANCE);
        return sound && !(suffice && fusion.as_ref().filter(known).is_some_and(decides));
    };
    let Some(fusion) = fusion.filter(|_| sound && suffice) else { return false };
    if unknown.is_some() != (rows.classes() > columns.len()) {
        return false;
    }
    let close = |a: f64, b: f64| (a - b).abs() <= TOLERANCE;
    let Some(likeliest) = certificate.place(class).and_then(|place| fusion.probabilities.get(place).copied())
    else {
        return false;
    };
    fusion.probabilities.iter().zip(probabilities.iter().chain(unknown)).all(|(a, b)| close(*a, *b))
        && close(likeliest, decision.confidence)
        && close(likeliest, fusion.probabilities[fusion.top.index()])
        && config.convinces(withstands(&fusion) + TOLERANCE)
}
