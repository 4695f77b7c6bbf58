//! What one robot has seen in one round, summed.

use std::time::Duration;

/// The least probability taken seriously: below it, a classifier speaks of its own limits, not of the gesture.
const FLOOR: f64 = 1e-6;

/// The most looks that later ones are compared with.
const MAX_VIEWS: usize = 32;

/// The part of τ by which a camera's frame may come early and still begin the next look.
const JITTER: f64 = 0.1;

/// A frame, as evidence takes it.
#[derive(Clone, Copy, Debug)]
pub struct JudgedFrame<'a> {
    /// When it was taken.
    pub at: Duration,
    /// The probability of each class.
    pub probabilities: &'a [f64],
    /// That of a further one, see [`Classify::unknown`](crate::Classify::unknown).
    pub unknown: Option<f64>,
    /// How far it is to be trusted, `0.0..=1.0`.
    pub quality: f64,
    /// Where it lies among all views, see [`Classify::view`](crate::Classify::view); empty when that is not known.
    pub view: &'a [f32],
}

/// Log-evidence for each class, ℓ(k) = Σ w (log p(k) − mean log p), over the looks so far.
///
/// Frames are no independent witnesses: thirty in a second show the same picture. So the frames within τ make **one look**,
/// of their mean log-probabilities; and a look weighs w = quality · (1 − s), s = max exp(−‖v − v′‖²) over the looks
/// before, v being the mean view: **what looks the same counts once**, however long it is looked at. A camera of 30
/// frames per second with one bad view does not outvote ten of 2 with good ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// Of the looks that are over: for each class, for "unknown", and the odds of that.
    sums: Vec<f64>,
    /// Whether every frame told what is unknown.
    tells: bool,
    weight: f64,
    views: Vec<Vec<f64>>,
    current: Option<Current>,
}

/// The look that frames are still added to. All sums are weighted by quality.
#[derive(Clone, Debug, PartialEq)]
struct Current {
    began: Duration,
    frames: f64,
    quality: f64,
    logs: Vec<f64>,
    view: Vec<f64>,
    /// 1 − s.
    novelty: f64,
}

impl Current {
    /// w: what it weighs so far.
    fn weight(&self) -> f64 {
        self.novelty * self.quality / self.frames
    }

    /// What it adds to the evidence for a class.
    fn part(&self, class: usize) -> f64 {
        self.weight() * self.logs[class] / self.quality
    }
}

impl Evidence {
    /// No evidence yet over that many classes.
    #[must_use]
    pub fn new(classes: usize) -> Self {
        Self { sums: vec![0.0; classes + 2], tells: true, weight: 0.0, views: Vec::new(), current: None }
    }

    /// Counts a frame over as many classes; `decorrelation` is τ, above zero. Says whether it weighed anything.
    pub fn add(&mut self, frame: JudgedFrame<'_>, decorrelation: Duration) -> bool {
        if !(frame.quality > 0.0 && frame.quality.is_finite()) {
            return false;
        }
        let next = self.current.as_ref().and_then(|current| {
            let due = current.began + decorrelation;
            (frame.at >= due.saturating_sub(decorrelation.mul_f64(JITTER))).then_some(due)
        });
        if let Some(due) = next {
            self.end_look();
            // On the grid of τ, unless there was a pause: so that no rate of frames gains or loses by rounding.
            let began = if frame.at < due + decorrelation { due } else { frame.at };
            self.begin_look(began, frame);
        } else if self.current.is_none() {
            self.begin_look(frame.at, frame);
        }
        let Some(current) = &mut self.current else { return false };
        current.frames += 1.0;
        current.quality += frame.quality;
        self.tells &= frame.unknown.is_some();
        let logs: Vec<f64> = frame.probabilities.iter().map(|p| p.max(FLOOR).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let (unknown, odds) = unknown_and_odds(&frame);
        let unknown = unknown - mean;
        for (sum, log) in
            current.logs.iter_mut().zip(logs.into_iter().map(|log| log - mean).chain([unknown, odds]))
        {
            *sum += frame.quality * log;
        }
        for (sum, x) in current.view.iter_mut().zip(frame.view) {
            *sum += frame.quality * f64::from(*x);
        }
        let view: Vec<f64> = current.view.iter().map(|sum| sum / current.quality).collect();
        let alike = |other: &Vec<f64>| {
            let distance: f64 = view.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum();
            if view.is_empty() || other.len() != view.len() { 0.0 } else { (-distance).exp() }
        };
        current.novelty = 1.0 - self.views.iter().map(alike).fold(0.0, f64::max);
        current.novelty > 0.0
    }

    fn begin_look(&mut self, began: Duration, frame: JudgedFrame<'_>) {
        self.current = Some(Current {
            began,
            frames: 0.0,
            quality: 0.0,
            logs: vec![0.0; self.sums.len()],
            view: vec![0.0; frame.view.len()],
            novelty: 1.0,
        });
    }

    fn end_look(&mut self) {
        let Some(current) = self.current.take() else { return };
        for (class, sum) in self.sums.iter_mut().enumerate() {
            *sum += current.part(class);
        }
        self.weight += current.weight();
        if self.views.len() == MAX_VIEWS {
            self.views.remove(0);
        }
        self.views.push(current.view.iter().map(|sum| sum / current.quality).collect());
    }

    /// How many classes it is about.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.sums.len() - 2
    }

    /// Σ w: the number of independent looks.
    #[must_use]
    pub fn looks(&self) -> f64 {
        self.weight + self.current.as_ref().map_or(0.0, Current::weight)
    }

    /// Whether a gesture is one that was taught does not become another question by looking longer, as which one it is does with another view of it: of
    /// the odds of "unknown", and of what was never taught, the mean of all looks counts, as of one.
    fn count_odds_once(&self, totals: &mut [f64]) {
        let (classes, looks) = (self.classes(), self.looks());
        let [unknown, odds] = [totals[classes], totals[classes + 1]];
        let taught = || totals[..classes].iter().filter(|total| **total != unknown);
        let greatest = taught().copied().fold(f64::NEG_INFINITY, f64::max);
        if !self.tells || looks <= 1.0 || !greatest.is_finite() {
            return;
        }
        let together = greatest + taught().map(|total| (total - greatest).exp()).sum::<f64>().ln();
        for total in totals[..=classes].iter_mut().filter(|total| **total == unknown) {
            *total = together + odds / looks;
        }
    }

    /// The sums as a vote carries them, within ±`clip`; empty when nothing was seen.
    ///
    /// Where the greatest is beyond the clip, all are lowered by what it has too much: a robot that has looked for long is as sure as may be
    /// of the likeliest class, and not of two.
    #[must_use]
    pub fn clipped(&self, clip: f64) -> Vec<f32> {
        self.clipped_with_unknown(clip).0
    }

    /// The same, and beside it that for a gesture that nobody taught, where every frame told.
    #[must_use]
    pub fn clipped_with_unknown(&self, clip: f64) -> (Vec<f32>, Option<f32>) {
        let Some(current) = &self.current else { return (Vec::new(), None) };
        let mut totals: Vec<f64> =
            self.sums.iter().enumerate().map(|(class, sum)| sum + current.part(class)).collect();
        self.count_odds_once(&mut totals);
        let counted = &totals[..self.classes() + usize::from(self.tells)];
        let excess = counted.iter().map(|total| total - clip).fold(0.0, f64::max);
        let mut clipped: Vec<f32> =
            counted.iter().map(|total| (total - excess).min(clip).max(-clip) as f32).collect();
        let unknown = if self.tells { clipped.pop() } else { None };
        (clipped, unknown)
    }
}

/// The logarithms of the probability of "unknown", and of its odds against all classes that are not as likely, which were taught.
fn unknown_and_odds(frame: &JudgedFrame<'_>) -> (f64, f64) {
    let Some(unknown) = frame.unknown else { return (0.0, 0.0) };
    let taught: f64 = frame.probabilities.iter().filter(|p| **p != unknown).sum();
    let unknown = unknown.max(FLOOR).ln();
    (unknown, if taught > 0.0 { unknown - taught.max(FLOOR).ln() } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAU: Duration = Duration::from_millis(500);

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn look(ms: u64, probabilities: &[f64], quality: f64) -> JudgedFrame<'_> {
        JudgedFrame { at: at(ms), probabilities, unknown: None, quality, view: &[] }
    }

    #[test]
    fn evidence_is_the_centred_log_probability() {
        let mut evidence = Evidence::new(3);
        evidence.add(look(0, &[0.5, 0.25, 0.25], 1.0), TAU);
        let third = 2f32.ln() / 3.0;
        for (found, expected) in evidence.clipped(6.0).iter().zip([2.0 * third, -third, -third]) {
            assert!((found - expected).abs() < 1e-6);
        }
        assert_eq!(evidence.looks(), 1.0);
    }

    /// Evidence of three seconds, a frame every so many milliseconds; `view` is what is seen at a time.
    fn watched(period_ms: u64, view: impl Fn(u64) -> Vec<f32>) -> Evidence {
        let mut evidence = Evidence::new(2);
        for t in (0..=3000).step_by(period_ms as usize) {
            evidence.add(JudgedFrame { view: &view(t), ..look(t, &[0.6, 0.4], 1.0) }, TAU);
        }
        evidence
    }

    #[test]
    fn thirty_frames_a_second_weigh_what_two_do() {
        for period in [30, 33, 40, 66, 100, 495] {
            let (slow, fast) = (watched(500, |_| Vec::new()), watched(period, |_| Vec::new()));
            assert_eq!(slow.looks(), 7.0);
            assert!((fast.looks() - 7.0).abs() < 1e-9, "{period} ms: {}", fast.looks());
            assert!((slow.clipped(60.0)[0] - fast.clipped(60.0)[0]).abs() < 1e-5);
        }
    }

    #[test]
    fn what_looks_the_same_counts_once_at_any_rate_and_what_changes_counts_anew() {
        for period in [33, 500] {
            let same = watched(period, |_| vec![0.3, 0.2]);
            assert!((same.looks() - 1.0).abs() < 1e-9, "{period} ms: {}", same.looks());
            // Every half second, somewhere else.
            let other = watched(period, |t| vec![(t / 500) as f32 * 4.0, 0.0]);
            assert!((6.0..=7.0).contains(&other.looks()), "{period} ms: {}", other.looks());
            let slowly = watched(period, |t| vec![t as f32 / 1000.0, 0.0]);
            assert!((1.5..5.0).contains(&slowly.looks()), "{period} ms: {}", slowly.looks());
        }
    }

    #[test]
    fn a_view_seen_before_is_known_again() {
        let mut evidence = Evidence::new(2);
        for (t, x) in [(0, 0.0), (500, 5.0), (1000, 0.0)] {
            evidence.add(JudgedFrame { view: &[x], ..look(t, &[0.6, 0.4], 1.0) }, TAU);
        }
        assert!((evidence.looks() - 2.0).abs() < 1e-6, "{}", evidence.looks());
    }

    #[test]
    fn a_fast_robot_with_one_bad_view_does_not_outvote_ten_slow_ones_with_good_views() {
        let good = [0.5, 0.25, 0.25];
        let bad = [0.04, 0.92, 0.04];
        let watch = |period: u64, p: &[f64], bearing: f32| {
            let mut evidence = Evidence::new(3);
            for t in (0..3000).step_by(period as usize) {
                // Ten that sway a little, one that stands like a rock.
                let view = [bearing + if period == 500 { (t / 500) as f32 * 0.5 } else { 0.0 }];
                evidence.add(JudgedFrame { view: &view, ..look(t, p, 1.0) }, TAU);
            }
            // No bound on what one robot may say.
            evidence.clipped(1e9)
        };
        let votes: Vec<Vec<f32>> =
            (0..10).map(|n| watch(500, &good, n as f32)).chain([watch(33, &bad, 99.0)]).collect();
        let total = |class: usize| votes.iter().map(|vote| vote[class]).sum::<f32>();
        assert!(total(0) > total(1) + 3.0, "{} {}", total(0), total(1));
        // Counted by the frame, the one would have won.
        let by_the_frame = |p: &[f64; 3], frames: f64| frames * (p[0] / p[1]).ln();
        assert!(10.0 * by_the_frame(&good, 6.0) + by_the_frame(&bad, 91.0) < -100.0);
    }

    #[test]
    fn the_frames_of_one_look_are_averaged() {
        let mut evidence = Evidence::new(2);
        evidence.add(look(0, &[0.8, 0.2], 1.0), TAU);
        evidence.add(look(100, &[0.2, 0.8], 1.0), TAU);
        assert!(evidence.clipped(6.0)[0].abs() < 1e-6, "one for, one against");
        assert_eq!(evidence.looks(), 1.0);
    }

    #[test]
    fn looking_longer_makes_a_gesture_no_better_known() {
        let mut evidence = Evidence::new(3);
        // The third was never taught.
        let p = [0.6, 0.3, 0.1];
        let frame = |ms| JudgedFrame { unknown: Some(0.1), ..look(ms, &p, 1.0) };
        evidence.add(frame(0), TAU);
        let (first, of_first) = evidence.clipped_with_unknown(9.0);
        let lead = |vote: &[f32]| vote[0] - vote[1];
        assert_eq!(of_first, Some(first[2]));
        for look in 1..4 {
            evidence.add(frame(500 * look), TAU);
        }
        let (fourth, of_fourth) = evidence.clipped_with_unknown(9.0);
        assert_eq!((of_fourth, fourth.len()), (Some(fourth[2]), 3));
        assert!((lead(&fourth) - 4.0 * lead(&first)).abs() < 1e-4, "which of those taught: {fourth:?}");
        // P(unknown) / P(taught) of four looks: that of one.
        let known: f32 = (fourth[0].exp() + fourth[1].exp()).ln();
        assert!((fourth[2] - known - (0.1_f32 / 0.9).ln()).abs() < 1e-4, "{fourth:?}");
    }

    #[test]
    fn a_pause_makes_no_frame_weigh_more_than_one_look() {
        let mut evidence = Evidence::new(2);
        evidence.add(look(0, &[0.6, 0.4], 1.0), TAU);
        evidence.add(look(60_000, &[0.6, 0.4], 1.0), TAU);
        evidence.add(look(60_400, &[0.6, 0.4], 1.0), TAU);
        assert_eq!(evidence.looks(), 2.0);
    }

    #[test]
    fn quality_scales_a_frame_and_none_discards_it() {
        let mut evidence = Evidence::new(2);
        assert!(!evidence.add(look(0, &[0.9, 0.1], 0.0), TAU));
        assert!(evidence.clipped(6.0).is_empty(), "nothing seen, nothing said");
        assert!(evidence.add(look(10, &[0.9, 0.1], 0.25), TAU));
        assert_eq!(evidence.looks(), 0.25);
        assert!(!evidence.add(look(600, &[0.9, 0.1], f64::NAN), TAU));
    }

    #[test]
    fn a_probability_of_zero_is_floored_and_the_sum_clipped() {
        let mut evidence = Evidence::new(2);
        evidence.add(look(0, &[1.0, 0.0], 1.0), TAU);
        let half = (FLOOR.ln() / -2.0) as f32;
        assert_eq!(evidence.clipped(100.0), [half, -half]);
        assert_eq!(evidence.clipped(6.0), [6.0, -6.0]);
    }

    #[test]
    fn looking_for_long_makes_no_two_classes_equal() {
        let mut evidence = Evidence::new(4);
        for t in 0..50 {
            evidence.add(look(500 * t, &[0.5, 0.3, 0.1, 0.1], 1.0), TAU);
        }
        let vote = evidence.clipped(6.0);
        assert_eq!(vote[0], 6.0);
        assert_eq!(vote[1..], [-6.0; 3], "50 looks of ln 5/3 are 25 nats");
        let mut twice = Evidence::new(4);
        (0..12).for_each(|t| {
            twice.add(look(500 * t, &[0.5, 0.3, 0.1, 0.1], 1.0), TAU);
        });
        let vote = twice.clipped(6.0);
        let lead = 12.0 * (0.5_f32 / 0.3).ln();
        assert!((vote[0] - vote[1] - lead).abs() < 1e-3, "{vote:?}");
    }

    #[test]
    fn what_is_remembered_of_a_long_round_is_bounded() {
        let mut evidence = Evidence::new(2);
        for t in 0..10_000 {
            evidence.add(JudgedFrame { view: &[t as f32 * 10.0], ..look(t * 500, &[0.6, 0.4], 1.0) }, TAU);
        }
        assert_eq!(evidence.views.len(), MAX_VIEWS);
        assert_eq!(evidence.looks(), 10_000.0);
    }
}
