//! From a blob of the hand's colour to the hand: its place, its palm, its wrist, without the forearm.

use opencv::core::{
    Mat, MatTraitConst, Moments, Point, Point2f, Rect, Scalar, Size, Vector, min_max_loc, no_array,
};
use opencv::imgproc::{DIST_L2, bounding_rect, distance_transform_def, fill_convex_poly_def, moments};

use super::blob::{BlobFinder, Hole, MARGIN};
use super::frame::View;
use super::ring::{Arc, arcs, ring};
use super::{HandConfig, NoHand, NoObservation};

/// The forearm is cut off this many palm radii below the palm's centre.
const WRIST: f32 = 1.4;
/// Fingers are told apart this many palm radii from the palm's centre.
const FINGERS: f32 = 2.0;
/// Directions in which the wrist is sought: one every 4 degrees.
const DIRECTIONS: usize = 90;
/// An arc of more directions is as wide as a wrist can be.
const WIDEST: usize = 18;
/// The widest arc of a finger, in directions.
const FINGER: usize = 7;
/// How far beside its root a finger may end, in directions.
const SPREAD: f32 = 4.0;
/// How much likelier a wrist is below the palm than beside it.
const GRAVITY: f32 = 0.8;
/// More of the frame's edge than this is no hand's.
const LARGEST_EDGE: f32 = 0.4;
/// Less of the frame than this is a speck at a glance, whatever its pixels.
const SMALLEST_SHARE: f32 = 0.0006;
/// Room around the hand in the close view, as a share of its longer side, on each side.
const ROOM: f32 = 0.12;

/// A hand. Coordinates are those of the mask: pixels of the close view plus [`MARGIN`], y downwards.
pub struct Hand<'a> {
    /// Its pixels, 255; all others 0.
    pub mask: &'a Mat,
    /// Its outline, every pixel.
    pub contour: &'a Vector<Point>,
    /// Its holes, largest first.
    pub holes: &'a [Hole],
    /// The smallest upright rectangle around it.
    pub bounds: Rect,
    /// Moments of its pixels, relative to the corner of `bounds`.
    pub moments: Moments,
    /// Centre of the largest circle within it.
    pub palm: Point2f,
    /// Radius of that circle, pixels.
    pub radius: f32,
    /// Unit vector from the wrist to the fingers.
    pub up: Point2f,
    /// How plausible its size and place in the frame are, `0.0..=1.0`.
    pub plausibility: f32,
}

impl Hand<'_> {
    /// The mean of its pixels.
    pub fn centroid(&self) -> Point2f {
        let mean = |first: f64| (first / self.moments.m00.max(1.0)) as f32;
        let corner = Point2f::new(self.bounds.x as f32, self.bounds.y as f32);
        corner + Point2f::new(mean(self.moments.m10), mean(self.moments.m01))
    }

    /// The right and up coordinates of a point from the palm's centre, in palm radii.
    pub fn axes(&self, point: Point2f) -> (f32, f32) {
        let from_palm = point - self.palm;
        let right = Point2f::new(-self.up.y, self.up.x);
        let along = |axis: Point2f| (from_palm.x * axis.x + from_palm.y * axis.y) / self.radius;
        (along(right), along(self.up))
    }
}

/// Finds the hand among the pixels that have its colour.
pub struct HandFinder {
    config: HandConfig,
    blobs: BlobFinder,
    mask: Mat,
    contour: Vector<Point>,
    holes: Vec<Hole>,
    distance: Mat,
    plausibility: f32,
}

impl HandFinder {
    pub fn new(config: HandConfig) -> Self {
        Self {
            config,
            blobs: BlobFinder::default(),
            mask: Mat::default(),
            contour: Vector::new(),
            holes: Vec::new(),
            distance: Mat::default(),
            plausibility: 0.0,
        }
    }

    pub fn mask(&self) -> &Mat {
        &self.mask
    }

    /// Where the hand is: the region of the frame around the largest blob seen at a glance, with room on each
    /// side.
    pub fn locate(&mut self, glance: &View) -> Result<Rect, NoObservation> {
        let size = glance.mask.size()?;
        let blob = self.blobs.largest(&glance.mask, 0)?.ok_or(NoHand::TooSmall { share: 0.0 })?;
        let share = blob.area as f32 / size.area() as f32;
        let edge = edge_share(blob.contour.as_slice(), size);
        let pixels = share * glance.frame.area() as f32;
        if pixels < self.config.minimum_pixels || share < SMALLEST_SHARE {
            return Err(NoHand::TooSmall { share }.into());
        }
        if share > self.config.maximum_area {
            return Err(NoHand::TooLarge { share }.into());
        }
        if edge > LARGEST_EDGE {
            return Err(NoHand::AlongTheEdge { share: edge }.into());
        }
        // Full marks for a hand four times as large as the smallest, and for half of the edge that is allowed.
        let large_enough = (pixels / (4.0 * self.config.minimum_pixels)).min(1.0);
        let inside = (2.0 - 2.0 * edge / LARGEST_EDGE).min(1.0);
        self.plausibility = large_enough * inside;

        let bounds = bounding_rect(&blob.contour)?;
        let room = ROOM * bounds.width.max(bounds.height) as f32 + 2.0;
        let span = |start: i32, length: i32, limit: i32| {
            let first = ((start as f32 - room) / glance.scale()).max(0.0) as i32;
            let end = ((start + length) as f32 + room) / glance.scale();
            (first, (end.ceil() as i32).min(limit) - first)
        };
        let (x, width) = span(bounds.x, bounds.width, glance.frame.width);
        let (y, height) = span(bounds.y, bounds.height, glance.frame.height);
        Ok(Rect::new(x, y, width, height))
    }

    /// The hand in the close view of the region that [`Self::locate`] found.
    pub fn find(&mut self, close: &View) -> Result<Hand<'_>, NoObservation> {
        let nothing = NoHand::TooSmall { share: 0.0 };
        let view = close.mask.size()?;
        let size = Size::new(view.width + 2 * MARGIN, view.height + 2 * MARGIN);
        let arm = self.blobs.largest(&close.mask, MARGIN)?.ok_or(nothing)?;
        self.blobs.draw(&arm, size, &mut self.mask, &mut self.holes, close.patchy)?;
        let (palm, radius) = self.palm(&arm.contour)?;
        let up = match from_edge(&arm.contour, close, palm, radius) {
            Some(up) => up,
            None => self.up(palm, radius)?,
        };
        self.cut_forearm(palm, radius, up)?;

        let hand = self.blobs.largest(&self.mask, 0)?.ok_or(nothing)?;
        self.blobs.draw(&hand, size, &mut self.mask, &mut self.holes, close.patchy)?;
        self.contour = hand.contour;
        let bounds = bounding_rect(&self.contour)?;
        let moments = moments(&Mat::roi(&self.mask, bounds)?, true)?;
        Ok(Hand {
            mask: &self.mask,
            contour: &self.contour,
            holes: &self.holes,
            bounds,
            moments,
            palm,
            radius,
            up,
            plausibility: self.plausibility,
        })
    }

    /// The largest circle within the blob drawn: its centre and radius.
    fn palm(&mut self, contour: &Vector<Point>) -> Result<(Point2f, f32), opencv::Error> {
        let bounds = bounding_rect(contour)?;
        let around = Rect::new(bounds.x - 1, bounds.y - 1, bounds.width + 2, bounds.height + 2);
        distance_transform_def(&Mat::roi(&self.mask, around)?, &mut self.distance, DIST_L2, 3)?;
        let (mut radius, mut centre) = (0.0, Point::default());
        min_max_loc(&self.distance, None, Some(&mut radius), None, Some(&mut centre), &no_array())?;
        Ok((Point2f::new((around.x + centre.x) as f32, (around.y + centre.y) as f32), radius as f32))
    }

    /// Which way the fingers are: opposite to the wrist, within the view. The wrist is the arc in which the
    /// blob leaves a circle around the palm which is wide, rather below than above, and does not split into
    /// fingers further out. Straight up when the blob leaves the circle nowhere.
    fn up(&self, palm: Point2f, radius: f32) -> Result<Point2f, opencv::Error> {
        let around = |palm_radii: f32| ring(&self.mask, palm, palm_radii * radius, DIRECTIONS);
        let (near, far) = (arcs(&around(WRIST)?), arcs(&around(FINGERS)?));
        let mut best = (0.0, Point2f::new(0.0, -1.0));
        for arc in near {
            let is_finger_of_it = |other: &&Arc| {
                let turn = (other.middle() - arc.middle()).rem_euclid(DIRECTIONS as f32);
                let away = turn.min(DIRECTIONS as f32 - turn);
                other.length <= FINGER && away <= arc.length as f32 / 2.0 + SPREAD
            };
            let fingers = far.iter().filter(is_finger_of_it).count();
            let (sin, cos) = (arc.middle() * std::f32::consts::TAU / DIRECTIONS as f32).sin_cos();
            let score = arc.length.min(WIDEST) as f32 * (1.0 + GRAVITY * sin) / (1 + fingers) as f32;
            if score > best.0 {
                best = (score, Point2f::new(-cos, -sin));
            }
        }
        Ok(best.1)
    }

    /// Blackens what lies further below the palm than the wrist.
    fn cut_forearm(&mut self, palm: Point2f, radius: f32, up: Point2f) -> Result<(), opencv::Error> {
        // Wide enough to leave the mask on all sides.
        let far = (self.mask.cols() + self.mask.rows()) as f32;
        let wrist = palm - up * (WRIST * radius);
        let side = Point2f::new(-up.y, up.x) * far;
        let end = wrist - up * far;
        let corner = |p: Point2f| Point::new(p.x.round() as i32, p.y.round() as i32);
        let forearm = [wrist + side, wrist - side, end - side, end + side].map(corner);
        fill_convex_poly_def(&mut self.mask, &Vector::from_slice(&forearm), Scalar::all(0.0))
    }
}

/// Which way the fingers are when the blob covers as much of the frame's edge as a wrist would: away from
/// there, since the arm comes in there.
fn from_edge(contour: &Vector<Point>, close: &View, palm: Point2f, radius: f32) -> Option<Point2f> {
    let (region, frame) = (close.region, close.frame);
    let (right, bottom) = (close.mask.cols() - 1 + MARGIN, close.mask.rows() - 1 + MARGIN);
    let on_edge = |p: &Point| {
        (p.x == MARGIN && region.x == 0)
            || (p.y == MARGIN && region.y == 0)
            || (p.x == right && region.x + region.width == frame.width)
            || (p.y == bottom && region.y + region.height == frame.height)
    };
    let (mut count, mut sum) = (0.0, Point2f::default());
    for point in contour.iter().filter(on_edge) {
        count += 1.0;
        sum += Point2f::new(point.x as f32, point.y as f32);
    }
    if count < radius {
        return None;
    }
    let up = palm - sum * (1.0 / count);
    let length = up.x.hypot(up.y);
    // An arm that comes in on all sides comes from nowhere.
    (length > radius / 2.0).then(|| up * (1.0 / length))
}

/// The share of the frame's edge that a contour lies on.
fn edge_share(contour: &[Point], frame: Size) -> f32 {
    let on_edge = |p: &&Point| p.x == 0 || p.y == 0 || p.x == frame.width - 1 || p.y == frame.height - 1;
    contour.iter().filter(on_edge).count() as f32 / (2 * (frame.width + frame.height)) as f32
}
