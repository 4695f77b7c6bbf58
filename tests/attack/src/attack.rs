//! One line of the table: an attack, who can do it, and what it must come to.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::panic::resume_unwind;

/// What an attacker has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tier {
    /// It reaches a port of the swarm, and hears and says what it likes there.
    T0,
    /// It has recorded everything that was said so far.
    T2,
    /// It stole one robot, with its key.
    T3,
    /// It has an enrolled robot, or several, whose program is its own.
    T4,
    /// It is an instructor.
    T5,
}

/// Whether robots sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Nobody signs; a robot is whoever says so.
    Open,
    /// Votes are signed by Ed25519, and those of members are counted alone.
    Sealed,
}

impl fmt::Display for Tier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::T0 => "T0",
            Self::T2 => "T2",
            Self::T3 => "T3",
            Self::T4 => "T4",
            Self::T5 => "T5",
        })
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Open => "open",
            Self::Sealed => "sealed",
        })
    }
}

/// What must be counted of an attack.
#[derive(Clone, Copy, Debug)]
pub enum Counted {
    /// Every message of it, each by a counter; these counters must be among them.
    All(&'static [&'static str]),
    /// These counters, and maybe not every message.
    Some(&'static [&'static str]),
    /// None: why there is nothing to refuse.
    None(&'static str),
}

/// What came of one run.
#[derive(Clone, Debug)]
pub struct Played {
    /// Whether what is expected was reached, or what happened instead.
    pub reached: Result<(), String>,
    /// What honest robots refused of the attack, by counter.
    pub refused: BTreeMap<String, u64>,
    /// How many messages of the attack no counter names.
    pub silent: u64,
}

/// An attack.
#[derive(Clone, Copy, Debug)]
pub struct Attack {
    /// Its number, or numbers.
    pub number: &'static str,
    /// What the attacker does.
    pub what: &'static str,
    /// What the attacker has.
    pub tier: Tier,
    /// Whether the robots sign.
    pub setting: Setting,
    /// What is expected of the swarm.
    pub expected: &'static str,
    /// What must be counted.
    pub counted: Counted,
    /// Why it is not reached today; `None` for what is promised.
    pub gap: Option<&'static str>,
    /// Plays it with one seed.
    pub play: fn(u64) -> Played,
}

/// What came of all runs of an attack.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Whether every run reached what is expected, or the first that did not, with its seed.
    pub reached: Result<(), String>,
    /// What was refused in all runs, by counter.
    pub refused: BTreeMap<String, u64>,
}

impl Verdict {
    fn add(&mut self, seed: u64, counted: Result<(), String>, played: Played) {
        if let (true, Err(error)) = (self.reached.is_ok(), played.reached.and(counted)) {
            self.reached = Err(format!("seed {seed}: {error}"));
        }
        for (counter, times) in played.refused {
            *self.refused.entry(counter).or_default() += times;
        }
    }
}

impl Attack {
    /// Plays it with the seeds from 1 to that number; a gap until one of them shows it.
    #[must_use]
    pub fn run(&self, seeds: u64) -> Verdict {
        let mut verdict = Verdict { reached: Ok(()), refused: BTreeMap::new() };
        let at_once = if self.gap.is_some() { 1 } else { seeds };
        for first in (1..=seeds).step_by(at_once.max(1) as usize) {
            for (seed, played) in self.play_all(first..first + at_once) {
                verdict.add(seed, self.check_counters(&played), played);
            }
            if verdict.reached.is_err() {
                break;
            }
        }
        verdict
    }

    /// What came of each seed, in their order; played on all cores.
    fn play_all(&self, seeds: Range<u64>) -> BTreeMap<u64, Played> {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let play = self.play;
        let share = |nth: usize| {
            let seeds = seeds.clone().skip(nth).step_by(cores);
            move || seeds.map(|seed| (seed, play(seed))).collect::<Vec<_>>()
        };
        std::thread::scope(|scope| {
            let shares: Vec<_> = (0..cores).map(|nth| scope.spawn(share(nth))).collect();
            // What panicked there panics here.
            let joined =
                shares.into_iter().map(|share| share.join().unwrap_or_else(|panic| resume_unwind(panic)));
            joined.flatten().collect()
        })
    }

    /// Whether that verdict is the one that the line announces: reached what is promised, and not what is a gap, so that a gap
    /// which was closed is noticed.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, verdict: &Verdict) -> Result<(), String> {
        match (&verdict.reached, self.gap) {
            (Ok(()), None) | (Err(_), Some(_)) => Ok(()),
            (Err(error), None) => Err(error.clone()),
            (Ok(()), Some(gap)) => {
                Err(format!("reached now, so it is no gap any more: strike off \"{gap}\""))
            }
        }
    }

    fn check_counters(&self, played: &Played) -> Result<(), String> {
        let keys = match self.counted {
            Counted::All(_) if played.silent > 0 => {
                return Err(format!(
                    "{} messages were dropped and not counted: {:?}",
                    played.silent, played.refused
                ));
            }
            Counted::All(keys) | Counted::Some(keys) => keys,
            Counted::None(_) => &[],
        };
        match keys.iter().find(|key| !played.refused.contains_key(**key)) {
            Some(key) => Err(format!("{key} does not count it: {:?}", played.refused)),
            None => Ok(()),
        }
    }
}
