//! How signatures are made and checked.

use std::fmt::Debug;
use std::sync::LazyLock;

use curve25519_dalek::constants::EIGHT_TORSION;
use ed25519_dalek::hazmat::{ExpandedSecretKey, raw_sign};
use ed25519_dalek::{SigningKey, Verifier, VerifyingKey};
use gestalt_protocol::Signature;
use sha2::Sha512;
use zeroize::Zeroizing;

use crate::public_key::PublicKey;

/// A way to sign. There is one that robots use, [`Ed25519`], which every type of this crate takes by default; and one for
/// emulated swarms, behind the feature `fake`. Nobody else can add one.
pub trait Scheme: sealed::Sealed + Clone + Debug + PartialEq + Eq + 'static {
    /// What an author keeps to itself; wiped from memory when dropped.
    type Secret: Send + Sync;
    /// A public key as it is ready to check signatures with.
    type Key: Clone + Debug + PartialEq + Send + Sync;

    /// The secret made of these 32 bytes.
    fn secret(bytes: &[u8; 32]) -> Self::Secret;

    /// The 32 bytes that make this secret.
    fn secret_bytes(secret: &Self::Secret) -> Zeroizing<[u8; 32]>;

    /// The public key that belongs to a secret.
    fn public(secret: &Self::Secret) -> PublicKey;

    /// The key to check with; `None` for bytes that are no key, or one that nobody should trust.
    fn key(public: &PublicKey) -> Option<Self::Key>;

    /// The signature under a message: always the same for the same secret and message.
    fn sign(secret: &Self::Secret, message: &[u8]) -> Signature;

    /// Whether that is the key's signature under that message.
    fn verify(key: &Self::Key, message: &[u8], signature: &Signature) -> bool;

    /// What whoever has this secret and whoever has the secret of that key both come to, and nobody else.
    fn agree(secret: &Self::Secret, key: &Self::Key) -> Zeroizing<[u8; 32]>;
}

/// Ed25519 (RFC 8032) by its strict rule, one signature at a time.
///
/// The strict rule leaves no choice: it refuses keys and points of small order, and every second spelling of a point or number.
/// Checking many signatures as one batch is not done, though it would cost half as much: a batch is checked up to the cofactor,
/// so it accepts signatures that the strict rule refuses, and two robots would count different votes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ed25519 {}

/// A secret key, as it is ready to sign with: a signature that expands the key first takes half as long again.
///
/// Its parts are made together, and only here: signatures by one secret that name two public keys give the secret away.
pub struct Ed25519Secret {
    bytes: Zeroizing<[u8; 32]>,
    expanded: ExpandedSecretKey,
    public: VerifyingKey,
}

impl Scheme for Ed25519 {
    type Secret = Ed25519Secret;
    type Key = VerifyingKey;

    fn secret(bytes: &[u8; 32]) -> Ed25519Secret {
        let public = SigningKey::from_bytes(bytes).verifying_key();
        Ed25519Secret { bytes: Zeroizing::new(*bytes), expanded: bytes.into(), public }
    }

    fn secret_bytes(secret: &Ed25519Secret) -> Zeroizing<[u8; 32]> {
        secret.bytes.clone()
    }

    fn public(secret: &Ed25519Secret) -> PublicKey {
        PublicKey::from_bytes(secret.public.to_bytes())
    }

    fn key(public: &PublicKey) -> Option<VerifyingKey> {
        let key = VerifyingKey::from_bytes(public.as_bytes()).ok()?;
        // A point has few spellings besides its shortest; with them one robot would have two keys.
        let shortest = key.to_edwards().compress().to_bytes() == *public.as_bytes();
        (shortest && !key.is_weak()).then_some(key)
    }

    fn sign(secret: &Ed25519Secret, message: &[u8]) -> Signature {
        Signature::from_bytes(raw_sign::<Sha512>(&secret.expanded, message, &secret.public).to_bytes())
    }

    fn verify(key: &VerifyingKey, message: &[u8], signature: &Signature) -> bool {
        let signature = ed25519_dalek::Signature::from_bytes(signature.as_bytes());
        !key.is_weak() && !is_of_small_order(signature.r_bytes()) && key.verify(message, &signature).is_ok()
    }

    /// X25519 of the keys' Montgomery forms (RFC 7748, 4.1 and 6.1).
    fn agree(secret: &Ed25519Secret, key: &VerifyingKey) -> Zeroizing<[u8; 32]> {
        Zeroizing::new((key.to_montgomery() * secret.expanded.scalar).to_bytes())
    }
}

/// Whether a point is one of the eight whose order divides the cofactor, by its shortest spelling.
///
/// A signature's point is held against the shortest spelling of the point that it has to be, so another spelling is refused there,
/// and no point needs to be worked out from its spelling: a tenth of what `verify_strict` takes.
fn is_of_small_order(point: &[u8; 32]) -> bool {
    static SMALL: LazyLock<[[u8; 32]; 8]> =
        LazyLock::new(|| EIGHT_TORSION.map(|point| point.compress().to_bytes()));
    SMALL.contains(point)
}

pub(crate) mod sealed {
    /// Keeps [`Scheme`](super::Scheme) to this crate.
    pub trait Sealed {}

    impl Sealed for super::Ed25519 {}
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8032, 7.1, test 2.
    #[test]
    fn it_is_the_standard_signature() {
        let secret =
            gestalt_protocol::hex::parse("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb");
        let secret = Ed25519::secret(&secret.unwrap());
        let public = "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c";
        assert_eq!(Ed25519::public(&secret).to_string(), public);
        let signature = "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da\
                         085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00";
        assert_eq!(Ed25519::sign(&secret, &[0x72]).to_string(), signature);
    }

    #[test]
    fn an_expanded_key_signs_as_the_key_itself() {
        for number in 0..64 {
            let (bytes, message) = ([number; 32], vec![number; 3 * usize::from(number)]);
            let signature = ed25519_dalek::Signer::sign(&SigningKey::from_bytes(&bytes), &message);
            let secret = Ed25519::secret(&bytes);
            assert_eq!(Ed25519::sign(&secret, &message).as_bytes(), &signature.to_bytes());
            assert_eq!(*Ed25519::secret_bytes(&secret), bytes);
        }
    }

    /// R is the neutral point and S = H(R ‖ A ‖ M)·a: OpenSSL accepts it, made by the author itself, and so would the lax rule.
    #[test]
    fn a_point_of_small_order_is_refused_where_others_let_it_pass() {
        let robot = crate::testing::robot(1);
        let key = Ed25519::key(&robot.public_key()).unwrap();
        let signature: Signature = "0100000000000000000000000000000000000000000000000000000000000000\
                                    0e3c5f3cb322f04669d74f3c07b21d648a6d7e3f419fbb8f0b99008cd9bfde06"
            .parse()
            .unwrap();
        let lax = ed25519_dalek::Signature::from_bytes(signature.as_bytes());
        assert!(key.verify(b"said", &lax).is_ok());
        assert!(!Ed25519::verify(&key, b"said", &signature));
    }

    /// Signatures of every small point, signatures of another key and message, and signatures with any bit of their point turned.
    #[test]
    fn the_strict_rule_is_the_library_s_own() {
        let secret = Ed25519::secret(&[7; 32]);
        let key = Ed25519::key(&Ed25519::public(&secret)).unwrap();
        let mut signatures = vec![Ed25519::sign(&secret, b"said"), Ed25519::sign(&secret, b"unsaid")];
        signatures.push(Ed25519::sign(&Ed25519::secret(&[8; 32]), b"said"));
        for point in EIGHT_TORSION {
            let mut bytes = *signatures[0].as_bytes();
            bytes[..32].copy_from_slice(point.compress().as_bytes());
            signatures.push(Signature::from_bytes(bytes));
        }
        for bit in 0..256 {
            let mut bytes = *signatures[0].as_bytes();
            bytes[bit / 8] ^= 1 << (bit % 8);
            signatures.push(Signature::from_bytes(bytes));
        }
        for signature in &signatures {
            let strict = key
                .verify_strict(b"said", &ed25519_dalek::Signature::from_bytes(signature.as_bytes()))
                .is_ok();
            assert_eq!(Ed25519::verify(&key, b"said", signature), strict, "{signature}");
        }
        assert!(Ed25519::verify(&key, b"said", &signatures[0]));
    }

    #[test]
    fn a_weak_or_misspelt_key_is_no_key() {
        let mut neutral = [0; 32];
        neutral[0] = 1;
        // y = p + 3, a second spelling of y = 3, which is on the curve or not; y = p is one of 0, of order 4.
        let mut misspelt = [0xff; 32];
        (misspelt[0], misspelt[31]) = (0xed, 0x7f);
        let mut other_sign_of_zero = neutral;
        other_sign_of_zero[31] = 0x80;
        for bytes in [[0; 32], neutral, misspelt, other_sign_of_zero, [2; 32]] {
            assert_eq!(Ed25519::key(&PublicKey::from_bytes(bytes)), None, "{bytes:?}");
        }
        // The 19 values from p up are second spellings, whatever their order.
        for least in 0xed..=0xff {
            misspelt[0] = least;
            assert_eq!(Ed25519::key(&PublicKey::from_bytes(misspelt)), None, "{least}");
        }
    }
}
