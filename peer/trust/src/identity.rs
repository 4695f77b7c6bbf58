//! Who a robot is to itself: its secret key.

use std::fmt;

use gestalt_protocol::Signature;
use rand::CryptoRng;
use zeroize::Zeroizing;

use crate::public_key::PublicKey;
use crate::scheme::{Ed25519, Scheme};

/// A secret key and its public one: of a robot, an instructor, or the authority over a swarm.
///
/// Whoever has the secret speaks in its name, so it can be neither cloned nor serialised, `Debug` shows the public key alone, and
/// its memory is wiped when it is dropped.
pub struct Identity<S: Scheme = Ed25519> {
    secret: S::Secret,
    public: PublicKey,
}

impl Identity {
    /// A new identity of 32 bytes from that generator, which nobody else may be able to guess or to run again.
    #[must_use]
    pub fn generate(rng: &mut impl CryptoRng) -> Self {
        let mut bytes = Zeroizing::new([0; 32]);
        rng.fill_bytes(bytes.as_mut());
        Self::from_bytes(&bytes)
    }

    /// The identity of this secret: any 32 bytes make one.
    #[must_use]
    pub fn from_bytes(secret: &[u8; 32]) -> Self {
        Self::of_secret(secret)
    }
}

impl<S: Scheme> Identity<S> {
    pub(crate) fn of_secret(secret: &[u8; 32]) -> Self {
        let secret = S::secret(secret);
        Self { public: S::public(&secret), secret }
    }

    /// The secret, to be kept; wiped from memory when dropped.
    #[must_use]
    pub fn to_bytes(&self) -> Zeroizing<[u8; 32]> {
        S::secret_bytes(&self.secret)
    }

    /// What others know it by.
    #[must_use]
    pub fn public_key(&self) -> PublicKey {
        self.public
    }

    /// The signature under the body of an X.509 certificate (RFC 5280, `TBSCertificate`); `None` for any other bytes. Such a body begins as
    /// nothing else does that is signed here, so it is never taken for anything else.
    #[must_use]
    pub fn sign_certificate(&self, body: &[u8]) -> Option<Signature> {
        // A sequence, whose length takes more than one byte to say.
        (body.len() > 0x80 && body[0] == 0x30 && body[1] > 0x80).then(|| self.sign(body))
    }

    /// The signature under bytes that already say what they are for.
    pub(crate) fn sign(&self, message: &[u8]) -> Signature {
        S::sign(&self.secret, message)
    }

    /// What this one and whoever has that key come to alone.
    pub(crate) fn agree(&self, key: &S::Key) -> Zeroizing<[u8; 32]> {
        S::agree(&self.secret, key)
    }
}

impl<S: Scheme> fmt::Debug for Identity<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Identity({})", self.public)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::hex::Hex;
    use rand::SeedableRng;
    use rand_chacha::ChaCha20Rng;

    use super::*;

    #[test]
    fn the_same_seed_makes_the_same_identity() {
        let new = |seed| Identity::generate(&mut ChaCha20Rng::seed_from_u64(seed));
        assert_eq!(new(1).public_key(), new(1).public_key());
        assert_ne!(new(1).public_key(), new(2).public_key());
        let again = Identity::from_bytes(&new(1).to_bytes());
        assert_eq!(again.public_key(), new(1).public_key());
    }

    #[test]
    fn a_certificate_is_no_statement() {
        let identity = Identity::from_bytes(&[1; 32]);
        let mut body = vec![0; 300];
        body[..2].copy_from_slice(&[0x30, 0x82]);
        assert!(identity.sign_certificate(&body).is_some());
        for domain in [crate::STATEMENT_DOMAIN.as_slice(), crate::ROSTER_DOMAIN.as_slice()] {
            body[..domain.len()].copy_from_slice(domain);
            assert_eq!(identity.sign_certificate(&body), None);
        }
        assert_eq!(identity.sign_certificate(&[0x30, 0x82]), None);
        // The shortest whose length takes more than a byte to say; and one that does not say it, which no certificate may leave out.
        body[..2].copy_from_slice(&[0x30, 0x81]);
        assert!(identity.sign_certificate(&body[..0x81]).is_some());
        assert_eq!(identity.sign_certificate(&body[..0x80]), None);
        body[1] = 0x80;
        assert_eq!(identity.sign_certificate(&body), None);
    }

    #[test]
    fn debug_never_shows_the_secret() {
        let identity = Identity::from_bytes(&[0xab; 32]);
        for shown in [format!("{identity:?}"), format!("{identity:#?}")] {
            assert!(shown.contains(&identity.public_key().to_string()), "{shown}");
            assert!(!shown.contains(&Hex(&[0xab; 4]).to_string()) && !shown.contains("171"), "{shown}");
        }
    }
}
