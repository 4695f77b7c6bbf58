//! The table of all attacks, as it is printed.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::attack::{Attack, Counted, Verdict};
use crate::attacks::all;
use crate::on_all_cores;

/// Plays the attacks of these numbers, or all, and prints what comes of each; whether all came to what their line says.
#[must_use]
pub fn print(numbers: &[String], seeds: u64) -> bool {
    let began = Instant::now();
    let wanted = |attack: &Attack| numbers.is_empty() || numbers.iter().any(|number| attack.is_of(number));
    let (mut reached, mut gaps, mut failed) = (0, 0, 0);
    println!("{:<10} {:<6} {:<2}  {:<8} attack → expected", "number", "swarm", "", "reached");
    let attacks: Vec<Attack> = all().into_iter().filter(|attack| wanted(attack)).collect();
    on_all_cores::play(&attacks, seeds, |attack, verdict, took| {
        let took = took.as_secs_f64();
        let answer = attack.check(&verdict);
        let word = match (&answer, attack.gap) {
            (Err(_), _) => "FAILED",
            (Ok(()), Some(_)) => "open",
            (Ok(()), None) => "yes",
        };
        match word {
            "yes" => reached += 1,
            "open" => gaps += 1,
            _ => failed += 1,
        }
        let Attack { number, setting, tier, what, expected, .. } = attack;
        println!("{number:<10} {setting:<6} {tier:<2}  {word:<8} {what} → {expected}");
        println!("{:<31} {} · {took:.1} s", "", refused(attack, &verdict));
        if let (Some(gap), Err(seen)) = (attack.gap, &verdict.reached) {
            println!("{:<31} open: {gap}", "");
            println!("{:<31} seen: {}", "", seen.chars().take(160).collect::<String>());
        }
        if let Err(error) = answer {
            println!("{:<31} FAILED: {error}", "");
        }
    });
    println!(
        "{} attacks, {seeds} seeds each: {reached} come to nothing or to what is bounded, {gaps} open, {failed} FAILED · {:.1} s",
        reached + gaps + failed,
        began.elapsed().as_secs_f64()
    );
    failed == 0
}

/// How often each counter named it.
fn refused(attack: &Attack, verdict: &Verdict) -> String {
    let words = |refused: &BTreeMap<String, u64>| {
        refused.iter().map(|(counter, times)| format!("{counter} {times}")).collect::<Vec<_>>().join(", ")
    };
    match attack.counted {
        _ if !verdict.refused.is_empty() => words(&verdict.refused),
        Counted::None(why) => format!("nothing refused: {why}"),
        Counted::All(_) | Counted::Some(_) => "nothing refused".to_owned(),
    }
}
