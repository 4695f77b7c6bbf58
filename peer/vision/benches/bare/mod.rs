//! The plain OpenCV calls that finding and describing a hand take, with their buffers kept: the bound to measure against.

#![allow(dead_code, reason = "each bench uses the part it needs")]

use std::hint::black_box;

use opencv::Result;
use opencv::core::{
    BORDER_DEFAULT, CV_8U, Mat, Point, Point2f, Rect, Scalar, Size, Vec4i, Vector, in_range,
    mean_std_dev_def, min_max_loc, multiply, no_array,
};
use opencv::imgproc::*;
use opencv::objdetect::HOGDescriptor;
use opencv::prelude::*;

/// The buffers of the plain calls.
pub struct Bare {
    glance: Plane,
    close: Plane,
    mask: Mat,
    distance: Mat,
    hand: Vector<Point>,
    grey: Mat,
    small: Mat,
    small_mask: Mat,
    even: Mat,
    crop: Mat,
    descriptor: HOGDescriptor,
    values: Vector<f32>,
}

#[derive(Default)]
struct Plane {
    image: Mat,
    chroma: Mat,
    candidates: Mat,
    opened: Mat,
    contours: Vector<Vector<Point>>,
    hierarchy: Vector<Vec4i>,
}

impl Plane {
    /// Segmentation: scale, change the colour space, compare with a known glove, smooth, find the largest
    /// contour.
    fn largest(
        &mut self,
        bgr: &impl opencv::core::ToInputArray,
        size: Size,
    ) -> Result<(usize, Vector<Point>)> {
        resize(bgr, &mut self.image, size, 0.0, 0.0, INTER_AREA)?;
        cvt_color_def(&self.image, &mut self.chroma, COLOR_BGR2YCrCb)?;
        let (low, high) = (Scalar::new(0.0, 0.0, 128.0, 0.0), Scalar::new(255.0, 112.0, 255.0, 0.0));
        in_range(&self.chroma, &low, &high, &mut self.candidates)?;
        gaussian_blur(&self.candidates, &mut self.opened, Size::new(3, 3), 0.0, 0.0, BORDER_DEFAULT)?;
        threshold(&self.opened, &mut self.candidates, 127.0, 255.0, THRESH_BINARY)?;
        largest(&self.candidates, &mut self.contours, &mut self.hierarchy)
    }
}

fn largest(
    mask: &Mat,
    contours: &mut Vector<Vector<Point>>,
    hierarchy: &mut Vector<Vec4i>,
) -> Result<(usize, Vector<Point>)> {
    let offset = Point::new(0, 0);
    find_contours_with_hierarchy(mask, contours, hierarchy, RETR_CCOMP, CHAIN_APPROX_NONE, offset)?;
    let mut best = (0, 0.0);
    for index in 0..contours.len() {
        let area = contour_area_def(&contours.get(index)?)?;
        if area > best.1 {
            best = (index, area);
        }
    }
    Ok((best.0, contours.get(best.0)?))
}

impl Bare {
    pub fn new() -> Result<Self> {
        let square = |side| Size::new(side, side);
        Ok(Self {
            glance: Plane::default(),
            close: Plane::default(),
            mask: Mat::default(),
            distance: Mat::default(),
            hand: Vector::new(),
            grey: Mat::default(),
            small: Mat::default(),
            small_mask: Mat::default(),
            even: Mat::default(),
            crop: Mat::new_rows_cols_with_default(64, 64, CV_8U, Scalar::all(0.0))?,
            descriptor: HOGDescriptor::new_def(square(64), square(16), square(8), square(8), 9)?,
            values: Vector::new(),
        })
    }

    /// Finds the hand: coarse place, close view, palm, forearm cut off.
    pub fn hand(&mut self, bgr: &Mat) -> Result<()> {
        let (_, blob) = self.glance.largest(bgr, Size::new(160, 90))?;
        let near = bounding_rect(&blob)?;
        let grow = |start: i32, length: i32, limit: i32| {
            let first = ((start - length / 8) * 4).max(0);
            (first, (((start + length + length / 8) * 4).min(limit)) - first)
        };
        let ((x, width), (y, height)) =
            (grow(near.x, near.width, bgr.cols()), grow(near.y, near.height, bgr.rows()));
        let scale = 192.0 / f64::from(width.max(height));
        let size = Size::new((f64::from(width) * scale) as i32, (f64::from(height) * scale) as i32);
        let (index, _) = self.close.largest(&Mat::roi(bgr, Rect::new(x, y, width, height))?, size)?;
        self.mask = Mat::new_size_with_default(size, CV_8U, Scalar::all(0.0))?;
        self.fill(index)?;
        distance_transform_def(&self.mask, &mut self.distance, DIST_L2, 3)?;
        let (mut radius, mut palm) = (0.0, Point::default());
        min_max_loc(&self.distance, None, Some(&mut radius), None, Some(&mut palm), &no_array())?;
        let wrist = palm.y + (1.4 * radius) as i32;
        let forearm = [(0, wrist), (size.width, wrist), (size.width, 2 * size.height), (0, 2 * size.height)];
        let forearm: Vector<Point> = forearm.into_iter().map(|(x, y)| Point::new(x, y)).collect();
        fill_convex_poly_def(&mut self.mask, &forearm, Scalar::all(0.0))?;
        let index;
        (index, self.hand) = largest(&self.mask, &mut self.close.contours, &mut self.close.hierarchy)?;
        self.fill(index)
    }

    fn fill(&mut self, index: usize) -> Result<()> {
        let (contours, hierarchy) = (&self.close.contours, &self.close.hierarchy);
        let (white, nowhere) = (Scalar::all(255.0), Point::new(0, 0));
        draw_contours(&mut self.mask, contours, index as i32, white, FILLED, LINE_8, hierarchy, 1, nowhere)
    }

    /// Moments, Hu, hull, defects, perimeter, rectangle, circle, polygon.
    pub fn shape(&mut self) -> Result<()> {
        let hand = &self.hand;
        let of_pixels = moments(&Mat::roi(&self.mask, bounding_rect(hand)?)?, true)?;
        let mut hu = [0.0; 7];
        hu_moments(of_pixels, &mut hu)?;
        let (mut hull, mut corners) = (Vector::<i32>::new(), Vector::<Point>::new());
        convex_hull(hand, &mut hull, false, false)?;
        convex_hull(hand, &mut corners, false, true)?;
        let mut defects = Vector::<Vec4i>::new();
        convexity_defects(hand, &hull, &mut defects)?;
        let perimeter = arc_length(hand, true)?;
        let (mut centre, mut radius, mut polygon) = (Point2f::default(), 0.0, Vector::<Point>::new());
        min_enclosing_circle(hand, &mut centre, &mut radius)?;
        approx_poly_dp(hand, &mut polygon, 0.02 * perimeter, true)?;
        black_box((hu, defects, contour_area_def(&corners)?, arc_length(&corners, true)?, radius, polygon));
        black_box(min_area_rect(hand)?);
        Ok(())
    }

    /// The crop and its descriptor.
    pub fn hog(&mut self) -> Result<()> {
        let bounds = bounding_rect(&self.hand)?;
        let scale = 56.0 / f64::from(bounds.width.max(bounds.height));
        let scaled = |side: i32| ((f64::from(side) * scale) as i32).max(1);
        let size = Size::new(scaled(bounds.width), scaled(bounds.height));
        cvt_color_def(&Mat::roi(&self.close.image, bounds)?, &mut self.grey, COLOR_BGR2GRAY)?;
        resize(&self.grey, &mut self.small, size, 0.0, 0.0, INTER_AREA)?;
        resize(&Mat::roi(&self.mask, bounds)?, &mut self.small_mask, size, 0.0, 0.0, INTER_AREA)?;
        let (mut mean, mut deviation) = (Scalar::default(), Scalar::default());
        mean_std_dev_def(&self.small, &mut mean, &mut deviation)?;
        let gain = 40.0 / deviation[0].max(1.0);
        self.small.convert_to(&mut self.even, CV_8U, gain, 140.0 - gain * mean[0])?;
        self.crop.set_to(&Scalar::all(0.0), &no_array())?;
        let place = Rect::new((64 - size.width) / 2, (64 - size.height) / 2, size.width, size.height);
        multiply(&self.even, &self.small_mask, &mut Mat::roi_mut(&mut self.crop, place)?, 1.0 / 255.0, -1)?;
        let (no_stride, no_padding) = (Size::default(), Size::default());
        self.descriptor.compute(&self.crop, &mut self.values, no_stride, no_padding, &Vector::<Point>::new())
    }
}
