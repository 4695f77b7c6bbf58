//! Hangs up links over which nothing is heard, so that they are made anew.
//!
//! When many links break and come back at once (a machine that stood still for longer than the lease, a switch that was off), Zenoh's
//! routers may process each other's news in an order that leaves them with other maps of the network than the real one: it logs "unknown link
//! mapping". They may then take a link for working over which they send nothing, as was seen among twenty robots in a line that were
//! stopped for a second or more. Two that are linked tell each other what they have all the time, so silence shows it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;

use crate::account::Account;
use crate::inbox::Inbox;
use crate::session::Node;

/// How often links are looked at.
const PERIOD: Duration = Duration::from_secs(1);

/// Who is newly linked is heard after this long: both say what they have at the busy pace, and answer. Nor is a link cut sooner that was heard
/// over, however short the periods are: what is slow is not deaf, and what is dead ends by its lease.
const FIRST_WORD: Duration = Duration::from_secs(5);

/// The longest that first words are waited for, when links made anew stayed silent too: perhaps that robot tells nobody anything.
const LONGEST: Duration = Duration::from_secs(300);

/// Who was heard is heard again after so many idle periods of repair: neighbours are answered after half as many.
const SILENT_PERIODS: u32 = 12;

/// Looks after the links of a robot that compares notes with its neighbours every `idle` at the latest; some of them may have `most` such
/// neighbours. Never returns.
pub(crate) async fn mend_deafness(
    node: Node,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    idle: Duration,
    most: usize,
) -> Result<(), String> {
    let mut patience = Patience::new(idle);
    loop {
        tokio::time::sleep(PERIOD).await;
        let now = Instant::now();
        let links = inbox.hearing();
        // Where hundreds start on one machine, first words take their time.
        patience.of = links.len().max(most).max(inbox.tokens().len() / ROBOTS_A_TURN);
        for (id, robot, since, last) in links {
            if patience.is_over(robot, now.duration_since(since), last.map(|last| now.duration_since(last))) {
                tracing::info!("nothing is heard from robot {robot} over its link, which is made anew");
                account.count("links_deaf");
                node.hang_up(id);
            }
        }
    }
}

/// So many robots of the swarm are reckoned with as one more neighbour.
const ROBOTS_A_TURN: usize = 5;

/// Who has so many neighbours turns to each as often as is reckoned with here; who has twice as many, half as often.
const FEW: usize = 8;

/// How long each neighbour may be silent.
struct Patience {
    idle: Duration,
    /// How many neighbours there are: who has many, as a relay has, turns to each the more rarely.
    of: usize,
    /// How often each was hung up on without a word since.
    tried: BTreeMap<RobotId, u32>,
}

impl Patience {
    fn new(idle: Duration) -> Self {
        Self { idle, of: 0, tried: BTreeMap::new() }
    }

    /// Whether a robot, linked for so long and last heard so long ago, if ever, has been silent for too long.
    fn is_over(&mut self, robot: RobotId, linked: Duration, silent: Option<Duration>) -> bool {
        let over = match silent {
            Some(silent) => {
                self.tried.remove(&robot);
                let periods = SILENT_PERIODS.max(u32::try_from(2 * self.of).unwrap_or(u32::MAX));
                silent > self.idle.saturating_mul(periods).max(FIRST_WORD)
            }
            None => {
                let tried = self.tried.get(&robot).copied().unwrap_or_default();
                let turns = u32::try_from(self.of.div_ceil(FEW)).unwrap_or(u32::MAX).max(1);
                linked > FIRST_WORD.saturating_mul(turns).saturating_mul(1 << tried.min(16)).min(LONGEST)
            }
        };
        if over {
            *self.tried.entry(robot).or_default() += 1;
        }
        over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: RobotId = RobotId(1);

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn who_never_speaks_is_tried_anew_ever_more_rarely() {
        let mut patience = Patience::new(seconds(4));
        for limit in [5, 10, 20, 40, 80, 160, 300, 300] {
            assert!(!patience.is_over(ROBOT, seconds(limit), None));
            assert!(patience.is_over(ROBOT, seconds(limit + 1), None));
        }
        assert!(!patience.is_over(ROBOT, seconds(1000), Some(seconds(1))), "it speaks");
        assert!(patience.is_over(ROBOT, seconds(6), None), "and counts as new again");
    }

    #[test]
    fn who_was_heard_may_be_silent_for_twelve_periods() {
        let mut patience = Patience::new(seconds(4));
        assert!(!patience.is_over(ROBOT, seconds(1000), Some(seconds(48))));
        assert!(patience.is_over(ROBOT, seconds(1000), Some(seconds(49))));
    }

    #[test]
    fn nobody_is_cut_off_within_seconds_however_short_the_periods_are() {
        for idle in [1, 50, 400] {
            let mut patience = Patience::new(Duration::from_millis(idle));
            assert!(!patience.is_over(ROBOT, seconds(1000), Some(FIRST_WORD)), "{idle} ms");
            assert!(patience.is_over(ROBOT, seconds(1000), Some(2 * FIRST_WORD)), "{idle} ms");
        }
    }
}
