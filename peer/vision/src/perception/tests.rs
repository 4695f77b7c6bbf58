//! What holds for perception as a whole: on drawn hands, on no hands, and on what is no picture at all.

use std::f32::consts::TAU;

use opencv::core::{CV_8U, CV_8UC3, CV_16UC3, Mat, Point, Scalar, Size, Vec3b};
use opencv::imgproc::{FILLED, INTER_AREA, LINE_8, circle, line, resize};
use opencv::prelude::*;
use proptest::prelude::*;

use super::*;

const WALL: [u8; 3] = [150, 155, 160];
const SKIN: [u8; 3] = [95, 125, 190];
const GLOVE: [u8; 3] = [180, 170, 30];

fn scalar([b, g, r]: [u8; 3]) -> Scalar {
    Scalar::new(b.into(), g.into(), r.into(), 0.0)
}

fn plain(width: i32, height: i32, colour: [u8; 3]) -> Mat {
    Mat::new_rows_cols_with_default(height, width, CV_8UC3, scalar(colour)).unwrap()
}

/// A palm with a wrist below and `fingers` fanned out above, drawn in one colour.
fn draw_hand(frame: &mut Mat, (x, y): (i32, i32), palm: i32, fingers: i32, colour: [u8; 3]) {
    let colour = scalar(colour);
    let stroke = |frame: &mut Mat, angle: f32, length: f32, width: f32| {
        let (sin, cos) = angle.sin_cos();
        let tip = Point::new(x + (sin * length) as i32, y - (cos * length) as i32);
        line(frame, Point::new(x, y), tip, colour, width as i32, LINE_8, 0).unwrap();
    };
    circle(frame, Point::new(x, y), palm, colour, FILLED, LINE_8, 0).unwrap();
    stroke(frame, TAU / 2.0, 1.7 * palm as f32, 1.3 * palm as f32);
    for finger in 0..fingers {
        let angle = 0.55 * (finger as f32 - (fingers - 1) as f32 / 2.0);
        stroke(frame, angle, 2.6 * palm as f32, (0.4 * palm as f32).max(1.0));
    }
}

fn hand(width: i32, height: i32, fingers: i32, colour: [u8; 3]) -> Mat {
    let mut frame = plain(width, height, WALL);
    draw_hand(&mut frame, (width / 2, height * 3 / 5), height / 8, fingers, colour);
    frame
}

fn perception(set: FeatureSet) -> Perception {
    Perception::new(set, HandConfig::default()).unwrap()
}

fn shape(frame: &Mat) -> Vec<f32> {
    perception(FeatureSet::Shape).observe(frame).unwrap().features
}

fn feature(vector: &[f32], name: &str) -> f32 {
    vector[features().iter().position(|feature| feature.name == name).unwrap()]
}

/// Neither a panic nor a number that is none.
fn assert_sane(frame: &Mat) {
    for set in FeatureSet::ALL {
        if let Ok(observation) = perception(set).observe(frame) {
            assert_eq!(observation.features.len(), set.length());
            assert!(observation.features.iter().all(|value| value.is_finite()));
            assert!((0.0..=1.0).contains(&observation.quality));
        }
    }
}

#[test]
fn there_are_110_features_each_with_a_name_of_its_own() {
    let mut names: Vec<_> = features().iter().map(|feature| feature.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 110);
    assert!(features().iter().all(|f| !f.formula.is_empty() && ["1", "rad", "count"].contains(&f.unit)));
}

#[test]
fn a_feature_set_reads_its_short_and_its_full_name() {
    for (text, set) in ["shape", "hog", "embedding"].into_iter().zip(FeatureSet::ALL) {
        assert_eq!(text.parse(), Ok(set));
        assert_eq!(set.name().parse(), Ok(set));
    }
    assert!("sift".parse::<FeatureSet>().is_err());
}

#[test]
fn the_raised_fingers_are_counted_where_they_cross_a_circle() {
    for fingers in 1..=5 {
        for colour in [SKIN, GLOVE] {
            let vector = shape(&hand(640, 480, fingers, colour));
            assert_eq!(feature(&vector, "fingers_at_1.9"), fingers as f32, "{fingers} fingers in {colour:?}");
        }
    }
}

#[test]
fn the_same_hand_at_two_resolutions_gives_nearly_the_same_features() {
    let large = hand(1280, 720, 4, SKIN);
    let mut small = Mat::default();
    resize(&large, &mut small, Size::new(320, 180), 0.0, 0.0, INTER_AREA).unwrap();
    for (known, (a, b)) in features().iter().zip(shape(&large).into_iter().zip(shape(&small))) {
        let tolerance = if known.unit == "count" { 1.0 } else { 0.15 * a.abs().max(1.0) };
        assert!((a - b).abs() <= tolerance, "{}: {a} and {b}", known.name);
    }
}

#[test]
fn neither_place_nor_distance_nor_light_matters() {
    let reference = shape(&hand(640, 480, 3, SKIN));
    let mut moved = plain(640, 480, WALL);
    draw_hand(&mut moved, (200, 200), 35, 3, SKIN);
    let dark = |colour: [u8; 3]| [colour[0] / 2, colour[1] / 2, colour[2] / 3];
    let mut dim = plain(640, 480, dark(WALL));
    draw_hand(&mut dim, (320, 288), 60, 3, dark(SKIN));
    for other in [moved, dim] {
        let other = shape(&other);
        for name in ["solidity", "aspect", "palm_radius", "reach", "defect_1_depth", "top"] {
            let (a, b) = (feature(&reference, name), feature(&other, name));
            assert!((a - b).abs() < 0.1 * a.abs().max(1.0), "{name}: {a} and {b}");
        }
    }
}

#[test]
fn a_bare_forearm_is_cut_off() {
    let mut long = plain(640, 480, WALL);
    line(&mut long, Point::new(320, 250), Point::new(320, 480), scalar(SKIN), 70, LINE_8, 0).unwrap();
    draw_hand(&mut long, (320, 220), 50, 3, SKIN);
    let mut short = plain(640, 480, WALL);
    draw_hand(&mut short, (320, 220), 50, 3, SKIN);
    let (long, short) = (shape(&long), shape(&short));
    let length = |vector: &[f32]| feature(vector, "length");
    assert!((length(&long) - length(&short)).abs() < 0.1, "{} and {}", length(&long), length(&short));
}

#[test]
fn a_frame_without_a_hand_says_so() {
    for colour in [[0; 3], [255; 3], WALL, SKIN] {
        let seen = perception(FeatureSet::Shape).observe(&plain(640, 360, colour));
        assert!(matches!(seen, Err(NoObservation::NoHand(NoHand::NothingStandsOut { .. }))), "{colour:?}");
    }
    let mut speck = plain(640, 360, WALL);
    circle(&mut speck, Point::new(100, 100), 6, scalar(SKIN), FILLED, LINE_8, 0).unwrap();
    let seen = perception(FeatureSet::Shape).observe(&speck);
    assert!(matches!(seen, Err(NoObservation::NoHand(_))), "{seen:?}");
}

#[test]
fn noise_is_no_hand() {
    let mut noise = plain(640, 480, WALL);
    opencv::core::set_rng_seed(7).unwrap();
    opencv::core::randu(&mut noise, &Scalar::all(0.0), &Scalar::all(256.0)).unwrap();
    let seen = perception(FeatureSet::Shape).observe(&noise);
    assert!(matches!(seen, Err(NoObservation::NoHand(_))), "{:?}", seen.map(|o| o.quality));
}

#[test]
fn what_is_no_picture_is_refused_by_its_cause() {
    let mut eyes = perception(FeatureSet::Hog);
    assert!(matches!(eyes.observe(&Mat::default()), Err(NoObservation::EmptyFrame)));
    let grey = Mat::new_rows_cols_with_default(48, 64, CV_8U, Scalar::all(9.0)).unwrap();
    assert!(matches!(eyes.observe(&grey), Err(NoObservation::Format { channels: 1, depth: 0 })));
    let deep = Mat::new_rows_cols_with_default(48, 64, CV_16UC3, Scalar::all(9.0)).unwrap();
    assert!(matches!(eyes.observe(&deep), Err(NoObservation::Format { channels: 3, depth: 2 })));
    let line = plain(4000, 3, WALL);
    assert!(matches!(eyes.observe(&line), Err(NoObservation::TooNarrow { width: 4000, height: 3 })));
    // And it still sees.
    assert!(eyes.observe(&hand(384, 288, 2, GLOVE)).is_ok());
}

#[test]
fn a_single_pixel_and_ten_megapixels_are_frames_like_others() {
    assert!(matches!(
        perception(FeatureSet::Shape).observe(&plain(1, 1, SKIN)),
        Err(NoObservation::NoHand(_))
    ));
    let huge = shape(&hand(3888, 2592, 5, SKIN));
    assert_eq!(feature(&huge, "fingers_at_1.9"), 5.0);
}

#[test]
fn a_configuration_out_of_range_names_the_field() {
    let config = HandConfig { minimum_contrast: f32::NAN, ..HandConfig::default() };
    let error = Perception::new(FeatureSet::Shape, config).err().unwrap();
    assert!(error.to_string().contains("minimum_contrast"), "{error}");
    let config = HandConfig { minimum_pixels: 0.0, ..HandConfig::default() };
    let error = Perception::new(FeatureSet::Shape, config).err().unwrap();
    assert!(error.to_string().contains("minimum_pixels"), "{error}");
}

#[test]
fn the_crop_shows_the_hand_alone() {
    let mut eyes = perception(FeatureSet::Hog);
    let quality = eyes.observe(&hand(640, 480, 2, SKIN)).unwrap().quality;
    assert!(quality > 0.8, "{quality}");
    let crop = eyes.crop();
    assert_eq!((crop.rows(), crop.cols(), crop.channels()), (64, 64, 1));
    let bright = crop.data_bytes().unwrap().iter().filter(|&&value| value > 0).count();
    assert!((600..3000).contains(&bright), "{bright} pixels");
    let inside = eyes.mask().data_bytes().unwrap().iter().filter(|&&value| value == 255).count();
    assert!(inside > 3000, "{inside} pixels");
}

/// A wall with a poster of the hand's own colour on it, larger than the hand.
fn wall_with_a_poster(colour: [u8; 3]) -> Mat {
    let mut wall = plain(640, 480, WALL);
    let poster = opencv::core::Rect::new(20, 20, 220, 180);
    opencv::imgproc::rectangle(&mut wall, poster, scalar(colour), FILLED, LINE_8, 0).unwrap();
    wall
}

#[test]
fn what_was_there_before_is_no_hand() {
    let wall = wall_with_a_poster(SKIN);
    let mut frame = wall.clone();
    draw_hand(&mut frame, (430, 290), 50, 4, SKIN);
    let mut eyes = perception(FeatureSet::Shape);
    let alone = eyes.observe(&frame).map(|seen| feature(&seen.features, "fingers_at_1.9"));
    assert!(!matches!(alone, Ok(fingers) if fingers == 4.0), "the poster is the larger blob: {alone:?}");
    // Dimmer by a third, under another light, and of another size: the same wall.
    let mut before = Mat::default();
    resize(&wall, &mut before, Size::new(320, 240), 0.0, 0.0, INTER_AREA).unwrap();
    let mut cast = Mat::default();
    opencv::core::multiply(&before, &Scalar::new(0.6, 0.7, 0.8, 0.0), &mut cast, 1.0, -1).unwrap();
    for before in [before, cast] {
        let seen = eyes.observe_before(&frame, Some(&before)).unwrap();
        assert_eq!(feature(&seen.features, "fingers_at_1.9"), 4.0);
        let empty = eyes.observe_before(&wall, Some(&before));
        assert!(matches!(empty, Err(NoObservation::NoHand(_))), "{empty:?}");
    }
}

#[test]
fn a_plain_background_known_changes_nothing_and_a_wrong_one_is_not_believed() {
    let frame = hand(640, 480, 3, SKIN);
    let reference = shape(&frame);
    for before in [plain(640, 480, WALL), plain(64, 48, [9, 200, 9]), hand(640, 480, 3, SKIN)] {
        let seen = perception(FeatureSet::Shape).observe_before(&frame, Some(&before));
        // A background that shows the very hand leaves nothing to see; any other, the same hand.
        match seen {
            Ok(seen) => {
                assert_eq!(feature(&seen.features, "fingers_at_1.9"), feature(&reference, "fingers_at_1.9"))
            }
            Err(error) => assert!(matches!(error, NoObservation::NoHand(_)), "{error}"),
        }
    }
    let seen = perception(FeatureSet::Shape).observe_before(&frame, Some(&plain(640, 480, WALL))).unwrap();
    for (known, (a, b)) in features().iter().zip(reference.iter().zip(seen.features)) {
        assert!((a - b).abs() <= 0.05 * a.abs().max(1.0), "{}: {a} and {b}", known.name);
    }
}

#[test]
fn a_hand_before_an_overexposed_wall_is_still_a_hand() {
    let mut frame = plain(640, 480, [255; 3]);
    draw_hand(&mut frame, (320, 288), 60, 3, [200, 240, 255]);
    assert_eq!(feature(&shape(&frame), "fingers_at_1.9"), 3.0);
}

#[test]
fn a_camera_that_is_not_as_its_model_says_is_seen_all_the_same() {
    let camera = CameraModel::parrot();
    let mut eyes =
        Perception::for_camera(FeatureSet::Shape, HandConfig::default(), LayerConfig::ALL, &camera).unwrap();
    for (width, height) in [(640, 360), (640, 480), (320, 240), (1280, 720)] {
        let seen = eyes.observe(&hand(width, height, 3, SKIN)).unwrap();
        assert_eq!(feature(&seen.features, "fingers_at_1.9"), 3.0, "{width}×{height}");
    }
}

#[test]
fn each_stage_off_is_a_pipeline_that_works_where_nothing_needs_it() {
    let camera = CameraModel::laptop();
    for layer in [
        LayerConfig { geometry: false, ..LayerConfig::ALL },
        LayerConfig { colour: false, ..LayerConfig::ALL },
        LayerConfig { resolution: false, ..LayerConfig::ALL },
        LayerConfig { time: false, ..LayerConfig::ALL },
        LayerConfig::NONE,
    ] {
        let mut eyes =
            Perception::for_camera(FeatureSet::Shape, HandConfig::default(), layer, &camera).unwrap();
        let seen = eyes.observe(&hand(640, 480, 3, GLOVE)).unwrap();
        assert_eq!(feature(&seen.features, "fingers_at_1.9"), 3.0, "{layer:?}");
        assert_eq!(eyes.layer(), layer);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn random_blobs_give_finite_features(
        (width, height) in (16..700_i32, 16..500_i32),
        strokes in proptest::collection::vec((0..700_i32, 0..500_i32, 0..700_i32, 0..500_i32, 1..60_i32, any::<[u8; 3]>()), 0..8),
        wall in any::<[u8; 3]>(),
    ) {
        let mut frame = plain(width, height, wall);
        for (x1, y1, x2, y2, thickness, colour) in strokes {
            let (from, to) = (Point::new(x1, y1), Point::new(x2, y2));
            line(&mut frame, from, to, scalar(colour), thickness, LINE_8, 0).unwrap();
        }
        assert_sane(&frame);
    }

    #[test]
    fn random_pixels_give_finite_features_or_none(
        (rows, columns) in (1..40_i32, 1..40_i32),
        bytes in proptest::collection::vec(any::<u8>(), 4800),
    ) {
        let pixels: Vec<Vec3b> = bytes.chunks_exact(3).map(|c| Vec3b::from([c[0], c[1], c[2]])).collect();
        let frame = Mat::new_rows_cols_with_data(rows, columns, &pixels[..(rows * columns) as usize]).unwrap();
        assert_sane(&frame.try_clone().unwrap());
    }
}
