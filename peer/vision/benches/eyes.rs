//! What the networks of learned eyes cost, each alone, and a whole look: one core, one picture.
//!
//! `cargo bench -p gestalt-vision --bench eyes`.

use divan::{Bencher, black_box};
use gestalt_vision::network::{Counter, FeatureMap, Finder, Refiner, shipped};

fn main() {
    #[cfg(feature = "opencv")]
    opencv::core::set_num_threads(1).expect("OpenCV takes one thread");
    divan::main();
}

/// Some picture: the networks take the same time for every one.
fn picture(channels: usize, height: usize, width: usize) -> FeatureMap {
    let mut map = FeatureMap::new(channels, height, width);
    for (index, value) in map.values_mut().iter_mut().enumerate() {
        *value = (index * 7919 % 1000) as f32 / 500.0 - 1.0;
    }
    map
}

#[divan::bench(args = [1, 2])]
fn finder(bencher: Bencher<'_, '_>, times: usize) {
    let mut finder = Finder::decode(shipped::FINDER).expect("the shipped weights fit");
    let picture = picture(3, 120 * times, 160 * times);
    bencher.bench_local(|| black_box(finder.run(black_box(&picture)).values()[0]));
}

#[divan::bench]
fn refiner(bencher: Bencher<'_, '_>) {
    let mut refiner = Refiner::decode(shipped::REFINER).expect("the shipped weights fit");
    let picture = picture(3, Refiner::SIDE, Refiner::SIDE);
    bencher.bench_local(|| refiner.run(black_box(&picture)));
}

#[divan::bench]
fn refiner_with_mask(bencher: Bencher<'_, '_>) {
    let mut refiner = Refiner::decode(shipped::REFINER).expect("the shipped weights fit");
    let picture = picture(3, Refiner::SIDE, Refiner::SIDE);
    bencher.bench_local(|| black_box(refiner.run_with_mask(black_box(&picture)).1[0]));
}

#[divan::bench]
fn counter(bencher: Bencher<'_, '_>) {
    let mut counter = Counter::decode(shipped::COUNTER).expect("the shipped weights fit");
    let picture = picture(2, Counter::SIDE, Counter::SIDE);
    bencher.bench_local(|| counter.run(black_box(&picture)));
}

/// A frame of 640×360 with a drawn hand: a first look, and one where the hand was.
#[cfg(feature = "opencv")]
#[divan::bench(args = [false, true])]
fn look(bencher: Bencher<'_, '_>, again: bool) {
    use std::time::Duration;

    use gestalt_vision::camera_model::CameraModel;
    use gestalt_vision::eyes::{Eyes, Place};
    use gestalt_vision::pose::Pose;
    use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};

    let mut source = RenderedSource::new(CameraModel::parrot(), Pose::FRONTAL, Glove::Cyan, 1)
        .expect("the preset is a valid camera");
    let scene = Scene { gesture: Some(4), seed: 3 };
    let frame = source.next_frame(Duration::ZERO, &scene).expect("0 to 5 fingers can be drawn").image;
    let mut eyes = Eyes::shipped().expect("the shipped weights fit");
    let memory = eyes.look(&frame, None).ok().map(|look| look.place);
    let memory = again.then(|| memory.unwrap_or(Place { x: 320.0, y: 180.0, side: 150.0, up: 0.0 }));
    // Whatever the eyes say of it.
    bencher.bench_local(|| eyes.look(black_box(&frame), memory).is_ok());
}
