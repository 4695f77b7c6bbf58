//! Project Wycheproof's vectors for Ed25519, under the one rule by which robots check signatures.
//!
//! All 151 come out as the project says. The strict rule differs from the standard's only where the author itself chose a key or a
//! point of small order; those vectors (flag `InvalidSignature`) the project calls invalid too.

use std::collections::BTreeMap;

use gestalt_protocol::Signature;
use gestalt_protocol::hex;
use gestalt_trust::{Ed25519, PublicKey, Scheme};

const VECTORS: &str = include_str!("wycheproof_ed25519.txt");

fn bytes(text: &str) -> Vec<u8> {
    let text = if text == "-" { "" } else { text };
    let pairs = text.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    pairs.map(|pair| hex::parse::<1>(pair).unwrap()[0]).collect()
}

#[test]
fn every_vector_comes_out_as_published() {
    let mut key = None;
    let mut results: BTreeMap<&str, usize> = BTreeMap::new();
    for line in VECTORS.lines().filter(|line| !line.starts_with('#')) {
        if let Some(text) = line.strip_prefix("key ") {
            key = Ed25519::key(&text.parse::<PublicKey>().unwrap());
            assert!(key.is_some(), "{text}");
            continue;
        }
        let fields: Vec<&str> = line.split(' ').collect();
        let [number, result, flags, message, signature] = fields[..] else { panic!("{line}") };
        // What has not 64 bytes is no signature here, so it cannot be accepted.
        let signature: Option<[u8; 64]> = bytes(signature).try_into().ok();
        let accepted = signature.is_some_and(|signature| {
            Ed25519::verify(key.as_ref().unwrap(), &bytes(message), &Signature::from_bytes(signature))
        });
        assert_eq!(accepted, result == "valid", "vector {number}, {flags}");
        *results.entry(result).or_default() += 1;
    }
    assert_eq!(results, BTreeMap::from([("invalid", 63), ("valid", 88)]));
}
