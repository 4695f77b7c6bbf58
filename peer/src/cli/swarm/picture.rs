//! A picture of what each robot saw in one round.

use std::path::Path;

use gestalt_protocol::{ClassId, Decision, RoundId};

use super::super::Failure;
use crate::body::Body;
use crate::config::Config;
use crate::opinion::likeliest;
use crate::picture::{self, Panel};

/// How many robots see it otherwise than the swarm.
pub(super) fn dissenters(bodies: &[Body], decision: &Decision) -> usize {
    let own = |body: &Body| {
        let seen = body.seen().filter(|seen| seen.round.counter == decision.round.counter)?;
        likeliest(&seen.probabilities(&*body.robot().classifier()?))
    };
    bodies.iter().filter(|body| own(body).map(|(class, _)| class) != decision.class).count()
}

/// The picture of one round.
pub(super) fn draw(
    path: &Path,
    configs: &[Config],
    bodies: &[Body],
    decision: &Decision,
    truth: ClassId,
) -> Result<(), Failure> {
    let RoundId { counter, .. } = decision.round;
    let vocabulary = bodies.iter().find_map(|body| Some(body.robot().classifier()?.vocabulary().clone()));
    let label = |class: ClassId| {
        let label = vocabulary.as_ref().and_then(|vocabulary| vocabulary.label(class));
        label.map_or_else(|| format!("class {class}"), str::to_owned)
    };
    let seen: Vec<_> =
        bodies.iter().zip(configs).filter_map(|(body, config)| Some((config, body, body.seen()?))).collect();
    let panels: Vec<Panel<'_>> = seen
        .iter()
        .filter(|(_, _, seen)| seen.round.counter == counter)
        .map(|(config, body, seen)| {
            let classifier = body.robot().classifier();
            let probabilities =
                classifier.map(|classifier| seen.probabilities(&*classifier)).unwrap_or_default();
            let opinion = likeliest(&probabilities);
            let by_class = (0..).map(ClassId).zip(probabilities);
            Panel {
                title: config.name(),
                image: &seen.image,
                opinion: opinion.map(|(class, probability)| (label(class), probability)),
                correct: opinion.map(|(class, _)| Some(class) == decision.class),
                probabilities: by_class.map(|(class, p)| (label(class), p)).collect(),
            }
        })
        .collect();
    let decided = match decision.class {
        Some(class) => format!("decided \"{}\" (p = {:.3}, ", label(class), decision.confidence),
        None => "undecided (".to_owned(),
    };
    let headline = format!(
        "round {counter}: shown \"{}\", {decided}{} votes, {} ms)",
        label(truth),
        decision.certificate.votes.len(),
        decision.certificate.elapsed_ms
    );
    Ok(gestalt_draw::write(&picture::round(&panels, &headline)?, path)?)
}
