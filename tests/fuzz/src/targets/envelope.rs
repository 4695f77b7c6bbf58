//! Messages between robots.

use gestalt_protocol::{Envelope, MAX_MESSAGE, PROTOCOL_VERSION};
use gestalt_trust::{Evidence, statement};

use crate::memory::bounded;

/// What is read is written so that it reads the same, in no more bytes; a statement has one spelling.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    let heading = statement::heading(bytes);
    match bounded(bytes, || Envelope::decode(bytes)) {
        Ok(envelope) => {
            assert_eq!(bytes[0], PROTOCOL_VERSION);
            let written = envelope.encode();
            assert!(written.len() <= bytes.len() && bytes.len() <= MAX_MESSAGE);
            let again = Envelope::decode(&written);
            assert_eq!(again.as_ref(), Ok(&envelope));
            assert_eq!(again.map(|envelope| envelope.encode()).as_ref(), Ok(&written), "bit for bit");
            let heading_of_it = statement::heading(&written).map(|heading| (heading.author, heading.stamp));
            assert_eq!(heading_of_it, Ok((envelope.author, envelope.stamp)));
            assert_eq!(statement::read(bytes).is_ok(), written == bytes, "one spelling");
            if written == bytes {
                assert!(heading.is_ok());
            }
        }
        Err(_) => assert!(statement::read(bytes).is_err()),
    }
    if let Ok(evidence) = bounded(bytes, || Evidence::decode(bytes)) {
        assert_eq!(Evidence::decode(&evidence.encode()), Ok(evidence));
    }
}
