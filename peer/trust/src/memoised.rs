//! Ed25519 that works nothing out twice.

use std::cell::RefCell;
use std::collections::BTreeMap;

use ed25519_dalek::VerifyingKey;
use gestalt_protocol::Signature;
use sha2::{Digest, Sha256};
use zeroize::Zeroizing;

use crate::identity::Identity;
use crate::public_key::PublicKey;
use crate::scheme::{Ed25519, Ed25519Secret, Scheme, sealed};

/// [`Ed25519`], whose answers a thread remembers: for emulations in which many robots of one thread check the same signatures.
///
/// Every answer is the one of Ed25519, whose functions have no other input than what is looked up here. It is no scheme for
/// robots: secrets stay in memory until the thread ends, and how long a check takes tells whether it was made before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Memoised {}

/// Answers of one kind that a thread keeps at most, a few MB; then it starts again from none.
const REMEMBERED: usize = 1 << 15;

#[derive(Default)]
struct Memo {
    keys: BTreeMap<PublicKey, Option<VerifyingKey>>,
    /// By the secret and the message, and by the public key, the signature and the message; hashed, since messages are long.
    signatures: BTreeMap<[u8; 32], Signature>,
    verified: BTreeMap<[u8; 32], bool>,
    agreed: BTreeMap<([u8; 32], PublicKey), Zeroizing<[u8; 32]>>,
}

thread_local! {
    static MEMO: RefCell<Memo> = RefCell::default();
}

fn remembered<K: Ord, V: Clone>(
    of: impl FnOnce(&mut Memo) -> &mut BTreeMap<K, V>,
    key: K,
    work_out: impl FnOnce() -> V,
) -> V {
    MEMO.with_borrow_mut(|memo| {
        let answers = of(memo);
        if answers.len() >= REMEMBERED {
            answers.clear();
        }
        answers.entry(key).or_insert_with(work_out).clone()
    })
}

impl sealed::Sealed for Memoised {}

impl Scheme for Memoised {
    type Secret = Ed25519Secret;
    type Key = VerifyingKey;

    fn secret(bytes: &[u8; 32]) -> Self::Secret {
        Ed25519::secret(bytes)
    }

    fn secret_bytes(secret: &Self::Secret) -> Zeroizing<[u8; 32]> {
        Ed25519::secret_bytes(secret)
    }

    fn public(secret: &Self::Secret) -> PublicKey {
        Ed25519::public(secret)
    }

    fn key(public: &PublicKey) -> Option<VerifyingKey> {
        remembered(|memo| &mut memo.keys, *public, || Ed25519::key(public))
    }

    fn sign(secret: &Self::Secret, message: &[u8]) -> Signature {
        let asked = hash(Ed25519::secret_bytes(secret).as_ref(), &[], message);
        remembered(|memo| &mut memo.signatures, asked, || Ed25519::sign(secret, message))
    }

    fn verify(key: &VerifyingKey, message: &[u8], signature: &Signature) -> bool {
        let asked = hash(key.as_bytes(), signature.as_bytes(), message);
        remembered(|memo| &mut memo.verified, asked, || Ed25519::verify(key, message, signature))
    }

    fn agree(secret: &Self::Secret, key: &VerifyingKey) -> Zeroizing<[u8; 32]> {
        let asked = (*Ed25519::secret_bytes(secret), PublicKey::from_bytes(key.to_bytes()));
        remembered(|memo| &mut memo.agreed, asked, || Ed25519::agree(secret, key))
    }
}

/// The first two are of the same lengths at every call for one kind of answer, so no two questions run together to the same bytes.
fn hash(key: &[u8], signature: &[u8], message: &[u8]) -> [u8; 32] {
    Sha256::new().chain_update(key).chain_update(signature).chain_update(message).finalize().into()
}

impl Identity<Memoised> {
    /// The identity of this secret, as [`Identity::from_bytes`] of robots.
    #[must_use]
    pub fn memoised(secret: &[u8; 32]) -> Self {
        Self::of_secret(secret)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asked twice, in either order, and beyond what is kept: the answers of Ed25519.
    #[test]
    fn it_answers_as_ed25519_does() {
        let secrets = [[1; 32], [2; 32]];
        for _ in 0..2 {
            for bytes in &secrets {
                let (mine, plain) = (Memoised::secret(bytes), Ed25519::secret(bytes));
                let public = Ed25519::public(&plain);
                assert_eq!(Memoised::public(&mine), public);
                let key = Ed25519::key(&public).unwrap();
                assert_eq!(Memoised::key(&public), Some(key));
                for message in [&b"a"[..], b"b", b""] {
                    let signature = Ed25519::sign(&plain, message);
                    assert_eq!(Memoised::sign(&mine, message), signature);
                    assert!(Memoised::verify(&key, message, &signature));
                    assert!(!Memoised::verify(&key, b"other", &signature));
                    let mut flipped = *signature.as_bytes();
                    flipped[5] ^= 1;
                    assert!(!Memoised::verify(&key, message, &Signature::from_bytes(flipped)));
                }
                for other in &secrets {
                    let other = Ed25519::key(&Ed25519::public(&Ed25519::secret(other))).unwrap();
                    assert_eq!(Memoised::agree(&mine, &other), Ed25519::agree(&plain, &other));
                }
            }
        }
        assert_eq!(Memoised::key(&PublicKey::from_bytes([0; 32])), None);
    }

    #[test]
    fn what_it_keeps_has_a_bound() {
        for number in 0..2 * REMEMBERED {
            remembered(|memo| &mut memo.verified, hash(&number.to_le_bytes(), &[], b""), || true);
            assert!(MEMO.with_borrow(|memo| memo.verified.len()) <= REMEMBERED);
        }
    }
}
