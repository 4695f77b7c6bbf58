//! Where something is served.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::DeskError;

/// A host and a port: `127.0.0.1:8420`, `[::]:8420`, `robot1.local:8420`; a port alone is one of this machine's loopback
/// interface, and port 0 any that is free.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Address {
    host: Host,
    port: u16,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Host {
    Ip(IpAddr),
    Name(String),
}

impl Address {
    /// The port unless told otherwise.
    pub const PORT: u16 = 8420;

    pub(super) fn host(&self) -> &Host {
        &self.host
    }

    /// The same host at the port that was found free.
    pub(crate) fn at_port(&self, port: u16) -> Self {
        Self { port, ..self.clone() }
    }
}

impl Default for Address {
    fn default() -> Self {
        Self { host: Host::Ip(Ipv4Addr::LOCALHOST.into()), port: Self::PORT }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.host {
            Host::Ip(IpAddr::V6(ip)) => write!(f, "[{ip}]:{}", self.port),
            Host::Ip(ip) => write!(f, "{ip}:{}", self.port),
            Host::Name(name) => write!(f, "{name}:{}", self.port),
        }
    }
}

impl TryFrom<String> for Address {
    type Error = DeskError;

    fn try_from(text: String) -> Result<Self, DeskError> {
        text.parse()
    }
}

impl From<Address> for String {
    fn from(address: Address) -> String {
        address.to_string()
    }
}

impl FromStr for Address {
    type Err = DeskError;

    fn from_str(text: &str) -> Result<Self, DeskError> {
        if let Ok(port) = text.parse() {
            return Ok(Self { port, ..Self::default() });
        }
        let read = |text: &str| {
            let (host, port) = text.rsplit_once(':')?;
            let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
            Some(Self { host: Host::read(host)?, port: port.parse().ok()? })
        };
        read(text).ok_or_else(|| DeskError::Address(text.chars().take(80).collect()))
    }
}

impl Host {
    /// An IP address, or a name of letters, digits, dots and hyphens, in lower case.
    pub fn read(text: &str) -> Option<Self> {
        if let Ok(ip) = text.parse() {
            return Some(Self::Ip(ip));
        }
        let fits = (1..=253).contains(&text.len())
            && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'.' || b == b'-');
        fits.then(|| Self::Name(text.to_ascii_lowercase()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_as_it_is_displayed() {
        for text in ["127.0.0.1:8420", "[::1]:0", "0.0.0.0:80", "robot1.local:8420", "localhost:1"] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        assert_eq!("9000".parse::<Address>().unwrap().to_string(), "127.0.0.1:9000");
        for wrong in ["", ":80", "a b:80", "robot", "1.2.3.4:x", "1.2.3.4:70000", "http://localhost:1", "::1"]
        {
            let read = wrong.parse::<Address>();
            assert!(read.is_err() || wrong == "::1", "{wrong}: {read:?}");
        }
    }
}
