//! Robots compute what was trained.

use gestalt_vision::network as robots;

use super::*;
use crate::counting::{self, Shown};
use crate::frames::{CELLS, Crop, Frame, HEIGHT, WIDTH};
use crate::image::Pyramid;
use crate::learning::Planes;
use crate::places::{CROP, Place};
use crate::train;

fn noise(n: usize) -> Vec<u8> {
    (0..n).map(|i| (i * 7919 % 251) as u8).collect()
}

fn numbers(n: usize) -> Vec<f32> {
    noise(n).into_iter().map(|byte| f32::from(byte) / 100.0 - 1.2).collect()
}

fn map(channels: usize, side: [usize; 2], values: &[f32]) -> robots::FeatureMap {
    let mut map = robots::FeatureMap::new(channels, side[0], side[1]);
    map.values_mut().copy_from_slice(values);
    map
}

/// Weights are shipped in 16 bits: a thousandth of each.
#[track_caller]
fn assert_near(robots: &[f32], trained: &[f32]) {
    assert_eq!(robots.len(), trained.len());
    let largest = trained.iter().fold(0.0, |a: f32, b| a.max(b.abs()));
    for (a, b) in robots.iter().zip(trained) {
        assert!((a - b).abs() < 0.02 * largest + 1e-3, "{a}, trained as {b}");
    }
}

fn frame() -> Frame {
    Frame {
        picture: noise(3 * WIDTH * HEIGHT),
        hands: vec![Place { x: 70.0, y: 50.0, side: 40.0, up: 0.3 }],
        mask: vec![90; CELLS.0 * CELLS.1],
    }
}

#[test]
fn the_finder_of_robots_says_what_it_was_trained_to_say() {
    let mut finder = train::finder(&[frame()], None, 3, 1e-2, 1);
    let x = numbers(3 * WIDTH * HEIGHT);
    let mut theirs = robots::Finder::decode(&encode(&finder.weights())).unwrap();
    let (graph, out) = finder.forward(Planes::of(&x, 3, (HEIGHT, WIDTH), 0), false);
    assert_near(theirs.run(&map(3, [HEIGHT, WIDTH], &x)).values(), &graph.value(out).to_values());
}

#[test]
fn the_same_seed_trains_the_same_weights() {
    let weights = |seed| encode(&train::finder(&[frame()], None, 2, 1e-2, seed).weights());
    assert_eq!(weights(1), weights(1));
    assert_ne!(weights(1), weights(2));
}

#[test]
fn the_refiner_of_robots_says_what_it_was_trained_to_say() {
    let crop =
        Crop { picture: noise(3 * CROP * CROP), mask: noise(CROP * CROP), hand: Some([0.1, 0.0, 0.2, -0.5]) };
    let mut refiner = train::refiner(&[crop], None, 3, 1e-2, 1);
    let x = numbers(3 * CROP * CROP);
    let mut theirs = robots::Refiner::decode(&encode(&refiner.weights())).unwrap();
    let (graph, six, mask) = refiner.forward(Planes::of(&x, 3, (CROP, CROP), 0), false);
    let (said, logits) = theirs.run_with_mask(&map(3, [CROP, CROP], &x));
    let six = graph.value(six).to_values();
    assert_near(&[said.hand, said.right, said.down, said.larger, said.sine, said.cosine], &six);
    let quarters = graph.value(mask).to_values();
    let half = CROP / 2;
    let logit = |i: usize| {
        let (x, y) = (i % CROP, i / CROP);
        quarters[((2 * (y % 2) + x % 2) * half + y / 2) * half + x / 2]
    };
    assert_near(logits, &(0..CROP * CROP).map(logit).collect::<Vec<_>>());
}

#[test]
fn the_counter_of_robots_says_what_it_was_trained_to_say() {
    let mask = Pyramid::new(64, 64, 1, vec![255; 64 * 64]);
    let shown = Shown {
        picture: Pyramid::new(64, 64, 3, noise(3 * 64 * 64)),
        arm: mask.clone(),
        frame: counting::frame(&mask, 0.1).unwrap(),
        mask,
        count: Some(3),
        fingers: Some([false, true, true, true, false]),
        joints: Some([(30.0, 20.0); 21]),
        hand: true,
        origin: 0,
        drawn: false,
        seen: false,
    };
    let mut counter = train::counter(&[(1.0, vec![shown])], 3, 1e-2, 1);
    let x = numbers(2 * 48 * 48);
    let mut theirs = robots::Counter::decode(&encode(&counter.weights())).unwrap();
    let (graph, said) = counter.forward(Planes::of(&x, 2, (48, 48), 0), None);
    let values = |id| graph.value(id).to_values();
    let count = theirs.run(&map(2, [48, 48], &x));
    assert_near(&count.embedding, &values(said.embedding));
    assert_near(&count.counts, &values(said.count));
    assert_near(&count.fingers, &values(said.fingers));
    assert_near(&[count.hand], &values(said.hand));
}
