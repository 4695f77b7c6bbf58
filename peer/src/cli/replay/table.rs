//! The ways to count, side by side.

use gestalt_strategies::{MindConfig, Proportion};
use gestalt_tape::{Outcome, Run, Score, WhatIf, outcomes};
use serde_json::{Value, json};

use super::super::Failure;
use super::super::show::line;
use super::Args;
use super::variants::variants;

/// Prints a line for what happened, and one for each way to count that was asked for.
pub(super) fn all(args: &Args, run: &Run, config: &MindConfig) -> Result<(), Failure> {
    let variants = variants(args, run, config)?;
    let as_it_was = outcomes(run, &WhatIf::default(), config);
    if as_it_was.is_empty() {
        return Ok(());
    }
    let happened: Vec<Outcome> = as_it_was.iter().map(|it| Outcome { would: it.happened, ..*it }).collect();
    let widest = variants.iter().map(|variant| variant.what.to_string().len()).max().unwrap_or(0).max(14);
    if !args.json {
        let heads = ["right of known", "decided", "as it happened", "better", "worse", "difference [95 %]"];
        let [right, decided, agrees, better, worse, difference] = heads;
        let words = format!(
            "{:widest$}  {right:24}  {decided:20}  {agrees:20}  {better:>6}  {worse:>5}  {difference}",
            ""
        );
        line(false, &json!(null), words.trim_end())?;
    }
    row(args, widest, "what happened", &json!({"event": "happened"}), &happened)?;
    for variant in &variants {
        let mut object = json!({
            "event": "what_if", "rule": variant.config.rule, "quorum": variant.config.quorum,
            "alpha": variant.config.alpha(), "liars": variant.config.liars, "without": variant.what.without,
        });
        object["until_ms"] = json!(variant.what.until.map(|until| until.as_millis() as u64));
        row(
            args,
            widest,
            &variant.what.to_string(),
            &object,
            &outcomes(run, &variant.what, &variant.config),
        )?;
    }
    Ok(())
}

fn row(args: &Args, widest: usize, name: &str, object: &Value, outcomes: &[Outcome]) -> Result<(), Failure> {
    let score = Score::of(outcomes);
    let mut object = object.clone();
    object["score"] = json!(score);
    object["accuracy"] = json!(score.accuracy());
    object["decisiveness"] = json!(score.decisiveness());
    object["agreement"] = json!(score.agreement());
    object["difference"] = json!(score.difference());
    object["outcomes"] = json!(outcomes);
    let difference = score.difference().map_or_else(String::new, |it| {
        let percent = |value: f64| 100.0 * value;
        format!(
            "{:+.1} [{:+.1}, {:+.1}] p = {:.3}",
            percent(it.value),
            percent(it.low),
            percent(it.high),
            it.p
        )
    });
    let words = format!(
        "{name:widest$}  {:24}  {:20}  {:20}  {:>6}  {:>5}  {difference}",
        shown(score.accuracy(), Some((score.right, score.known))),
        shown(score.decisiveness(), None),
        shown(score.agreement(), None),
        score.better,
        score.worse,
    );
    line(args.json, &object, words.trim_end())
}

/// `92.9 % [68.5, 98.7]`, with the counts in front if they are given; `–` where nothing is known.
fn shown(proportion: Option<Proportion>, counts: Option<(u64, u64)>) -> String {
    let Some(Proportion { value, low, high }) = proportion else { return "–".to_owned() };
    let counts = counts.map_or_else(String::new, |(of, all)| format!("{of}/{all} "));
    format!("{counts}{:.1} % [{:.1}, {:.1}]", 100.0 * value, 100.0 * low, 100.0 * high)
}
