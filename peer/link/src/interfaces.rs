//! Notices a network that Zenoh does not know.
//!
//! Zenoh reads the addresses of the computer once in a program. Multicast goes by no other, so who started before its network, or has another
//! address since, finds nobody there and is found by nobody until its program is started again.

use std::collections::BTreeSet;
use std::net::IpAddr;
use std::time::Duration;

use pnet_datalink::NetworkInterface;

/// So long nothing is said: others may be found all the same, and addresses come one after the other.
const PATIENCE: Duration = Duration::from_secs(5);

/// Addresses that Zenoh does not know, and whether that was said.
#[derive(Debug, Default)]
pub(crate) struct Interfaces {
    /// Those that are there while the robot is alone, and since when.
    unknown: Option<(BTreeSet<IpAddr>, Duration)>,
    said: BTreeSet<IpAddr>,
}

impl Interfaces {
    /// Whether it is to be said now that Zenoh does not know those addresses: once, when a robot has been alone with them for a while.
    pub fn is_news(&mut self, now: Duration, is_alone: bool, unknown: &BTreeSet<IpAddr>) -> bool {
        if unknown.is_empty() {
            self.said.clear();
        }
        if !is_alone || unknown.is_empty() {
            self.unknown = None;
            return false;
        }
        let since = match &self.unknown {
            Some((before, since)) if before == unknown => *since,
            _ => now,
        };
        self.unknown = Some((unknown.clone(), since));
        if now.saturating_sub(since) < PATIENCE || self.said == *unknown {
            return false;
        }
        self.said.clone_from(unknown);
        true
    }
}

/// The addresses that multicast would go by now, of the interface that is configured, and that Zenoh does not know. Those that went
/// away do no harm.
pub(crate) fn unknown(configured: &str) -> BTreeSet<IpAddr> {
    let known = zenoh_util::net::get_local_addresses(None).unwrap_or_default();
    let interfaces = pnet_datalink::interfaces();
    let of_multicast =
        |it: &&NetworkInterface| it.is_up() && it.is_running() && it.is_multicast() && !it.is_loopback();
    let addresses = interfaces.iter().filter(of_multicast).filter_map(|it| address(it, configured));
    addresses.filter(|address| !known.contains(address)).collect()
}

/// The address that Zenoh would take of an interface: its first of version 4, or the one that is configured.
fn address(interface: &NetworkInterface, configured: &str) -> Option<IpAddr> {
    let mut addresses = interface.ips.iter().map(|network| network.ip());
    let names = configured.split(',').map(str::trim);
    if configured == "auto" || names.clone().any(|name| name == interface.name) {
        return addresses.find(IpAddr::is_ipv4);
    }
    addresses.find(|address| names.clone().any(|name| name.parse() == Ok(*address)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn addresses<const N: usize>(last: [u8; N]) -> BTreeSet<IpAddr> {
        last.into_iter().map(|last| IpAddr::from([10, 0, 0, last])).collect()
    }

    #[test]
    fn a_new_address_is_said_once_when_a_robot_has_been_alone_with_it_for_a_while() {
        let mut interfaces = Interfaces::default();
        assert!(!interfaces.is_news(seconds(0), true, &addresses([])), "nothing is new");
        assert!(!interfaces.is_news(seconds(9), true, &addresses([1])), "it has just come");
        assert!(!interfaces.is_news(seconds(13), true, &addresses([1, 2])), "and another one");
        assert!(!interfaces.is_news(seconds(17), true, &addresses([1, 2])));
        assert!(interfaces.is_news(seconds(18), true, &addresses([1, 2])));
        assert!((19..99).all(|now| !interfaces.is_news(seconds(now), true, &addresses([1, 2]))), "again");
        assert!(!interfaces.is_news(seconds(99), true, &addresses([3])));
        assert!(interfaces.is_news(seconds(104), true, &addresses([3])), "another change");
    }

    #[test]
    fn who_is_linked_says_nothing() {
        let mut interfaces = Interfaces::default();
        for now in 0..20 {
            assert!(!interfaces.is_news(seconds(now), now % 4 != 0, &addresses([1])));
        }
    }

    #[test]
    fn of_each_interface_the_address_counts_that_multicast_goes_by() {
        let ips = ["fe80::1/64", "10.0.0.7/24", "10.0.0.8/24"];
        let interface = NetworkInterface {
            name: "wlan0".to_owned(),
            description: String::new(),
            index: 2,
            mac: None,
            ips: ips.iter().map(|ip| ip.parse().unwrap()).collect(),
            flags: 0,
        };
        let last = |configured| address(&interface, configured).map(|address| address.to_string());
        for configured in ["auto", "wlan0", "eth0, wlan0", "10.0.0.7"] {
            assert_eq!(last(configured).as_deref(), Some("10.0.0.7"), "{configured}");
        }
        assert_eq!(last("eth0,10.0.0.8").as_deref(), Some("10.0.0.8"));
        assert_eq!(last("eth0"), None);
    }

    #[test]
    fn what_is_there_at_the_start_is_known() {
        assert_eq!(unknown("auto"), BTreeSet::new());
    }
}
