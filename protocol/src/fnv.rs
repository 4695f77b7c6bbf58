//! FNV-1a (G. Fowler, L. C. Noll, K.-P. Vo): a hash that names things the same on every machine.

/// The 64-bit hash of the bytes added so far: what feature spaces and digests are named by.
///
/// Fast and unkeyed: it tells apart what differs by chance, not what somebody made to look alike.
#[derive(Clone, Copy, Debug)]
pub struct Fnv1a(u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv1a {
    /// Adds bytes.
    pub fn add(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// The hash.
    #[must_use]
    pub fn hash(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_published_hash() {
        // The test vectors of the draft of its RFC.
        for (text, hash) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut fnv = Fnv1a::default();
            fnv.add(text.bytes());
            assert_eq!(fnv.hash(), hash, "{text}");
        }
    }
}
