//! What perception costs per frame, beside the plain OpenCV calls that the same job takes.
//!
//! `cargo bench -p gestalt-vision --bench perception`: one core, a drawn hand in a frame of 640×360. The plain
//! calls look for one known colour, at the same sizes and with the same buffers kept; learning the colour,
//! judging whether there is a hand, and everything else that is not a call of OpenCV is what perception adds.

mod bare;

use std::time::Duration;

use bare::Bare;
use divan::{Bencher, black_box};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::motion::{MotionConfig, MotionDetector};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};
use opencv::core::Mat;

fn main() {
    opencv::core::set_num_threads(1).expect("OpenCV takes one thread");
    divan::main();
}

fn frame() -> Mat {
    scene(Some(4))
}

fn scene(gesture: Option<u8>) -> Mat {
    let mut source = RenderedSource::new(CameraModel::parrot(), Pose::FRONTAL, Glove::Cyan, 1)
        .expect("the preset is a valid camera");
    source.next_frame(Duration::ZERO, &Scene { gesture, seed: 3 }).expect("0 to 5 fingers can be drawn").image
}

fn observe(bencher: Bencher<'_, '_>, set: FeatureSet) {
    let frame = frame();
    let mut perception = Perception::new(set, HandConfig::default()).expect("the defaults are valid");
    bencher.bench_local(|| perception.observe(black_box(&frame)).expect("the frame shows a hand"));
}

#[divan::bench]
fn observe_shape(bencher: Bencher<'_, '_>) {
    observe(bencher, FeatureSet::Shape);
}

#[divan::bench]
fn observe_hog(bencher: Bencher<'_, '_>) {
    observe(bencher, FeatureSet::Hog);
}

fn observe_before(bencher: Bencher<'_, '_>, background: &Mat) {
    let frame = frame();
    let mut perception =
        Perception::new(FeatureSet::Shape, HandConfig::default()).expect("the defaults are valid");
    bencher.bench_local(|| {
        perception.observe_before(black_box(&frame), Some(background)).expect("the frame shows a hand")
    });
}

#[divan::bench]
fn observe_shape_in_a_room_known_empty(bencher: Bencher<'_, '_>) {
    observe_before(bencher, &scene(None));
}

/// By the background that a robot has learned, which is small.
#[divan::bench]
fn observe_shape_in_a_room_it_has_watched(bencher: Bencher<'_, '_>) {
    let room = scene(None);
    let mut detector = MotionDetector::new(MotionConfig::watching()).expect("the defaults are valid");
    for number in 0..200 {
        detector.watch(&room, number * Duration::from_millis(33)).expect("it is a frame");
    }
    observe_before(bencher, detector.background().expect("seven seconds show an empty room"));
}

/// Nobody there, and a hand.
#[divan::bench(args = [None, Some(3)])]
fn watch_for_motion(bencher: Bencher<'_, '_>, gesture: Option<u8>) {
    let camera = CameraModel::parrot();
    let mut source =
        RenderedSource::new(camera, Pose::FRONTAL, Glove::Cyan, 1).expect("the preset is a valid camera");
    let mut take = || source.next_frame(Duration::ZERO, &Scene { gesture, seed: 2 });
    let frames: Vec<Mat> = (0..30).map(|_| take().expect("0 to 5 fingers can be drawn").image).collect();
    let mut detector = MotionDetector::new(MotionConfig::watching()).expect("the defaults are valid");
    let mut number = 0_u32;
    bencher.bench_local(|| {
        number += 1;
        let frame = &frames[number as usize % frames.len()];
        detector.watch(black_box(frame), number * Duration::from_millis(33)).expect("it is a frame")
    });
}

#[divan::bench(args = ["shape", "hog"])]
fn bare_opencv_calls(bencher: Bencher<'_, '_>, set: &str) {
    let frame = frame();
    let mut bare = Bare::new().expect("the sizes of the descriptor divide each other");
    bencher.bench_local(|| {
        bare.hand(black_box(&frame)).expect("the frame shows a hand");
        if set == "shape" { bare.shape() } else { bare.hog() }.expect("there is a hand to describe");
    });
}
