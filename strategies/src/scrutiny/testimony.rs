//! What the samples of each robot say of a sample of another: does a gesture of that name lie where it lies?

use gestalt_protocol::ClassId;

/// The nearest samples of one witness to the sample in question, as squared distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    /// Of the same class.
    pub same: f32,
    /// Of any other class.
    pub other: f32,
}

impl Nearest {
    /// Of a witness that has no sample.
    pub const NONE: Self = Self { same: f32::INFINITY, other: f32::INFINITY };

    pub fn see(&mut self, squared: f32, class: ClassId, asked: ClassId) {
        let nearest = if class == asked { &mut self.same } else { &mut self.other };
        *nearest = nearest.min(squared);
    }

    /// For (above 0) or against it: the logarithm of how much nearer its own class lies, as a kernel of that `reach` (a squared
    /// distance) tells it. What lies out of reach says nothing, and neither does a witness that does not know the gesture, or no other.
    pub fn evidence(self, reach: f32, faint: f64) -> Option<f64> {
        if !self.same.is_finite() || !self.other.is_finite() {
            return None;
        }
        let near = |squared: f32| faint + f64::from(-squared / reach).exp();
        Some((near(self.same) / near(self.other)).ln())
    }
}
