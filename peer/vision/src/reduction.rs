//! A frame, reduced to as many pixels as show where something is: once, for motion and for the first look at a hand (learned
//! eyes have a first look of their own, of the size that their networks learned from).

use opencv::core::{Mat, Size};
use opencv::imgproc::{INTER_AREA, resize};
use opencv::prelude::*;

/// Reduced frames are the largest images of their frame's aspect within this; smaller frames stay as they are.
const LIMIT: Size = Size { width: 160, height: 120 };

/// The size to which a frame of that size is reduced.
pub fn reduced(frame: Size) -> Size {
    let part = |limit: i32, side: i32| f64::from(limit) / f64::from(side.max(1));
    let scale = part(LIMIT.width, frame.width).min(part(LIMIT.height, frame.height)).min(1.0);
    let side = |length: i32| ((f64::from(length) * scale).round() as i32).max(1);
    Size::new(side(frame.width), side(frame.height))
}

/// A reduced frame, and the steps on the way there.
#[derive(Default)]
pub struct Reduction {
    halved: [Mat; 2],
    pub image: Mat,
}

impl Reduction {
    /// Reduces a frame that is of size `whole`, or was before something else reduced it. By area, so that no pixel is lost; by
    /// halves first, which is several times as fast.
    pub fn take(&mut self, bgr: &Mat, whole: Size) -> opencv::Result<()> {
        let target = reduced(whole);
        let [even, odd] = &mut self.halved;
        let mut source = bgr;
        for buffer in [even, odd] {
            let size = source.size()?;
            let half = Size::new(size.width / 2, size.height / 2);
            if half.width < target.width || half.height < target.height {
                break;
            }
            resize(source, buffer, half, 0.0, 0.0, INTER_AREA)?;
            source = buffer;
        }
        match source.size()? == target {
            true => source.copy_to(&mut self.image),
            false => resize(source, &mut self.image, target, 0.0, 0.0, INTER_AREA),
        }
    }
}
