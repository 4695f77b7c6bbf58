//! Fewer pixels of the same channels, and fewer channels of more pixels.

use super::feature_map::FeatureMap;

/// The largest of each 2×2 pixels; a last row or column without a pair is left out.
pub fn halve_by_maximum(input: &FeatureMap, output: &mut FeatureMap) {
    let (channels, height, width) = input.shape();
    output.reshape(channels, height / 2, width / 2);
    let (rows, columns) = (height / 2, width / 2);
    for channel in 0..channels {
        let picture = input.channel(channel);
        let target = &mut output.values_mut()[channel * rows * columns..][..rows * columns];
        for (row, target) in target.chunks_exact_mut(columns.max(1)).enumerate() {
            let (upper, lower) = picture[2 * row * width..].split_at(width);
            for ((value, a), b) in target.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
                *value = a[0].max(a[1]).max(b[0].max(b[1]));
            }
        }
    }
}

/// One picture of twice the size from four channels: the left and right of even rows, then of odd ones.
pub fn shuffle_four(input: &FeatureMap, output: &mut FeatureMap) {
    let (channels, height, width) = input.shape();
    debug_assert_eq!(channels, 4);
    output.reshape(1, 2 * height, 2 * width);
    for (row, target) in output.values_mut().chunks_exact_mut((2 * width).max(1)).enumerate() {
        let line = |channel: usize| &input.channel(channel)[row / 2 * width..][..width];
        let (left, right) = (line(2 * (row % 2)), line(2 * (row % 2) + 1));
        for ((pair, left), right) in target.chunks_exact_mut(2).zip(left).zip(right) {
            (pair[0], pair[1]) = (*left, *right);
        }
    }
}
