//! What flows through a network: a stack of pictures of one size.

/// Channels of the same height and width, one after another, each row by row: the order `[channel][y][x]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureMap {
    channels: usize,
    height: usize,
    width: usize,
    values: Vec<f32>,
}

impl FeatureMap {
    /// A map of zeros.
    #[must_use]
    pub fn new(channels: usize, height: usize, width: usize) -> Self {
        let mut map = Self::default();
        map.reshape(channels, height, width);
        map
    }

    /// Makes it a map of that shape, whose values are arbitrary. Allocates only when it has never been as large.
    pub fn reshape(&mut self, channels: usize, height: usize, width: usize) {
        (self.channels, self.height, self.width) = (channels, height, width);
        self.values.resize(channels * height * width, 0.0);
    }

    /// Channels, height and width.
    #[must_use]
    pub fn shape(&self) -> (usize, usize, usize) {
        (self.channels, self.height, self.width)
    }

    /// All values.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values, to be written.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The values of one channel, row by row.
    ///
    /// # Panics
    /// When there is no such channel.
    #[must_use]
    pub fn channel(&self, channel: usize) -> &[f32] {
        let area = self.height * self.width;
        &self.values[channel * area..][..area]
    }

    /// Makes it the mirror image of another, left to right.
    pub fn mirror(&mut self, other: &Self) {
        self.reshape(other.channels, other.height, other.width);
        let rows = other.values.chunks_exact(other.width.max(1));
        for (to, from) in self.values.chunks_exact_mut(other.width.max(1)).zip(rows) {
            to.copy_from_slice(from);
            to.reverse();
        }
    }

    /// Adds a map of the same shape.
    pub(super) fn add(&mut self, other: &Self) {
        debug_assert_eq!(self.shape(), other.shape());
        for (value, more) in self.values.iter_mut().zip(&other.values) {
            *value += more;
        }
    }

    /// Adds a map of half the size, each of its pixels to four, and cuts off what is below zero. Where this map has an
    /// odd size, the other is half of it rounded up.
    pub(super) fn add_doubled_and_rectify(&mut self, half: &Self) {
        debug_assert_eq!(
            half.shape(),
            (self.channels, self.height.div_ceil(2), self.width.div_ceil(2)),
            "of {:?}",
            self.shape()
        );
        let rows = half.values.chunks_exact(half.width);
        let mut rows_of_two = self.values.chunks_exact_mut(self.width);
        for (index, row) in rows.enumerate() {
            let last = self.height % 2 == 1 && (index + 1) % half.height == 0;
            for target in rows_of_two.by_ref().take(if last { 1 } else { 2 }) {
                for (pair, more) in target.chunks_mut(2).zip(row) {
                    for value in pair {
                        *value = (*value + more).max(0.0);
                    }
                }
            }
        }
    }
}
