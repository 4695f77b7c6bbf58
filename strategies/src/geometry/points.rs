//! Squared Euclidean distances from one point to many, at the speed of the memory.

use std::ops::ControlFlow;

/// Points side by side in a block: four vector registers of the smallest instruction set.
const LANES: usize = 16;

/// Points kept component by component in blocks of 16, each with a key; removal moves the last into the gap.
///
/// The distances from one point to all are then sums side by side, at a sixth of what one after the other takes. Each
/// is the sum over the components in their order, in `f32`, so the formula written plainly gives the same bits. Points
/// are as wide as the widest: a component that one of them lacks counts as 0.
#[derive(Clone, Debug, Default)]
pub struct Points {
    keys: Vec<u64>,
    dimension: usize,
    /// Component `j` of the point at place `i`: row `i / LANES * dimension + j`, lane `i % LANES`.
    rows: Vec<[f32; LANES]>,
}

impl Points {
    /// The keys, by place.
    #[must_use]
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }

    /// How many components the points have.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The place of a key.
    #[must_use]
    pub fn place(&self, key: u64) -> Option<usize> {
        self.keys.iter().position(|held| *held == key)
    }

    /// Puts a point at the last place.
    pub fn push(&mut self, key: u64, vector: &[f32]) {
        if vector.len() > self.dimension {
            self.widen(vector.len());
        }
        let place = self.keys.len();
        if place.is_multiple_of(LANES) {
            // A thousand robots that hold as many points each would otherwise hold room for as many again.
            if self.rows.capacity() < self.rows.len() + self.dimension {
                self.rows.reserve_exact(self.dimension + self.rows.len() / 8);
            }
            self.rows.resize(self.rows.len() + self.dimension, [0.0; LANES]);
        }
        self.keys.push(key);
        self.write(place, vector);
    }

    /// Takes the point at a place out; the last one takes its place.
    ///
    /// # Panics
    /// If there is no such place.
    pub fn swap_remove(&mut self, place: usize) {
        let last = self.point(self.keys.len() - 1);
        self.write(place, &last);
        self.keys.swap_remove(place);
        self.rows.truncate(self.keys.len().div_ceil(LANES) * self.dimension);
    }

    /// The point at a place.
    ///
    /// # Panics
    /// If there is no such place.
    #[must_use]
    pub fn point(&self, place: usize) -> Vec<f32> {
        let first = place / LANES * self.dimension;
        self.rows[first..first + self.dimension].iter().map(|row| row[place % LANES]).collect()
    }

    /// Calls with the place of each point and its squared distance to the given one, in the order of the places.
    pub fn measure(&self, from: &[f32], mut each: impl FnMut(usize, f32)) {
        self.measure_until(from, |place, distance| {
            each(place, distance);
            ControlFlow::Continue(())
        });
    }

    /// The same, until the call says that it has seen enough.
    pub fn measure_until(&self, from: &[f32], mut each: impl FnMut(usize, f32) -> ControlFlow<()>) {
        let mut padded = from.to_vec();
        padded.resize(self.dimension.max(from.len()), 0.0);
        let (from, beyond) = padded.split_at(self.dimension);
        for first in (0..self.keys.len()).step_by(LANES) {
            let row = first / LANES * self.dimension;
            let mut sums = [0.0_f32; LANES];
            for (row, x) in self.rows[row..row + self.dimension].iter().zip(from) {
                for (sum, y) in sums.iter_mut().zip(row) {
                    let difference = x - y;
                    *sum += difference * difference;
                }
            }
            for x in beyond {
                sums.iter_mut().for_each(|sum| *sum += x * x);
            }
            for (place, sum) in (first..self.keys.len()).zip(sums) {
                if each(place, sum).is_break() {
                    return;
                }
            }
        }
    }

    /// The key of the point nearest to the given one; of equals the smaller.
    #[must_use]
    pub fn nearest_to(&self, point: &[f32]) -> Option<u64> {
        self.first_by(point, |a, b| a < b)
    }

    /// The key of the point farthest from the given one; of equals the smaller.
    #[must_use]
    pub fn farthest_from(&self, point: &[f32]) -> Option<u64> {
        self.first_by(point, |a, b| a > b)
    }

    fn first_by(&self, point: &[f32], before: impl Fn(f32, f32) -> bool) -> Option<u64> {
        let mut best: Option<(f32, u64)> = None;
        self.measure(point, |place, distance| {
            let key = self.keys[place];
            let first = best
                .is_none_or(|(held, other)| before(distance, held) || !before(held, distance) && key < other);
            if first {
                best = Some((distance, key));
            }
        });
        best.map(|(_, key)| key)
    }

    fn write(&mut self, place: usize, vector: &[f32]) {
        let first = place / LANES * self.dimension;
        let values = vector.iter().copied().chain(std::iter::repeat(0.0));
        for (row, x) in self.rows[first..first + self.dimension].iter_mut().zip(values) {
            row[place % LANES] = x;
        }
    }

    fn widen(&mut self, dimension: usize) {
        let points: Vec<Vec<f32>> = (0..self.keys.len()).map(|place| self.point(place)).collect();
        let keys = std::mem::take(&mut self.keys);
        self.rows.clear();
        self.dimension = dimension;
        for (key, point) in keys.into_iter().zip(points) {
            self.push(key, &point);
        }
    }
}
