//! Attacks are played on all cores, seed by seed, and judged in their order.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use crate::attack::{Attack, Played, Verdict};

/// Seeds of one attack that one core plays after each other.
struct Turn {
    attack: usize,
    seeds: RangeInclusive<u64>,
}

/// What comes of one attack with the seeds from 1 to that number.
#[must_use]
pub fn run(attack: &Attack, seeds: u64) -> Verdict {
    let mut verdict = Verdict::default();
    play(&[*attack], seeds, |_, found, _| verdict = found);
    verdict
}

/// Plays these with the seeds from 1 to that number, and hands on what came of each, and how long a core took for it, in their order.
/// A gap is played until one seed shows it.
pub fn play(attacks: &[Attack], seeds: u64, mut each: impl FnMut(&Attack, Verdict, Duration)) {
    let turns: Vec<Turn> =
        attacks.iter().enumerate().flat_map(|(n, attack)| turns_of(n, attack, seeds)).collect();
    let next = AtomicUsize::new(0);
    let (told, heard) = mpsc::channel();
    let take_turns = |told: mpsc::Sender<_>| {
        while let Some(turn) = turns.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (began, attack) = (Instant::now(), &attacks[turn.attack]);
            let played = attack.play_until_shown(turn.seeds.clone());
            let _ = told.send((turn.attack, played, began.elapsed()));
        }
    };
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let players: Vec<_> = (0..cores)
            .map(|_| {
                let told = told.clone();
                scope.spawn(|| take_turns(told))
            })
            .collect();
        drop(told);
        let mut of_each: Vec<(usize, BTreeMap<u64, Played>, Duration)> = Vec::new();
        of_each.resize_with(attacks.len(), Default::default);
        turns.iter().for_each(|turn| of_each[turn.attack].0 += 1);
        let mut done = 0;
        for (attack, played, took) in heard {
            let (left, all, time) = &mut of_each[attack];
            (*left, *time) = (*left - 1, *time + took);
            all.extend(played);
            while let Some((0, played, took)) = of_each.get_mut(done) {
                each(&attacks[done], attacks[done].judge(std::mem::take(played)), *took);
                done += 1;
            }
        }
        for player in players {
            // What panicked there panics here.
            player.join().unwrap_or_else(|panic| resume_unwind(panic));
        }
    });
}

fn turns_of(attack: usize, of: &Attack, seeds: u64) -> Vec<Turn> {
    match of.gap {
        Some(_) => vec![Turn { attack, seeds: 1..=seeds }],
        None => (1..=seeds).map(|seed| Turn { attack, seeds: seed..=seed }).collect(),
    }
}
