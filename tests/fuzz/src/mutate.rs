//! Changes of inputs, as chance wants them.

use gestalt_protocol::PROTOCOL_VERSION;
use rand::{Rng, RngExt};

/// The longest input.
pub const MAX_INPUT: usize = 4096;

/// Bytes and words at which readers decide.
const WORDS: &[&[u8]] = &[
    &[PROTOCOL_VERSION],
    &[0],
    &[1],
    &[0x7f],
    &[0x80, 0x01],
    &[0xff, 0x01],
    // The greatest of 32 and of 64 bits as varints, one too large, and one written longer than it need be.
    &[0xff, 0xff, 0xff, 0xff, 0x0f],
    &[0xff, 0xff, 0xff, 0xff, 0x1f],
    &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01],
    &[0x81, 0x00],
    // Single precision: infinite, not a number, minus zero, the least.
    &[0, 0, 0x80, 0x7f],
    &[0, 0, 0xc0, 0x7f],
    &[0, 0, 0, 0x80],
    &[1, 0, 0, 0],
    b"0",
    b"-1",
    b"-0.0",
    b"255",
    b"256",
    b"4294967295",
    b"4294967296",
    b"18446744073709551615",
    b"18446744073709551616",
    b"1e39",
    b"1e400",
    b"1e-320",
    b"0.1",
    b"null",
    b"true",
    b"\"\"",
    b"[]",
    b"{}",
    b"[[[[[[[[[[[[[[[[",
    b"\"say\":",
    b"\"open\"",
    b"\"round\":",
    b"\"class\":",
    b"\"votes\":",
    b"\"other\"",
    b"\\u0000",
    b"\\ud800",
    "é".as_bytes(),
    b"\xff",
    b"gestalt/demo/",
    b"robot/",
    b"1/",
    b"/vote",
    b"/feedback",
    b"decision",
    b"instructor/",
    b"*",
    b"**",
    b"$*",
    b"//",
    b"@",
    b"+",
];

/// Changes an input in one to eight ways. `other` is another input, of which parts may come in.
pub fn mutate(bytes: &mut Vec<u8>, other: &[u8], rng: &mut impl Rng) {
    for _ in 0..1 << rng.random_range(0..4) {
        once(bytes, other, rng);
    }
    bytes.truncate(MAX_INPUT);
}

fn once(bytes: &mut Vec<u8>, other: &[u8], rng: &mut impl Rng) {
    let at = rng.random_range(0..=bytes.len());
    let end = rng.random_range(at..=bytes.len().min(at + 64));
    match rng.random_range(0..10) {
        0 => flip(bytes, 1 << rng.random_range(0..8), at),
        1 => flip(bytes, rng.random::<u8>(), at),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..end)),
        4 => {
            let again = bytes[at..end].to_vec();
            drop(bytes.splice(at..at, again));
        }
        5 | 6 => {
            let word = WORDS[rng.random_range(0..WORDS.len())];
            // In place of as much, or in between.
            let until = if rng.random() { (at + word.len()).min(bytes.len()) } else { at };
            drop(bytes.splice(at..until, word.iter().copied()));
        }
        7 => {
            let from = rng.random_range(0..=other.len());
            let until = rng.random_range(from..=other.len());
            let end = if rng.random() { end } else { at };
            drop(bytes.splice(at..end, other[from..until].iter().copied()));
        }
        8 => {
            // A number in text, or a byte as a number.
            if let Some(byte) = bytes.get_mut(at) {
                *byte = byte.wrapping_add(if rng.random() { 1 } else { u8::MAX });
            }
        }
        _ => {
            let random: [u8; 4] = rng.random();
            drop(bytes.splice(at..at, random[..rng.random_range(1..=4)].iter().copied()));
        }
    }
}

fn flip(bytes: &mut [u8], bits: u8, at: usize) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte ^= bits;
    }
}
