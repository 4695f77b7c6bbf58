//! The best blob of a mask: its outline, its holes, and nothing else.

use opencv::core::{
    CV_8U, Mat, MatTrait, MatTraitConst, Point, Point2f, Scalar, Size, Vec4i, Vector, no_array,
};
use opencv::imgproc::{
    CHAIN_APPROX_NONE, FILLED, LINE_8, RETR_CCOMP, contour_area_def, draw_contours,
    find_contours_with_hierarchy,
};

/// Black pixels around a drawn mask, so that the view's edge bounds a hand as background does.
pub const MARGIN: i32 = 1;
/// A hole of a smaller share of the blob is noise and gets filled.
const SMALLEST_HOLE: f64 = 0.002;

/// A connected part of a mask.
pub struct Blob {
    index: usize,
    first_hole: i32,
    /// Area within the outline, pixels.
    pub area: f64,
    /// The outline, every pixel.
    pub contour: Vector<Point>,
}

/// A hole in a blob, such as thumb and finger form.
#[derive(Clone, Copy, Debug)]
pub struct Hole {
    /// Its area, pixels.
    pub area: f64,
    /// The mean of its outline.
    pub centre: Point2f,
}

/// Finds blobs. Owns the buffers that takes.
#[derive(Default)]
pub struct BlobFinder {
    contours: Vector<Vector<Point>>,
    hierarchy: Vector<Vec4i>,
}

impl BlobFinder {
    /// The blob of the largest area, its coordinates shifted by `offset`; `None` when the mask is black.
    pub fn largest(&mut self, mask: &Mat, offset: i32) -> Result<Option<Blob>, opencv::Error> {
        let (contours, hierarchy) = (&mut self.contours, &mut self.hierarchy);
        let offset = Point::new(offset, offset);
        find_contours_with_hierarchy(mask, contours, hierarchy, RETR_CCOMP, CHAIN_APPROX_NONE, offset)?;
        let mut largest: Option<Blob> = None;
        for (index, links) in self.hierarchy.iter().enumerate() {
            let is_outline = links[3] < 0;
            if is_outline {
                let contour = self.contours.get(index)?;
                let area = contour_area_def(&contour)?;
                if largest.as_ref().is_none_or(|blob| area > blob.area) {
                    largest = Some(Blob { index, first_hole: links[2], area, contour });
                }
            }
        }
        Ok(largest)
    }

    /// Draws a blob found last, white on a black mask of `size`, and collects its holes that are no noise,
    /// largest first. A `solid` one has none.
    pub fn draw(
        &self,
        blob: &Blob,
        size: Size,
        mask: &mut Mat,
        holes: &mut Vec<Hole>,
        solid: bool,
    ) -> Result<(), opencv::Error> {
        if mask.size()? == size {
            mask.set_to(&Scalar::all(0.0), &no_array())?;
        } else {
            *mask = Mat::new_size_with_default(size, CV_8U, Scalar::all(0.0))?;
        }
        // Outline and holes in one call: even and odd nesting leaves the holes black and the pixels around them
        // whole.
        self.fill(mask, blob.index, if solid { 0 } else { i32::MAX })?;
        holes.clear();
        if solid {
            return Ok(());
        }
        let mut child = blob.first_hole;
        while let Ok(hole) = usize::try_from(child) {
            let outline = self.contours.get(hole)?;
            let area = contour_area_def(&outline)?;
            if area > SMALLEST_HOLE * blob.area {
                let sum = outline.iter().fold((0.0, 0.0), |(x, y), p| (x + p.x as f32, y + p.y as f32));
                let n = outline.len() as f32;
                holes.push(Hole { area, centre: Point2f::new(sum.0 / n, sum.1 / n) });
            } else {
                self.fill(mask, hole, 0)?;
            }
            child = self.hierarchy.get(hole)?[0];
        }
        holes.sort_by(|a, b| b.area.total_cmp(&a.area));
        Ok(())
    }

    /// Fills a contour, leaving out the holes nested in it down to `levels`.
    fn fill(&self, mask: &mut Mat, contour: usize, levels: i32) -> Result<(), opencv::Error> {
        let (contours, hierarchy) = (&self.contours, &self.hierarchy);
        let (white, nowhere) = (Scalar::all(255.0), Point::new(0, 0));
        draw_contours(mask, contours, contour as i32, white, FILLED, LINE_8, hierarchy, levels, nowhere)
    }
}
