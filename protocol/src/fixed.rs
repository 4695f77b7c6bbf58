//! Numbers of which each value is as likely as another: as a varint they would mostly take a byte more than they have. In
//! text they are numbers like all others.

macro_rules! fixed {
    ($name:ident) => {
        pub mod $name {
            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            pub fn serialize<S: Serializer>(number: &$name, to: S) -> Result<S::Ok, S::Error> {
                if to.is_human_readable() { number.serialize(to) } else { number.to_le_bytes().serialize(to) }
            }

            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$name, D::Error> {
                if from.is_human_readable() {
                    $name::deserialize(from)
                } else {
                    <[u8; size_of::<$name>()]>::deserialize(from).map($name::from_le_bytes)
                }
            }
        }
    };
}

fixed!(u32);
fixed!(u64);
