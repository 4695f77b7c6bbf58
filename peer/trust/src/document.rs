//! The JSON of a roster, read with bounds.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

use gestalt_protocol::{InstructorId, MAX_ROBOTS, RobotId, Signature};
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::membership::{Instructor, MAX_INSTRUCTORS, Membership};
use crate::public_key::PublicKey;
use crate::roles::Roles;

/// The JSON of a roster.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Document {
    swarm: String,
    authority: PublicKey,
    epoch: u64,
    #[serde(deserialize_with = "members::<_, _, _, MAX_ROBOTS>")]
    robots: BTreeMap<RobotId, PublicKey>,
    #[serde(default, deserialize_with = "members::<_, _, _, MAX_INSTRUCTORS>")]
    instructors: BTreeMap<InstructorId, Instructor>,
    #[serde(default)]
    local: Roles,
    #[serde(default, deserialize_with = "members::<_, _, _, MAX_ROBOTS>")]
    expelled: BTreeMap<RobotId, PublicKey>,
    signature: Signature,
}

impl Document {
    pub(crate) fn new(members: &Membership, authority: PublicKey, signature: Signature) -> Self {
        let Membership { swarm, epoch, robots, instructors, local, expelled } = members.clone();
        Self { swarm, authority, epoch, robots, instructors, local, expelled, signature }
    }

    pub(crate) fn into_parts(self) -> (Membership, PublicKey, Signature) {
        let Self { swarm, authority, epoch, robots, instructors, local, expelled, signature } = self;
        (Membership { swarm, epoch, robots, instructors, local, expelled }, authority, signature)
    }
}

/// At most `MAX` members, none twice: of two keys for one robot, which one counts must not depend on who reads.
fn members<'de, D, K, V, const MAX: usize>(deserializer: D) -> Result<BTreeMap<K, V>, D::Error>
where
    D: Deserializer<'de>,
    K: FromStr<Err: fmt::Display> + Ord + fmt::Display,
    V: Deserialize<'de>,
{
    struct Members<K, V, const MAX: usize>(PhantomData<(K, V)>);

    impl<'de, K, V, const MAX: usize> Visitor<'de> for Members<K, V, MAX>
    where
        K: FromStr<Err: fmt::Display> + Ord + fmt::Display,
        V: Deserialize<'de>,
    {
        type Value = BTreeMap<K, V>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "at most {MAX} members and their keys")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut members = BTreeMap::new();
            // As text: the JSON of a number as a name would have to be written without escapes.
            while let Some((member, key)) = map.next_entry::<String, V>()? {
                if members.len() == MAX {
                    return Err(A::Error::invalid_length(MAX + 1, &self));
                }
                let member: K = member.parse().map_err(A::Error::custom)?;
                if members.contains_key(&member) {
                    return Err(A::Error::custom(format_args!("'{member}' is there twice")));
                }
                members.insert(member, key);
            }
            Ok(members)
        }
    }

    deserializer.deserialize_map(Members::<K, V, MAX>(PhantomData))
}
