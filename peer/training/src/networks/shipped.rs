//! Weights as they are shipped.

/// The weights of a network, in the order in which its layers stand, normalisation folded in.
pub type Weights = Vec<Vec<f32>>;

/// The bytes of a weights file: see `gestalt_vision::network`.
pub fn encode(weights: &Weights) -> Vec<u8> {
    let mut bytes = b"GESTNET1".to_vec();
    bytes.extend((weights.len() as u32).to_le_bytes());
    for tensor in weights {
        bytes.extend((tensor.len() as u32).to_le_bytes());
    }
    for value in weights.iter().flatten() {
        bytes.extend(half(*value).to_le_bytes());
    }
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// The nearest 16-bit float (IEEE 754 binary16).
fn half(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let magnitude = value.abs();
    if magnitude >= 65504.0 {
        return sign | 0x7BFF;
    }
    if magnitude < 2.0_f32.powi(-14) {
        return sign | (magnitude * 2.0_f32.powi(24)).round_ties_even() as u16;
    }
    // Rounding may carry into the exponent, as it should.
    let bits = bits & 0x7FFF_FFFF;
    let rounded = bits + 0xFFF + (bits >> 13 & 1);
    sign | ((rounded >> 13) - (112 << 10)) as u16
}
