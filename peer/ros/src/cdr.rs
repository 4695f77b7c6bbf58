//! Plain CDR (XCDR version 1), in which ROS 2 writes its messages.
//!
//! Four bytes say the byte order (`00 01 00 00`: little endian), then come the fields, each at a multiple of its own size
//! counted from after these four (OMG DDS-XTypes 1.3, section 7.4). A text is its length with the zero byte that ends it, the
//! bytes, and that zero.

use thiserror::Error;

const HEADER: usize = 4;

/// What is no message of the type it is read as.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CdrError {
    /// It ends too early, or states a length beyond its end.
    #[error("the message ends after {at} bytes, {missing} too early")]
    Short {
        /// Where.
        at: usize,
        /// How many bytes are missing.
        missing: usize,
    },
    /// Not plain CDR.
    #[error("the first bytes {0:02x?} do not say plain CDR (00 00 or 00 01)")]
    Encapsulation([u8; 2]),
    /// A text that is not UTF-8, or does not end with a zero.
    #[error("the text at byte {0} is no UTF-8 with a zero at its end")]
    Text(usize),
    /// A field that holds what it may not.
    #[error("{0}")]
    Field(String),
}

/// Writes fields, little endian.
#[derive(Clone, Debug)]
pub struct Writer(Vec<u8>);

impl Default for Writer {
    fn default() -> Self {
        Self(vec![0, 1, 0, 0])
    }
}

impl Writer {
    fn align(&mut self, to: usize) {
        let length = (self.0.len() - HEADER).next_multiple_of(to);
        self.0.resize(HEADER + length, 0);
    }

    /// One byte.
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    /// Four bytes.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    /// Four bytes with a sign.
    pub fn i32(&mut self, value: i32) {
        self.u32(value.cast_unsigned());
    }

    /// How many things follow. What is longer than a length can say is cut by whoever writes them, see [`length`].
    pub fn length(&mut self, length: usize) {
        self.u32(self::length(length));
    }

    /// A text. A zero byte in it would end it early at the reader's: there it ends here too.
    pub fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        let text = &text.as_bytes()[..text.len().min(u32::MAX as usize - 1)];
        self.length(text.len() + 1);
        self.0.extend(text);
        self.0.push(0);
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        let length = self::length(bytes.len());
        self.u32(length);
        self.0.extend(&bytes[..length as usize]);
    }

    /// The message.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// A length as it is written.
#[must_use]
pub fn length(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

/// Reads fields, in either byte order. It takes nothing but views of the message, so nothing grows by what a message states.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    fields: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Reader<'a> {
    /// Of a message.
    ///
    /// # Errors
    /// [`CdrError::Encapsulation`] when it is not plain CDR.
    pub fn new(message: &'a [u8]) -> Result<Self, CdrError> {
        let Some((header, fields)) = message.split_at_checked(HEADER) else {
            return Err(CdrError::Short { at: message.len(), missing: HEADER - message.len() });
        };
        match [header[0], header[1]] {
            [0, order @ (0 | 1)] => Ok(Self { fields, at: 0, big_endian: order == 0 }),
            other => Err(CdrError::Encapsulation(other)),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], CdrError> {
        let rest = self.fields.get(self.at..).unwrap_or_default();
        let Some(taken) = rest.get(..count) else {
            return Err(CdrError::Short { at: HEADER + self.fields.len(), missing: count - rest.len() });
        };
        self.at += count;
        Ok(taken)
    }

    /// One byte.
    ///
    /// # Errors
    /// [`CdrError::Short`], as for all fields.
    pub fn u8(&mut self) -> Result<u8, CdrError> {
        Ok(self.take(1)?[0])
    }

    /// Four bytes.
    ///
    /// # Errors
    /// [`CdrError::Short`]
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        self.at = self.at.next_multiple_of(4);
        let mut four = [0; 4];
        four.copy_from_slice(self.take(4)?);
        Ok(if self.big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// Four bytes with a sign.
    ///
    /// # Errors
    /// [`CdrError::Short`]
    pub fn i32(&mut self) -> Result<i32, CdrError> {
        self.u32().map(u32::cast_signed)
    }

    /// A sequence of bytes.
    ///
    /// # Errors
    /// [`CdrError::Short`]
    pub fn bytes(&mut self) -> Result<&'a [u8], CdrError> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    /// A text. Some writers give an empty one no zero byte.
    ///
    /// # Errors
    /// [`CdrError::Short`], [`CdrError::Text`]
    pub fn text(&mut self) -> Result<&'a str, CdrError> {
        let bytes = self.bytes()?;
        let at = HEADER + self.at;
        match bytes {
            [] => Ok(""),
            [text @ .., 0] => str::from_utf8(text).map_err(|_| CdrError::Text(at)),
            _ => Err(CdrError::Text(at)),
        }
    }

    /// How many bytes are left: no more things than that can follow.
    #[must_use]
    pub fn left(&self) -> usize {
        self.fields.len().saturating_sub(self.at)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_is_written_is_read_again_whatever_stands_before_it(
            before in 0_usize..9,
            number: u32,
            text in "[^\0]{0,40}",
            bytes: Vec<u8>,
        ) {
            let mut writer = Writer::default();
            (0..before).for_each(|_| writer.u8(7));
            writer.u32(number);
            writer.text(&text);
            writer.bytes(&bytes);
            let message = writer.finish();
            let mut reader = Reader::new(&message).unwrap();
            (0..before).for_each(|_| assert_eq!(reader.u8(), Ok(7)));
            prop_assert_eq!(reader.u32().unwrap(), number);
            prop_assert_eq!(reader.text().unwrap(), text);
            prop_assert_eq!(reader.bytes().unwrap(), bytes);
            prop_assert_eq!(reader.left(), 0);
        }

        #[test]
        fn no_bytes_make_a_reader_panic(message: Vec<u8>, order in 0_u8..3) {
            let message = [&[0, order, 0, 0], &message[..]].concat();
            if let Ok(mut reader) = Reader::new(&message) {
                while reader.text().is_ok() && reader.bytes().is_ok() && reader.left() > 0 {}
            }
        }
    }

    #[test]
    fn a_message_of_the_other_byte_order_is_read() {
        let message = [0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 2, b'a', 0];
        let mut reader = Reader::new(&message).unwrap();
        assert_eq!(reader.u8(), Ok(7));
        assert_eq!(reader.text(), Ok("a"));
        assert_eq!(Reader::new(&[0, 7, 0, 0]).unwrap_err(), CdrError::Encapsulation([0, 7]));
    }
}
