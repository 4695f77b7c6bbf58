//! Certificates, as the authority of a swarm writes them and its members keep them.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gestalt_protocol::Signature;
use gestalt_trust::{Ed25519, Identity, PublicKey, Roster, Scheme, SwarmId};
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyUsagePurpose, PKCS_ED25519, PublicKeyData, SerialNumber, SignatureAlgorithm, SigningKey,
};
use thiserror::Error;

use super::name::{Bearer, Name};

const BEGIN: &str = "-----BEGIN CERTIFICATE-----";
const END: &str = "-----END CERTIFICATE-----";

/// The longest file of certificates looked into; two take less than 2 KiB.
const MAX_CERTIFICATE: u64 = 16 * 1024;

/// A certificate that cannot be used, or not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CertificateError {
    /// The file could not be read or written.
    #[error("{path}: the certificate could not be {verb}: enrol again, or restore it")]
    File {
        /// The file.
        path: PathBuf,
        /// `read` or `written`.
        verb: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// Not two certificates as the authority writes them.
    #[error("no certificate as `gestalt trust` writes it: take the one that the authority wrote, unchanged")]
    Malformed,
    /// Of somebody else, another swarm, or another key.
    #[error("the certificate is not that of {0} with the key that it has here: enrol it with this key")]
    NotOurs(String),
    /// Not signed by the authority of the roster.
    #[error("the certificate was not signed by the authority of this roster: enrol again")]
    Forged,
    /// It could not be put together.
    #[error("cannot make a certificate: {0}")]
    Make(#[from] rcgen::Error),
}

/// A member's certificate and that of its authority, in PEM: neither is a secret.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Certificate {
    member: String,
    authority: String,
}

impl Certificate {
    /// Certifies that `key` is that of `holder` in the swarm of that name. It holds until the roster says otherwise: robots may have no clock.
    ///
    /// # Errors
    /// [`CertificateError::Make`].
    pub fn issue(
        authority: &Identity,
        swarm: &str,
        holder: Bearer,
        key: &PublicKey,
    ) -> Result<Self, CertificateError> {
        let public = authority.public_key();
        let id = SwarmId::new(&public, swarm);
        let signer = Authority { identity: authority, public };
        let of_authority = params(&Name::new(&id, Bearer::Authority, &public), &public, true);
        let authority = of_authority.self_signed(&signer)?;
        let issuer = Issuer::from_params(&of_authority, signer);
        let member = params(&Name::new(&id, holder, key), key, false).signed_by(&Member(*key), &issuer)?;
        Ok(Self { member: pem(member.der()), authority: pem(authority.der()) })
    }

    /// The member's own, in PEM.
    #[must_use]
    pub fn member(&self) -> &str {
        &self.member
    }

    /// The authority's, in PEM.
    #[must_use]
    pub fn authority(&self) -> &str {
        &self.authority
    }

    /// Both, as they stand in a file: the member's first.
    #[must_use]
    pub fn to_pem(&self) -> String {
        format!("{}{}", self.member, self.authority)
    }

    /// Reads what [`Certificate::to_pem`] wrote.
    ///
    /// # Errors
    /// [`CertificateError::Malformed`].
    pub fn parse(text: &str) -> Result<Self, CertificateError> {
        let (member, rest) = cut(text).ok_or(CertificateError::Malformed)?;
        let (authority, rest) = cut(rest).ok_or(CertificateError::Malformed)?;
        if rest.trim().is_empty() { Ok(Self { member, authority }) } else { Err(CertificateError::Malformed) }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`CertificateError::File`], [`CertificateError::Malformed`].
    pub fn read(path: &Path) -> Result<Self, CertificateError> {
        let unreadable = |source| CertificateError::File { path: path.to_owned(), verb: "read", source };
        let mut text = String::new();
        let file = fs::File::open(path).map_err(unreadable)?;
        file.take(MAX_CERTIFICATE).read_to_string(&mut text).map_err(unreadable)?;
        Self::parse(&text)
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// [`CertificateError::File`].
    pub fn write(&self, path: &Path) -> Result<(), CertificateError> {
        let unwritable = |source| CertificateError::File { path: path.to_owned(), verb: "written", source };
        gestalt_file::replace(path, self.to_pem().as_bytes()).map_err(unwritable)
    }

    /// Whether it is that holder's, with that key, by the authority of that roster: said here, where it can be mended, and not by links that
    /// never stand.
    ///
    /// # Errors
    /// [`CertificateError::Malformed`], [`CertificateError::NotOurs`], [`CertificateError::Forged`].
    pub fn check(&self, roster: &Roster, holder: Bearer, key: &PublicKey) -> Result<(), CertificateError> {
        let der = der(&self.member).ok_or(CertificateError::Malformed)?;
        let (body, signature) = signed(&der).ok_or(CertificateError::Malformed)?;
        let name = Name::new(&roster.swarm_id(), holder, key);
        let holds = |part: &[u8]| body.windows(part.len()).any(|window| window == part);
        if !holds(name.to_string().as_bytes()) || !holds(key.as_bytes()) {
            return Err(CertificateError::NotOurs(name.holder.to_string()));
        }
        let authority = roster.authority();
        let of_authority = self::der(&self.authority).ok_or(CertificateError::Malformed)?;
        let is_its = of_authority.windows(32).any(|window| window == authority.as_bytes());
        let signed = Ed25519::key(&authority).is_some_and(|key| Ed25519::verify(&key, body, &signature));
        if is_its && signed { Ok(()) } else { Err(CertificateError::Forged) }
    }
}

fn params(name: &Name, key: &PublicKey, is_authority: bool) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name.to_string());
    // Another one for another key, as X.509 wants it.
    params.serial_number = Some(SerialNumber::from_slice(&key.as_bytes()[..16]));
    if is_authority {
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
        params.key_identifier_method = rcgen::KeyIdMethod::PreSpecified(key.as_bytes()[..20].to_vec());
    } else {
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages =
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
    }
    params
}

/// A key that something is certified of.
struct Member(PublicKey);

impl PublicKeyData for Member {
    fn der_bytes(&self) -> &[u8] {
        self.0.as_bytes()
    }

    fn algorithm(&self) -> &'static SignatureAlgorithm {
        &PKCS_ED25519
    }
}

/// Who certifies.
struct Authority<'a> {
    identity: &'a Identity,
    public: PublicKey,
}

impl PublicKeyData for Authority<'_> {
    fn der_bytes(&self) -> &[u8] {
        self.public.as_bytes()
    }

    fn algorithm(&self) -> &'static SignatureAlgorithm {
        &PKCS_ED25519
    }
}

impl SigningKey for Authority<'_> {
    fn sign(&self, body: &[u8]) -> Result<Vec<u8>, rcgen::Error> {
        let signature = self.identity.sign_certificate(body).ok_or(rcgen::Error::RemoteKeyError)?;
        Ok(signature.as_bytes().to_vec())
    }
}

/// As PEM, in lines of 64 characters.
fn pem(der: &[u8]) -> String {
    let text = STANDARD.encode(der);
    let lines: Vec<&str> =
        text.as_bytes().chunks(64).map(|line| str::from_utf8(line).unwrap_or_default()).collect();
    format!("{BEGIN}\n{}\n{END}\n", lines.join("\n"))
}

/// The first certificate of a text, as [`pem`] writes it, and the rest.
fn cut(text: &str) -> Option<(String, &str)> {
    let (body, rest) = text.trim_start().strip_prefix(BEGIN)?.split_once(END)?;
    let text: String = body.split_whitespace().collect();
    Some((pem(&STANDARD.decode(text).ok()?), rest))
}

fn der(pem: &str) -> Option<Vec<u8>> {
    let body = pem.trim().strip_prefix(BEGIN)?.strip_suffix(END)?;
    STANDARD.decode(body.split_whitespace().collect::<String>()).ok()
}

/// The body of a certificate, and the Ed25519 signature under it (RFC 5280, 4.1).
fn signed(der: &[u8]) -> Option<(&[u8], Signature)> {
    let (outer, rest) = value(der, 0x30)?;
    let (inner, after) = value(outer, 0x30)?;
    let body = &outer[..outer.len() - after.len()];
    let (algorithm, after) = value(after, 0x30)?;
    let (bits, end) = value(after, 0x03)?;
    let signature = bits.strip_prefix(&[0])?.try_into().ok()?;
    // Ed25519 (RFC 8410), and nothing beside it.
    let whole =
        algorithm == [6, 3, 0x2b, 0x65, 0x70] && rest.is_empty() && end.is_empty() && !inner.is_empty();
    whole.then(|| (body, Signature::from_bytes(signature)))
}

/// The value of the first element of DER bytes, which must have that tag, and what follows it.
fn value(der: &[u8], tag: u8) -> Option<(&[u8], &[u8])> {
    let (&found, rest) = der.split_first()?;
    let (&first, rest) = rest.split_first()?;
    let (length, rest) = match first {
        0..=0x7f => (usize::from(first), rest),
        0x81 => (usize::from(*rest.first()?), &rest[1..]),
        0x82 => {
            let (length, rest) = rest.split_first_chunk::<2>()?;
            (usize::from(u16::from_be_bytes(*length)), rest)
        }
        _ => return None,
    };
    (found == tag).then_some(rest)?.split_at_checked(length)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;
    use gestalt_trust::Membership;

    use super::*;

    fn key(number: u8) -> Identity {
        Identity::from_bytes(&[number; 32])
    }

    fn roster(swarm: &str) -> Roster {
        Membership { swarm: swarm.to_owned(), epoch: 1, ..Membership::default() }.sign(&key(100)).unwrap()
    }

    fn robot(id: u32) -> Bearer {
        Bearer::Robot(RobotId(id))
    }

    fn issued() -> Certificate {
        Certificate::issue(&key(100), "demo", robot(7), &key(7).public_key()).unwrap()
    }

    #[test]
    fn a_certificate_is_its_holders_alone() {
        let check = |certificate: &Certificate, swarm: &str, holder, key: &Identity| {
            certificate.check(&roster(swarm), holder, &key.public_key())
        };
        let issued = issued();
        assert!(check(&issued, "demo", robot(7), &key(7)).is_ok());
        for (swarm, holder, with) in [("demo", robot(8), 7), ("demo", robot(7), 8), ("other", robot(7), 7)] {
            let refused = check(&issued, swarm, holder, &key(with)).unwrap_err();
            assert!(matches!(refused, CertificateError::NotOurs(_)), "{refused}");
        }
        // By another authority that says it is this one's swarm, and one whose bytes were changed.
        let usurped = Certificate::issue(&key(66), "demo", robot(7), &key(7).public_key()).unwrap();
        let mixed = Certificate { authority: issued.authority.clone(), ..usurped };
        assert!(check(&mixed, "demo", robot(7), &key(7)).is_err());
        let mut bytes = der(&issued.member).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        let changed = Certificate { member: pem(&bytes), ..issued.clone() };
        assert!(matches!(check(&changed, "demo", robot(7), &key(7)), Err(CertificateError::Forged)));
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot-7.crt");
        issued().write(&path).unwrap();
        assert_eq!(Certificate::read(&path).unwrap(), issued());
        assert!(matches!(
            Certificate::read(&folder.path().join("no.crt")),
            Err(CertificateError::File { verb: "read", .. })
        ));
        for bad in ["", issued().member(), &(issued().to_pem() + "x"), &issued().to_pem()[1..]] {
            assert!(matches!(Certificate::parse(bad), Err(CertificateError::Malformed)), "{bad}");
        }
    }

    #[test]
    fn bytes_that_are_no_certificate_are_refused_whatever_they_are() {
        let whole = der(issued().member()).unwrap();
        for cut in 0..whole.len() {
            assert!(signed(&whole[..cut]).is_none(), "{cut}");
        }
        for place in 0..whole.len() {
            for bit in 0..8 {
                let mut changed = whole.clone();
                changed[place] ^= 1 << bit;
                let certificate = Certificate { member: pem(&changed), ..issued() };
                assert!(
                    certificate.check(&roster("demo"), robot(7), &key(7).public_key()).is_err(),
                    "{place}"
                );
            }
        }
    }
}
