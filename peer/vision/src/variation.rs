//! Pictures of the same gesture that nobody took: mirrored, rolled, brighter or darker.

use opencv::core::{self, Mat, Point2f, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;
use rand::{Rng, RngExt};

/// A picture is rolled by at most this, to either side.
pub const ROLL_DEG: f64 = 30.0;

/// A picture becomes brighter or darker by at most this factor; what is brighter than white is white.
pub const GAIN: f64 = 2.0;

/// The mirror image of a picture, left to right.
///
/// # Errors
/// OpenCV's, for a picture without pixels.
pub fn mirrored(picture: &Mat) -> Result<Mat, opencv::Error> {
    const LEFT_TO_RIGHT: i32 = 1;
    let mut mirrored = Mat::default();
    core::flip(picture, &mut mirrored, LEFT_TO_RIGHT)?;
    Ok(mirrored)
}

/// A variation of a picture (blue, green, red, 8 bits): where `mirror` allows it, [`mirrored`] or not; rolled by up to
/// ±[`ROLL_DEG`], its levels times a gain between 1/[`GAIN`] and [`GAIN`]. Nothing is cut off: the picture grows with the
/// roll, and its border is drawn out into the corners. Roll and gain do not depend on `mirror`.
///
/// # Errors
/// OpenCV's, for a picture without pixels.
pub fn varied(picture: &Mat, mirror: bool, rng: &mut impl Rng) -> Result<Mat, opencv::Error> {
    let (heads, roll) = (rng.random_bool(0.5), rng.random_range(-ROLL_DEG..=ROLL_DEG));
    // Twice as bright is as likely as half as bright.
    let gain = GAIN.powf(rng.random_range(-1.0..=1.0));
    let upright = if mirror && heads { mirrored(picture)? } else { picture.clone() };
    let mut bright = Mat::default();
    rolled(&upright, roll)?.convert_to(&mut bright, -1, gain, 0.0)?;
    Ok(bright)
}

fn rolled(picture: &Mat, degrees: f64) -> Result<Mat, opencv::Error> {
    let (width, height) = (f64::from(picture.cols()), f64::from(picture.rows()));
    let (sin, cos) = degrees.to_radians().sin_cos();
    let across = (width * cos + height * sin.abs()).ceil();
    let down = (height * cos + width * sin.abs()).ceil();
    let centre = Point2f::new((width / 2.0) as f32, (height / 2.0) as f32);
    let mut turn = imgproc::get_rotation_matrix_2d(centre, degrees, 1.0)?;
    *turn.at_2d_mut::<f64>(0, 2)? += (across - width) / 2.0;
    *turn.at_2d_mut::<f64>(1, 2)? += (down - height) / 2.0;
    let mut rolled = Mat::default();
    let size = Size::new(across as i32, down as i32);
    let (how, border) = (imgproc::INTER_LINEAR, core::BORDER_REPLICATE);
    imgproc::warp_affine(picture, &mut rolled, &turn, size, how, border, Scalar::default())?;
    Ok(rolled)
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, Rect, Vec3b};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    /// A dark wall with a bright bar from the middle to the right edge: not its own mirror image.
    fn picture() -> Mat {
        let mut picture = Mat::new_rows_cols_with_default(120, 160, CV_8UC3, Scalar::all(60.0)).unwrap();
        let bar = Rect::new(80, 40, 80, 40);
        imgproc::rectangle(&mut picture, bar, Scalar::all(120.0), imgproc::FILLED, imgproc::LINE_8, 0)
            .unwrap();
        picture
    }

    #[test]
    fn the_same_seed_gives_the_same_pictures() {
        let pictures = |seed| -> Vec<Vec<u8>> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let made = (0..4).map(|_| varied(&picture(), true, &mut rng).unwrap());
            made.map(|made| made.data_bytes().unwrap().to_vec()).collect()
        };
        let made = pictures(1);
        assert_eq!(made, pictures(1));
        assert!(made[0] != made[1] && made != pictures(2));
    }

    #[test]
    fn some_are_mirrored_and_all_are_within_the_gain_and_nothing_is_cut_off() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut mirrored, mut gains) = (0, Vec::new());
        for _ in 0..200 {
            let made = varied(&picture(), true, &mut rng).unwrap();
            assert!(made.cols() >= 160 && made.rows() >= 120, "{:?}", made.size());
            let level =
                |x: i32| f64::from(made.at_2d::<Vec3b>(made.rows() / 2, made.cols() / 2 + x).unwrap()[0]);
            let (left, right) = (level(-20), level(20));
            mirrored += u32::from(left > right);
            gains.push(left.min(right) / 60.0);
            assert!((left.max(right) / left.min(right) - 2.0).abs() < 0.1, "{left} {right}");
        }
        assert!((70..130).contains(&mirrored), "{mirrored} of 200");
        let (least, most) = gains.iter().fold((9.0_f64, 0.0_f64), |(a, b), &gain| (a.min(gain), b.max(gain)));
        assert!((0.49..0.6).contains(&least) && (1.7..2.01).contains(&most), "{least} {most}");
    }

    #[test]
    fn without_mirroring_the_others_are_as_they_were() {
        let made = |mirror| {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let made = (0..40).map(move |_| varied(&picture(), mirror, &mut rng).unwrap());
            made.map(|made| made.data_bytes().unwrap().to_vec()).collect::<Vec<_>>()
        };
        let (with, without) = (made(true), made(false));
        let same = with.iter().zip(&without).filter(|(a, b)| a == b).count();
        assert!((10..30).contains(&same), "{same} of 40");
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..40 {
            let made = varied(&picture(), false, &mut rng).unwrap();
            let level = |x: i32| made.at_2d::<Vec3b>(made.rows() / 2, made.cols() / 2 + x).unwrap()[0];
            assert!(level(20) > level(-20), "the bar is on the right");
        }
    }

    #[test]
    fn what_is_brighter_than_white_is_white() {
        let white = Mat::new_rows_cols_with_default(20, 20, CV_8UC3, Scalar::all(250.0)).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let levels: Vec<u8> =
            (0..20).map(|_| varied(&white, true, &mut rng).unwrap().data_bytes().unwrap()[0]).collect();
        assert!(levels.contains(&255) && levels.iter().any(|level| *level < 200), "{levels:?}");
        assert!(varied(&Mat::default(), true, &mut rng).is_err());
    }
}
