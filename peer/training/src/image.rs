//! Pictures as plain numbers, and what is done to them geometrically.
//!
//! Pixel centres have whole coordinates, as in OpenCV; channels lie beside each other (blue, green, red).

/// A picture of 8 bits with its halvings, so that it can be shrunk without aliasing.
#[derive(Clone, Debug)]
pub struct Pyramid {
    levels: Vec<Level>,
    pub channels: usize,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    values: Vec<u8>,
}

/// What lies outside of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outside {
    Nearest,
    Mirrored,
    Zero,
}

impl Pyramid {
    pub fn new(width: usize, height: usize, channels: usize, values: Vec<u8>) -> Self {
        assert_eq!(values.len(), width * height * channels);
        let mut levels = vec![Level { width, height, values }];
        for _ in 0..4 {
            let last = levels.last().expect("there is one");
            if last.width < 4 || last.height < 4 {
                break;
            }
            levels.push(last.half(channels));
        }
        Self { levels, channels }
    }

    pub fn width(&self) -> usize {
        self.levels[0].width
    }

    pub fn height(&self) -> usize {
        self.levels[0].height
    }

    pub fn pixels(&self) -> &[u8] {
        &self.levels[0].values
    }

    /// The picture as `map` places it on a canvas of that size.
    pub fn warp(&self, map: &Affine, width: usize, height: usize, outside: Outside) -> Canvas {
        let shrink = 1.0 / map.scale().max(1e-3);
        let level = ((shrink.log2() + 0.35).floor().max(0.0) as usize).min(self.levels.len() - 1);
        let source = &self.levels[level];
        let (kx, ky) = (
            self.levels[0].width as f32 / source.width as f32,
            self.levels[0].height as f32 / source.height as f32,
        );
        let back = map.inverse();
        let mut canvas = Canvas::new(width, height, self.channels);
        for y in 0..height {
            for x in 0..width {
                let (sx, sy) = back.apply(x as f32, y as f32);
                let (sx, sy) = ((sx - (kx - 1.0) / 2.0) / kx, (sy - (ky - 1.0) / 2.0) / ky);
                let at = (y * width + x) * self.channels;
                source.sample(sx, sy, outside, &mut canvas.values[at..at + self.channels]);
            }
        }
        canvas
    }
}

impl Level {
    fn half(&self, channels: usize) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height * channels);
        for y in 0..height {
            for x in 0..width {
                for c in 0..channels {
                    let at = |dx: usize, dy: usize| {
                        u32::from(self.values[((2 * y + dy) * self.width + 2 * x + dx) * channels + c])
                    };
                    values.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
                }
            }
        }
        Self { width, height, values }
    }

    /// Between a pixel and those right of it and below.
    fn between<const C: usize>(&self, at: usize, fx: f32, fy: f32) -> [f32; C] {
        let row = self.width * C;
        let upper = &self.values[at * C..][..row + 2 * C];
        std::array::from_fn(|c| {
            let value = |i: usize| f32::from(upper[i + c]);
            let (above, below) =
                (value(0) + fx * (value(C) - value(0)), value(row) + fx * (value(row + C) - value(row)));
            above + fy * (below - above)
        })
    }

    fn sample(&self, x: f32, y: f32, outside: Outside, out: &mut [f32]) {
        let (w, h) = (self.width as i64, self.height as i64);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i64, y0 as i64);
        // All four within: no need to look at each, which is most of the time that pictures take.
        if x0 >= 0 && y0 >= 0 && x0 + 1 < w && y0 + 1 < h {
            let at = (y0 * w + x0) as usize;
            match out {
                [one] => [*one] = self.between::<1>(at, fx, fy),
                [b, g, r] => [*b, *g, *r] = self.between::<3>(at, fx, fy),
                _ => unreachable!("pictures have one channel or three"),
            }
            return;
        }
        out.fill(0.0);
        for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
            for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
                let weight = wx * wy;
                if weight == 0.0 {
                    continue;
                }
                let (mut px, mut py) = (x0 + dx, y0 + dy);
                match outside {
                    Outside::Zero if px < 0 || py < 0 || px >= w || py >= h => continue,
                    Outside::Mirrored => {
                        px = mirrored(px, w);
                        py = mirrored(py, h);
                    }
                    _ => {
                        px = px.clamp(0, w - 1);
                        py = py.clamp(0, h - 1);
                    }
                }
                let at = (py * w + px) as usize * out.len();
                for (value, source) in out.iter_mut().zip(&self.values[at..]) {
                    *value += weight * f32::from(*source);
                }
            }
        }
    }
}

fn mirrored(at: i64, size: i64) -> i64 {
    let around = at.rem_euclid(2 * size);
    if around < size { around } else { 2 * size - 1 - around }
}

/// Across and down: the wrist, and four joints of each finger from its root to its tip, thumb first.
pub type Joints = [(f32, f32); 21];

/// `out = m · in + t`.
#[derive(Clone, Copy, Debug)]
pub struct Affine {
    pub m: [[f32; 2]; 2],
    pub t: [f32; 2],
}

impl Affine {
    /// Takes `from` to `to`, turned by `angle`, larger by `scale`; `mirror` is 1 or -1, `aspect` stretches across.
    pub fn similar(
        from: (f32, f32),
        to: (f32, f32),
        angle: f32,
        scale: f32,
        mirror: f32,
        aspect: f32,
    ) -> Self {
        let (s, c) = angle.sin_cos();
        let (s, c) = (s * scale, c * scale);
        let m = [[c * mirror * aspect, -s], [s * mirror * aspect, c]];
        let t = [to.0 - m[0][0] * from.0 - m[0][1] * from.1, to.1 - m[1][0] * from.0 - m[1][1] * from.1];
        Self { m, t }
    }

    pub fn apply(&self, x: f32, y: f32) -> (f32, f32) {
        (self.m[0][0] * x + self.m[0][1] * y + self.t[0], self.m[1][0] * x + self.m[1][1] * y + self.t[1])
    }

    /// The same of joints.
    pub fn joints(&self, joints: &Joints) -> Joints {
        joints.map(|(x, y)| self.apply(x, y))
    }

    pub fn determinant(&self) -> f32 {
        self.m[0][0] * self.m[1][1] - self.m[0][1] * self.m[1][0]
    }

    pub fn scale(&self) -> f32 {
        self.determinant().abs().sqrt()
    }

    pub fn inverse(&self) -> Self {
        let d = self.determinant();
        let m = [[self.m[1][1] / d, -self.m[0][1] / d], [-self.m[1][0] / d, self.m[0][0] / d]];
        let t = [-(m[0][0] * self.t[0] + m[0][1] * self.t[1]), -(m[1][0] * self.t[0] + m[1][1] * self.t[1])];
        Self { m, t }
    }
}

/// Adds so much of each value.
fn add(to: &mut [f32], from: &[f32], weight: f32) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += weight * from);
}

/// A picture being made.
#[derive(Clone, Debug)]
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub values: Vec<f32>,
}

impl Canvas {
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, values: vec![0.0; width * height * channels] }
    }

    pub fn pixel(&mut self, i: usize) -> &mut [f32] {
        &mut self.values[i * self.channels..(i + 1) * self.channels]
    }

    /// Lays `over` on it, as far as `share` (one channel, `0.0..=1.0`) says.
    pub fn blend(&mut self, over: &Self, share: &[f32]) {
        for (i, &a) in share.iter().enumerate() {
            if a > 0.0 {
                let at = i * self.channels;
                for c in 0..self.channels {
                    self.values[at + c] += a * (over.values[at + c] - self.values[at + c]);
                }
            }
        }
    }

    /// Smoothed by a separable kernel, its middle one in the middle; the outermost pixels go on outside.
    pub fn smoothed(&self, kernel: &[f32]) -> Self {
        let (reach, c, row) = (kernel.len() / 2, self.channels, self.width * self.channels);
        let mut across = Self::new(self.width, self.height, c);
        let mut wide = vec![0.0; row + 2 * reach * c];
        for (out, line) in across.values.chunks_exact_mut(row).zip(self.values.chunks_exact(row)) {
            wide[reach * c..][..row].copy_from_slice(line);
            for k in 0..reach {
                wide[k * c..][..c].copy_from_slice(&line[..c]);
                wide[reach * c + row + k * c..][..c].copy_from_slice(&line[row - c..]);
            }
            for (k, weight) in kernel.iter().enumerate() {
                add(out, &wide[k * c..], *weight);
            }
        }
        let mut out = Self::new(self.width, self.height, c);
        for (y, to) in out.values.chunks_exact_mut(row).enumerate() {
            for (k, weight) in kernel.iter().enumerate() {
                let from = (y + k).saturating_sub(reach).min(self.height - 1);
                add(to, &across.values[from * row..], *weight);
            }
        }
        out
    }

    pub fn blurred(&self, sigma: f32) -> Self {
        let reach = (2.5 * sigma).ceil() as i32;
        let mut kernel: Vec<f32> =
            (-reach..=reach).map(|x| (-(x as f32).powi(2) / (2.0 * sigma * sigma)).exp()).collect();
        let sum: f32 = kernel.iter().sum();
        kernel.iter_mut().for_each(|k| *k /= sum);
        self.smoothed(&kernel)
    }

    /// Shrunk to the means of its blocks, and enlarged again: what a coarser camera saw.
    pub fn coarse(&self, factor: f32) -> Self {
        let pyramid = self.to_pyramid();
        let (w, h) = ((self.width as f32 / factor).max(2.0), (self.height as f32 / factor).max(2.0));
        let (w, h) = (w as usize, h as usize);
        let scale = w as f32 / self.width as f32;
        let map = Affine { m: [[scale, 0.0], [0.0, scale]], t: [(scale - 1.0) / 2.0; 2] };
        let small = pyramid.warp(&map, w, h, Outside::Nearest).to_pyramid();
        small.warp(&map.inverse(), self.width, self.height, Outside::Nearest)
    }

    pub fn to_bytes(&self) -> Vec<u8> {
        self.values.iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect()
    }

    pub fn to_pyramid(&self) -> Pyramid {
        Pyramid::new(self.width, self.height, self.channels, self.to_bytes())
    }
}
