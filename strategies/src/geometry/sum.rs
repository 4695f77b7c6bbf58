//! Sums and means that do not depend on the order of what was added and taken out.

/// What 1 is in the sums: they count in steps of 2⁻⁶⁴.
const ONE: f64 = 18_446_744_073_709_551_616.0;
/// The greatest component that is added as it is: 2²³ of them fit into a sum of 128 bits, which saturates beyond.
const GREATEST: f64 = 1_099_511_627_776.0;

/// Vectors added up exactly, in fixed point: adding and taking out commute, so the mean of what is left is the same
/// bits as if it alone had been added. Components are exact from 2⁻⁴⁰ to 2⁴⁰; a missing one counts as 0.
#[derive(Clone, Debug, Default)]
pub struct ExactSum {
    total: Vec<i128>,
    count: i64,
}

impl ExactSum {
    /// Adds a vector.
    pub fn add(&mut self, vector: &[f32]) {
        self.accumulate(vector, 1);
    }

    /// Takes a vector out that was added.
    pub fn subtract(&mut self, vector: &[f32]) {
        self.accumulate(vector, -1);
    }

    /// How many vectors there are.
    #[must_use]
    pub fn count(&self) -> f64 {
        self.count as f64
    }

    /// Component `j` of the sum.
    #[must_use]
    pub fn total(&self, j: usize) -> f64 {
        self.total.get(j).map_or(0.0, |total| *total as f64 / ONE)
    }

    /// The mean; `None` of none.
    #[must_use]
    pub fn mean(&self) -> Option<Vec<f64>> {
        let components = 0..self.total.len();
        (self.count > 0).then(|| components.map(|j| self.total(j) / self.count()).collect())
    }

    fn accumulate(&mut self, vector: &[f32], sign: i8) {
        if self.total.len() < vector.len() {
            self.total.resize(vector.len(), 0);
        }
        for (total, x) in self.total.iter_mut().zip(vector) {
            let steps = (f64::from(*x).clamp(-GREATEST, GREATEST) * ONE) as i128;
            *total = total.saturating_add(i128::from(sign) * steps);
        }
        self.count += i64::from(sign);
    }
}

/// A mean in the precision that distances are measured in.
#[must_use]
pub fn narrow(vector: Vec<f64>) -> Vec<f32> {
    vector.into_iter().map(|x| x as f32).collect()
}
