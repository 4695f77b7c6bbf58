//! Skin, cloth, limbs, and surfaces of rooms that nobody has seen.

use rand::{Rng, RngExt};

use crate::chance::{normal, uniform};
use crate::image::Canvas;

/// Skin from dark to fair: blue, green, red.
const SKIN: [[f32; 3]; 10] = [
    [60.0, 85.0, 130.0],
    [40.0, 60.0, 100.0],
    [25.0, 40.0, 70.0],
    [90.0, 120.0, 175.0],
    [120.0, 150.0, 205.0],
    [150.0, 180.0, 235.0],
    [110.0, 135.0, 190.0],
    [75.0, 105.0, 160.0],
    [130.0, 165.0, 225.0],
    [180.0, 200.0, 240.0],
];

pub fn skin(rng: &mut impl Rng) -> [f32; 3] {
    let tone = SKIN[rng.random_range(0..SKIN.len())];
    let light = (0.25 * normal(rng)).exp();
    tone.map(|channel| channel * light * (0.06 * normal(rng)).exp())
}

pub fn cloth(rng: &mut impl Rng) -> [f32; 3] {
    let base = uniform(rng, 0.0, 160.0);
    std::array::from_fn(|_| uniform(rng, 0.0, 230.0) * 0.4 + base)
}

/// Smooth noise of unit variance: `cells` of it side by side.
pub fn smooth_noise(
    rng: &mut impl Rng,
    width: usize,
    height: usize,
    cells: usize,
    channels: usize,
) -> Canvas {
    let grid: Vec<f32> = (0..cells * cells * channels).map(|_| normal(rng)).collect();
    let mut canvas = Canvas::new(width, height, channels);
    let last = cells - 1;
    // Between which two cells a pixel lies, and how far from the first.
    let between = |at: usize, size: usize| {
        let g = ((at as f32 + 0.5) / size as f32 * cells as f32 - 0.5).clamp(0.0, last as f32);
        (g as usize, (g as usize + 1).min(last), g.fract())
    };
    let across: Vec<_> = (0..width).map(|x| between(x, width)).collect();
    let mut row = vec![0.0; cells * channels];
    for (y, out) in canvas.values.chunks_exact_mut(width * channels).enumerate() {
        let (above, below, share) = between(y, height);
        let line = |y: usize| &grid[y * cells * channels..][..cells * channels];
        for (value, (a, b)) in row.iter_mut().zip(line(above).iter().zip(line(below))) {
            *value = a * (1.0 - share) + b * share;
        }
        for (out, (left, right, share)) in out.chunks_exact_mut(channels).zip(&across) {
            for (c, out) in out.iter_mut().enumerate() {
                *out = row[left * channels + c] * (1.0 - share) + row[right * channels + c] * share;
            }
        }
    }
    canvas
}

/// A limb or a stick: a capsule from one point to another.
pub fn limb(
    canvas: &mut Canvas,
    from: (f32, f32),
    to: (f32, f32),
    radii: (f32, f32),
    colour: [f32; 3],
    rng: &mut impl Rng,
) {
    let (w, h) = (canvas.width, canvas.height);
    let rough = uniform(rng, 0.0, 0.2);
    let (slow, fast) = (smooth_noise(rng, w, h, 3, 1), smooth_noise(rng, w, h, 20, 1));
    let d = (to.0 - from.0, to.1 - from.1);
    let squared = (d.0 * d.0 + d.1 * d.1).max(1e-3);
    for y in 0..h {
        for x in 0..w {
            let p = (x as f32 - from.0, y as f32 - from.1);
            let t = ((p.0 * d.0 + p.1 * d.1) / squared).clamp(0.0, 1.0);
            let away = (p.0 - t * d.0).hypot(p.1 - t * d.1);
            let cover = (radii.0 + t * (radii.1 - radii.0) + 0.5 - away).clamp(0.0, 1.0);
            if cover > 0.0 {
                let i = y * w + x;
                let shade = 1.0 + 0.12 * slow.values[i] + rough * fast.values[i];
                for (value, colour) in canvas.pixel(i).iter_mut().zip(colour) {
                    *value += cover * ((colour * shade).clamp(0.0, 255.0) - *value);
                }
            }
        }
    }
}

/// An invented surface: stripes, blotches, grain, and polygons on it.
pub fn texture(rng: &mut impl Rng, w: usize, h: usize) -> Canvas {
    let kind: f32 = rng.random();
    let bright = uniform(rng, 10.0, 240.0);
    let base: [f32; 3] = std::array::from_fn(|_| bright * (1.0 + 0.15 * normal(rng)).clamp(0.5, 1.5));
    let (tint, light) = (smooth_noise(rng, w, h, 3, 3), smooth_noise(rng, w, h, 3, 1));
    let (tinted, lit) = (uniform(rng, 3.0, 25.0), uniform(rng, 3.0, 40.0));
    let cells = rng.random_range(6..30);
    let (fine, strength) = (smooth_noise(rng, w, h, cells, 1), uniform(rng, 3.0, 40.0));
    let (angle, pitch, phase) =
        (uniform(rng, 0.0, std::f32::consts::PI), uniform(rng, 0.1, 1.2), uniform(rng, 0.0, 6.0));
    let (edge, stripe): (f32, [f32; 3]) =
        (uniform(rng, -0.5, 0.9), std::array::from_fn(|_| 40.0 * normal(rng)));
    let grain = uniform(rng, 5.0, 40.0);
    let mut canvas = Canvas::new(w, h, 3);
    for i in 0..w * h {
        let mut add = lit * light.values[i];
        if kind < 0.4 {
            add += strength * fine.values[i];
        } else if (0.6..0.7).contains(&kind) {
            add += grain * normal(rng);
        }
        let (x, y) = ((i % w) as f32, (i / w) as f32);
        let striped =
            (0.4..0.6).contains(&kind) && ((x * angle.cos() + y * angle.sin()) * pitch + phase).sin() > edge;
        for c in 0..3 {
            let more = if striped { stripe[c] } else { 0.0 };
            canvas.values[3 * i + c] = base[c] + tinted * tint.values[3 * i + c] + add + more;
        }
    }
    for _ in 0..rng.random_range(0..5) {
        let at = |rng: &mut _| (uniform(rng, -20.0, w as f32 + 20.0), uniform(rng, -20.0, h as f32 + 20.0));
        let (a, b, c) = (at(rng), at(rng), at(rng));
        let colour: [f32; 3] = std::array::from_fn(|_| uniform(rng, 0.0, 255.0));
        triangle(&mut canvas, [a, b, c], colour);
    }
    canvas.values.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
    canvas
}

fn triangle(canvas: &mut Canvas, corners: [(f32, f32); 3], colour: [f32; 3]) {
    let side =
        |a: (f32, f32), b: (f32, f32), p: (f32, f32)| (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0);
    for i in 0..canvas.width * canvas.height {
        let p = ((i % canvas.width) as f32, (i / canvas.width) as f32);
        let s = [0, 1, 2].map(|k| side(corners[k], corners[(k + 1) % 3], p) > 0.0);
        if s[0] == s[1] && s[1] == s[2] {
            canvas.pixel(i).copy_from_slice(&colour);
        }
    }
}
