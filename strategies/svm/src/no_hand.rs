//! How likely it is that nothing was shown: what looks like a hand to the eyes, hardly, and is none.
//!
//! Where a view lies among gestures tells other gestures from known ones. It hardly tells things, which networks that were trained on hands place
//! anywhere among them. But the eyes were shown both, and say how likely they saw a hand (learning from what is none: D. Hendrycks, M. Mazeika,
//! T. Dietterich, "Deep anomaly detection with outlier exposure", ICLR 2019).

/// The odds against a known gesture of no hand at all where the eyes find both as likely. Together with the power below chosen on frames of people who
/// sign words; see `docs/results.md`.
const AS_LIKELY: f64 = 0.5;

/// The least probability of a hand that is taken seriously, so that odds stay bounded.
const LEAST: f64 = 0.05;

/// The odds, against a known gesture, of no hand at all, where eyes find a hand so likely, `0.0..=1.0`: 0 for a certain one.
///
/// The square of the eyes' own odds, (1 − q)² / q². Their q is a product of what three networks say, none of which is ever certain, so it moves less than
/// it should.
pub(crate) fn odds_of_no_hand(hand: f32) -> f64 {
    // What is not a number says nothing of a hand.
    let hand = if hand.is_nan() { LEAST } else { f64::from(hand).clamp(LEAST, 1.0) };
    AS_LIKELY * ((1.0 - hand) / hand).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_less_it_looks_like_a_hand_the_likelier_it_is_none_within_bounds() {
        assert_eq!(odds_of_no_hand(1.0), 0.0);
        assert_eq!(odds_of_no_hand(0.5), AS_LIKELY);
        let odds: Vec<f64> = (0..=100).map(|percent| odds_of_no_hand(percent as f32 / 100.0)).collect();
        assert!(odds.is_sorted_by(|a, b| a >= b), "{odds:?}");
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 7.0] {
            assert!((0.0..=200.0).contains(&odds_of_no_hand(odd)), "{odd}");
        }
    }
}
