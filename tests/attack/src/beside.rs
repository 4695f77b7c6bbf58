//! One run with an adversary beside the same run without: what differs is what the attack came to.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::attack::Played;
use crate::swarm::{Plan, Swarm};

/// Whether a run at war came to what is expected, measured against the same run in peace.
pub type Judge = fn(&Swarm, &Swarm) -> Result<(), String>;

/// Plays it twice, the first time with an adversary that keeps silent.
///
/// # Panics
/// If it says nothing to anybody: then nothing is shown.
pub fn beside(plan: &Plan, seed: u64, play: impl Fn(&mut Swarm), judge: Judge) -> Played {
    let run = |peace| {
        let mut swarm = Swarm::new(plan, seed, peace);
        play(&mut swarm);
        swarm
    };
    let (peace, war) = (run(true), run(false));
    assert!(war.uttered() > 0, "the attacker says nothing to anybody");
    let mut refused: BTreeMap<String, u64> = war.refused();
    for (counter, times) in peace.refused() {
        if let Some(more) = refused.get_mut(&counter) {
            *more = more.saturating_sub(times);
        }
    }
    refused.retain(|_, times| *times > 0);
    Played { reached: judge(&peace, &war), refused, silent: war.silent() }
}

/// Nothing: every robot says at every moment what it would have said, and knows in the end what it would have known.
pub fn unmoved(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    for (before, after) in peace.accounts().iter().zip(war.accounts()) {
        if before.said != after.said {
            return Err(format!("robot {} says something else than in peace", after.robot));
        }
        if before.knows != after.knows {
            return Err(format!("robot {} knows {}, in peace {}", after.robot, after.knows, before.knows));
        }
    }
    Ok(())
}

/// Each gesture is decided as in peace, by all, and announced at most so much later; and announced as final, where it was in peace.
pub fn decided_alike(peace: &Swarm, war: &Swarm, later: Duration) -> Result<(), String> {
    for (n, (before, after)) in peace.shown().iter().zip(war.shown()).enumerate() {
        if before.held != after.held {
            return Err(format!(
                "showing {n} of {}: held {:?}, in peace {:?}",
                after.class, after.held, before.held
            ));
        }
        let in_time = |what: &str, usual: Option<Duration>, took: Option<Duration>| match (usual, took) {
            (Some(usual), Some(took)) if took <= usual + later => Ok(()),
            _ => Err(format!("showing {n}: {what} after {took:?}, in peace after {usual:?}")),
        };
        in_time("announced", before.announced, after.announced)?;
        if before.settled.is_some() {
            in_time("final", before.settled, after.settled)?;
        }
    }
    Ok(())
}

/// The same without any delay to speak of.
pub fn decided_in_time(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    decided_alike(peace, war, Duration::from_millis(150))
}

/// All know the same samples and lessons as in peace.
pub fn learned_alike(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    for (before, after) in peace.accounts().iter().zip(war.accounts()) {
        if before.learned != after.learned {
            return Err(format!(
                "robot {} learned {}, in peace {}",
                after.robot, after.learned, before.learned
            ));
        }
    }
    Ok(())
}
