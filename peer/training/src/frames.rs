//! Whole frames for the finder, and crops for the refiner.

use std::f32::consts::PI;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::camera::expose;
use crate::chance::{normal, uniform};
use crate::image::{Affine, Canvas, Joints, Outside};
use crate::places::{COVERED, CROP, MASK, Place, ROOM, onto_crop, scaled};
use crate::scenery::{Scenery, covered, onto, real};

/// The finder's frame and its maps.
pub const WIDTH: usize = 160;
pub const HEIGHT: usize = 120;
pub const CELLS: (usize, usize) = (40, 30);
/// Two hands of each tenth frame are all.
pub const MOST: usize = 2;

/// Shares of frames that are real pictures as they are: without a hand, and with one. The others are composed.
const NOTHING: f32 = 0.13;
const REAL: f32 = 0.4;

/// One frame, where its hands are, and which share of each cell is hand.
pub struct Frame {
    pub picture: Vec<u8>,
    pub hands: Vec<Place>,
    pub mask: Vec<u8>,
}

/// One crop: whether a hand is in its middle, where exactly, and its pixels.
pub struct Crop {
    pub picture: Vec<u8>,
    pub mask: Vec<u8>,
    /// In shares of the crop, from its middle; side in shares of `CROP / ROOM`; turn in radians.
    pub hand: Option<[f32; 4]>,
}

pub fn generator(seed: u64, i: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(i);
    rng
}

pub fn frames(scenery: &Scenery, seed: u64, count: usize) -> Vec<Frame> {
    let frame = |i| Scene::new(scenery, &mut generator(seed, i), 1).frame();
    (0..count as u64).into_par_iter().map(frame).collect()
}

pub fn crops(scenery: &Scenery, seed: u64, count: usize) -> Vec<Crop> {
    (0..count as u64).into_par_iter().map(|i| crop(scenery, &mut generator(seed, i))).collect()
}

/// A hand in a scene.
pub struct Hand {
    pub place: Place,
    pub count: Option<u8>,
    pub fingers: Option<[bool; 5]>,
    pub joints: Option<Joints>,
    pub origin: u32,
}

/// What a camera took: its picture, the hands in it, and the hands' pixels.
pub struct Scene {
    pub canvas: Canvas,
    pub mask: Canvas,
    pub hands: Vec<Hand>,
}

impl Scene {
    /// One of `times` the finder's frame.
    pub fn new(scenery: &Scenery, rng: &mut ChaCha8Rng, times: usize) -> Self {
        let (width, height) = (WIDTH * times, HEIGHT * times);
        let (w, h, k) = (width as f32, height as f32, times as f32);
        let mut mask = Canvas::new(width, height, 1);
        let mut hands: Vec<Hand> = Vec::new();
        let mut canvas;
        let kind: f32 = rng.random();
        let nothing = if kind < NOTHING { scenery.nothing(rng, width, height, 2.0) } else { None };
        if let Some(nothing) = nothing {
            canvas = nothing;
        } else if kind < NOTHING + REAL {
            let hand;
            (canvas, mask, hand) = real_frame(scenery, rng, times);
            if rng.random::<f32>() < 0.15 {
                let at = (uniform(rng, 0.0, w), uniform(rng, 0.0, h));
                if (at.0 - hand.place.x).hypot(at.1 - hand.place.y) > 0.9 * hand.place.side + 25.0 * k {
                    let size = uniform(rng, 10.0, 30.0) * k;
                    scenery.face(&mut canvas, at, size, rng);
                }
            }
            hands.push(hand);
        } else {
            canvas = scenery.background(rng, width, height);
            scenery.distract(&mut canvas, rng, (10.0 * k, 70.0 * k), (k, 16.0 * k));
            let count = match rng.random::<f32>() {
                x if x < 0.2 => 0,
                x if x < 0.9 => 1,
                _ => MOST,
            };
            for _ in 0..count {
                for _ in 0..10 {
                    let place = somewhere(rng, k);
                    let apart = |other: &Hand| {
                        (place.x - other.place.x).hypot(place.y - other.place.y)
                            > 0.6 * (place.side + other.place.side)
                    };
                    if hands.iter().all(apart) {
                        let drawn = rng.random::<f32>() < 0.4;
                        let pasted = scenery.paste(&mut canvas, &place, drawn, rng);
                        for (all, one) in mask.values.iter_mut().zip(&pasted.mask.values) {
                            *all = all.max(*one);
                        }
                        let (count, fingers, origin) = (pasted.count, pasted.fingers, pasted.origin);
                        hands.push(Hand { place, count, fingers, joints: Some(pasted.joints), origin });
                        break;
                    }
                }
            }
        }
        expose(&mut canvas, rng);
        Self { canvas, mask, hands }.without_strays()
    }

    /// Hands whose middle is outside are not to be found.
    fn without_strays(mut self) -> Self {
        let (w, h) = (self.canvas.width as f32, self.canvas.height as f32);
        let edge = w / 32.0;
        self.hands
            .retain(|Hand { place: p, .. }| p.x > -edge && p.x < w + edge && p.y > -edge && p.y < h + edge);
        self
    }

    /// As the finder is shown it.
    pub fn frame(&self) -> Frame {
        let k = WIDTH as f32 / self.canvas.width as f32;
        let hands = self.hands.iter().map(|hand| scaled(&hand.place, k)).collect();
        if self.canvas.width == WIDTH {
            return Frame { picture: self.canvas.to_bytes(), hands, mask: shrunk_mask(&self.mask) };
        }
        let map = Affine { m: [[k, 0.0], [0.0, k]], t: [(k - 1.0) / 2.0; 2] };
        let small = |canvas: &Canvas| canvas.to_pyramid().warp(&map, WIDTH, HEIGHT, Outside::Nearest);
        Frame { picture: small(&self.canvas).to_bytes(), hands, mask: shrunk_mask(&small(&self.mask)) }
    }

    /// A part of it, as large as the finder's frame: what a second, finer look sees; and where its corner is.
    pub fn window(&self, rng: &mut ChaCha8Rng) -> (Self, (f32, f32)) {
        let x = rng.random_range(0..=self.canvas.width - WIDTH);
        let y = rng.random_range(0..=self.canvas.height - HEIGHT);
        let part = |canvas: &Canvas| {
            let c = canvas.channels;
            let rows = (y..y + HEIGHT).flat_map(|row| {
                let first = (row * canvas.width + x) * c;
                canvas.values[first..first + WIDTH * c].iter().copied()
            });
            Canvas { width: WIDTH, height: HEIGHT, channels: c, values: rows.collect() }
        };
        // A finer look is not for hands that fill it.
        let hands = self.hands.iter().filter(|hand| hand.place.side < 0.9 * WIDTH as f32).map(|hand| {
            let place = Place { x: hand.place.x - x as f32, y: hand.place.y - y as f32, ..hand.place };
            let joints = hand.joints.map(|joints| joints.map(|(jx, jy)| (jx - x as f32, jy - y as f32)));
            Hand { place, joints, ..*hand }
        });
        let part = Self { canvas: part(&self.canvas), mask: part(&self.mask), hands: hands.collect() };
        (part.without_strays(), (x as f32, y as f32))
    }
}

fn shrunk_mask(mask: &Canvas) -> Vec<u8> {
    let (w, h) = CELLS;
    let mut out = Vec::with_capacity(w * h);
    for y in 0..h {
        for x in 0..w {
            let sum: f32 = (0..16).map(|k| mask.values[(4 * y + k / 4) * WIDTH + 4 * x + k % 4]).sum();
            out.push((sum / 16.0).clamp(0.0, 255.0) as u8);
        }
    }
    out
}

fn somewhere(rng: &mut ChaCha8Rng, k: f32) -> Place {
    let side = uniform(rng, 7.0_f32.ln(), 120.0_f32.ln()).exp() * k;
    let up = if rng.random::<f32>() < 0.65 { 0.6 * normal(rng) } else { uniform(rng, -PI, PI) };
    let edge = (0.35 * side).min(50.0 * k);
    let x = uniform(rng, edge, WIDTH as f32 * k - edge);
    let y = uniform(rng, edge.min(45.0 * k), HEIGHT as f32 * k - edge.min(45.0 * k));
    Place { x, y, side, up }
}

/// A real picture, larger or smaller, so that it covers the frame or lies on another.
fn real_frame(scenery: &Scenery, rng: &mut ChaCha8Rng, times: usize) -> (Canvas, Canvas, Hand) {
    let photo = scenery.room(rng);
    let (width, height) = (WIDTH * times, HEIGHT * times);
    let (w, h, k) = (width as f32, height as f32, times as f32);
    let (pw, ph) = (photo.picture.width() as f32, photo.picture.height() as f32);
    let mirror = if rng.random() { 1.0 } else { -1.0 };
    let turn = 0.3 * normal(rng);
    let (fit, fill) = ((w / pw).min(h / ph), (w / pw).max(h / ph));
    let scale = if rng.random::<f32>() < 0.6 {
        fill * uniform(rng, -0.1, 0.5).exp()
    } else {
        fit * uniform(rng, -1.3, 0.1).exp()
    };
    let side = (photo.place.side * scale).clamp(8.0 * k, 130.0 * k);
    let scale = side / photo.place.side;
    let edge = |limit: f32| (0.4 * side).min(limit / 2.0);
    let mut to = (uniform(rng, edge(w), w - edge(w)), uniform(rng, edge(h), h - edge(h)));
    let from = (photo.place.x, photo.place.y);
    if scale >= 0.9 * fill {
        // The picture covers the frame as far as it can.
        let map = Affine::similar(from, to, turn, scale, mirror, 1.0);
        let corners = [(0.0, 0.0), (pw, 0.0), (0.0, ph), (pw, ph)].map(|(x, y)| map.apply(x, y));
        let span = |pick: fn(&(f32, f32)) -> f32| {
            let all = corners.iter().map(pick);
            (all.clone().fold(f32::MAX, f32::min), all.fold(f32::MIN, f32::max))
        };
        let shift = |(low, high): (f32, f32), size: f32| {
            if low > 0.0 {
                -low
            } else if high < size {
                size - high
            } else {
                0.0
            }
        };
        to.0 += shift(span(|p| p.0), w);
        to.1 += shift(span(|p| p.1), h);
    }
    let up = photo.place.up * mirror + turn;
    let place = Place { x: to.0, y: to.1, side, up };
    let map = Affine::similar(from, to, turn, scale, mirror, 1.0);
    let (picture, mask) = real(photo, &place, width, height, mirror, 1.0);
    let mut canvas = scenery.background(rng, width, height);
    let mut share =
        Canvas { width, height, channels: 1, values: covered(&photo.picture, &map, width, height) };
    if rng.random::<f32>() < 0.5 {
        share = share.blurred(uniform(rng, 0.5, 3.0));
    }
    canvas.blend(&picture, &share.values);
    let joints = Some(onto(photo, &place, mirror, 1.0).joints(&photo.joints));
    (canvas, mask, Hand { place, count: photo.count, fingers: photo.fingers, joints, origin: photo.origin })
}

fn crop(scenery: &Scenery, rng: &mut ChaCha8Rng) -> Crop {
    let kind: f32 = rng.random();
    let size = CROP as f32;
    let room = ROOM * (0.17 * normal(rng)).exp();
    let side = size / room;
    let middle = size / 2.0 - 0.5;
    let x = middle + 0.11 * side * normal(rng);
    let y = middle + 0.11 * side * normal(rng);
    let up = if rng.random::<f32>() < 0.9 { 0.35 * normal(rng) } else { uniform(rng, -PI, PI) };
    let place = Place { x, y, side, up };
    let mut hand = Some([(x - middle) / size, (y - middle) / size, (side / (size / ROOM)).ln(), up]);
    let mut mask = Canvas::new(CROP, CROP, 1);
    let mut canvas;
    if kind < 0.42 {
        let photo = scenery.room(rng);
        let mirror = if rng.random() { 1.0 } else { -1.0 };
        (canvas, mask) = real(photo, &place, CROP, CROP, mirror, (0.05 * normal(rng)).exp());
    } else if kind < 0.80 {
        canvas = scenery.background(rng, CROP, CROP);
        scenery.distract(&mut canvas, rng, (18.0, 70.0), (2.0, 16.0));
        let drawn = rng.random::<f32>() < 0.4;
        mask = scenery.paste(&mut canvas, &place, drawn, rng).mask;
    } else {
        hand = None;
        canvas = scenery.background(rng, CROP, CROP);
        scenery.distract(&mut canvas, rng, (18.0, 70.0), (2.0, 16.0));
        // A part of a hand that is not its middle is none either.
        if kind > 0.94 {
            let away = uniform(rng, -PI, PI);
            let far = uniform(rng, 0.75, 1.1) * side;
            let place = Place { x: middle + far * away.cos(), y: middle + far * away.sin(), side, up };
            let drawn = rng.random::<f32>() < 0.4;
            scenery.paste(&mut canvas, &place, drawn, rng);
        }
    }
    if rng.random::<f32>() < 0.3 {
        canvas = canvas.coarse(uniform(rng, 1.3, 3.0));
    }
    expose(&mut canvas, rng);
    Crop { picture: canvas.to_bytes(), mask: mask.to_bytes(), hand }
}

/// A crop of a real picture as the refiner is shown it after the finder.
pub fn crop_at(picture: &crate::image::Pyramid, place: &Place) -> Vec<u8> {
    picture.warp(&onto_crop(place), CROP, CROP, Outside::Nearest).to_bytes()
}

/// The truth of a mask, in the same frame as [`crop_at`].
pub fn mask_at(mask: &crate::image::Pyramid, of: &Place, place: &Place) -> Vec<u8> {
    let map = onto_crop(place);
    let centre = (MASK as f32 - 1.0) / 2.0;
    let k = COVERED * of.side / MASK as f32;
    // From the mask's pixels to the picture's to the crop's.
    let t = [of.x - k * centre, of.y - k * centre];
    let (tx, ty) = map.apply(t[0], t[1]);
    let whole = Affine { m: map.m.map(|row| row.map(|v| v * k)), t: [tx, ty] };
    mask.warp(&whole, CROP, CROP, Outside::Zero).to_bytes()
}
