//! What pictures for training are made of: rooms, faces, arms, hands.

use rand::{Rng, RngExt};

use crate::camera::tone;
use crate::chance::{chance, log_uniform, normal, sign, uniform};
use crate::drawn::{Drawn, HAND, SIDE, draw, fingers};
use crate::image::{Affine, Canvas, Joints, Outside, Pyramid};
use crate::photos::{Photo, Photos};
use crate::places::{COVERED, MASK, Place};
use crate::sets::Set;
use crate::surfaces::{cloth, limb, skin, smooth_noise, texture};

/// What backgrounds are: invented below this, pictures without hands below the next, else parts of pictures beside a hand.
const TEXTURES: f32 = 0.15;
const NOTHING: f32 = 0.55;

/// The origin of drawn hands.
pub const DRAWN: u32 = 1000;

pub struct Scenery {
    pub photos: Photos,
    pub drawn: Vec<Drawn>,
    /// Of each set that shows surroundings: its share, and its pictures.
    rooms: Vec<(f32, Vec<usize>)>,
    /// The same of sets whose pictures are nothing but the hand.
    cuts: Vec<(f32, Vec<usize>)>,
}

/// A hand in a picture.
pub struct Pasted {
    pub mask: Canvas,
    pub count: Option<u8>,
    pub fingers: Option<[bool; 5]>,
    pub joints: Joints,
    pub origin: u32,
}

impl Scenery {
    pub fn new(photos: Photos, drawn: Vec<Drawn>) -> Self {
        let by_set = photos.by_set();
        let of = |pick: &dyn Fn(&Set) -> bool| -> Vec<(f32, Vec<usize>)> {
            let sets = photos.sets.iter().filter(|set| pick(set));
            sets.filter_map(|set| Some((set.scenes, by_set.get(set.name.as_str())?.clone()))).collect()
        };
        let rooms = of(&|set| set.surroundings);
        let cuts = of(&|_| true);
        Self { photos, drawn, rooms, cuts }
    }

    /// A picture with its surroundings.
    pub fn room(&self, rng: &mut impl Rng) -> &Photo {
        &self.photos.hands[*pick(&self.rooms, rng).expect("there are pictures of rooms")]
    }

    fn cut(&self, rng: &mut impl Rng) -> &Photo {
        &self.photos.hands[*pick(&self.cuts, rng).expect("there are pictures of hands")]
    }

    /// A real picture without a hand, or a part of it: from the whole to an area `closest` squared times as small.
    pub fn nothing(&self, rng: &mut impl Rng, w: usize, h: usize, closest: f32) -> Option<Canvas> {
        let picture = pick(&self.photos.empty, rng)?;
        let centre = (w as f32 / 2.0 - 0.5, h as f32 / 2.0 - 0.5);
        let (pw, ph) = (picture.width() as f32, picture.height() as f32);
        let scale = (w as f32 / pw).max(h as f32 / ph) * uniform(rng, 0.0, closest.ln()).exp();
        let from = (
            pw / 2.0 + uniform(rng, -0.5, 0.5) * (pw - w as f32 / scale),
            ph / 2.0 + uniform(rng, -0.5, 0.5) * (ph - h as f32 / scale),
        );
        let map = Affine::similar(from, centre, 0.15 * normal(rng), scale, sign(rng), 1.0);
        Some(picture.warp(&map, w, h, Outside::Mirrored))
    }

    /// Something without a hand.
    pub fn background(&self, rng: &mut impl Rng, w: usize, h: usize) -> Canvas {
        let kind: f32 = rng.random();
        let real = match kind {
            k if k < TEXTURES => None,
            k if k < NOTHING => self.nothing(rng, w, h, 3.0),
            _ => self.beside_a_hand(rng, w, h),
        };
        let mut canvas = real.unwrap_or_else(|| texture(rng, w, h));
        if chance(rng, 0.35) {
            for _ in 0..rng.random_range(0..3) {
                let Some(picture) = pick(&self.photos.empty, rng) else { break };
                let (bw, bh) = (uniform(rng, 15.0, 80.0), uniform(rng, 15.0, 80.0));
                let (x, y) = (uniform(rng, -20.0, w as f32), uniform(rng, -20.0, h as f32));
                let scale = (bw / picture.width() as f32).max(bh / picture.height() as f32);
                let map = Affine { m: [[scale, 0.0], [0.0, scale]], t: [x, y] };
                let patch = picture.warp(&map, w, h, Outside::Nearest);
                let inside = |i: usize| {
                    let (px, py) = ((i % w) as f32, (i / w) as f32);
                    f32::from(px >= x && px < x + bw && py >= y && py < y + bh)
                };
                let share: Vec<f32> = (0..w * h).map(inside).collect();
                canvas.blend(&patch, &share);
            }
        }
        if chance(rng, 0.5) {
            tone(&mut canvas, rng, 0.2);
        }
        canvas
    }

    /// A part of a real picture in which the hand is not.
    fn beside_a_hand(&self, rng: &mut impl Rng, w: usize, h: usize) -> Option<Canvas> {
        let photo = self.room(rng);
        let (pw, ph) = (photo.picture.width() as f32, photo.picture.height() as f32);
        let Place { x: hx, y: hy, side, .. } = photo.place;
        let reach = 0.6 * side;
        for _ in 0..14 {
            let bw = pw * uniform(rng, 0.22, 0.7);
            let bh = bw * h as f32 / w as f32;
            if bh > ph {
                continue;
            }
            let (x, y) = (uniform(rng, 0.0, pw - bw), uniform(rng, 0.0, ph - bh));
            let apart = |a: f32, length: f32, b: f32| a + length < b - reach || a > b + reach;
            if apart(x, bw, hx) || apart(y, bh, hy) {
                let centre = (w as f32 / 2.0 - 0.5, h as f32 / 2.0 - 0.5);
                let map =
                    Affine::similar((x + bw / 2.0, y + bh / 2.0), centre, 0.0, w as f32 / bw, sign(rng), 1.0);
                return Some(photo.picture.warp(&map, w, h, Outside::Nearest));
            }
        }
        None
    }

    /// Things that are easily taken for hands: faces with bodies, bare limbs, sticks.
    pub fn distract(&self, canvas: &mut Canvas, rng: &mut impl Rng, faces: (f32, f32), limbs: (f32, f32)) {
        let (w, h) = (canvas.width as f32, canvas.height as f32);
        for _ in 0..rng.random_range(0..3) {
            if chance(rng, 0.5) {
                let at = (uniform(rng, 0.0, w), uniform(rng, 0.0, h));
                let size = log_uniform(rng, faces.0, faces.1);
                self.face(canvas, at, size, rng);
            } else if chance(rng, 0.65) {
                let from = (uniform(rng, 0.0, w), uniform(rng, 0.0, h));
                let to = (uniform(rng, -20.0, w + 20.0), uniform(rng, -20.0, h + 20.0));
                let radii = (uniform(rng, limbs.0, limbs.1), uniform(rng, limbs.0, limbs.1));
                let colour = if chance(rng, 0.7) {
                    skin(rng)
                } else {
                    std::array::from_fn(|_| uniform(rng, 0.0, 255.0))
                };
                limb(canvas, from, to, radii, colour, rng);
            }
        }
    }

    pub fn face(&self, canvas: &mut Canvas, at: (f32, f32), size: f32, rng: &mut impl Rng) {
        let (w, h) = (canvas.width, canvas.height);
        if chance(rng, 0.6) {
            let (down, wide) = (size * 0.95, size * 3.0);
            let colour = cloth(rng);
            let to = (at.0 + 5.0 * normal(rng), at.1 + wide);
            limb(canvas, (at.0, at.1 + down), to, (size * 0.5, size * 0.8), colour, rng);
        }
        if !self.photos.faces.is_empty() && chance(rng, 0.8) {
            let face = &self.photos.faces[rng.random_range(0..self.photos.faces.len())];
            let turn = 0.15 * normal(rng);
            let map = Affine::similar((48.0, 50.0), at, turn, size / 75.0, sign(rng), 1.0);
            let mut picture = face.warp(&map, w, h, Outside::Nearest);
            if chance(rng, 0.6) {
                tone(&mut picture, rng, 0.15);
            }
            let back = map.inverse();
            let share: Vec<f32> = (0..w * h)
                .map(|i| {
                    let (x, y) = back.apply((i % w) as f32, (i / w) as f32);
                    let out = ((x - 48.0) / 30.0).powi(2) + ((y - 50.0) / 41.0).powi(2);
                    ((1.0 - out) * 6.0).clamp(0.0, 1.0)
                })
                .collect();
            canvas.blend(&picture, &share);
            return;
        }
        let colour = skin(rng);
        let hair = [uniform(rng, 10.0, 90.0); 3];
        let mut disc = |dx: f32, dy: f32, rx: f32, ry: f32, colour: [f32; 3]| {
            for i in 0..w * h {
                let (x, y) = ((i % w) as f32 - at.0 - dx * size, (i / w) as f32 - at.1 - dy * size);
                if (x / (rx * size)).powi(2) + (y / (ry * size)).powi(2) < 1.0 {
                    canvas.pixel(i).copy_from_slice(&colour);
                }
            }
        };
        disc(0.0, -0.12, 0.4, 0.5, hair);
        disc(0.0, 0.0, 0.36, 0.48, colour);
        for side in [-0.15, 0.15] {
            disc(side, -0.08, 0.06, 0.03, colour.map(|c| c * 0.4));
        }
        disc(0.0, 0.24, 0.13, 0.035, colour.map(|c| c * 0.6));
    }

    /// Puts a drawn hand, or one cut from a real picture, at that place of the canvas.
    pub fn paste(&self, canvas: &mut Canvas, place: &Place, drawn: bool, rng: &mut impl Rng) -> Pasted {
        let (w, h) = (canvas.width, canvas.height);
        let (mirror, aspect) = (sign(rng), (0.06 * normal(rng)).exp());
        let to = (place.x, place.y);
        let up = (place.up.sin(), -place.up.cos());
        let (mut picture, mask, arm, count, fingers, joints, origin);
        if drawn {
            let hand = &self.drawn[rng.random_range(0..self.drawn.len())];
            let middle = (SIDE as f32 / 2.0 - 0.5, SIDE as f32 / 2.0 - 0.5);
            let map = Affine::similar(middle, to, place.up, place.side / HAND, mirror, aspect);
            let shade = hand.shade.warp(&map, w, h, Outside::Zero);
            mask = hand.mask.warp(&map, w, h, Outside::Zero);
            let whole = hand.arm.warp(&map, w, h, Outside::Zero);
            let glove = chance(rng, 0.12);
            let tone = if glove { std::array::from_fn(|_| uniform(rng, 20.0, 235.0)) } else { skin(rng) };
            let sleeve = chance(rng, 0.5).then(|| cloth(rng));
            let shine = uniform(rng, 0.0, 60.0);
            picture = Canvas::new(w, h, 3);
            for i in 0..w * h {
                let light = shade.values[i] / 110.0;
                let bare = mask.values[i] > 127.0;
                let colour = if bare { tone } else { sleeve.unwrap_or(tone) };
                let gloss = (light - 1.1).clamp(0.0, 1.0) * shine;
                for (value, colour) in picture.pixel(i).iter_mut().zip(colour) {
                    *value = (light * colour + gloss).clamp(0.0, 255.0);
                }
            }
            arm = chance(rng, 0.85).then_some(whole);
            count = Some(hand.fingers.iter().filter(|f| **f).count() as u8);
            fingers = Some(hand.fingers);
            joints = map.joints(&hand.joints);
            origin = DRAWN;
        } else {
            let photo = self.cut(rng);
            (picture, mask) = real(photo, place, w, h, mirror, aspect);
            let (mut sum, mut n) = ([0.0; 3], 0.0);
            for (i, m) in mask.values.iter().enumerate() {
                if *m > 150.0 {
                    n += 1.0;
                    (0..3).for_each(|c| sum[c] += picture.values[3 * i + c]);
                }
            }
            let mut mean = sum.map(|s| s / f32::max(n, 1.0));
            if chance(rng, 0.5) {
                let target = skin(rng);
                let factor: [f32; 3] = std::array::from_fn(|c| target[c] / (mean[c] + 4.0));
                for pixel in picture.values.chunks_exact_mut(3) {
                    (0..3).for_each(|c| pixel[c] = (pixel[c] * factor[c]).clamp(0.0, 255.0));
                }
                mean = target;
            }
            arm = None;
            if chance(rng, 0.8) {
                let back = uniform(rng, 0.24, 0.36) * place.side;
                let wrist = (place.x - up.0 * back, place.y - up.1 * back);
                let long = uniform(rng, 0.4, 3.0) * place.side;
                let bent = (up.0 + 0.25 * normal(rng), up.1 + 0.25 * normal(rng));
                let elbow = (wrist.0 - bent.0 * long, wrist.1 - bent.1 * long);
                let colour = if chance(rng, 0.5) { mean } else { cloth(rng) };
                let radii = (uniform(rng, 0.1, 0.16) * place.side, uniform(rng, 0.13, 0.28) * place.side);
                limb(canvas, wrist, elbow, radii, colour, rng);
            }
            count = photo.count;
            fingers = photo.fingers;
            joints = onto(photo, place, mirror, aspect).joints(&photo.joints);
            origin = photo.origin;
        }
        if chance(rng, 0.5) {
            let light = smooth_noise(rng, w, h, 3, 1);
            for (pixel, light) in picture.values.chunks_exact_mut(3).zip(&light.values) {
                let factor = (0.15 * light).exp();
                pixel.iter_mut().for_each(|v| *v = (*v * factor).clamp(0.0, 255.0));
            }
        }
        if let Some(arm) = arm {
            canvas.blend(&picture, &arm.values.iter().map(|v| v / 255.0).collect::<Vec<_>>());
        }
        let soft = if place.side < 40.0 { mask.clone() } else { mask.smoothed(&[0.25, 0.5, 0.25]) };
        canvas.blend(&picture, &soft.values.iter().map(|v| v / 255.0).collect::<Vec<_>>());
        Pasted { mask, count, fingers, joints, origin }
    }
}

/// One of any set, each set by its share.
fn pick<'a, T>(sets: &'a [(f32, Vec<T>)], rng: &mut impl Rng) -> Option<&'a T> {
    let total: f32 = sets.iter().map(|(share, _)| share).sum();
    let mut at = uniform(rng, 0.0, total);
    let taken = sets.iter().find(|(share, _)| {
        at -= share;
        at <= 0.0
    });
    let (_, all) = taken.or(sets.first())?;
    all.get(rng.random_range(0..all.len()))
}

/// So many drawn hands.
pub fn drawn_hands(count: usize, seed: u64) -> Vec<Drawn> {
    use rand::SeedableRng;
    use rayon::prelude::*;
    (0..count as u64)
        .into_par_iter()
        .map(|i| {
            let rng =
                &mut rand_chacha::ChaCha8Rng::seed_from_u64(seed ^ i.wrapping_mul(0x9E37_79B9_7F4A_7C15));
            let raised = fingers(rng);
            draw(raised, rng)
        })
        .collect()
}

/// From a hand's picture to one in which the hand is at `place`.
pub fn onto(photo: &Photo, place: &Place, mirror: f32, aspect: f32) -> Affine {
    let angle = place.up - photo.place.up * mirror;
    let from = (photo.place.x, photo.place.y);
    Affine::similar(from, (place.x, place.y), angle, place.side / photo.place.side, mirror, aspect)
}

/// A hand's picture in which the hand is at `place` on a canvas of that size.
pub fn real(photo: &Photo, place: &Place, w: usize, h: usize, mirror: f32, aspect: f32) -> (Canvas, Canvas) {
    let to = (place.x, place.y);
    let angle = place.up - photo.place.up * mirror;
    let map = onto(photo, place, mirror, aspect);
    let middle = ((MASK as f32 - 1.0) / 2.0, (MASK as f32 - 1.0) / 2.0);
    let of_mask = Affine::similar(middle, to, angle, place.side * COVERED / MASK as f32, mirror, aspect);
    (photo.picture.warp(&map, w, h, Outside::Nearest), photo.mask.warp(&of_mask, w, h, Outside::Zero))
}

/// Where the picture itself lies on such a canvas, `0.0..=1.0`.
pub fn covered(picture: &Pyramid, map: &Affine, w: usize, h: usize) -> Vec<f32> {
    let back = map.inverse();
    let (pw, ph) = (picture.width() as f32, picture.height() as f32);
    (0..w * h)
        .map(|i| {
            let (x, y) = back.apply((i % w) as f32, (i / w) as f32);
            f32::from(x >= -0.5 && y >= -0.5 && x <= pw - 0.5 && y <= ph - 0.5)
        })
        .collect()
}
