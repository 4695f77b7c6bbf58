//! What a session shows to be let in.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gestalt_trust::{Identity, Roster, SwarmId};
use zeroize::Zeroizing;

use super::certificate::{Certificate, CertificateError};
use super::name::Bearer;

/// A key of a sealed swarm, and the certificate that lets its holder in.
#[derive(Clone)]
pub struct Credentials {
    /// Who holds it.
    pub(crate) holder: Bearer,
    pub(crate) identity: Arc<Identity>,
    pub(crate) swarm: SwarmId,
    /// The file with the count of the last word that was said with this key.
    pub(crate) words: Option<PathBuf>,
    roster: Arc<Roster>,
    certificate: Certificate,
}

impl Credentials {
    /// That holder's, if the certificate is.
    ///
    /// # Errors
    /// As [`Certificate::check`].
    pub fn new(
        roster: &Roster,
        holder: Bearer,
        identity: Arc<Identity>,
        certificate: Certificate,
    ) -> Result<Self, CertificateError> {
        certificate.check(roster, holder.clone(), &identity.public_key())?;
        let (swarm, roster) = (roster.swarm_id(), Arc::new(roster.clone()));
        Ok(Self { holder, identity, swarm, words: None, roster, certificate })
    }

    /// The same, which counts on from the last word that any program said with this key: that count is kept in that file. Without one a client whose
    /// clock was set back is not heeded until it has caught up.
    #[must_use]
    pub fn counting_in(self, file: PathBuf) -> Self {
        Self { words: Some(file), ..self }
    }

    /// Those of the authority itself, which writes its own certificate: to tell a running swarm of its next roster.
    ///
    /// # Errors
    /// As [`Certificate::issue`].
    pub fn of_authority(authority: Arc<Identity>, roster: &Roster) -> Result<Self, CertificateError> {
        let (swarm, key) = (&roster.members().swarm, authority.public_key());
        let certificate = Certificate::issue(&authority, swarm, Bearer::Authority, &key)?;
        Self::new(roster, Bearer::Authority, authority, certificate)
    }

    /// Who else is a member.
    pub(crate) fn roster(&self) -> &Roster {
        &self.roster
    }

    /// The `transport/link/tls` of Zenoh's configuration. Zenoh never writes out what is handed to it in this form.
    #[must_use]
    pub fn tls(&self) -> serde_json::Value {
        let key = STANDARD.encode(&*private_key(&self.identity));
        let certificate = STANDARD.encode(self.certificate.member());
        serde_json::json!({
            "root_ca_certificate_base64": STANDARD.encode(self.certificate.authority()),
            "enable_mtls": true,
            "listen_private_key_base64": key,
            "listen_certificate_base64": certificate,
            "connect_private_key_base64": key,
            "connect_certificate_base64": certificate,
            // Addresses change; who it is stands in the certificate, and is looked up on the roster.
            "verify_name_on_connect": false,
            "close_link_on_expiration": false,
        })
    }
}

/// An Ed25519 key in PKCS #8 (RFC 8410), as PEM: what every TLS library reads.
pub(crate) fn private_key(identity: &Identity) -> Zeroizing<String> {
    const HEAD: [u8; 16] = [0x30, 0x2e, 2, 1, 0, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 4, 0x22, 4, 0x20];
    let secret = identity.to_bytes();
    let mut der = Zeroizing::new([0; 48]);
    der[..16].copy_from_slice(&HEAD);
    der[16..].copy_from_slice(&*secret);
    let text = Zeroizing::new(STANDARD.encode(*der));
    Zeroizing::new(format!("-----BEGIN PRIVATE KEY-----\n{}\n-----END PRIVATE KEY-----\n", &*text))
}

impl PartialEq for Credentials {
    /// Whether they let the same one into the same swarm.
    fn eq(&self, other: &Self) -> bool {
        self.certificate == other.certificate
    }
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Credentials({}, {:?})", self.holder, self.identity)
    }
}
