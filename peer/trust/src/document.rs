//! The JSON of a roster, read with bounds.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use gestalt_protocol::{InstructorId, MAX_ROBOTS, RobotId, Signature};
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::membership::{MAX_INSTRUCTORS, Membership};
use crate::public_key::PublicKey;

/// The JSON of a roster.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Document {
    swarm: String,
    authority: PublicKey,
    epoch: u64,
    #[serde(deserialize_with = "members::<_, _, MAX_ROBOTS>")]
    robots: BTreeMap<RobotId, PublicKey>,
    #[serde(default, deserialize_with = "members::<_, _, MAX_INSTRUCTORS>")]
    instructors: BTreeMap<InstructorId, PublicKey>,
    #[serde(default, deserialize_with = "members::<_, _, MAX_ROBOTS>")]
    expelled: BTreeMap<RobotId, PublicKey>,
    signature: Signature,
}

impl Document {
    pub(crate) fn new(members: &Membership, authority: PublicKey, signature: Signature) -> Self {
        let Membership { swarm, epoch, robots, instructors, expelled } = members.clone();
        Self { swarm, authority, epoch, robots, instructors, expelled, signature }
    }

    pub(crate) fn into_parts(self) -> (Membership, PublicKey, Signature) {
        let Self { swarm, authority, epoch, robots, instructors, expelled, signature } = self;
        (Membership { swarm, epoch, robots, instructors, expelled }, authority, signature)
    }
}

/// At most `MAX` members, none twice: of two keys for one robot, which one counts must not depend on who reads.
fn members<'de, D, K, const MAX: usize>(deserializer: D) -> Result<BTreeMap<K, PublicKey>, D::Error>
where
    D: Deserializer<'de>,
    K: Deserialize<'de> + Ord + fmt::Display,
{
    struct Members<K, const MAX: usize>(PhantomData<K>);

    impl<'de, K, const MAX: usize> Visitor<'de> for Members<K, MAX>
    where
        K: Deserialize<'de> + Ord + fmt::Display,
    {
        type Value = BTreeMap<K, PublicKey>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "at most {MAX} members and their keys")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut members = BTreeMap::new();
            while let Some((member, key)) = map.next_entry()? {
                if members.len() == MAX {
                    return Err(A::Error::invalid_length(MAX + 1, &self));
                }
                if members.contains_key(&member) {
                    return Err(A::Error::custom(format_args!("'{member}' is there twice")));
                }
                members.insert(member, key);
            }
            Ok(members)
        }
    }

    deserializer.deserialize_map(Members::<K, MAX>(PhantomData))
}
