//! What one robot has seen in one round, summed.

use std::time::Duration;

/// The least probability taken seriously: below it, a classifier speaks of its own limits, not of the gesture.
const FLOOR: f64 = 1e-6;

/// Log-evidence for each class: ℓ(k) = Σ w (log p(k) − mean log p), over the frames so far.
///
/// A frame weighs w = quality · min(1, Δt / τ), Δt since the frame before: frames that repeat each other count as
/// one look, so that a camera of 30 frames per second does not outvote one of 2 by showing the same picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    sums: Vec<f64>,
    looks: f64,
    latest: Option<Duration>,
}

impl Evidence {
    /// No evidence yet over that many classes.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self { sums: vec![0.0; classes], looks: 0.0, latest: None }
    }

    /// Counts a frame seen at `now` with these class probabilities; `decorrelation` is τ, above zero. Says whether
    /// the frame weighed anything.
    pub fn add(
        &mut self,
        now: Duration,
        probabilities: &[f64],
        quality: f64,
        decorrelation: Duration,
    ) -> bool {
        let fresh = self
            .latest
            .map_or(1.0, |before| now.saturating_sub(before).as_secs_f64() / decorrelation.as_secs_f64());
        let weight = quality * fresh.min(1.0);
        if !(weight > 0.0 && weight.is_finite()) {
            return false;
        }
        let logs: Vec<f64> = probabilities.iter().map(|p| p.max(FLOOR).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        for (sum, log) in self.sums.iter_mut().zip(logs) {
            *sum += weight * (log - mean);
        }
        self.looks += weight;
        self.latest = Some(now);
        true
    }

    /// How many classes it is about.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.sums.len()
    }

    /// Σ w: the number of independent looks.
    #[must_use]
    pub fn looks(&self) -> f64 {
        self.looks
    }

    /// The sums as a vote carries them, clipped to ±`clip`; empty when nothing was seen.
    #[must_use]
    pub fn clipped(&self, clip: f64) -> Vec<f32> {
        if self.latest.is_none() {
            return Vec::new();
        }
        self.sums.iter().map(|sum| sum.min(clip).max(-clip) as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAU: Duration = Duration::from_millis(500);

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn evidence_is_the_centred_log_probability() {
        let mut evidence = Evidence::new(3);
        evidence.add(at(0), &[0.5, 0.25, 0.25], 1.0, TAU);
        let third = 2f32.ln() / 3.0;
        for (found, expected) in evidence.clipped(6.0).iter().zip([2.0 * third, -third, -third]) {
            assert!((found - expected).abs() < 1e-6);
        }
        assert_eq!(evidence.looks(), 1.0);
    }

    #[test]
    fn thirty_frames_a_second_weigh_what_two_do() {
        let look = |period_ms: u64| {
            let mut evidence = Evidence::new(2);
            for t in (0..=3000).step_by(period_ms as usize) {
                evidence.add(at(t), &[0.6, 0.4], 1.0, TAU);
            }
            evidence
        };
        let (slow, fast) = (look(500), look(30));
        assert!((slow.looks() - fast.looks()).abs() < 1e-9, "{} {}", slow.looks(), fast.looks());
        assert!((slow.clipped(60.0)[0] - fast.clipped(60.0)[0]).abs() < 1e-5);
    }

    #[test]
    fn a_pause_makes_no_frame_weigh_more_than_one_look() {
        let mut evidence = Evidence::new(2);
        evidence.add(at(0), &[0.6, 0.4], 1.0, TAU);
        evidence.add(at(60_000), &[0.6, 0.4], 1.0, TAU);
        assert_eq!(evidence.looks(), 2.0);
    }

    #[test]
    fn quality_scales_a_frame_and_none_discards_it() {
        let mut evidence = Evidence::new(2);
        assert!(!evidence.add(at(0), &[0.9, 0.1], 0.0, TAU));
        assert!(evidence.clipped(6.0).is_empty(), "nothing seen, nothing said");
        assert!(evidence.add(at(10), &[0.9, 0.1], 0.25, TAU));
        assert_eq!(evidence.looks(), 0.25);
        assert!(!evidence.add(at(600), &[0.9, 0.1], f64::NAN, TAU));
    }

    #[test]
    fn a_probability_of_zero_is_floored_and_the_sum_clipped() {
        let mut evidence = Evidence::new(2);
        evidence.add(at(0), &[1.0, 0.0], 1.0, TAU);
        let half = (FLOOR.ln() / -2.0) as f32;
        assert_eq!(evidence.clipped(100.0), [half, -half]);
        assert_eq!(evidence.clipped(6.0), [6.0, -6.0]);
    }
}
