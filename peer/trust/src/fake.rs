//! Signatures of the right size that cost next to nothing and prove nothing.

use gestalt_protocol::Signature;
use sha2::{Digest, Sha256, Sha512};
use zeroize::Zeroizing;

use crate::identity::Identity;
use crate::public_key::PublicKey;
use crate::scheme::{Scheme, sealed};

/// A hash of the public key and the message in place of a signature, for emulated swarms and fuzzers: the same sizes and the
/// same paths through the code as with [`Ed25519`](crate::Ed25519), the same bytes on every run.
///
/// **Everybody can make everybody's.** No robot takes one by mistake: the feature `fake` is off by default, and with it on a
/// `Verifier`, `Roster` or `Identity` without further words is still one of Ed25519, a different type:
///
/// ```compile_fail,E0308
/// use gestalt_trust::{Budget, Identity, Membership, Verifier};
///
/// let roster = Membership::default().sign(&Identity::fake(1)).unwrap();
/// let a_robots_own: Verifier = Verifier::new(roster, Budget::default());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fake {}

impl sealed::Sealed for Fake {}

impl Scheme for Fake {
    type Secret = Zeroizing<[u8; 32]>;
    type Key = PublicKey;

    fn secret(bytes: &[u8; 32]) -> Self::Secret {
        Zeroizing::new(*bytes)
    }

    fn secret_bytes(secret: &Self::Secret) -> Zeroizing<[u8; 32]> {
        secret.clone()
    }

    fn public(secret: &Self::Secret) -> PublicKey {
        PublicKey::from_bytes(Sha256::new().chain_update("fake key").chain_update(**secret).finalize().into())
    }

    fn key(public: &PublicKey) -> Option<PublicKey> {
        // Some bytes are no key here too, so that rosters with bad keys are met in emulations.
        (*public.as_bytes() != [0; PublicKey::LENGTH]).then_some(*public)
    }

    fn sign(secret: &Self::Secret, message: &[u8]) -> Signature {
        forge(&Self::public(secret), message)
    }

    fn verify(key: &PublicKey, message: &[u8], signature: &Signature) -> bool {
        forge(key, message) == *signature
    }

    fn agree(secret: &Self::Secret, key: &PublicKey) -> Zeroizing<[u8; 32]> {
        let mut both = [Self::public(secret), *key];
        both.sort_unstable();
        let hash = both.iter().fold(Sha256::new(), |hash, key| hash.chain_update(key.as_bytes()));
        Zeroizing::new(hash.finalize().into())
    }
}

fn forge(key: &PublicKey, message: &[u8]) -> Signature {
    Signature::from_bytes(Sha512::new().chain_update(key.as_bytes()).chain_update(message).finalize().into())
}

impl Identity<Fake> {
    /// The emulated identity of that number.
    #[must_use]
    pub fn fake(number: u64) -> Self {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&number.to_le_bytes());
        Self::of_secret(&bytes)
    }
}
