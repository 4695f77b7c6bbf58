//! Ports, multicast, and why an endpoint is not reached.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
use std::path::Path;
use std::time::Duration;

use serde_json::Value;

use crate::config::{Config, ScoutingSection};
use crate::doctor::robot::PortFacts;

/// How long a connection may take, and a datagram that only goes to this machine.
const CONNECT: Duration = Duration::from_secs(1);
const ECHO: Duration = Duration::from_millis(300);

/// The endpoints of `zenoh.listen` or `zenoh.connect`, however they are written: as a list, or by mode.
pub(super) fn endpoints(config: &Config, which: &str) -> Vec<String> {
    fn strings(value: &Value, found: &mut Vec<String>) {
        match value {
            Value::String(endpoint) => found.push(endpoint.clone()),
            Value::Array(values) => values.iter().for_each(|value| strings(value, found)),
            Value::Object(by_mode) => by_mode.values().for_each(|value| strings(value, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    if let Some(value) = config.zenoh.get(which).and_then(|section| section.get("endpoints")) {
        strings(value, &mut found);
    }
    found
}

/// Host and port of a TCP endpoint, with TLS or without.
fn address(endpoint: &str) -> Option<&str> {
    let rest = endpoint.strip_prefix("tcp/").or_else(|| endpoint.strip_prefix("tls/"));
    rest.map(|rest| rest.split(['?', '#']).next().unwrap_or(rest))
}

/// Which of the ports that the robot is to listen on can be had; those it takes as they come (port 0) always can.
pub(super) fn ports(config: &Config) -> Vec<PortFacts> {
    let named = endpoints(config, "listen")
        .into_iter()
        .filter(|it| address(it).is_some_and(|it| !it.ends_with(":0")));
    named
        .map(|endpoint| {
            let taken =
                address(&endpoint).and_then(|address| TcpListener::bind(address).err()).map(|error| {
                    match error.kind() {
                        ErrorKind::AddrInUse => "another program listens there".to_owned(),
                        ErrorKind::AddrNotAvailable => {
                            "no interface of this machine has that address".to_owned()
                        }
                        ErrorKind::PermissionDenied => "ports below 1024 are for root alone".to_owned(),
                        _ => error.to_string(),
                    }
                });
            PortFacts { endpoint, taken }
        })
        .collect()
}

/// The endpoint at which a robot of this machine is reached that listens there.
pub(super) fn at_home(endpoint: &str) -> String {
    endpoint.replacen("/0.0.0.0:", "/127.0.0.1:", 1).replacen("/[::]:", "/[::1]:", 1)
}

/// Why nobody answers at a TCP endpoint; `None` when somebody listens there.
pub(super) fn unreachable(endpoint: &str) -> Option<String> {
    let Some(address) = address(endpoint) else {
        return Some("this build speaks TCP and TLS alone: tcp/ADDRESS:PORT, tls/ADDRESS:PORT".to_owned());
    };
    let addresses: Vec<SocketAddr> = match address.to_socket_addrs() {
        Ok(addresses) => addresses.collect(),
        Err(error) => return Some(format!("is no address of any machine: {error}")),
    };
    let mut cause = "is no address of any machine".to_owned();
    for address in addresses.iter().take(4) {
        match TcpStream::connect_timeout(address, CONNECT) {
            Ok(_) => return None,
            Err(error) => {
                cause = match error.kind() {
                    ErrorKind::ConnectionRefused => "nothing listens there".to_owned(),
                    ErrorKind::TimedOut => {
                        "nobody answers within a second: it is off, or a firewall is between".to_owned()
                    }
                    _ => error.to_string(),
                };
            }
        }
    }
    Some(cause)
}

/// Whether a datagram to the group of scouting comes back to this machine.
pub(super) fn multicast(scouting: &ScoutingSection) -> Result<(), String> {
    let interface = scouting.interface.as_str();
    if interface != "auto" {
        return is_up(interface);
    }
    let group = match scouting.address.parse::<SocketAddr>().map(|address| address.ip()) {
        Ok(IpAddr::V4(group)) => group,
        // Version 6 is Zenoh's to try.
        Ok(IpAddr::V6(_)) => return Ok(()),
        Err(error) => return Err(format!("links.scouting.address \"{}\": {error}", scouting.address)),
    };
    echo(group).map_err(|error| match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => {
            format!("what is sent to {group} does not come back: a firewall drops it")
        }
        _ => format!("{group}: {error}"),
    })
}

fn echo(group: Ipv4Addr) -> std::io::Result<()> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.join_multicast_v4(&group, &Ipv4Addr::UNSPECIFIED)?;
    socket.set_multicast_ttl_v4(1)?;
    socket.set_read_timeout(Some(ECHO))?;
    socket.send_to(b"gestalt doctor", (group, socket.local_addr()?.port()))?;
    socket.recv_from(&mut [0; 64]).map(drop)
}

/// Whether a network interface is there, and up; Linux tells.
fn is_up(interface: &str) -> Result<(), String> {
    let all = Path::new("/sys/class/net");
    if !all.is_dir() {
        return Ok(());
    }
    let Ok(flags) = std::fs::read_to_string(all.join(interface).join("flags")) else {
        let there: Vec<String> = std::fs::read_dir(all)
            .map(|found| found.flatten().map(|it| it.file_name().to_string_lossy().into_owned()).collect())
            .unwrap_or_default();
        return Err(format!("there is no network interface \"{interface}\"; there are {}", there.join(", ")));
    };
    let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).unwrap_or_default();
    if flags & 1 == 1 { Ok(()) } else { Err(format!("the network interface \"{interface}\" is down")) }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn config(zenoh: Value) -> Config {
        Config { zenoh: zenoh.as_object().cloned().unwrap_or_default(), ..Config::default() }
    }

    #[test]
    fn endpoints_are_found_however_they_are_written() {
        let named = |zenoh| endpoints(&config(zenoh), "listen");
        assert_eq!(named(json!({"listen": {"endpoints": ["tcp/[::]:7447"]}})), ["tcp/[::]:7447"]);
        assert_eq!(
            named(json!({"listen": {"endpoints": {"router": ["tcp/a:1", "tcp/b:2"]}}})),
            ["tcp/a:1", "tcp/b:2"]
        );
        assert!(named(json!({"listen": 7})).is_empty());
    }

    #[test]
    fn a_port_that_is_taken_is_told_from_one_that_is_free() {
        let holder = TcpListener::bind("127.0.0.1:0").unwrap();
        let taken = format!("tcp/{}", holder.local_addr().unwrap());
        let free = {
            let other = TcpListener::bind("127.0.0.1:0").unwrap();
            format!("tcp/{}", other.local_addr().unwrap())
        };
        let found = ports(&config(json!({"listen": {"endpoints": [taken, free, "tcp/0.0.0.0:0"]}})));
        assert_eq!(found.iter().map(|port| port.taken.is_some()).collect::<Vec<_>>(), [true, false]);
        assert_eq!(unreachable(&found[0].endpoint), None);
        assert!(unreachable(&found[1].endpoint).unwrap().contains("nothing listens"));
        assert!(unreachable("udp/localhost:7447").unwrap().contains("TCP and TLS alone"));
    }

    #[test]
    fn an_interface_that_is_not_there_is_named_with_those_that_are() {
        let scouting = ScoutingSection { interface: "wlan77".to_owned(), ..ScoutingSection::default() };
        let error = multicast(&scouting).unwrap_err();
        assert!(error.contains("wlan77") && error.contains("lo"), "{error}");
    }
}
