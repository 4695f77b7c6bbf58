//! A look as robots do it, with networks that are being trained: to judge them, and to show each the faults of the one before.

use crate::counting::{Shown, frame};
use crate::frames::{CELLS, HEIGHT, WIDTH};
use crate::image::{Affine, Outside, Pyramid};
use crate::losses::sigmoid;
use crate::places::{CROP, MASK, Place, ROOM, onto_mask};
use crate::robots::Robot;

/// A place that may be a hand's, and how sure the finder is.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    pub score: f32,
    pub place: Place,
}

/// The whole picture in the finder's frame: its map, and the picture.
pub fn letterboxed(picture: &Pyramid) -> (Affine, Vec<u8>) {
    let (w, h) = (picture.width() as f32, picture.height() as f32);
    let k = (WIDTH as f32 / w).min(HEIGHT as f32 / h);
    let (x, y) = ((WIDTH as f32 - (w * k).round()) / 2.0, (HEIGHT as f32 - (h * k).round()) / 2.0);
    let (x, y) = (x.floor(), y.floor());
    let map = Affine { m: [[k, 0.0], [0.0, k]], t: [x + (k - 1.0) / 2.0, y + (k - 1.0) / 2.0] };
    let mut canvas = picture.warp(&map, WIDTH, HEIGHT, Outside::Nearest);
    let inside = |i: usize| {
        let (px, py) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
        px >= x && px < x + (w * k).round() && py >= y && py < y + (h * k).round()
    };
    let (mut sum, mut n) = ([0.0; 3], 0.0);
    for i in (0..WIDTH * HEIGHT).filter(|i| inside(*i)) {
        (0..3).for_each(|c| sum[c] += canvas.values[3 * i + c]);
        n += 1.0;
    }
    for i in (0..WIDTH * HEIGHT).filter(|i| !inside(*i)) {
        (0..3).for_each(|c| canvas.values[3 * i + c] = sum[c] / n);
    }
    (map, canvas.to_bytes())
}

/// The highest peaks of a finder's maps, in the frame's pixels.
pub fn peaks(maps: &[f32], most: usize) -> Vec<Candidate> {
    let (w, h) = CELLS;
    let n = w * h;
    let p: Vec<f32> = maps[..n].iter().copied().map(sigmoid).collect();
    let around = |i: usize| {
        let (x, y) = (i % w, i / w);
        let rows = y.saturating_sub(1)..(y + 2).min(h);
        rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(w)).map(move |x| y * w + x))
    };
    let mut tops: Vec<usize> = (0..n).filter(|&i| around(i).all(|j| p[j] <= p[i])).collect();
    tops.sort_by(|a, b| p[*b].total_cmp(&p[*a]));
    let mut out: Vec<Candidate> = Vec::new();
    for i in tops.into_iter().take(most + 2) {
        let side = 24.0 * maps[n + i].clamp(-1.6, 1.7).exp();
        let (mut x, mut y, mut sum) = (0.0, 0.0, 0.0);
        for j in around(i) {
            x += p[j] * (j % w) as f32;
            y += p[j] * (j / w) as f32;
            sum += p[j];
        }
        let place = Place {
            x: (x / sum + 0.5) * 4.0 - 0.5,
            y: (y / sum + 0.5) * 4.0 - 0.5,
            side,
            up: maps[2 * n + i].atan2(maps[3 * n + i]),
        };
        let new = |other: &Candidate| {
            (place.x - other.place.x).hypot(place.y - other.place.y) > 0.35 * side.max(other.place.side)
        };
        if out.iter().all(new) {
            out.push(Candidate { score: p[i], place });
        }
    }
    out.truncate(most);
    out
}

/// The candidates in a picture's own pixels.
pub fn candidates(robot: &mut Robot, picture: &Pyramid, most: usize) -> Vec<Candidate> {
    let (map, frame) = letterboxed(picture);
    let back = map.inverse();
    let mut found = peaks(robot.find(&frame), most);
    for candidate in &mut found {
        let place = &mut candidate.place;
        (place.x, place.y) = back.apply(place.x, place.y);
        place.side *= back.scale();
    }
    found
}

/// A place as the refiner corrects it.
pub fn corrected(place: &Place, said: &[f32; 6]) -> Place {
    let (dx, dy) =
        (said[1].clamp(-0.4, 0.4) * ROOM * place.side, said[2].clamp(-0.4, 0.4) * ROOM * place.side);
    let (s, c) = place.up.sin_cos();
    Place {
        x: place.x + c * dx - s * dy,
        y: place.y + s * dx + c * dy,
        side: place.side * said[3].clamp(-0.7, 0.7).exp(),
        up: place.up + said[4].atan2(said[5]),
    }
}

/// A hand that was found.
pub struct Found {
    pub place: Place,
    /// The place of the crop that the mask belongs to.
    pub crop: Place,
    pub mask: Vec<f32>,
}

/// The mask without what is not joined to its largest part.
pub fn largest(mut mask: Vec<f32>) -> Vec<f32> {
    let mut part = vec![0_usize; mask.len()];
    let (mut best, mut parts) = ((0, 0), 0);
    for start in 0..mask.len() {
        if mask[start] <= 0.5 || part[start] != 0 {
            continue;
        }
        parts += 1;
        let (mut open, mut n) = (vec![start], 0);
        part[start] = parts;
        while let Some(i) = open.pop() {
            n += 1;
            let (x, y) = ((i % CROP) as i32, (i / CROP) as i32);
            for k in 0..9 {
                let (px, py) = (x + k % 3 - 1, y + k / 3 - 1);
                if px < 0 || py < 0 || px >= CROP as i32 || py >= CROP as i32 {
                    continue;
                }
                let j = py as usize * CROP + px as usize;
                if mask[j] > 0.5 && part[j] == 0 {
                    part[j] = parts;
                    open.push(j);
                }
            }
        }
        if n > best.0 {
            best = (n, parts);
        }
    }
    let kept: Vec<bool> = (0..mask.len())
        .map(|i| {
            let (x, y) = ((i % CROP) as i32, (i / CROP) as i32);
            (0..9).any(|k| {
                let (px, py) = (x + k % 3 - 1, y + k / 3 - 1);
                px >= 0
                    && py >= 0
                    && px < CROP as i32
                    && py < CROP as i32
                    && part[py as usize * CROP + px as usize] == best.1
            })
        })
        .collect();
    mask.iter_mut().zip(kept).for_each(|(m, kept)| *m *= f32::from(kept && best.1 > 0));
    mask
}

/// A found hand as the counter is shown it: the picture around it, and the mask laid on it.
pub fn shown(picture: &Pyramid, found: &Found) -> Option<Shown> {
    let map = onto_mask(&found.place);
    let around = picture.warp(&map, MASK, MASK, Outside::Nearest).to_pyramid();
    let bytes = found.mask.iter().map(|m| (m * 255.0) as u8).collect();
    let mask = Pyramid::new(CROP, CROP, 1, bytes);
    let centre = CROP as f32 / 2.0 - 0.5;
    let (x, y) = map.apply(found.crop.x, found.crop.y);
    let size = ROOM * found.crop.side / CROP as f32 * map.scale();
    let laid = Affine::similar((centre, centre), (x, y), found.crop.up, size, 1.0, 1.0);
    let mask = mask.warp(&laid, MASK, MASK, Outside::Zero).to_pyramid();
    let frame = frame(&mask, found.place.up)?;
    let arm = mask.clone();
    Some(Shown {
        picture: around,
        mask,
        arm,
        frame,
        count: None,
        fingers: None,
        joints: None,
        hand: true,
        origin: 0,
        drawn: false,
        seen: true,
    })
}
