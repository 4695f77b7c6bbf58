//! From hand-coloured pixels to the hand: the best blob, its palm, its wrist, without the forearm.

use opencv::core::{
    CV_8U, Mat, MatTraitConst, Moments, Point, Point2f, Rect, Scalar, Size, Vec4i, Vector, min_max_loc,
    no_array,
};
use opencv::core::{MatTrait, MatTraitConstManual};
use opencv::imgproc::{
    CHAIN_APPROX_NONE, DIST_L2, FILLED, LINE_8, RETR_CCOMP, bounding_rect, contour_area_def,
    distance_transform_def, draw_contours, fill_convex_poly_def, find_contours_with_hierarchy, moments,
};

use super::{HandConfig, NoHand, NoObservation};

/// Black pixels around a mask, so that the frame's edge bounds a hand as background does.
pub const MARGIN: i32 = 1;
/// The forearm is cut off this many palm radii below the palm's centre.
const WRIST: f32 = 1.4;
/// A hole of a smaller share of the blob is noise and gets filled.
const SMALLEST_HOLE: f64 = 0.002;
/// More of the frame's edge than this is no hand's.
const LARGEST_EDGE: f32 = 0.4;
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

/// A hand on the canvas. Coordinates are those of the mask: canvas pixels plus [`MARGIN`], y downwards.
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
    /// Share of the frame that it covers, `0.0..=1.0`.
    pub share: f32,
    /// Share of the frame's edge that it covers, `0.0..=1.0`.
    pub edge: f32,
    /// [`HandConfig::minimum_area`].
    minimum_area: f32,
}

impl Hand<'_> {
    /// The right and up coordinates of a point from the palm's centre, in palm radii.
    pub fn axes(&self, point: Point2f) -> (f32, f32) {
        let from_palm = point - self.palm;
        let right = Point2f::new(-self.up.y, self.up.x);
        let along = |axis: Point2f| (from_palm.x * axis.x + from_palm.y * axis.y) / self.radius;
        (along(right), along(self.up))
    }

    /// How plausible the hand is, `0.0..=1.0`: it must stand out by `separation` standard deviations, be large enough
    /// to show its fingers, and not run along the frame's edge.
    pub fn quality(&self, separation: f32) -> f32 {
        let ramp = |value: f32, worst: f32, best: f32| ((value - worst) / (best - worst)).clamp(0.0, 1.0);
        let contrast = ramp(separation, 0.8, 2.0);
        let size = ramp(self.share, 0.0, 4.0 * self.minimum_area);
        let inside = ramp(self.edge, LARGEST_EDGE, LARGEST_EDGE / 2.0);
        contrast * size * inside
    }
}

/// A hole in a hand, such as thumb and finger form.
#[derive(Clone, Copy, Debug)]
pub struct Hole {
    /// Its area, pixels.
    pub area: f64,
    /// Its middle.
    pub centre: Point2f,
}

/// Finds the hand in a mask.
pub struct HandFinder {
    config: HandConfig,
    contours: Vector<Vector<Point>>,
    hierarchy: Vector<Vec4i>,
    contour: Vector<Point>,
    holes: Vec<Hole>,
    mask: Mat,
    distance: Mat,
}

impl HandFinder {
    pub fn new(config: HandConfig) -> Self {
        Self {
            config,
            contours: Vector::new(),
            hierarchy: Vector::new(),
            contour: Vector::new(),
            holes: Vec::new(),
            mask: Mat::default(),
            distance: Mat::default(),
        }
    }

    pub fn mask(&self) -> &Mat {
        &self.mask
    }

    /// The hand among the pixels (255) that have its colour.
    pub fn find(&mut self, candidates: &Mat) -> Result<Hand<'_>, NoObservation> {
        let frame = candidates.size()?;
        let pixels = frame.area() as f32;
        find_contours_with_hierarchy(
            candidates,
            &mut self.contours,
            &mut self.hierarchy,
            RETR_CCOMP,
            CHAIN_APPROX_NONE,
            Point::new(MARGIN, MARGIN),
        )?;
        self.keep_largest(frame)?;
        let share = contour_area_def(&self.contour)? as f32 / pixels;
        if share > self.config.maximum_area {
            return Err(NoHand::TooLarge { share }.into());
        }
        let edge = edge_share(self.contour.as_slice(), frame);
        if edge > LARGEST_EDGE {
            return Err(NoHand::AlongTheEdge { share: edge }.into());
        }
        let (palm, radius) = self.palm()?;
        let up = self.up(palm, radius)?;
        self.cut_forearm(palm, radius, up)?;
        let whole_mask = Point::new(0, 0);
        find_contours_with_hierarchy(
            &self.mask,
            &mut self.contours,
            &mut self.hierarchy,
            RETR_CCOMP,
            CHAIN_APPROX_NONE,
            whole_mask,
        )?;
        self.keep_largest(frame)?;
        let bounds = bounding_rect(&self.contour)?;
        let moments = moments(&Mat::roi(&self.mask, bounds)?, true)?;
        let share = moments.m00 as f32 / pixels;
        if share < self.config.minimum_area {
            return Err(NoHand::TooSmall { share }.into());
        }
        Ok(Hand {
            mask: &self.mask,
            contour: &self.contour,
            holes: &self.holes,
            bounds,
            moments,
            palm,
            radius,
            up,
            share,
            edge,
            minimum_area: self.config.minimum_area,
        })
    }

    /// Redraws the mask with the largest of the contours alone, and its holes that are no noise.
    fn keep_largest(&mut self, frame: Size) -> Result<(), NoObservation> {
        let mut largest = None;
        let mut largest_area = 0.0;
        for (index, links) in self.hierarchy.iter().enumerate() {
            let is_outer = links[3] < 0;
            if is_outer {
                let contour = self.contours.get(index)?;
                // A contour of n pixels cannot enclose more than (n / 4)² of them.
                let at_most = (contour.len() as f64 / 4.0).powi(2);
                if at_most > largest_area {
                    let area = contour_area_def(&contour)?;
                    if area > largest_area {
                        (largest, largest_area) = (Some((index, links[2], contour)), area);
                    }
                }
            }
        }
        let Some((index, mut child, contour)) = largest else {
            return Err(NoHand::TooSmall { share: 0.0 }.into());
        };
        let size = Size::new(frame.width + 2 * MARGIN, frame.height + 2 * MARGIN);
        if self.mask.size()? != size {
            self.mask = Mat::new_size_with_default(size, CV_8U, Scalar::all(0.0))?;
        } else {
            self.mask.set_to(&Scalar::all(0.0), &no_array())?;
        }
        // Outline and holes in one call: even and odd nesting leaves the holes black and the pixels around them whole.
        self.fill(index, i32::MAX)?;
        self.holes.clear();
        while let Ok(hole) = usize::try_from(child) {
            let outline = self.contours.get(hole)?;
            let area = contour_area_def(&outline)?;
            if area > SMALLEST_HOLE * largest_area {
                let sum = outline.iter().fold((0.0, 0.0), |(x, y), p| (x + p.x as f32, y + p.y as f32));
                let n = outline.len() as f32;
                self.holes.push(Hole { area, centre: Point2f::new(sum.0 / n, sum.1 / n) });
            } else {
                self.fill(hole, 0)?;
            }
            child = self.hierarchy.get(hole)?[0];
        }
        self.holes.sort_by(|a, b| b.area.total_cmp(&a.area));
        self.contour = contour;
        Ok(())
    }

    /// Fills a contour, leaving out the holes nested in it down to `levels`.
    fn fill(&mut self, contour: usize, levels: i32) -> Result<(), opencv::Error> {
        let (contours, hierarchy) = (&self.contours, &self.hierarchy);
        let (white, nowhere) = (Scalar::all(255.0), Point::new(0, 0));
        draw_contours(
            &mut self.mask,
            contours,
            contour as i32,
            white,
            FILLED,
            LINE_8,
            hierarchy,
            levels,
            nowhere,
        )
    }

    /// The largest circle within the blob: its centre and radius.
    fn palm(&mut self) -> Result<(Point2f, f32), opencv::Error> {
        let bounds = bounding_rect(&self.contour)?;
        let around = Rect::new(bounds.x - 1, bounds.y - 1, bounds.width + 2, bounds.height + 2);
        distance_transform_def(&Mat::roi(&self.mask, around)?, &mut self.distance, DIST_L2, 3)?;
        let (mut radius, mut centre) = (0.0, Point::default());
        min_max_loc(&self.distance, None, Some(&mut radius), None, Some(&mut centre), &no_array())?;
        Ok((Point2f::new((around.x + centre.x) as f32, (around.y + centre.y) as f32), radius as f32))
    }

    /// Which way the fingers are: opposite to the wrist. That is the arc in which the blob leaves a circle around the palm
    /// which is wide, rather below than above, and does not split into fingers further out. Straight up when the blob
    /// leaves the circle nowhere.
    fn up(&self, palm: Point2f, radius: f32) -> Result<Point2f, opencv::Error> {
        let near = arcs(&ring(&self.mask, palm, WRIST * radius, DIRECTIONS)?);
        let far = arcs(&ring(&self.mask, palm, FINGERS * radius, DIRECTIONS)?);
        let middle = |&(start, length): &(usize, usize)| start as f32 + (length - 1) as f32 / 2.0;
        let mut best = (0.0, Point2f::new(0.0, -1.0));
        for arc in &near {
            let (at, length) = (middle(arc), arc.1);
            let is_finger_of_it = |other: &&(usize, usize)| {
                let away = (middle(other) - at).rem_euclid(DIRECTIONS as f32);
                let away = away.min(DIRECTIONS as f32 - away);
                other.1 <= FINGER && away <= length as f32 / 2.0 + SPREAD
            };
            let fingers = far.iter().filter(is_finger_of_it).count();
            let (sin, cos) = (at * std::f32::consts::TAU / DIRECTIONS as f32).sin_cos();
            let score = length.min(WIDEST) as f32 * (1.0 + GRAVITY * sin) / (1 + fingers) as f32;
            if score > best.0 {
                best = (score, Point2f::new(-cos, -sin));
            }
        }
        Ok(best.1)
    }

    /// Blackens what lies further below the palm than the wrist.
    fn cut_forearm(&mut self, palm: Point2f, radius: f32, up: Point2f) -> Result<(), opencv::Error> {
        // Wide enough to leave the canvas on all sides.
        let far = (self.mask.cols() + self.mask.rows()) as f32;
        let wrist = palm - up * (WRIST * radius);
        let side = Point2f::new(-up.y, up.x) * far;
        let end = wrist - up * far;
        let corner = |p: Point2f| Point::new(p.x.round() as i32, p.y.round() as i32);
        let forearm = [wrist + side, wrist - side, end - side, end + side].map(corner);
        fill_convex_poly_def(&mut self.mask, &Vector::from_slice(&forearm), Scalar::all(0.0))
    }
}

/// Samples the mask on a circle, clockwise from the direction of x. Outside the frame it continues as at its edge: an arm
/// goes on there.
pub fn ring(mask: &Mat, centre: Point2f, radius: f32, samples: usize) -> Result<Vec<bool>, opencv::Error> {
    let (columns, rows) = (mask.cols(), mask.rows());
    let (right, bottom) = (columns - 1 - MARGIN, rows - 1 - MARGIN);
    let pixels = mask.data_bytes()?;
    let inside = |sample: usize| {
        let (sin, cos) = (sample as f32 * std::f32::consts::TAU / samples as f32).sin_cos();
        let x = (centre.x + cos * radius).round() as i32;
        let y = (centre.y + sin * radius).round() as i32;
        pixels[(y.clamp(MARGIN, bottom) * columns + x.clamp(MARGIN, right)) as usize] > 0
    };
    Ok((0..samples).map(inside).collect())
}

/// The runs of `true` around a circle, as (first index, length). None where all are alike: then nothing begins or ends.
pub fn arcs(ring: &[bool]) -> Vec<(usize, usize)> {
    let n = ring.len();
    let begins = |i: usize| ring[i] && !ring[(i + n - 1) % n];
    let length = |start: usize| (0..n).take_while(|step| ring[(start + step) % n]).count();
    (0..n).filter(|&i| begins(i)).map(|start| (start, length(start))).collect()
}

/// The share of the frame's edge that a contour lies on.
fn edge_share(contour: &[Point], frame: Size) -> f32 {
    let (right, bottom) = (frame.width - 1 + MARGIN, frame.height - 1 + MARGIN);
    let on_edge = |p: &&Point| p.x == MARGIN || p.y == MARGIN || p.x == right || p.y == bottom;
    contour.iter().filter(on_edge).count() as f32 / (2 * (frame.width + frame.height)) as f32
}
