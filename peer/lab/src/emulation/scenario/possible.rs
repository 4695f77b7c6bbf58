//! Whether what is to go wrong in a scenario can.

use std::collections::BTreeMap;

use gestalt_protocol::RobotId;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Scenario;
use super::error::ScenarioError;
use super::fault::{Event, Fault};
use crate::emulation::network::Presence;
use crate::emulation::route::link;
use crate::shape::NetworkShape;

impl Scenario {
    /// That all faults are of robots and links that there are, happen before the end, and find robots as they must be for that.
    ///
    /// # Errors
    /// A [`ScenarioError::Value`] that names the first that cannot happen.
    pub(super) fn check_faults(&self) -> Result<(), ScenarioError> {
        let wrong = |key, mend: String| Err(ScenarioError::Value { key, mend });
        let (size, end) = (self.swarm_size(), self.showing_at(self.rounds));
        let known = |robot: RobotId| (1..=size).contains(&(robot.0 as usize));
        for Fault { at, event } in &self.faults {
            if let Some(robot) = event.robots().into_iter().find(|robot| !known(*robot)) {
                return wrong("faults", format!("there is no robot {robot}: choose 1 to {size}"));
            }
            if *at > end {
                let mend =
                    format!("{at:?} is after the end of the run, {end:?}: choose less, or more rounds");
                return wrong("faults.at", mend);
            }
        }
        self.check_links()?;
        self.check_presence()
    }

    fn check_links(&self) -> Result<(), ScenarioError> {
        let wrong = |mend: String| Err(ScenarioError::Value { key: "faults", mend });
        let mut links = None;
        for fault in &self.faults {
            let (Event::Cut(a, b) | Event::Heal(a, b)) = fault.event else { continue };
            if a == b {
                return wrong("a link has two ends: name two robots".to_owned());
            }
            // A full network has all of them; a random one has others of each seed.
            if matches!(self.topology, NetworkShape::Full | NetworkShape::Random) {
                continue;
            }
            let unused = &mut ChaCha8Rng::seed_from_u64(0);
            let links = links.get_or_insert_with(|| self.topology.links(self.swarm_size(), unused));
            if links.binary_search(&link(a.0 as usize - 1, b.0 as usize - 1)).is_err() {
                let shape = format!("{:?}", self.topology).to_lowercase();
                return wrong(format!("robots {a} and {b} have no link in a {shape}: name neighbours"));
            }
        }
        Ok(())
    }

    /// Goes through the faults as they will happen: of those at one time, in the order of the file.
    fn check_presence(&self) -> Result<(), ScenarioError> {
        let mut faults: Vec<&Fault> = self.faults.iter().collect();
        faults.sort_by_key(|fault| fault.at);
        let mut robots: BTreeMap<RobotId, Presence> = BTreeMap::new();
        for Fault { at, event } in faults {
            let Some((robot, after)) = event.makes() else { continue };
            let before = robots.insert(robot, after).unwrap_or(Presence::Up);
            if event.can_befall(before) {
                continue;
            }
            let is = match before {
                Presence::Up => "up",
                Presence::Frozen => "frozen",
                Presence::Down => "down",
            };
            let first = match (event, before) {
                (Event::Restart(_), _) => "kill",
                (Event::Thaw(_), _) => "freeze",
                (_, Presence::Down) => "restart",
                _ => "thaw",
            };
            let mend = format!("at {at:?} robot {robot} is {is}: {first} it before");
            return Err(ScenarioError::Value { key: "faults", mend });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(topology: &str, faults: &str) -> Option<String> {
        let text = format!(
            "{{ robots: [{{ name: 'a', count: 9 }}], topology: '{topology}', rounds: 4, faults: [{faults}] }}"
        );
        Scenario::parse(&text, "test").err().map(|error| error.to_string())
    }

    #[test]
    fn a_link_that_is_not_there_is_neither_cut_nor_healed() {
        for event in ["cut", "heal"] {
            let fault = format!("{{ at: '10s', event: {{ {event}: [5, 1] }} }}");
            for (topology, is_there) in [
                ("line", false),
                ("ring", false),
                ("grid", false),
                ("star", true),
                ("full", true),
                ("random", true),
            ] {
                let refused = refused(topology, &fault);
                assert_eq!(refused.is_none(), is_there, "{topology}: {refused:?}");
            }
        }
        assert_eq!(refused("ring", "{ at: '10s', event: { cut: [1, 9] } }"), None);
        assert_eq!(
            refused("ring", "{ at: '10s', event: { cut: [1, 5] } }").unwrap(),
            "faults: robots 1 and 5 have no link in a ring: name neighbours"
        );
    }

    #[test]
    fn nothing_happens_after_the_end() {
        assert_eq!(refused("ring", "{ at: '35s', event: { kill: 3 } }"), None);
        let late = refused("ring", "{ at: '35001ms', event: { kill: 3 } }").unwrap();
        assert!(late.starts_with("faults.at: 35.001s is after the end of the run, 35s: choose"), "{late}");
    }

    #[test]
    fn what_befalls_a_robot_finds_it_as_it_must_be() {
        let after = |events: &[&str]| {
            let faults =
                (1..).zip(events).map(|(at, event)| format!("{{ at: '{at}s', event: {{ {event}: 3 }} }}"));
            // The order of the file is none.
            let faults: Vec<String> = faults.collect::<Vec<_>>().into_iter().rev().collect();
            refused("ring", &faults.join(", "))
        };
        assert_eq!(after(&["freeze", "thaw", "kill", "restart", "freeze", "kill", "restart"]), None);
        for (events, said) in [
            (&["restart"][..], "at 1s robot 3 is up: kill it before"),
            (&["thaw"], "at 1s robot 3 is up: freeze it before"),
            (&["freeze", "restart"], "at 2s robot 3 is frozen: kill it before"),
            (&["freeze", "freeze"], "at 2s robot 3 is frozen: thaw it before"),
            (&["kill", "kill"], "at 2s robot 3 is down: restart it before"),
            (&["freeze", "kill", "thaw"], "at 3s robot 3 is down: freeze it before"),
        ] {
            let refused = after(events).unwrap();
            assert!(refused.ends_with(said), "{events:?}: {refused}");
        }
        assert_eq!(
            refused("ring", "{ at: '1s', event: { kill: 3 } }, { at: '1s', event: { restart: 3 } }"),
            None
        );
    }
}
