//! How much the evidence of robots is worth that repeat each other.

use gestalt_protocol::Pool;

/// β for that many equal voices.
pub(crate) fn sharpness(pool: Pool, voices: f64) -> f64 {
    1.0 / (pool.temperature * (1.0 + (voices - 1.0).max(0.0) * pool.likeness))
}

/// How many equal voices there are in rows of these strengths; 1 where all are silent.
pub(crate) fn voices(strengths: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = strengths.fold((0.0, 0.0), |(sum, squares), s| (sum + s, squares + s * s));
    if squares > 0.0 { sum * sum / squares } else { 1.0 }
}

/// How strong a voice is: the length of the clipped evidence about its mean.
pub(crate) fn strength(row: &[f64]) -> f64 {
    let mean = row.iter().sum::<f64>() / row.len().max(1) as f64;
    row.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>().sqrt()
}
