//! What one thread does with one frame, in milliseconds: the parts of which a centre's time is made.

use std::time::{Duration, Instant};

use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::{LayerConfig, MotionConfig};
use gestalt_vision::perception::FeatureSet;
use gestalt_vision::sight::{Sight, SightConfig};
use gestalt_vision::source::{Frame, MAX_MEGAPIXELS, decode, decode_reduced};
use opencv::core::Mat;

use super::bare::Bare;

/// How long each part is measured; the best tenth counts, for others use the machine too.
const TIME: Duration = Duration::from_secs(2);

/// Prints them, of frames with a hand at rest and of all.
pub fn report(clips: &[Vec<Vec<u8>>]) {
    let period = clips[0].len() / 4;
    // The second half of the hand's rest, in every showing.
    let at_rest: Vec<&Vec<u8>> =
        clips.iter().flat_map(|clip| clip.chunks(period).flat_map(|show| &show[110..148])).collect();
    let bytes = at_rest.iter().map(|jpeg| jpeg.len()).sum::<usize>() / at_rest.len();
    let config = |motion| SightConfig { camera: CameraModel::parrot(), layer: LayerConfig::ALL, motion };
    let new = |motion| Sight::new(config(motion), FeatureSet::Shape).expect("the defaults are valid");
    let mut frame = Frame { image: Mat::default(), at: Duration::ZERO };
    let decoding = best(&at_rest, |jpeg| decode(jpeg, MAX_MEGAPIXELS, &mut frame.image).expect("a picture"));
    let mut sight = new(MotionConfig::default());
    let looking = best(&at_rest, |jpeg| {
        decode(jpeg, MAX_MEGAPIXELS, &mut frame.image).expect("a picture");
        frame.at += Duration::from_millis(33);
        drop(sight.take(&frame, true));
    });
    let mut sight = new(MotionConfig::watching());
    let both = best(&at_rest, |jpeg| {
        decode(jpeg, MAX_MEGAPIXELS, &mut frame.image).expect("a picture");
        frame.at += Duration::from_millis(33);
        drop(sight.take(&frame, true));
    });
    let mut sight = new(MotionConfig::watching());
    let all: Vec<&Vec<u8>> = clips[0].iter().collect();
    let watching = best(&all, |jpeg| {
        let size = decode_reduced(jpeg, MAX_MEGAPIXELS, |size| sight.enough(size), &mut frame.image);
        frame.at += Duration::from_millis(33);
        drop(sight.take_reduced(&frame, size.expect("a picture"), false));
    });
    let mut bare = Bare::new().expect("the sizes of the descriptor divide each other");
    let mut image = Mat::default();
    let plain = best(&at_rest, |jpeg| {
        decode(jpeg, MAX_MEGAPIXELS, &mut image).expect("a picture");
        bare.hand(&image).expect("the frame shows a hand");
        bare.shape().expect("there is a hand to describe");
    });
    println!(
        "a frame of {bytes} bytes: decoded {decoding:.2} ms; and looked at {looking:.2} ms ({plain:.2} ms with plain OpenCV calls); and watched {both:.2} ms; reduced and watched {watching:.2} ms"
    );
}

/// The best of ten means, in milliseconds.
fn best(frames: &[&Vec<u8>], mut work: impl FnMut(&[u8])) -> f64 {
    let mut frames = frames.iter().cycle();
    let mut best = f64::INFINITY;
    for _ in 0..10 {
        let (began, mut done) = (Instant::now(), 0);
        while began.elapsed() < TIME / 10 {
            work(frames.next().expect("they go round"));
            done += 1;
        }
        best = best.min(began.elapsed().as_secs_f64() * 1e3 / f64::from(done));
    }
    best
}
