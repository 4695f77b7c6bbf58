//! Probabilities from logits.

/// Of one thing by itself.
pub fn alone(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// Of things of which one is the case.
pub fn among<const N: usize>(logits: [f32; N]) -> [f32; N] {
    let most = logits.into_iter().fold(f32::NEG_INFINITY, f32::max);
    let weights = logits.map(|logit| (logit - most).exp());
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}
