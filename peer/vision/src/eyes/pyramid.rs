//! Squares cut out of a frame, turned upright, at any scale: from the frame halved as often as it takes.

use opencv::core::{BORDER_REPLICATE, Mat, MatTraitConst, Scalar, Size};
use opencv::imgproc::{INTER_AREA, INTER_LINEAR, resize, warp_affine};

use super::affine::Affine;

/// Halvings at most: a hand of 4,000 pixels fills a square of 64.
const DEEPEST: usize = 6;
/// A picture may be reduced by this power of two, and that many halvings, before it is halved once more.
const SLACK: f64 = 0.35;

/// A frame, and what has been made of it so far: each half of the one before.
#[derive(Default)]
pub struct Pyramid {
    halves: Vec<Mat>,
    made: usize,
}

impl Pyramid {
    /// Forgets the frame.
    pub fn clear(&mut self) {
        self.made = 0;
    }

    /// Cuts a square of so many pixels out of the frame, which is the same since [`Self::clear`]. Beyond the frame's edge,
    /// its last pixels go on.
    pub fn cut(
        &mut self,
        frame: &Mat,
        onto: &Affine,
        pixels: usize,
        out: &mut Mat,
    ) -> Result<(), opencv::Error> {
        let smallest = f64::from(frame.rows().min(frame.cols())).log2();
        let wanted = (-onto.scale().log2() + SLACK).floor().min(smallest).clamp(0.0, DEEPEST as f64);
        let image = self.halved(frame, wanted as usize)?;
        // A pixel of the half covers two of the frame, so their centres are half a pixel apart.
        let step = |whole: i32, half: i32| f64::from(whole) / f64::from(half);
        let (x, y) = (step(frame.cols(), image.cols()), step(frame.rows(), image.rows()));
        let whole = Affine([[x, 0.0, (x - 1.0) / 2.0], [0.0, y, (y - 1.0) / 2.0]]);
        let size = Size::new(pixels as i32, pixels as i32);
        let matrix = onto.after(&whole).matrix();
        warp_affine(image, out, &matrix, size, INTER_LINEAR, BORDER_REPLICATE, Scalar::default())
    }

    /// The frame halved so many times.
    fn halved<'a>(&'a mut self, frame: &'a Mat, times: usize) -> Result<&'a Mat, opencv::Error> {
        self.halves.resize_with(self.halves.len().max(times), Mat::default);
        while self.made < times {
            let (before, after) = self.halves.split_at_mut(self.made);
            let before = before.last().unwrap_or(frame);
            let size = Size::new((before.cols() / 2).max(1), (before.rows() / 2).max(1));
            resize(before, &mut after[0], size, 0.0, 0.0, INTER_AREA)?;
            self.made += 1;
        }
        Ok(if times == 0 { frame } else { &self.halves[times - 1] })
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::Vec3b;
    use opencv::prelude::*;

    use super::super::place::Place;
    use super::*;

    #[test]
    fn every_pixel_is_where_it_was_at_any_scale_and_turn() {
        let (width, height) = (241, 181);
        let pixel = |i: usize| Vec3b::from([(i % width) as u8, (i / width) as u8, 0]);
        let pixels: Vec<Vec3b> = (0..width * height).map(pixel).collect();
        let frame = Mat::new_rows_cols_with_data(height as i32, width as i32, &pixels).unwrap();
        let frame = frame.try_clone().unwrap();
        let mut pyramid = Pyramid::default();
        let mut out = Mat::default();
        for (side, up) in [(100.0, 0.0), (90.0, 0.7), (40.0, -2.0), (20.0, 3.0), (7.0, 1.0)] {
            for pixels in [8, 16, 64] {
                let onto = Affine::onto(Place { x: 118.5, y: 91.0, side, up }, 1.2, pixels);
                pyramid.cut(&frame, &onto, pixels, &mut out).unwrap();
                assert_eq!((out.rows(), out.cols()), (pixels as i32, pixels as i32));
                for (index, bgr) in out.data_typed::<Vec3b>().unwrap().iter().enumerate() {
                    let (x, y) = onto.inverse().apply(((index % pixels) as f64, (index / pixels) as f64));
                    let (blue, green) = (f64::from(bgr[0]), f64::from(bgr[1]));
                    assert!((blue - x).abs() < 1.6 && (green - y).abs() < 1.6, "{blue} {green}, not {x} {y}");
                }
            }
        }
        assert_eq!(pyramid.made, 4, "halvings of the largest square of 8 pixels");
    }
}
