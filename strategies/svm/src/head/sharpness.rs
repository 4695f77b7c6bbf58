//! How much the logarithms of a discriminant are worth.

/// What is believed before anything was left out, and how firmly: a normal prior of the logarithm. Who is shown next, and by which camera, differs more
/// from all that was shown than one showing from the others.
const PRIOR: f64 = 0.4;
const SPREAD: f64 = 0.3;

/// The factors that are tried, each 1.25 times the one before.
const TRIED: i32 = 9;

/// The factor on logarithms with which probabilities of what was left out, given as class, weight and logarithms by class, have little loss.
pub(crate) fn sharpness<'a>(left_out: impl Iterator<Item = (usize, f64, &'a [f64])>) -> f64 {
    let factors: Vec<f64> = (0..TRIED).map(|step| PRIOR * 1.25_f64.powi(step - TRIED / 2)).collect();
    let prior = |factor: &f64| ((factor / PRIOR).ln() / SPREAD).powi(2) / 2.0;
    let mut losses: Vec<f64> = factors.iter().map(prior).collect();
    for (class, weight, logs) in left_out {
        let greatest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (loss, factor) in losses.iter_mut().zip(&factors) {
            let sum: f64 = logs.iter().map(|log| (factor * (log - greatest)).exp()).sum();
            *loss += weight * (sum.ln() - factor * (logs[class] - greatest));
        }
    }
    // The mean of what is likely, not the likeliest: so one showing more or less moves it a little.
    let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = losses.iter().map(|loss| (least - loss).exp()).collect();
    let mean: f64 = weights.iter().zip(&factors).map(|(weight, factor)| weight * factor.ln()).sum();
    (mean / weights.iter().sum::<f64>()).exp()
}
