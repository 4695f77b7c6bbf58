//! Every step against the loops of its definition, whole networks against those steps, and files that are none.

use half::f16;
use proptest::collection::vec;
use proptest::prelude::*;

use super::convolution::{Convolution, Shape, Workspace};
use super::dense::Dense;
use super::feature_map::FeatureMap;
use super::pooling::{halve_by_maximum, shuffle_four};
use super::tensors::Tensors;
use super::*;

const FINDER: [(usize, usize, usize); 13] = [
    (3, 12, 3),
    (12, 24, 3),
    (24, 48, 3),
    (48, 48, 3),
    (48, 64, 3),
    (64, 64, 3),
    (64, 64, 3),
    (64, 48, 1),
    (48, 32, 3),
    (32, 16, 1),
    (24, 16, 1),
    (16, 16, 3),
    (16, 5, 1),
];
const REFINER: [(usize, usize, usize); 15] = [
    (3, 12, 3),
    (12, 16, 3),
    (16, 40, 3),
    (40, 40, 3),
    (40, 64, 3),
    (64, 64, 3),
    (64, 64, 3),
    (64, 12, 1),
    (768, 32, 1),
    (32, 6, 1),
    (64, 40, 1),
    (40, 24, 3),
    (24, 16, 1),
    (16, 16, 3),
    (16, 4, 1),
];
const COUNTER: [(usize, usize, usize); 9] = [
    (2, 24, 5),
    (24, 40, 3),
    (40, 64, 3),
    (64, 96, 3),
    (864, 96, 1),
    (96, 24, 1),
    (24, 6, 1),
    (24, 5, 1),
    (24, 1, 1),
];

/// Numbers of a fixed sequence, between -1 and 1.
fn numbers(seed: u64) -> impl Iterator<Item = f32> {
    let mut state = seed;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    })
}

/// A file of these tensors.
fn file(tensors: &[Vec<f32>]) -> Vec<u8> {
    let mut bytes = b"GESTNET1".to_vec();
    bytes.extend((tensors.len() as u32).to_le_bytes());
    bytes.extend(tensors.iter().flat_map(|tensor| (tensor.len() as u32).to_le_bytes()));
    bytes.extend(tensors.iter().flatten().flat_map(|value| f16::from_f32(*value).to_le_bytes()));
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// Weights and biases of layers of these channels and sides, as large as keeps the spread of the values.
fn random(layers: &[(usize, usize, usize)], seed: u64) -> Vec<Vec<f32>> {
    let mut numbers = numbers(seed);
    let mut tensor = |count: usize, scale: f32| -> Vec<f32> {
        numbers.by_ref().take(count).map(|x| f16::from_f32(x * scale).to_f32()).collect()
    };
    let layer = |(from, to, side): &(usize, usize, usize)| {
        let patch = from * side * side;
        [tensor(to * patch, (6.0 / patch as f32).sqrt()), tensor(*to, 0.1)]
    };
    layers.iter().flat_map(layer).collect()
}

fn picture(channels: usize, height: usize, width: usize, seed: u64) -> FeatureMap {
    let mut map = FeatureMap::new(channels, height, width);
    map.values_mut().iter_mut().zip(numbers(seed)).for_each(|(value, number)| *value = number);
    map
}

#[track_caller]
fn assert_near(ours: &[f32], theirs: &[f32]) {
    assert_eq!(ours.len(), theirs.len());
    for (index, (a, b)) in ours.iter().zip(theirs).enumerate() {
        assert!((a - b).abs() <= 1e-4 * (1.0 + b.abs()), "value {index}: {a} and {b}");
    }
}

/// The definition, as plain loops, with the next two of a network's tensors.
struct Plain<'a>(std::slice::Iter<'a, Vec<f32>>);

impl Plain<'_> {
    fn convolve(&mut self, shape: Shape, input: &FeatureMap) -> FeatureMap {
        let (weights, bias) = (self.0.next().unwrap(), self.0.next().unwrap());
        let (channels, height, width) = input.shape();
        let Shape { side, stride, dilation, .. } = shape;
        let padding = (dilation * (side / 2)) as isize;
        let mut output = FeatureMap::new(shape.channels.1, height.div_ceil(stride), width.div_ceil(stride));
        let (_, rows, columns) = output.shape();
        for out in 0..shape.channels.1 {
            for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                let mut sum = f64::from(bias[out]);
                for channel in 0..channels {
                    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
                        let line = (y * stride + i * dilation) as isize - padding;
                        let pixel = (x * stride + j * dilation) as isize - padding;
                        if (0..height as isize).contains(&line) && (0..width as isize).contains(&pixel) {
                            let value = input.channel(channel)[line as usize * width + pixel as usize];
                            let weight = weights[((out * channels + channel) * side + i) * side + j];
                            sum += f64::from(value) * f64::from(weight);
                        }
                    }
                }
                let value = if shape.rectified { sum.max(0.0) } else { sum };
                output.values_mut()[(out * rows + y) * columns + x] = value as f32;
            }
        }
        output
    }

    fn dense(&mut self, to: usize, rectified: bool, input: &[f32]) -> Vec<f32> {
        let mut map = FeatureMap::new(input.len(), 1, 1);
        map.values_mut().copy_from_slice(input);
        self.convolve(Shape { rectified, ..Shape::point(input.len(), to) }, &map).values().to_vec()
    }

    fn trunk(&mut self, [a, b, c, d, e]: [usize; 5], second: Shape, picture: &FeatureMap) -> [FeatureMap; 3] {
        let first = self.convolve(Shape::halving(a, b), picture);
        let fine = self.convolve(second, &first);
        let third = self.convolve(Shape::halving(c, d), &fine);
        let middle = self.convolve(Shape::usual(d, d), &third);
        let mut coarse = self.convolve(Shape::halving(d, e), &middle);
        for dilation in [1, 2] {
            let more = self.convolve(Shape { dilation, ..Shape::usual(e, e) }, &coarse);
            coarse = sum(&coarse, &more);
        }
        [fine, middle, coarse]
    }
}

fn sum(a: &FeatureMap, b: &FeatureMap) -> FeatureMap {
    assert_eq!(a.shape(), b.shape());
    let mut sum = a.clone();
    sum.values_mut().iter_mut().zip(b.values()).for_each(|(value, more)| *value += more);
    sum
}

/// What is below zero cut off the sum of a map and another of half its size.
fn climb(high: &FeatureMap, half: &FeatureMap) -> FeatureMap {
    let (channels, height, width) = high.shape();
    let mut output = high.clone();
    for (channel, y, x) in
        (0..channels).flat_map(|c| (0..height).flat_map(move |y| (0..width).map(move |x| (c, y, x))))
    {
        let value = &mut output.values_mut()[(channel * height + y) * width + x];
        *value = (*value + half.channel(channel)[y / 2 * half.shape().2 + x / 2]).max(0.0);
    }
    output
}

fn halved(input: &FeatureMap) -> FeatureMap {
    let mut output = FeatureMap::default();
    halve_by_maximum(input, &mut output);
    output
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn a_convolution_is_its_definition(
        (from, to) in (1..9_usize, 1..12_usize),
        (side, stride, dilation) in (prop_oneof![Just(1_usize), Just(3), Just(5)], 1..4_usize, 1..3_usize),
        (height, width) in (1..40_usize, 1..150_usize),
        rectified: bool,
        seed: u64,
    ) {
        let shape = Shape { channels: (from, to), side, stride, dilation, rectified };
        let tensors = random(&[(from, to, side)], seed);
        let input = picture(from, height, width, seed ^ 1);
        let mut output = picture(3, 5, 7, seed ^ 2);
        let layer = Convolution::decode(shape, &mut Tensors::decode(&file(&tensors), 2).unwrap()).unwrap();
        let mut used = Workspace::default();
        layer.run(&picture(from, width, height, seed ^ 3), &mut output, &mut used);
        layer.run(&input, &mut output, &mut used);
        let plain = Plain(tensors.iter()).convolve(shape, &input);
        prop_assert_eq!(output.shape(), plain.shape());
        assert_near(output.values(), plain.values());
    }

    #[test]
    fn a_dense_layer_is_its_definition(from in 1..100_usize, to in 1..20_usize, rectified: bool, seed: u64) {
        let tensors = random(&[(from, to, 1)], seed);
        let input: Vec<f32> = numbers(seed ^ 1).take(from).collect();
        let layer = Dense::decode((from, to), rectified, &mut Tensors::decode(&file(&tensors), 2).unwrap());
        let mut output = vec![f32::NAN; to];
        layer.unwrap().run(&input, &mut output);
        assert_near(&output, &Plain(tensors.iter()).dense(to, rectified, &input));
    }

    #[test]
    fn climbing_and_shuffling_put_each_pixel_where_it_belongs(
        (channels, height, width) in (1..5_usize, 1..9_usize, 1..9_usize),
        seed: u64,
    ) {
        let half = picture(channels, height.div_ceil(2), width.div_ceil(2), seed);
        let mut high = picture(channels, height, width, seed ^ 1);
        let plain = climb(&high, &half);
        high.add_doubled_and_rectify(&half);
        prop_assert_eq!(&high, &plain);

        let four = picture(4, height, width, seed);
        let mut one = FeatureMap::default();
        shuffle_four(&four, &mut one);
        prop_assert_eq!(one.shape(), (1, 2 * height, 2 * width));
        for (y, x) in (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (y, x))) {
            let expected = four.channel(2 * (y % 2) + x % 2)[y / 2 * width + x / 2];
            prop_assert_eq!(one.values()[y * 2 * width + x], expected);
        }

        let pooled = halved(&high);
        prop_assert_eq!(pooled.shape(), (channels, height / 2, width / 2));
        for (channel, y, x) in (0..channels)
            .flat_map(|c| (0..height / 2).flat_map(move |y| (0..width / 2).map(move |x| (c, y, x))))
        {
            let of = |i: usize, j: usize| high.channel(channel)[(2 * y + i) * width + 2 * x + j];
            let most = of(0, 0).max(of(0, 1)).max(of(1, 0)).max(of(1, 1));
            prop_assert_eq!(pooled.channel(channel)[y * (width / 2) + x], most);
        }
    }

    #[test]
    fn garbage_is_refused(bytes in vec(any::<u8>(), 0..200), header: bool, count in 0..5_usize) {
        let mut file = if header { b"GESTNET1".to_vec() } else { Vec::new() };
        file.extend(&bytes);
        prop_assert!(Tensors::decode(&file, count).is_err());
    }

    #[test]
    fn a_damaged_file_is_refused(at in 0..500_usize, change in 1..=255_u8, cut in 0..500_usize) {
        let good = file(&random(&[(3, 4, 3), (4, 5, 1)], 1));
        let mut damaged = good.clone();
        let at = at % good.len();
        damaged[at] ^= change;
        prop_assert!(Tensors::decode(&damaged, 4).is_err());
        prop_assert!(Tensors::decode(&good[..cut % good.len()], 4).is_err());
        prop_assert!(Tensors::decode(&good, 4).is_ok());
    }
}

#[test]
fn the_finder_is_its_definition_at_both_sizes_and_any_other() {
    let tensors = random(&FINDER, 5);
    let mut finder = Finder::decode(&file(&tensors)).unwrap();
    for (height, width) in [(120, 160), (240, 320), (50, 31), (1, 1)] {
        let picture = picture(3, height, width, 9);
        let mut plain = Plain(tensors.iter());
        let [fine, middle, coarse] = plain.trunk([3, 12, 24, 48, 64], Shape::halving(12, 24), &picture);
        let y = climb(&middle, &plain.convolve(Shape::point(64, 48), &coarse));
        let y = plain.convolve(Shape::usual(48, 32), &y);
        let low = plain.convolve(Shape::point(32, 16), &y);
        let y = climb(&plain.convolve(Shape::point(24, 16), &fine), &low);
        let y = plain.convolve(Shape::usual(16, 16), &y);
        let maps = plain.convolve(Shape::point(16, 5), &y);
        let found = finder.run(&picture);
        assert_eq!(found.shape(), (5, height.div_ceil(2).div_ceil(2), width.div_ceil(2).div_ceil(2)));
        assert_near(found.values(), maps.values());
    }
}

#[test]
fn the_refiner_is_its_definition_with_and_without_its_mask() {
    let tensors = random(&REFINER, 6);
    let mut refiner = Refiner::decode(&file(&tensors)).unwrap();
    for seed in 0..2 {
        let picture = picture(3, 64, 64, seed);
        let mut plain = Plain(tensors.iter());
        let [fine, middle, coarse] = plain.trunk([3, 12, 16, 40, 64], Shape::usual(12, 16), &picture);
        let squeezed = plain.convolve(Shape { rectified: true, ..Shape::point(64, 12) }, &coarse);
        let hidden = plain.dense(32, true, squeezed.values());
        let said = plain.dense(6, false, &hidden);
        let y = climb(&middle, &plain.convolve(Shape::point(64, 40), &coarse));
        let y = plain.convolve(Shape::usual(40, 24), &y);
        let y = climb(&fine, &plain.convolve(Shape::point(24, 16), &y));
        let y = plain.convolve(Shape::usual(16, 16), &y);
        let mut logits = FeatureMap::default();
        shuffle_four(&plain.convolve(Shape::point(16, 4), &y), &mut logits);

        let alone = refiner.run(&picture);
        let (with, mask) = refiner.run_with_mask(&picture);
        assert_eq!(alone, with);
        assert_near(&[alone.hand, alone.right, alone.down, alone.larger, alone.sine, alone.cosine], &said);
        assert_near(mask, logits.values());
    }
}

#[test]
fn the_counter_is_its_definition() {
    let tensors = random(&COUNTER, 7);
    let mut counter = Counter::decode(&file(&tensors)).unwrap();
    for seed in 0..2 {
        let picture = picture(2, 48, 48, seed);
        let mut plain = Plain(tensors.iter());
        let y = halved(&plain.convolve(Shape { side: 5, ..Shape::halving(2, 24) }, &picture));
        let y = halved(&plain.convolve(Shape::usual(24, 40), &y));
        let y = plain.convolve(Shape::usual(40, 64), &y);
        let y = halved(&plain.convolve(Shape::usual(64, 96), &y));
        let hidden = plain.dense(96, true, y.values());
        let embedding = plain.dense(24, false, &hidden);
        let count = counter.run(&picture);
        assert_near(&count.embedding, &embedding);
        assert_near(&count.counts, &plain.dense(6, false, &embedding));
        assert_near(&count.fingers, &plain.dense(5, false, &embedding));
        assert_near(&[count.hand], &plain.dense(1, false, &embedding));
    }
}

#[test]
fn weights_of_another_network_are_refused_by_their_cause() {
    let other = file(&random(&COUNTER, 1));
    assert_eq!(Finder::decode(&other).err(), Some(WeightsError::Count { expected: 26, found: 18 }));
    let mut wide = random(&FINDER, 1);
    wide[2].push(0.0);
    let wrong = WeightsError::Length { tensor: 2, expected: 12 * 24 * 9, found: 12 * 24 * 9 + 1 };
    assert_eq!(Finder::decode(&file(&wide)).err(), Some(wrong));
    let mut infinite = random(&FINDER, 1);
    infinite[7][3] = f32::INFINITY;
    assert_eq!(Finder::decode(&file(&infinite)).err(), Some(WeightsError::NotFinite { tensor: 7 }));
    assert_eq!(Finder::decode(b"GESTALT").err(), Some(WeightsError::Magic));
    let damaged = &mut file(&random(&FINDER, 1));
    damaged[200] ^= 1;
    assert!(matches!(Finder::decode(damaged).err(), Some(WeightsError::Checksum { .. })));
}

#[test]
fn other_weights_have_another_checksum() {
    let files = |seed| [file(&random(&FINDER, 1)), file(&random(&REFINER, 2)), file(&random(&COUNTER, seed))];
    assert_eq!(checksum(files(3)), checksum(files(3)));
    assert_ne!(checksum(files(3)), checksum(files(4)));
}

#[test]
fn between_two_readings_everything_is_halfway() {
    let mut counter = Counter::decode(shipped::COUNTER).unwrap();
    let read = |counter: &mut Counter, level: f32| {
        let mut picture = FeatureMap::new(2, Counter::SIDE, Counter::SIDE);
        picture.values_mut().fill(level);
        counter.run(&picture)
    };
    let (one, other) = (read(&mut counter, 0.2), read(&mut counter, -0.7));
    let mean = one.mean(&other);
    assert_ne!(one.embedding, other.embedding);
    let halfway = |mean: &[f32], a: &[f32], b: &[f32]| {
        assert!(
            mean.iter().zip(a).zip(b).all(|((m, a), b)| (2.0 * m - a - b).abs() < 1e-4 * (1.0 + a.abs()))
        );
    };
    halfway(&mean.embedding, &one.embedding, &other.embedding);
    halfway(&mean.counts, &one.counts, &other.counts);
    halfway(&mean.fingers, &one.fingers, &other.fingers);
    halfway(&[mean.hand], &[one.hand], &[other.hand]);
    assert_eq!(one.mean(&one), one);
}

#[test]
fn the_shipped_weights_fit() {
    Finder::decode(shipped::FINDER).unwrap();
    Refiner::decode(shipped::REFINER).unwrap();
    Counter::decode(shipped::COUNTER).unwrap();
}
