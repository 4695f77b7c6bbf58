//! How far a robot lets itself be reached: an open one by its own computer alone, a sealed one by TLS from anywhere.

use std::net::IpAddr;

use serde_json::Value;

use crate::error::LinkError;

/// How far away one may be that reaches an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reach {
    /// This computer.
    Here,
    /// The one cable or cell that a link-local address is of.
    Beside,
    /// Anywhere.
    Far,
}

/// The endpoints that Zenoh is told, for whichever mode.
pub(crate) fn endpoints(config: &zenoh::Config, key: &str) -> Vec<String> {
    fn texts(value: Value) -> Vec<String> {
        match value {
            Value::String(text) => vec![text],
            Value::Array(values) => values.into_iter().flat_map(texts).collect(),
            Value::Object(by_mode) => by_mode.into_iter().flat_map(|(_, value)| texts(value)).collect(),
            _ => Vec::new(),
        }
    }
    let text = config.get_json(key).unwrap_or_default();
    serde_json::from_str(&text).map(texts).unwrap_or_default()
}

/// Refuses what is set at a key of endpoints where it says no protocol: of that, Zenoh says no more than that it could not be read.
pub(crate) fn check_named(key: &str, value: &Value) -> Result<(), LinkError> {
    if !matches!(key, "listen/endpoints" | "connect/endpoints") {
        return Ok(());
    }
    let is_protocol =
        |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
    match value {
        Value::String(endpoint) if !endpoint.split_once('/').is_some_and(|(name, _)| is_protocol(name)) => {
            let address = endpoint.rsplit('/').next().unwrap_or_default();
            Err(LinkError::Config {
                key: format!("zenoh.{}", key.replace('/', ".")),
                cause: format!(
                    "{endpoint:?} names no protocol: write tcp/{address}, or tls/{address} where the swarm is sealed"
                ),
            })
        }
        Value::Array(all) => all.iter().try_for_each(|value| check_named(key, value)),
        Value::Object(by_mode) => by_mode.values().try_for_each(|value| check_named(key, value)),
        _ => Ok(()),
    }
}

fn reach(endpoint: &str) -> Reach {
    let address = endpoint.split_once('/').map_or("", |(_, address)| address);
    let address = address.split(['#', '?']).next().unwrap_or_default();
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let host = host.split('%').next().unwrap_or_default();
    if host == "localhost" || endpoint.starts_with("unixsock-stream/") {
        return Reach::Here;
    }
    match host.parse::<IpAddr>() {
        Ok(address) if address.to_canonical().is_loopback() => Reach::Here,
        Ok(IpAddr::V4(address)) if address.is_link_local() => Reach::Beside,
        Ok(IpAddr::V6(address)) if address.is_unicast_link_local() => Reach::Beside,
        _ => Reach::Far,
    }
}

pub(crate) fn is_tls(endpoint: &str) -> bool {
    endpoint.starts_with("tls/")
}

/// Refuses to let an open robot be reached from anywhere without its owner's word.
pub(crate) fn check_open(config: &zenoh::Config, insecure: bool) -> Result<(), LinkError> {
    let far =
        endpoints(config, "listen/endpoints").into_iter().find(|endpoint| reach(endpoint) == Reach::Far);
    match far {
        Some(endpoint) if !insecure => Err(LinkError::Config {
            key: "trust".to_owned(),
            cause: format!(
                "an open robot that listens on {endpoint} believes whoever reaches it: enrol it (gestalt trust enrol), listen on tcp/127.0.0.1:0, \
                 or, on a network you trust, set trust.insecure to true"
            ),
        }),
        _ => Ok(()),
    }
}

/// Refuses to let a sealed robot be reached without TLS but on its own computer, and to dial without.
pub(crate) fn check_sealed(config: &zenoh::Config) -> Result<(), LinkError> {
    let refused = |key: &str, cause: String| Err(LinkError::Config { key: key.to_owned(), cause });
    let listen = endpoints(config, "listen/endpoints").into_iter();
    if let Some(endpoint) = listen.into_iter().find(|it| !is_tls(it) && reach(it) != Reach::Here) {
        return refused(
            "zenoh.listen.endpoints",
            format!(
                "a sealed robot is reached at tls/ endpoints: write tls/ for tcp/ in {endpoint}, or leave it out"
            ),
        );
    }
    if let Some(endpoint) = endpoints(config, "connect/endpoints").into_iter().find(|it| !is_tls(it)) {
        return refused(
            "zenoh.connect.endpoints",
            format!(
                "a sealed robot links to none that is open: enrol the robot at {endpoint}, and name its tls/ endpoint"
            ),
        );
    }
    Ok(())
}

/// Whether there is anybody to be dialled.
pub(crate) fn names_any(config: &zenoh::Config) -> bool {
    !endpoints(config, "connect/endpoints").is_empty()
}

/// Refuses to let a client of a sealed swarm dial where anybody could be: without TLS it goes to its own computer alone.
pub(crate) fn check_client(config: &zenoh::Config) -> Result<(), LinkError> {
    let mut dialled = endpoints(config, "connect/endpoints").into_iter();
    match dialled.find(|it| !is_tls(it) && reach(it) != Reach::Here) {
        Some(endpoint) => Err(LinkError::Config {
            key: "zenoh.connect.endpoints".to_owned(),
            cause: format!(
                "whoever is at {endpoint} could be anybody: name a tls/ endpoint of a robot, or one of this computer"
            ),
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;
    use crate::LinkConfig;

    fn config(listen: &[&str], connect: &[&str]) -> zenoh::Config {
        let mut config = zenoh::Config::default();
        config.insert_json5("mode", "\"router\"").unwrap();
        config.insert_json5("listen/endpoints", &serde_json::to_string(listen).unwrap()).unwrap();
        config.insert_json5("connect/endpoints", &serde_json::to_string(connect).unwrap()).unwrap();
        config
    }

    #[test]
    fn an_open_robot_is_reached_from_here_alone() {
        for near in [
            "tcp/127.0.0.1:0",
            "tcp/127.8.0.1:7447",
            "tcp/[::1]:7447",
            "tcp/localhost:7447",
            "tcp/169.254.3.4:7447",
            "tcp/[fe80::1%eth0]:7447",
            "tcp/[::ffff:127.0.0.1]:7447",
        ] {
            assert!(check_open(&config(&[near], &[]), false).is_ok(), "{near}");
        }
        for far in
            ["tcp/0.0.0.0:0", "tcp/[::]:7447", "tcp/10.0.0.5:7447", "tcp/robot1.local:7447", "tcp/:7447"]
        {
            let refused = check_open(&config(&["tcp/127.0.0.1:0", far], &[]), false).unwrap_err().to_string();
            assert!(refused.contains(far) && refused.contains("trust.insecure"), "{refused}");
            assert!(check_open(&config(&[far], &[]), true).is_ok());
        }
    }

    #[test]
    fn an_endpoint_names_its_protocol() {
        let named = serde_json::json!(["tcp/127.0.0.1:7447", "unixsock-stream//tmp/x", "tls/[::]:0#a=1"]);
        assert!(check_named("connect/endpoints", &named).is_ok());
        assert!(check_named("mode", &serde_json::json!("router")).is_ok());
        let bare = "127.0.0.1:7447".to_owned();
        for value in [serde_json::json!(bare), serde_json::json!({"router": [[bare]], "peer": named})] {
            let zenoh = serde_json::json!({"listen": {"endpoints": value}}).as_object().unwrap().clone();
            let of_zenoh = LinkConfig { zenoh, ..LinkConfig::default() };
            for link in [of_zenoh, LinkConfig { listen: vec![bare.clone()], ..LinkConfig::default() }] {
                let refused = link.to_zenoh(RobotId(7), "demo", 1).unwrap_err().to_string();
                assert!(refused.starts_with("zenoh.listen.endpoints: "), "{refused}");
                assert!(refused.contains("write tcp/127.0.0.1:7447"), "{refused}");
            }
        }
        let link = LinkConfig { connect: vec!["http://10.0.0.5:7447".to_owned()], ..LinkConfig::default() };
        let refused = link.client().unwrap_err().to_string();
        assert!(refused.contains("tcp/10.0.0.5:7447"), "{refused}");
    }

    #[test]
    fn a_client_of_a_sealed_swarm_dials_by_tls_but_on_its_own_computer() {
        for near in ["tls/10.0.0.5:7447", "tcp/127.0.0.1:7447", "tcp/localhost:7447"] {
            assert!(check_client(&config(&[], &[near])).is_ok(), "{near}");
        }
        for far in ["tcp/10.0.0.5:7447", "tcp/169.254.3.4:7447", "udp/10.0.0.5:7447"] {
            let refused = check_client(&config(&[], &["tls/10.0.0.5:7447", far])).unwrap_err().to_string();
            assert!(refused.contains(far) && refused.contains("tls/"), "{refused}");
        }
    }

    #[test]
    fn endpoints_of_every_mode_are_looked_at() {
        let mut config = config(&[], &[]);
        config.insert_json5("listen/endpoints", r#"{"router": [], "peer": ["tcp/0.0.0.0:1"]}"#).unwrap();
        assert!(check_open(&config, false).is_err());
    }

    #[test]
    fn a_sealed_robot_speaks_tls_but_on_its_own_computer() {
        assert!(
            check_sealed(&config(&["tls/0.0.0.0:7447", "tcp/127.0.0.1:0"], &["tls/10.0.0.5:7447"])).is_ok()
        );
        let listens = check_sealed(&config(&["tcp/10.0.0.5:7447"], &[])).unwrap_err().to_string();
        assert!(listens.contains("listen") && listens.contains("tls/"), "{listens}");
        let dials = check_sealed(&config(&[], &["tcp/10.0.0.5:7447"])).unwrap_err().to_string();
        assert!(dials.contains("connect") && dials.contains("tls/"), "{dials}");
    }
}
