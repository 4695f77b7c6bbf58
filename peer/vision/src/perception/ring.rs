//! A mask along a circle: where the circle is covered, and by how many separate parts.

use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Point2f};

use super::blob::MARGIN;

/// Samples a drawn mask on a circle, clockwise from the direction of x. Outside the view it continues as at its
/// edge: an arm goes on there.
pub fn ring(mask: &Mat, centre: Point2f, radius: f32, samples: usize) -> Result<Vec<bool>, opencv::Error> {
    let columns = mask.cols();
    let (right, bottom) = (columns - 1 - MARGIN, mask.rows() - 1 - MARGIN);
    let pixels = mask.data_bytes()?;
    let covered = |sample: usize| {
        let (sin, cos) = (sample as f32 * std::f32::consts::TAU / samples as f32).sin_cos();
        let x = (centre.x + cos * radius).round() as i32;
        let y = (centre.y + sin * radius).round() as i32;
        pixels[(y.clamp(MARGIN, bottom) * columns + x.clamp(MARGIN, right)) as usize] > 0
    };
    Ok((0..samples).map(covered).collect())
}

/// A run of covered samples of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Its first sample.
    pub start: usize,
    /// How many samples it has.
    pub length: usize,
}

impl Arc {
    /// The sample in its middle, which may lie between two or past the last one.
    pub fn middle(self) -> f32 {
        self.start as f32 + (self.length - 1) as f32 / 2.0
    }
}

/// The arcs of a circle that are covered. None where all samples are alike: then nothing begins or ends.
pub fn arcs(ring: &[bool]) -> Vec<Arc> {
    let n = ring.len();
    let begins = |&i: &usize| ring[i] && !ring[(i + n - 1) % n];
    let length = |start: usize| (0..n).take_while(|step| ring[(start + step) % n]).count();
    (0..n).filter(begins).map(|start| Arc { start, length: length(start) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_may_run_over_the_end_of_the_circle() {
        let ring = [true, false, false, true, false, true, true];
        assert_eq!(arcs(&ring), [Arc { start: 3, length: 1 }, Arc { start: 5, length: 3 }]);
        assert_eq!(arcs(&ring)[1].middle(), 6.0);
    }

    #[test]
    fn a_circle_all_alike_has_no_arc() {
        assert_eq!(arcs(&[true; 8]), []);
        assert_eq!(arcs(&[false; 8]), []);
    }
}
