//! One line of the table: an attack, who can do it, and what it must come to.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

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
    /// Whether every run counted what it must, or the first that did not, with its seed.
    pub counted: Result<(), String>,
    /// What was refused in all runs, by counter.
    pub refused: BTreeMap<String, u64>,
}

impl Default for Verdict {
    fn default() -> Self {
        Self { reached: Ok(()), counted: Ok(()), refused: BTreeMap::new() }
    }
}

impl Attack {
    /// What comes of these seeds, one after the other, up to the first with which what is expected is not reached.
    pub(crate) fn play_until_shown(&self, seeds: RangeInclusive<u64>) -> Vec<(u64, Played)> {
        let mut played: Vec<(u64, Played)> = Vec::new();
        for seed in seeds {
            if played.last().is_some_and(|(_, before)| before.reached.is_err()) {
                break;
            }
            played.push((seed, (self.play)(seed)));
        }
        played
    }

    /// What all of them come to.
    pub(crate) fn judge(&self, played: BTreeMap<u64, Played>) -> Verdict {
        let mut verdict = Verdict::default();
        for (seed, played) in played {
            let of_seed = |error: String| format!("seed {seed}: {error}");
            let counted = self.check_counters(&played).map_err(of_seed);
            verdict.reached = verdict.reached.and_then(|()| played.reached.map_err(of_seed));
            verdict.counted = verdict.counted.and(counted);
            for (counter, times) in played.refused {
                *verdict.refused.entry(counter).or_default() += times;
            }
        }
        verdict
    }

    /// Whether that verdict is the one that the line announces: reached what is promised, and not what is a gap, so that a gap
    /// which was closed is noticed; and counted what must be: an attack that nobody hears shows nothing.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, verdict: &Verdict) -> Result<(), String> {
        match (&verdict.reached, self.gap) {
            (Ok(()), None) | (Err(_), Some(_)) => verdict.counted.clone(),
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
