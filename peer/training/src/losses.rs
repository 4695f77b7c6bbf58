//! What is lost where a network errs, and how that changes with what it says.

/// The loss, and its slope by what was said.
#[derive(Clone, Copy, Debug)]
pub struct Loss {
    pub value: f32,
    pub slope: f32,
}

pub fn sigmoid(v: f32) -> f32 {
    1.0 / (1.0 + (-v).exp())
}

/// ln of the sigmoid, without overflow.
fn log_sigmoid(v: f32) -> f32 {
    v.min(0.0) - (-v.abs()).exp().ln_1p()
}

/// How unlikely the truth (`0.0..=1.0`) was said to be, in nats, by a logit.
pub fn likelihood(truth: f32, said: f32) -> Loss {
    let value = -truth * log_sigmoid(said) - (1.0 - truth) * log_sigmoid(-said);
    Loss { value, slope: sigmoid(said) - truth }
}

/// The same where nearly all is none: what is said rightly already counts little (T.-Y. Lin et al., "Focal loss for dense object
/// detection", 2017), and the less the nearer it is to a centre, which is 1 (H. Law, J. Deng, "CornerNet", 2018).
pub fn focal(truth: f32, said: f32) -> Loss {
    let s = sigmoid(said);
    if truth > 0.99 {
        let (log, rest) = (log_sigmoid(said), (1.0 - s).powi(2));
        Loss { value: -rest * log, slope: -rest * (1.0 - s - 2.0 * s * log) }
    } else {
        let (log, far) = (log_sigmoid(-said), (1.0 - truth).powi(4));
        Loss { value: -far * s * s * log, slope: -far * s * s * (2.0 * (1.0 - s) * log - s) }
    }
}

pub fn absolute(truth: f32, said: f32) -> Loss {
    let away = said - truth;
    Loss { value: away.abs(), slope: away.signum() }
}

pub fn squared(truth: f32, said: f32) -> Loss {
    let away = said - truth;
    Loss { value: away * away, slope: 2.0 * away }
}

/// Squared near the truth, absolute from .05 on.
pub fn bent(truth: f32, said: f32) -> Loss {
    let away = said - truth;
    if away.abs() < 0.05 {
        Loss { value: 10.0 * away * away, slope: 20.0 * away }
    } else {
        Loss { value: away.abs() - 0.025, slope: away.signum() }
    }
}

/// Cross entropy of a distribution, of logits; and its slopes.
pub fn softmax<const N: usize>(truth: &[f32; N], logits: &[f32; N]) -> (f32, [f32; N]) {
    let largest = logits.iter().copied().fold(f32::MIN, f32::max);
    let all = logits.map(|logit| (logit - largest).exp());
    let sum: f32 = all.iter().sum();
    let log = largest + sum.ln();
    let value = truth.iter().zip(logits).map(|(t, logit)| t * (log - logit)).sum();
    (value, std::array::from_fn(|c| all[c] / sum - truth[c]))
}

/// One less the overlap of a mask with the true one (twice what both cover, of the sum of both); adds `share` times its slopes to
/// `back`.
pub fn overlap(
    truth: impl Iterator<Item = f32> + Clone,
    logits: &[f32],
    back: &mut [f32],
    share: f32,
) -> f32 {
    let said: Vec<f32> = logits.iter().copied().map(sigmoid).collect();
    let both = 2.0 * truth.clone().zip(&said).map(|(t, p)| t * p).sum::<f32>() + 1.0;
    let either = truth.clone().sum::<f32>() + said.iter().sum::<f32>() + 1.0;
    for ((back, t), p) in back.iter_mut().zip(truth).zip(&said) {
        *back += share * (both / either - 2.0 * t) / either * p * (1.0 - p);
    }
    (1.0 - both / either) * share
}
