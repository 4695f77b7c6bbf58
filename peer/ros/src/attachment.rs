//! What `rmw_zenoh` puts beside each message: its number, when, and who published it.

use thiserror::Error;

use crate::graph::Gid;

/// The numbers beside a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// The publisher's messages are counted from 1.
    pub sequence: i64,
    /// Nanoseconds since 1970 by the publisher's clock.
    pub source_time: i64,
    /// Whose.
    pub publisher: Gid,
}

/// What is no attachment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} bytes are no attachment of rmw_zenoh 0.2.4 or later, which has 33")]
pub struct AttachmentError(pub usize);

/// How long the identifier is; it stands before it.
const GID_LENGTH: u8 = 16;

impl Attachment {
    /// How many bytes it has.
    pub const LENGTH: usize = 8 + 8 + 1 + GID_LENGTH as usize;

    /// As it is sent. Another format ends the ROS processes that read it, so there is exactly this one.
    #[must_use]
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let mut bytes = [0; Self::LENGTH];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_time.to_le_bytes());
        bytes[16] = GID_LENGTH;
        bytes[17..].copy_from_slice(&self.publisher.0);
        bytes
    }

    /// As it is received.
    ///
    /// # Errors
    /// [`AttachmentError`] for anything else.
    pub fn decode(bytes: &[u8]) -> Result<Self, AttachmentError> {
        let error = AttachmentError(bytes.len());
        let bytes: &[u8; Self::LENGTH] = bytes.try_into().map_err(|_| error)?;
        let eight = |from: usize| {
            let mut eight = [0; 8];
            eight.copy_from_slice(&bytes[from..from + 8]);
            i64::from_le_bytes(eight)
        };
        let mut publisher = [0; GID_LENGTH as usize];
        publisher.copy_from_slice(&bytes[17..]);
        match bytes[16] {
            GID_LENGTH => Ok(Self { sequence: eight(0), source_time: eight(8), publisher: Gid(publisher) }),
            _ => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_is_thirty_three_bytes_and_nothing_else_is_one() {
        let attachment = Attachment { sequence: 1, source_time: -2, publisher: Gid([9; 16]) };
        let bytes = attachment.encode();
        assert_eq!(bytes[..17], [1, 0, 0, 0, 0, 0, 0, 0, 254, 255, 255, 255, 255, 255, 255, 255, 16]);
        assert_eq!(Attachment::decode(&bytes), Ok(attachment));
        for cut in 0..bytes.len() {
            assert_eq!(Attachment::decode(&bytes[..cut]), Err(AttachmentError(cut)));
        }
        assert!(Attachment::decode(&[bytes.as_slice(), &[0]].concat()).is_err());
        let mut other = bytes;
        other[16] = 15;
        assert!(Attachment::decode(&other).is_err());
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_the_reader_panic_and_what_is_read_is_what_was_written(bytes: Vec<u8>, length in 30_usize..36) {
            let _ = Attachment::decode(&bytes);
            let padded: Vec<u8> = bytes.iter().copied().chain(std::iter::repeat(16)).take(length).collect();
            if let Ok(attachment) = Attachment::decode(&padded) {
                assert_eq!(attachment.encode().as_slice(), padded);
            }
        }
    }
}
