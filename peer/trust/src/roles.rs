//! What an instructor may do.

use std::fmt;
use std::str::FromStr;

use gestalt_protocol::Instruction;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One thing that an instructor may do, or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Open rounds.
    Open,
    /// Say which gesture it was, where nobody else has said so.
    Teach,
    /// Say it also where somebody else has.
    Overrule,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Open, Self::Teach, Self::Overrule];

    /// One word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Teach => "teach",
            Self::Overrule => "overrule",
        }
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A word that names no role.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no role: there are open, teach and overrule, and listen for none of them")]
pub struct RoleError(String);

impl FromStr for Role {
    type Err = RoleError;

    fn from_str(text: &str) -> Result<Self, RoleError> {
        let found = Self::ALL.into_iter().find(|role| role.name() == text);
        found.ok_or_else(|| RoleError(text.chars().take(40).collect()))
    }
}

/// What whoever has no role may do, as everybody who is let in.
const LISTEN: &str = "listen";

/// What somebody may do. In JSON a list of words, on the wire one byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Roles(u8);

impl Roles {
    /// Nothing.
    pub const NONE: Self = Self(0);

    /// Those that a role usually comes with: who may overrule may teach, and who may teach may open rounds.
    #[must_use]
    pub fn up_to(role: Role) -> Self {
        match role {
            Role::Open => Self::from_iter([Role::Open]),
            Role::Teach => Self::from_iter([Role::Open, Role::Teach]),
            Role::Overrule => Self::from_iter(Role::ALL),
        }
    }

    /// Those that a role usually comes with, by its word; `listen` for none.
    ///
    /// # Errors
    /// [`RoleError`] for any other word.
    pub fn named(word: &str) -> Result<Self, RoleError> {
        if word == LISTEN { Ok(Self::NONE) } else { word.parse().map(Self::up_to) }
    }

    /// Whether that is one of them.
    #[must_use]
    pub fn has(self, role: Role) -> bool {
        self.0 & role.bit() != 0
    }

    /// Whether who has them may say that. Who may not overrule says what was shown only where nobody else has: that is for those to see to who hold what was
    /// said.
    #[must_use]
    pub fn permit(self, said: &Instruction) -> bool {
        self.has(if *said == Instruction::Open { Role::Open } else { Role::Teach })
    }

    /// They, in their order.
    pub fn iter(self) -> impl Iterator<Item = Role> {
        Role::ALL.into_iter().filter(move |role| self.has(*role))
    }
}

impl FromIterator<Role> for Roles {
    fn from_iter<T: IntoIterator<Item = Role>>(roles: T) -> Self {
        Self(roles.into_iter().fold(0, |bits, role| bits | role.bit()))
    }
}

impl fmt::Display for Roles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE {
            return f.pad(LISTEN);
        }
        let names: Vec<&str> = self.iter().map(Role::name).collect();
        f.pad(&names.join(", "))
    }
}

impl Serialize for Roles {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            serializer.collect_seq(self.iter().map(Role::name))
        } else {
            serializer.serialize_u8(self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Roles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Words;

        impl<'de> Visitor<'de> for Words {
            type Value = Roles;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a list of roles: open, teach, overrule, in this order")
            }

            /// In their order, and none twice: one set of roles has one spelling.
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Roles, A::Error> {
                let mut roles: Vec<Role> = Vec::new();
                while let Some(word) = seq.next_element::<String>()? {
                    let role = word.parse().map_err(A::Error::custom)?;
                    if roles.last().is_some_and(|last| *last >= role) {
                        return Err(A::Error::custom(format_args!("'{role}' is not in its order")));
                    }
                    roles.push(role);
                }
                Ok(roles.into_iter().collect())
            }
        }

        if deserializer.is_human_readable() {
            return deserializer.deserialize_seq(Words);
        }
        let bits = u8::deserialize(deserializer)?;
        let known: Self = Role::ALL.into_iter().collect();
        if bits & !known.0 == 0 { Ok(Self(bits)) } else { Err(D::Error::custom("a role of a later release")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_have_one_spelling() {
        let roles = Roles::up_to(Role::Overrule);
        assert_eq!(serde_json::to_string(&roles).unwrap(), r#"["open","teach","overrule"]"#);
        assert_eq!(serde_json::from_str::<Roles>(r#"["open","teach","overrule"]"#).unwrap(), roles);
        assert_eq!(postcard::to_allocvec(&roles).unwrap(), [7]);
        assert_eq!(postcard::from_bytes::<Roles>(&[7]).unwrap(), roles);
        assert!(postcard::from_bytes::<Roles>(&[8]).is_err());
        for bad in [r#"["teach","open"]"#, r#"["open","open"]"#, r#"["reign"]"#, "7", r#""open""#] {
            assert!(serde_json::from_str::<Roles>(bad).is_err(), "{bad}");
        }
        let why = serde_json::from_str::<Roles>("7").unwrap_err().to_string();
        assert!(why.contains("a list of roles: open, teach, overrule, in this order"), "{why}");
    }

    #[test]
    fn a_role_is_read_as_it_is_written() {
        for role in Role::ALL {
            assert_eq!((role.name().parse(), role.to_string()), (Ok(role), role.name().to_owned()));
            assert!(Roles::up_to(role).has(role));
        }
        assert!("reign".parse::<Role>().unwrap_err().to_string().contains("overrule"));
        assert_eq!(Roles::up_to(Role::Teach).to_string(), "open, teach");
        assert_eq!(Roles::NONE.to_string(), "listen");
        assert_eq!(Roles::named("listen"), Ok(Roles::NONE));
        assert_eq!(Roles::named("teach"), Ok(Roles::up_to(Role::Teach)));
        assert!(Roles::named("reign").unwrap_err().to_string().contains("listen"));
        assert!(Roles::from_iter([Role::Teach, Role::Teach]).has(Role::Teach), "said twice it is said");
    }
}
