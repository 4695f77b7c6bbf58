//! Draws capsules into an image: projected, shaded, with a depth buffer and anti-aliased edges.

use nalgebra::Vector3;
use opencv::core::{Mat, Vec3b};
use opencv::prelude::*;

use super::Pinhole;
use super::hand::Capsule;

/// How the scene is lit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Towards the light, of length 1, in the hand's space.
    pub towards: Vector3<f32>,
    /// Brightness of what the light does not reach, `0.0..=1.0`.
    pub ambient: f32,
    /// Its colour: factors on blue, green, red.
    pub tint: [f32; 3],
}

/// Draws with a depth buffer that is kept from frame to frame.
#[derive(Default)]
pub(super) struct Rasterizer {
    depth: Vec<f32>,
}

/// A capsule in the image: all lengths in pixels, depths in metres.
struct Stroke {
    x: f32,
    y: f32,
    depth: f32,
    radius: f32,
    /// From the first end to the second.
    along: (f32, f32),
    depth_gain: f32,
    radius_gain: f32,
    px_per_m: f32,
    colour: [f32; 3],
}

impl Rasterizer {
    /// Draws the capsules over `image` (BGR, 8 bits), as the camera sees them in that light.
    ///
    /// # Errors
    /// When the image is of another type.
    pub fn draw(
        &mut self,
        image: &mut Mat,
        capsules: &[Capsule],
        pinhole: &Pinhole,
        light: &Light,
    ) -> opencv::Result<()> {
        let (width, height) = (image.cols() as usize, image.rows() as usize);
        self.depth.clear();
        self.depth.resize(width * height, f32::INFINITY);
        let towards_light = pinhole.direction(&light.towards);
        let mut strokes: Vec<Stroke> =
            capsules.iter().map(|capsule| stroke(capsule, pinhole, light)).collect();
        // Far ones first, so that soft edges blend with what really lies behind them.
        strokes.sort_by(|a, b| (b.depth + b.depth_gain / 2.0).total_cmp(&(a.depth + a.depth_gain / 2.0)));
        let pixels = image.data_typed_mut::<Vec3b>()?;
        for stroke in &strokes {
            fill(stroke, pixels, &mut self.depth, (width, height), &towards_light, light.ambient);
        }
        Ok(())
    }
}

fn stroke(capsule: &Capsule, pinhole: &Pinhole, light: &Light) -> Stroke {
    let (from, to) = (pinhole.project(&capsule.from), pinhole.project(&capsule.to));
    let px_per_m = pinhole.scale_px_per_m(from.depth);
    let radius = capsule.from_radius * px_per_m;
    Stroke {
        x: from.x,
        y: from.y,
        depth: from.depth,
        radius,
        along: (to.x - from.x, to.y - from.y),
        depth_gain: to.depth - from.depth,
        radius_gain: capsule.to_radius * pinhole.scale_px_per_m(to.depth) - radius,
        px_per_m,
        colour: std::array::from_fn(|channel| capsule.colour[channel] * light.tint[channel]),
    }
}

fn fill(
    stroke: &Stroke,
    pixels: &mut [Vec3b],
    depths: &mut [f32],
    (width, height): (usize, usize),
    towards_light: &Vector3<f32>,
    ambient: f32,
) {
    let reach = stroke.radius.max(stroke.radius + stroke.radius_gain) + 1.0;
    let span = |start: f32, along: f32, size: usize| {
        // A negative or huge float saturates as it becomes an integer.
        let low = (start + along.min(0.0) - reach).floor() as usize;
        let high = (start + along.max(0.0) + reach).ceil() as usize;
        low.min(size)..high.saturating_add(1).min(size)
    };
    let (columns, rows) = (span(stroke.x, stroke.along.0, width), span(stroke.y, stroke.along.1, height));
    let (ax, ay) = stroke.along;
    let inverse_length = 1.0 / (ax * ax + ay * ay).max(1e-3);
    let metres_per_px = 1.0 / stroke.px_per_m;
    for y in rows {
        let dy = y as f32 + 0.5 - stroke.y;
        let start = y * width + columns.start;
        let end = y * width + columns.end;
        let mut dx = columns.start as f32 + 0.5 - stroke.x;
        for (pixel, nearest) in pixels[start..end].iter_mut().zip(&mut depths[start..end]) {
            let t = ((dx * ax + dy * ay) * inverse_length).clamp(0.0, 1.0);
            let (lx, ly) = (dx - t * ax, dy - t * ay);
            dx += 1.0;
            let radius = stroke.radius + t * stroke.radius_gain;
            let squared = lx * lx + ly * ly;
            let outer = radius + 0.5;
            if squared >= outer * outer {
                continue;
            }
            let inside = (radius * radius - squared).max(0.0).sqrt();
            let depth = stroke.depth + t * stroke.depth_gain - inside * metres_per_px;
            if depth >= *nearest {
                continue;
            }
            let coverage = (outer - squared.sqrt()).min(1.0);
            if coverage > 0.5 {
                *nearest = depth;
            }
            // The surface faces sideways by (lx, ly) and towards the camera by what is left of the radius.
            let facing = inside / radius;
            let lit = (lx * towards_light.x + ly * towards_light.y) / radius + facing * towards_light.z;
            // Edges that face away darken: it keeps touching fingers apart, as the shadow between them does.
            let shade = (ambient + (1.0 - ambient) * lit.max(0.0)) * (0.62 + 0.38 * facing);
            for (value, colour) in pixel.iter_mut().zip(stroke.colour) {
                let old = f32::from(*value);
                *value = (old + coverage * (colour * shade - old) + 0.5) as u8;
            }
        }
    }
}
