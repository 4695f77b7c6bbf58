//! How one who is to become a member says which key it has: one line, to be copied to whoever has the authority's key.

use std::fmt;
use std::str::FromStr;

use gestalt_protocol::hex;
use gestalt_protocol::{InstructorId, RobotId, Signature};
use thiserror::Error;

use crate::identity::Identity;
use crate::public_key::PublicKey;
use crate::scheme::{Ed25519, Scheme};

/// Stands first under every signature of a request.
pub const REQUEST_DOMAIN: &[u8; 18] = b"gestalt-request-1\0";

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Applicant {
    /// A robot.
    Robot(RobotId),
    /// A client.
    Client(InstructorId),
}

impl fmt::Display for Applicant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot(robot) => write!(f, "robot:{robot}"),
            Self::Client(name) => write!(f, "client:{name}"),
        }
    }
}

/// "This is my key", signed with it: nobody can ask for what another one has. The key itself stays where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Who asks.
    pub applicant: Applicant,
    /// With which key.
    pub key: PublicKey,
    signature: Signature,
}

/// A text that is no request.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum RequestError {
    /// Not in the form that [`Request`] is written in.
    #[error(
        "no request: copy the whole line that `gestalt trust request` prints, it begins with gestalt-request-1:"
    )]
    Malformed,
    /// Not signed with the key that it names.
    #[error("the request is not signed with the key that it names: copy the whole line again, unchanged")]
    Forged,
}

impl Request {
    /// The request of whoever has that key.
    #[must_use]
    pub fn new(applicant: Applicant, identity: &Identity) -> Self {
        let key = identity.public_key();
        let signature = identity.sign(&signed_bytes(&applicant, &key));
        Self { applicant, key, signature }
    }
}

fn signed_bytes(applicant: &Applicant, key: &PublicKey) -> Vec<u8> {
    [REQUEST_DOMAIN.as_slice(), key.as_bytes(), applicant.to_string().as_bytes()].concat()
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "gestalt-request-1:{}:{}:{}", self.applicant, self.key, self.signature)
    }
}

impl FromStr for Request {
    type Err = RequestError;

    fn from_str(text: &str) -> Result<Self, RequestError> {
        let parts: Vec<&str> = text.trim().splitn(6, ':').collect();
        let ["gestalt-request-1", kind, who, key, signature] = parts[..] else {
            return Err(RequestError::Malformed);
        };
        let applicant = match kind {
            "robot" => who.parse().ok().map(Applicant::Robot),
            "client" => who.parse().ok().map(Applicant::Client),
            _ => None,
        };
        let applicant = applicant.ok_or(RequestError::Malformed)?;
        let key: PublicKey = key.parse().map_err(|_| RequestError::Malformed)?;
        let signature = Signature::from_bytes(hex::parse(signature).map_err(|_| RequestError::Malformed)?);
        let checked = Ed25519::key(&key).ok_or(RequestError::Forged)?;
        if !Ed25519::verify(&checked, &signed_bytes(&applicant, &key), &signature) {
            return Err(RequestError::Forged);
        }
        Ok(Self { applicant, key, signature })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::robot;

    #[test]
    fn a_request_is_one_line_of_who_asks_with_which_key() {
        for applicant in [Applicant::Robot(RobotId(7)), Applicant::Client("desk".parse().unwrap())] {
            let request = Request::new(applicant, &robot(7));
            let line = request.to_string();
            assert_eq!((line.lines().count(), line.parse()), (1, Ok(request)));
            assert_eq!(format!("  {line}\n").parse::<Request>().unwrap().to_string(), line);
        }
    }

    #[test]
    fn nobody_asks_for_what_another_one_has() {
        let line = Request::new(Applicant::Robot(RobotId(7)), &robot(7)).to_string();
        let (mine, other) = (robot(7).public_key().to_string(), robot(8).public_key().to_string());
        for (bad, why) in [
            (line.replace(":7:", ":8:"), RequestError::Forged),
            (line.replace(&mine, &other), RequestError::Forged),
            (line.replace("robot", "client"), RequestError::Forged),
            (line[1..].to_owned(), RequestError::Malformed),
            (line[..line.len() - 1].to_owned(), RequestError::Malformed),
            (line.clone() + ":", RequestError::Malformed),
            (String::new(), RequestError::Malformed),
        ] {
            assert_eq!(bad.parse::<Request>(), Err(why), "{bad}");
        }
    }
}
