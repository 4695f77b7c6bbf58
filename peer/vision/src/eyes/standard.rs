//! Pictures as the networks want them: channel after channel, of one mean and one contrast.

use opencv::core::{Mat, MatTraitConst, MatTraitConstManual};

use crate::network::FeatureMap;

/// Added to a picture's standard deviation, so that noise is not made into contrast.
const NOISE: f64 = 12.0;
/// The same within a hand.
const NOISE_WITHIN: f64 = 6.0;
/// Grey levels further from the hand's mean than so many of its standard deviations are cut off.
const FURTHEST: f64 = 3.0;

/// (value - mean) / (standard deviation + 12) of an 8-bit BGR picture without gaps between its rows; mean and deviation of
/// all pixels and channels together.
pub fn standardise(bgr: &Mat, map: &mut FeatureMap) -> Result<(), opencv::Error> {
    let bytes = bgr.data_bytes()?;
    let (sum, squares) = bytes.iter().fold((0_u64, 0_u64), |(sum, squares), byte| {
        let value = u64::from(*byte);
        (sum + value, squares + value * value)
    });
    let count = bytes.len().max(1) as f64;
    let mean = sum as f64 / count;
    let deviation = (squares as f64 / count - mean * mean).max(0.0).sqrt();
    let (mean, gain) = (mean as f32, (1.0 / (deviation + NOISE)) as f32);
    map.reshape(3, bgr.rows() as usize, bgr.cols() as usize);
    let (blue, rest) = map.values_mut().split_at_mut(bytes.len() / 3);
    let (green, red) = rest.split_at_mut(bytes.len() / 3);
    for (((pixel, blue), green), red) in bytes.chunks_exact(3).zip(blue).zip(green).zip(red) {
        let value = |byte: u8| (f32::from(byte) - mean) * gain;
        (*blue, *green, *red) = (value(pixel[0]), value(pixel[1]), value(pixel[2]));
    }
    Ok(())
}

/// A hand as the counter wants it: its grey levels, (value - mean) / (standard deviation + 6) cut off at ±3, mean and
/// deviation of its own pixels; then its pixels, -1..=1. `mask`: how much each pixel is the hand's, `0.0..=1.0`. Both are
/// of that many pixels square.
pub fn standardise_within(grey: &[f32], mask: &[f32], side: usize, map: &mut FeatureMap) {
    // One pixel more than there are, so that no hand at all is no division by zero.
    let weight = 1.0 + mask.iter().map(|m| f64::from(*m)).sum::<f64>();
    let mean_of = |value: &dyn Fn(f64) -> f64| {
        let pixels = grey.iter().zip(mask);
        pixels.map(|(g, m)| f64::from(*m) * value(f64::from(*g))).sum::<f64>() / weight
    };
    let mean = mean_of(&|grey| grey);
    let deviation = mean_of(&|grey| (grey - mean).powi(2)).sqrt();
    map.reshape(2, side, side);
    let (values, inside) = map.values_mut().split_at_mut(grey.len());
    for (((value, inside), grey), mask) in values.iter_mut().zip(inside).zip(grey).zip(mask) {
        *value = ((f64::from(*grey) - mean) / (deviation + NOISE_WITHIN)).clamp(-FURTHEST, FURTHEST) as f32;
        *inside = 2.0 * mask - 1.0;
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::Vec3b;

    use super::*;

    #[test]
    fn a_picture_is_split_into_channels_of_one_measure() {
        let pixels = [Vec3b::from([10, 20, 30]), Vec3b::from([40, 50, 60])];
        let bgr = Mat::new_rows_cols_with_data(1, 2, &pixels).unwrap().try_clone().unwrap();
        let mut map = FeatureMap::default();
        standardise(&bgr, &mut map).unwrap();
        let gain = 1.0 / (291.666_67_f32.sqrt() + 12.0);
        let expected = [-25.0, 5.0, -15.0, 15.0, -5.0, 25.0].map(|x: f32| x * gain);
        assert_eq!(map.shape(), (3, 1, 2));
        assert!(map.values().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{map:?}");
    }

    #[test]
    fn a_hand_is_measured_by_its_own_pixels() {
        let mut map = FeatureMap::default();
        standardise_within(&[100.0, 200.0, 0.0, 255.0], &[1.0, 1.0, 1.0, 0.0], 2, &mut map);
        let mean = 75.0_f32;
        let deviation = ((625.0 + 15625.0 + 5625.0) / 4.0_f32).sqrt();
        let of = |grey: f32| ((grey - mean) / (deviation + 6.0)).clamp(-3.0, 3.0);
        let expected = [of(100.0), of(200.0), of(0.0), of(255.0), 1.0, 1.0, 1.0, -1.0];
        assert!(map.values().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{map:?}");
        standardise_within(&[7.0; 4], &[0.0; 4], 2, &mut map);
        assert!(map.values().iter().all(|value| value.is_finite()));
    }
}
