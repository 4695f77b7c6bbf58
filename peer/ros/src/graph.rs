//! How nodes and their topics are named on Zenoh, and known to each other.
//!
//! ```text
//! data      <domain>/<topic without its outer slashes>/<type>/<type hash>
//! node      @ros2_lv/<domain>/<session>/<node>/<node>/NN/<enclave>/<namespace>/<name>
//! endpoint  @ros2_lv/<domain>/<session>/<node>/<endpoint>/{MP|MS}/<enclave>/<namespace>/<name>/<topic>/<type>/<type hash>/<qos>
//! ```
//!
//! In tokens each `/` inside a part is a `%`; the root namespace and the enclave are `%`.

use std::fmt;

use thiserror::Error;

use crate::error::NameError;
use crate::qos::Qos;

/// 16 bytes that tell endpoints apart: XXH3-128 of the token, little endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gid(pub [u8; 16]);

/// Who a node is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeName {
    namespace: String,
    name: String,
}

impl NodeName {
    /// A node of that name in a namespace: `/` or, for example, `/lab/left`.
    ///
    /// # Errors
    /// [`NameError`] for what ROS does not allow.
    pub fn new(namespace: &str, name: &str) -> Result<Self, NameError> {
        let namespace = namespace.trim_end_matches('/');
        if !namespace.is_empty() {
            absolute(namespace)?;
        }
        if !is_part(name) {
            return Err(NameError(name.to_owned()));
        }
        Ok(Self { namespace: namespace.to_owned(), name: name.to_owned() })
    }

    /// A topic as this node names it: `/absolute`, `~/private`, or else within its namespace.
    ///
    /// # Errors
    /// [`NameError`] for what ROS does not allow.
    pub fn topic(&self, topic: &str) -> Result<String, NameError> {
        let full = match (topic.strip_prefix("~/"), topic.starts_with('/')) {
            (Some(private), _) => format!("{}/{}/{private}", self.namespace, self.name),
            (None, true) => topic.to_owned(),
            (None, false) => format!("{}/{topic}", self.namespace),
        };
        absolute(&full).map_err(|_| NameError(topic.to_owned()))?;
        Ok(full)
    }

    fn token(&self) -> String {
        let namespace = if self.namespace.is_empty() { "/" } else { &self.namespace };
        format!("%/{}/{}", escaped(namespace), self.name)
    }
}

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.namespace, self.name)
    }
}

fn absolute(name: &str) -> Result<(), NameError> {
    let parts = name.strip_prefix('/').ok_or_else(|| NameError(name.to_owned()))?;
    if parts.split('/').all(is_part) { Ok(()) } else { Err(NameError(name.to_owned())) }
}

fn is_part(part: &str) -> bool {
    let mut characters = part.chars();
    characters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_')
        && characters.all(|other| other.is_ascii_alphanumeric() || other == '_')
}

fn escaped(part: &str) -> String {
    part.replace('/', "%")
}

/// What a node does with a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointKind {
    /// It publishes.
    Publisher,
    /// It subscribes.
    Subscription,
}

impl EndpointKind {
    fn code(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Subscription => "MS",
        }
    }
}

/// Where a node's session is.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub domain: u32,
    /// The Zenoh id of its session, as Zenoh prints it.
    pub session: String,
    pub node: NodeName,
}

/// The number of the one node of a session.
const NODE: u32 = 0;

impl Place {
    /// The node's own token.
    pub(crate) fn token(&self) -> String {
        let Self { domain, session, node } = self;
        format!("@ros2_lv/{domain}/{session}/{NODE}/{NODE}/NN/{}", node.token())
    }
}

/// One topic that a node publishes or subscribes to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// What the node does with it.
    pub kind: EndpointKind,
    /// Its full name: `/gestalt/decision`.
    pub topic: String,
    /// The type as DDS names it: `std_msgs::msg::dds_::String_`.
    pub type_name: String,
    /// The hash of the type's definition, `RIHS01_…`.
    pub type_hash: String,
    /// How it is delivered.
    pub qos: Qos,
}

impl Endpoint {
    /// The key of its messages in a domain.
    #[must_use]
    pub fn key(&self, domain: u32) -> String {
        format!("{domain}/{}/{}/{}", self.topic.trim_matches('/'), self.type_name, self.type_hash)
    }

    /// The key of its messages by whatever type hash their publisher writes: Humble's write none.
    #[must_use]
    pub fn key_of_any_hash(&self, domain: u32) -> String {
        format!("{domain}/{}/{}/*", self.topic.trim_matches('/'), self.type_name)
    }

    pub(crate) fn token(&self, number: u32, at: &Place) -> String {
        let Place { domain, session, node } = at;
        let Self { kind, topic, type_name, type_hash, qos } = self;
        format!(
            "@ros2_lv/{domain}/{session}/{NODE}/{number}/{}/{}/{}/{type_name}/{type_hash}/{}",
            kind.code(),
            node.token(),
            escaped(topic),
            qos.to_key()
        )
    }

    /// What a token says, with the name of its node; whoever declared it, this reads it without trust.
    ///
    /// # Errors
    /// [`GraphError`] for what is no token of an endpoint.
    pub fn parse(token: &str) -> Result<(String, Self), GraphError> {
        let parts: Vec<&str> = token.splitn(14, '/').collect();
        let &["@ros2_lv", _, _, _, _, kind, _, namespace, node, topic, type_name, type_hash, qos] =
            parts.as_slice()
        else {
            return Err(GraphError);
        };
        let kind = match kind {
            "MP" => EndpointKind::Publisher,
            "MS" => EndpointKind::Subscription,
            _ => return Err(GraphError),
        };
        let mut fields = qos.split(':');
        let (Some(reliability), Some(durability), Some(history)) =
            (fields.next(), fields.next(), fields.next())
        else {
            return Err(GraphError);
        };
        let depth = match history.split_once(',').ok_or(GraphError)?.1 {
            "" => 42,
            depth => depth.parse().map_err(|_| GraphError)?,
        };
        let plain = |part: &str| part.replace('%', "/");
        let node = format!("{}/{node}", plain(namespace).trim_end_matches('/'));
        let endpoint = Self {
            kind,
            topic: plain(topic),
            type_name: type_name.to_owned(),
            type_hash: type_hash.to_owned(),
            qos: Qos { reliable: reliability != "2", latched: durability == "1", depth },
        };
        Ok((node, endpoint))
    }
}

/// A token that is not one of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("this is no token of a publisher or a subscription")]
pub struct GraphError;

/// The identifier that belongs to a token.
pub(crate) fn gid(token: &str) -> Gid {
    Gid(xxhash_rust::xxh3::xxh3_128(token.as_bytes()).to_le_bytes())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn decision() -> Endpoint {
        Endpoint {
            kind: EndpointKind::Publisher,
            topic: "/gestalt/decision".to_owned(),
            type_name: "std_msgs::msg::dds_::String_".to_owned(),
            type_hash: HASH.to_owned(),
            qos: Qos::reliable(7),
        }
    }

    /// As captured from rmw_zenoh_cpp.
    #[test]
    fn keys_and_tokens_are_those_of_rmw_zenoh() {
        let place =
            Place { domain: 0, session: "a1b2".to_owned(), node: NodeName::new("/", "gestalt").unwrap() };
        assert_eq!(place.token(), "@ros2_lv/0/a1b2/0/0/NN/%/%/gestalt");
        assert_eq!(decision().key(0), format!("0/gestalt/decision/std_msgs::msg::dds_::String_/{HASH}"));
        let token = decision().token(1, &place);
        assert_eq!(
            token,
            format!(
                "@ros2_lv/0/a1b2/0/1/MP/%/%/gestalt/%gestalt%decision/std_msgs::msg::dds_::String_/{HASH}/::,7:,:,:,,"
            )
        );
        assert_eq!(Endpoint::parse(&token), Ok(("/gestalt".to_owned(), decision())));
    }

    /// `xxhsum -H2` of the empty text, its two halves exchanged: the low one stands first.
    #[test]
    fn an_identifier_is_the_hash_with_its_low_half_first() {
        let expected = 0x99aa_06d3_0147_98d8_6001_c324_468d_497f_u128.to_le_bytes();
        assert_eq!(gid(""), Gid(expected));
    }

    #[test]
    fn names_are_those_that_ros_allows() {
        let node = NodeName::new("/lab", "gestalt").unwrap();
        assert_eq!(node.topic("~/say").unwrap(), "/lab/gestalt/say");
        assert_eq!(node.topic("image").unwrap(), "/lab/image");
        assert_eq!(node.topic("/camera/image_raw/compressed").unwrap(), "/camera/image_raw/compressed");
        for wrong in ["", "a b", "/a//b", "/1a", "/a/", "~/", "/a*", "/a%b", "@x", "/**"] {
            assert!(node.topic(wrong).is_err(), "{wrong}");
        }
        assert!(NodeName::new("lab", "gestalt").is_err() && NodeName::new("/", "ge/stalt").is_err());
    }

    proptest! {
        #[test]
        fn no_token_makes_the_reader_panic(parts in proptest::collection::vec("[%:,0-9A-Za-z_@]{0,12}", 0..16)) {
            let _ = Endpoint::parse(&parts.join("/"));
            let _ = Endpoint::parse(&format!("@ros2_lv/{}", parts.join("/")));
        }
    }
}
