//! What holds whatever the weights say.

use opencv::core::Point;
use opencv::core::{CV_8UC3, Vec3b, flip};
use opencv::imgproc::{FILLED, LINE_8, circle};
use opencv::prelude::*;
use proptest::prelude::*;

use super::*;

fn frame(width: i32, height: i32) -> Mat {
    let mut frame =
        Mat::new_rows_cols_with_default(height, width, CV_8UC3, Scalar::new(150.0, 155.0, 160.0, 0.0))
            .unwrap();
    let (centre, skin) = (Point::new(width / 3, height / 2), Scalar::new(95.0, 125.0, 190.0, 0.0));
    circle(&mut frame, centre, height / 4, skin, FILLED, LINE_8, 0).unwrap();
    frame
}

#[track_caller]
fn assert_sane(seen: Result<Look, NoObservation>) {
    match seen {
        Ok(look) => {
            assert!((MINIMUM..=1.0).contains(&look.confidence));
            assert!(look.mask.len() == 64 * 64 && look.mask.iter().all(|value| (0.0..=1.0).contains(value)));
            assert!(look.embedding.iter().all(|value| value.is_finite()));
            assert!((look.counts.iter().sum::<f32>() - 1.0).abs() < 1e-4);
            assert!(look.fingers.iter().all(|finger| (0.0..=1.0).contains(finger)));
            assert!(look.place.up.abs() <= std::f32::consts::PI + 1e-6 && look.place.side > 0.0);
            assert!(look.outline().unwrap().len() > 3);
        }
        Err(NoObservation::NoHand(NoHand::Unrecognised { confidence, .. })) => assert!(confidence < MINIMUM),
        Err(NoObservation::TooNarrow { .. }) => (),
        Err(error) => panic!("{error}"),
    }
}

/// A file of weights whose layers with these biases say just that: `(tensor of the bias, its first values)`, the weights being
/// the tensor before.
fn saying(file: &[u8], biases: &[(usize, &[f32])]) -> Vec<u8> {
    let mut file = file.to_vec();
    let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let count = number(8);
    let lengths: Vec<usize> = (0..count).map(|tensor| number(12 + 4 * tensor)).collect();
    let range = |tensor: usize| {
        let start = 12 + 4 * count + 2 * lengths[..tensor].iter().sum::<usize>();
        start..start + 2 * lengths[tensor]
    };
    for (tensor, values) in biases {
        file[range(tensor - 1).start..range(*tensor).end].fill(0);
        let bytes = values.iter().flat_map(|value| half::f16::from_f32(*value).to_le_bytes());
        file[range(*tensor).start..].iter_mut().zip(bytes).for_each(|(byte, value)| *byte = value);
    }
    let end = file.len() - 4;
    let checksum = crc32fast::hash(&file[..end]);
    file[end..].copy_from_slice(&checksum.to_le_bytes());
    file
}

/// Eyes that take everything for a hand, with all its pixels, and the first place for the likeliest.
fn credulous() -> Eyes {
    let finder = saying(shipped::FINDER, &[(25, &[8.0])]);
    let refiner = saying(shipped::REFINER, &[(19, &[8.0]), (29, &[8.0; 4])]);
    Eyes::new(&finder, &refiner, &saying(shipped::COUNTER, &[(17, &[8.0])])).unwrap()
}

#[test]
fn a_first_look_goes_from_the_glance_to_the_place_in_the_frame() {
    let mut eyes = credulous();
    let look = eyes.look(&frame(640, 480), None).unwrap();
    // Between the first four cells of the finder's maps, 24 pixels of 160 large.
    assert_eq!((look.place.x, look.place.y, look.place.side, look.place.up), (15.5, 15.5, 96.0, 0.0));
    assert!(look.confidence > 0.999);
    assert_eq!(look.region(Size::new(640, 480)), Rect::new(0, 0, 91, 91));
}

#[test]
fn a_hand_that_is_still_there_is_read_where_it_was() {
    let (mut eyes, frame) = (credulous(), frame(640, 480));
    let memory = Place { x: 213.0, y: 240.0, side: 240.0, up: 0.4 };
    let look = eyes.look(&frame, Some(memory)).unwrap();
    assert_eq!((look.view, look.place), (memory, memory));
    assert!(look.confidence > 0.999);
    assert!(look.mask.iter().all(|value| *value > 0.999));
    // The whole square is the hand: its outline is the square.
    let outline = look.outline().unwrap();
    let furthest = outline.iter().map(|p| (p.x - 213.0).hypot(p.y - 240.0)).fold(0.0, f32::max);
    let expected = 0.5 * 1.55 * 240.0 * 2.0_f32.sqrt() * 63.0 / 64.0;
    assert!((furthest - expected).abs() < 0.5, "{furthest}, not {expected}");
    let region = look.region(frame.size().unwrap());
    let mut mask = Mat::default();
    eyes.draw_mask(&look, region, Size::new(192, 150), &mut mask).unwrap();
    assert_eq!((mask.cols(), mask.rows(), *mask.at_2d::<u8>(75, 96).unwrap()), (194, 152, 255));
    assert_eq!(*mask.at_2d::<u8>(0, 96).unwrap(), 0);
    assert_eq!((eyes.crop().cols(), eyes.crop().rows()), (48, 48));
    assert!(*eyes.crop().at_2d::<u8>(24, 24).unwrap() > 100);
}

#[test]
fn a_hand_and_its_mirror_image_are_looked_at_alike() {
    let (mut eyes, frame) = (Eyes::shipped().unwrap(), hands(&[true, false]));
    let mut mirrored = Mat::default();
    flip(&frame, &mut mirrored, 1).unwrap();
    let last = (frame.cols() - 1) as f32;
    let view = eyes.look(&frame, None).unwrap().place;
    let seen = eyes.close_up_with_mask(&frame, view).unwrap();
    let mask = eyes.mask.values().unwrap().to_vec();
    eyes.pyramid.clear();
    let other = eyes.close_up_with_mask(&mirrored, Place { x: last - view.x, up: -view.up, ..view }).unwrap();
    // Squares are cut out to a thirty-second of a pixel, in 8 bits.
    let near = |a: f32, b: f32| assert!((a - b).abs() < 0.02 * (1.0 + a.abs()), "{seen:?} and {other:?}");
    let (place, found) = (seen.place, other.place);
    let pairs =
        [(seen.hand, other.hand), (place.x, last - found.x), (place.y, found.y), (place.side, found.side)];
    pairs.into_iter().chain([(place.up, -found.up)]).for_each(|(a, b)| near(a, b));
    let rows = mask.chunks_exact(Refiner::SIDE).zip(eyes.mask.values().unwrap().chunks_exact(Refiner::SIDE));
    rows.flat_map(|(row, other)| row.iter().zip(other.iter().rev())).for_each(|(a, b)| near(*a, *b));
}

#[test]
fn a_memory_of_nowhere_is_no_memory() {
    let (mut eyes, frame) = (credulous(), frame(320, 240));
    let reference = eyes.look(&frame, None);
    for (x, y, side, up) in [
        (-9.0, 5.0, 50.0, 0.0),
        (5.0, 500.0, 50.0, 0.0),
        (5.0, 5.0, 0.0, 0.0),
        (f32::NAN, 5.0, 50.0, 0.0),
        (5.0, 5.0, 50.0, f32::NAN),
    ] {
        let seen = eyes.look(&frame, Some(Place { x, y, side, up }));
        assert_eq!(format!("{seen:?}"), format!("{reference:?}"));
    }
}

/// Eyes that take whatever they look at closely for a hand, but find what the shipped ones find.
pub(crate) fn easily_content() -> Eyes {
    let refiner = saying(shipped::REFINER, &[(19, &[8.0]), (29, &[8.0; 4])]);
    Eyes::new(shipped::FINDER, &refiner, &saying(shipped::COUNTER, &[(17, &[8.0])])).unwrap()
}

/// Before one wall, from the left to the right: a bare drawn hand or none.
pub(crate) fn hands(shown: &[bool]) -> Mat {
    use crate::camera_model::CameraModel;
    use crate::pose::Pose;
    use crate::source::{Glove, RenderedSource, Scene, Source};

    let near = Pose { distance_m: 0.6, ..Pose::FRONTAL };
    let mut source = RenderedSource::new(CameraModel::laptop(), near, Glove::Skin, 1).unwrap();
    let mut side = |shown: &bool| {
        let scene = Scene { gesture: shown.then_some(5), seed: 1 };
        source.next_frame(std::time::Duration::ZERO, &scene).unwrap().image
    };
    let sides: opencv::core::Vector<Mat> = shown.iter().map(&mut side).collect();
    let mut frame = Mat::default();
    opencv::core::hconcat(&sides, &mut frame).unwrap();
    frame
}

#[test]
fn a_glance_finds_the_hand_that_a_thing_was_taken_for() {
    let (mut eyes, frame) = (easily_content(), hands(&[true]));
    let hand = eyes.look(&frame, None).unwrap().place;
    // A corner of the wall, which the refiner takes for a hand.
    let thing = Place { x: 30.0, y: 30.0, side: 50.0, up: 0.0 };
    assert!(!thing.is_near(&hand, 1.0), "{hand:?}");
    let followed = eyes.look(&frame, Some(thing)).unwrap();
    assert_eq!((followed.place, followed.view), (thing, thing));
    assert_eq!(eyes.look_about(&frame, Some(thing), true).unwrap().place, hand);
}

#[test]
fn of_two_hands_alike_the_known_one_stays() {
    let (mut eyes, frame) = (Eyes::shipped().unwrap(), hands(&[true, true]));
    let hand = eyes.look(&hands(&[true]), None).unwrap();
    for aside in [0.0, frame.cols() as f32 / 2.0] {
        let known = Place { x: hand.place.x + aside, ..hand.place };
        let seen = eyes.look(&frame, Some(known)).unwrap();
        assert!(seen.place.is_near(&known, 0.2), "{seen:?}");
        assert_eq!(eyes.look_about(&frame, Some(known), true).unwrap(), seen);
    }
}

#[test]
fn what_is_no_picture_is_refused_by_its_cause() {
    let mut eyes = Eyes::shipped().unwrap();
    assert!(matches!(eyes.look(&Mat::default(), None), Err(NoObservation::EmptyFrame)));
    assert!(matches!(
        eyes.look(&frame(4000, 4), None),
        Err(NoObservation::TooNarrow { width: 4000, height: 4 })
    ));
    for (width, height) in [(1, 1), (160, 120), (641, 479), (3000, 2000)] {
        assert_sane(eyes.look(&frame(width, height), None));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn random_pixels_are_seen_as_something_or_nothing(
        (rows, columns) in (1..60_i32, 1..60_i32),
        bytes in proptest::collection::vec(any::<u8>(), 60 * 60 * 3),
        memory: Option<(f32, f32, f32, f32)>,
    ) {
        let pixels: Vec<Vec3b> = bytes.chunks_exact(3).map(|c| Vec3b::from([c[0], c[1], c[2]])).collect();
        let frame = Mat::new_rows_cols_with_data(rows, columns, &pixels[..(rows * columns) as usize]).unwrap();
        let frame = frame.try_clone().unwrap();
        let memory = memory.map(|(x, y, side, up)| Place { x, y, side, up });
        assert_sane(Eyes::shipped().unwrap().look(&frame, memory));
        assert_sane(credulous().look(&frame, Some(Place { x: 0.4, y: 0.3, side: 3.0, up: 7.0 })));
    }
}
