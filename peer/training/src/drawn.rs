//! Drawn hands in any pose: each finger raised or folded, palm or back, thumb beside or across, with a forearm.
//!
//! A hand is a skeleton of capsules; lengths are in palms (wrist to the middle finger's root). It is seen from afar.

use rand::{Rng, RngExt};

use crate::chance::normal;
use crate::image::{Canvas, Joints, Pyramid};

/// Side of a drawn picture; the hand's square is [`HAND`] of it.
pub const SIDE: usize = 112;
pub const HAND: f32 = SIDE as f32 / 1.7;

type V = [f32; 3];
type M = [V; 3];

/// A drawn hand: how bright it is (110 in full light), its pixels, and those of hand and arm.
pub struct Drawn {
    pub shade: Pyramid,
    pub mask: Pyramid,
    pub arm: Pyramid,
    pub joints: Joints,
    /// Raised fingers, thumb first.
    pub fingers: [bool; 5],
}

/// People raise neighbouring fingers; these are the usual ways.
const USUAL: [[u8; 5]; 19] = [
    [0, 1, 0, 0, 0],
    [1, 0, 0, 0, 0],
    [0, 0, 0, 0, 1],
    [0, 1, 1, 0, 0],
    [1, 1, 0, 0, 0],
    [0, 1, 0, 0, 1],
    [1, 0, 0, 0, 1],
    [1, 1, 1, 0, 0],
    [0, 1, 1, 1, 0],
    [0, 0, 1, 1, 1],
    [1, 1, 0, 0, 1],
    [0, 1, 1, 0, 1],
    [0, 1, 1, 1, 1],
    [1, 1, 1, 1, 0],
    [1, 0, 1, 1, 1],
    [1, 1, 1, 0, 1],
    [1, 1, 0, 1, 1],
    [1, 1, 1, 1, 1],
    [0, 0, 0, 0, 0],
];

/// Which fingers to raise: every count alike, usual ways four times of five.
pub fn fingers(rng: &mut impl Rng) -> [bool; 5] {
    let count: usize = rng.random_range(0..6);
    if rng.random::<f32>() < 0.2 {
        let mut order = [0, 1, 2, 3, 4];
        for i in (1..5).rev() {
            order.swap(i, rng.random_range(0..=i));
        }
        let mut raised = [false; 5];
        order[..count].iter().for_each(|&finger| raised[finger] = true);
        return raised;
    }
    let ways: Vec<_> = USUAL.iter().filter(|w| w.iter().sum::<u8>() as usize == count).collect();
    ways[rng.random_range(0..ways.len())].map(|bit| bit == 1)
}

fn turn(axis: usize, angle: f32) -> M {
    let (s, c) = angle.sin_cos();
    match axis {
        0 => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        1 => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    }
}

fn product(a: M, b: M) -> M {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn times(a: &M, v: V) -> V {
    std::array::from_fn(|i| (0..3).map(|k| a[i][k] * v[k]).sum())
}

fn plus(a: V, b: V, share: f32) -> V {
    std::array::from_fn(|i| a[i] + share * b[i])
}

struct Bone {
    from: V,
    to: V,
    from_radius: f32,
    to_radius: f32,
    part: Part,
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    Palm,
    Finger,
    Arm,
}

/// Its bones, and its joints in the order of [`Joints`].
fn skeleton(raised: [bool; 5], rng: &mut impl Rng) -> (Vec<Bone>, [V; 21]) {
    let mut joints = [[0.0; 3]; 21];
    let mut bones = Vec::with_capacity(32);
    let mut bone = |from: V, to: V, from_radius: f32, to_radius: f32, part: Part| {
        bones.push(Bone { from, to, from_radius, to_radius, part });
    };
    let degrees = std::f32::consts::PI / 180.0;
    let slim = rng.random_range(0.82..1.18_f32);
    let length = rng.random_range(0.85..1.15_f32);
    let width = rng.random_range(0.88..1.12_f32);
    let knuckles: [V; 4] = [[-0.36, 0.92, 0.0], [-0.12, 1.0, 0.02], [0.12, 0.95, 0.02], [0.33, 0.82, 0.0]]
        .map(|k| [k[0] * width, k[1], k[2]]);
    let phalanges = [[0.52, 0.31, 0.24], [0.57, 0.36, 0.25], [0.52, 0.34, 0.25], [0.41, 0.25, 0.22]]
        .map(|p: [f32; 3]| (p, length * (1.0 + 0.05 * normal(rng))))
        .map(|(p, factor)| p.map(|l| l * factor));
    let radii = [0.115, 0.118, 0.112, 0.098].map(|r: f32| r * slim);
    for (i, knuckle) in knuckles.iter().enumerate() {
        bone([-0.22 + 0.15 * i as f32, 0.08, 0.0], *knuckle, 0.17 * slim, 0.135 * slim, Part::Palm);
    }
    bone([-0.2, 0.05, 0.0], [0.2, 0.05, 0.0], 0.17 * slim, 0.17 * slim, Part::Palm);
    bone([-0.25, 0.45, 0.05], [0.22, 0.45, 0.02], 0.2 * slim, 0.18 * slim, Part::Palm);
    let spread = rng.random_range(0.0..1.3_f32);
    for i in 0..4 {
        let lean = ([10.0, 2.0, -6.0, -16.0][i] * spread + 4.0 * normal(rng)) * degrees;
        let up = raised[i + 1];
        let bends = if up {
            [10.0 * normal(rng) + 3.0, 12.0 * normal(rng).abs(), 8.0 * normal(rng).abs()]
        } else if rng.random::<f32>() < 0.15 {
            [rng.random_range(20.0..60.0), rng.random_range(95.0..115.0), rng.random_range(30.0..70.0)]
        } else {
            [rng.random_range(60.0..95.0), rng.random_range(85.0..112.0), rng.random_range(25.0..75.0)]
        };
        let aside = if up { lean } else { 0.3 * lean };
        let (mut at, mut bend) = (knuckles[i], 0.0_f32);
        joints[4 * i + 5] = at;
        for j in 0..3 {
            bend += bends[j] * degrees;
            let along = [-aside.sin() * bend.cos(), aside.cos() * bend.cos(), bend.sin()];
            let next = plus(at, along, phalanges[i][j]);
            let (thick, thin) = (1.0 - 0.07 * j as f32, 0.93 - 0.07 * j as f32);
            bone(at, next, radii[i] * thick, radii[i] * thin, Part::Finger);
            at = next;
            joints[4 * i + 6 + j] = at;
        }
    }
    let root = [-0.24, 0.18, 0.08];
    joints[1] = root;
    if raised[0] {
        let away = rng.random_range(25.0..75.0) * degrees;
        let out = rng.random_range(-25.0..25.0) * degrees;
        let bend = 12.0 * normal(rng) * degrees;
        let mut at = root;
        for j in 0..3 {
            let angle: f32 = away + bend * j as f32 * 0.6;
            let along = [-angle.sin() * out.cos(), angle.cos() * out.cos(), out.sin()];
            let next = plus(at, along, [0.42, 0.34, 0.27][j] * length);
            bone(at, next, [0.15, 0.12, 0.11][j] * slim, [0.12, 0.11, 0.09][j] * slim, Part::Finger);
            at = next;
            joints[2 + j] = at;
        }
    } else {
        let mut u = |low: f32, high: f32| rng.random_range(low..high);
        let way = u(0.0, 1.0);
        let (joint, tip) = if way < 0.55 {
            ([u(-0.25, 0.0), u(0.6, 0.8), u(0.2, 0.32)], [u(-0.02, 0.3), u(0.55, 0.85), u(0.2, 0.34)])
        } else if way < 0.8 {
            ([-0.33, u(0.65, 0.85), 0.2], [u(-0.35, -0.2), u(0.9, 1.08), u(0.15, 0.28)])
        } else {
            ([-0.2, u(0.55, 0.7), u(0.25, 0.35)], [u(0.0, 0.3), u(0.4, 0.6), u(0.22, 0.3)])
        };
        let knuckle = [-0.36, 0.5, 0.14];
        bone(root, knuckle, 0.15 * slim, 0.125 * slim, Part::Finger);
        bone(knuckle, joint, 0.125 * slim, 0.11 * slim, Part::Finger);
        bone(joint, tip, 0.11 * slim, 0.09 * slim, Part::Finger);
        (joints[2], joints[3], joints[4]) = (knuckle, joint, tip);
    }
    let elbow = [0.25 * normal(rng), -2.8, 0.4 * normal(rng)];
    // Thinner than the hand is thick, or it would hide the palm.
    bone(
        [0.0, -0.05, 0.0],
        elbow,
        rng.random_range(0.14..0.19) * slim,
        rng.random_range(0.22..0.4),
        Part::Arm,
    );
    (bones, joints)
}

/// A hand of some person, raising these fingers, from any side.
pub fn draw(raised: [bool; 5], rng: &mut impl Rng) -> Drawn {
    let (mut bones, joints) = skeleton(raised, rng);
    let back = if rng.random::<f32>() < 0.45 { std::f32::consts::PI } else { 0.0 };
    // Now and then the hand is tilted far: fingers towards the camera, or away.
    let tilt = if rng.random::<f32>() < 0.15 { 0.7 } else { 0.3 };
    let mut view = product(
        product(turn(2, 0.25 * normal(rng)), turn(0, tilt * normal(rng))),
        turn(1, back + 0.4 * normal(rng)),
    );
    if rng.random::<f32>() < 0.5 {
        view = product(view, [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }
    for bone in &mut bones {
        bone.from = times(&view, bone.from);
        bone.to = times(&view, bone.to);
    }
    let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
    for bone in bones.iter().filter(|bone| bone.part != Part::Arm) {
        for (end, radius) in [(bone.from, bone.from_radius), (bone.to, bone.to_radius)] {
            for axis in 0..2 {
                low[axis] = low[axis].min(end[axis] - radius);
                high[axis] = high[axis].max(end[axis] + radius);
            }
        }
    }
    let span = (high[0] - low[0]).max(high[1] - low[1]) * 1.18;
    let scale = HAND / span;
    let centre = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
    let mut paper = Paper::new();
    for arm in [true, false] {
        for bone in bones.iter().filter(|bone| (bone.part == Part::Arm) == arm) {
            paper.fill(bone, centre, scale);
        }
    }
    let joints = joints.map(|joint| {
        let joint = times(&view, joint);
        let half = SIDE as f32 / 2.0;
        ((joint[0] - centre[0]) * scale + half, half - (joint[1] - centre[1]) * scale)
    });
    paper.light(scale, raised, joints, rng)
}

struct Paper {
    depth: Vec<f32>,
    normal: Vec<V>,
    part: Vec<Option<Part>>,
}

impl Paper {
    fn new() -> Self {
        let n = SIDE * SIDE;
        Self { depth: vec![-9.0; n], normal: vec![[0.0; 3]; n], part: vec![None; n] }
    }

    fn fill(&mut self, bone: &Bone, centre: [f32; 2], scale: f32) {
        let half = SIDE as f32 / 2.0;
        let on = |p: V| [(p[0] - centre[0]) * scale + half, half - (p[1] - centre[1]) * scale];
        let (a, b) = (on(bone.from), on(bone.to));
        let (ra, rb) = (bone.from_radius * scale, bone.to_radius * scale);
        let span = |axis: usize| {
            let low = (a[axis] - ra).min(b[axis] - rb).floor() - 1.0;
            let high = (a[axis] + ra).max(b[axis] + rb).ceil() + 2.0;
            (low.max(0.0) as usize, (high.max(0.0) as usize).min(SIDE))
        };
        let ((x0, x1), (y0, y1)) = (span(0), span(1));
        let d = [b[0] - a[0], b[1] - a[1]];
        let squared = (d[0] * d[0] + d[1] * d[1]).max(1e-3);
        let bulge = if bone.part == Part::Finger { 1.0 } else { 0.8 };
        for y in y0..y1 {
            for x in x0..x1 {
                let (px, py) = (x as f32 - a[0], y as f32 - a[1]);
                let t = ((px * d[0] + py * d[1]) / squared).clamp(0.0, 1.0);
                let (dx, dy) = (px - t * d[0], py - t * d[1]);
                let r = ra + t * (rb - ra);
                let inside = r * r - dx * dx - dy * dy;
                if inside <= 0.0 {
                    continue;
                }
                let height = inside.sqrt();
                let z = (bone.from[2] + t * (bone.to[2] - bone.from[2])) * scale + height * bulge;
                let i = y * SIDE + x;
                if z > self.depth[i] {
                    self.depth[i] = z;
                    self.normal[i] = [dx / r, dy / r, height / r];
                    self.part[i] = Some(bone.part);
                }
            }
        }
    }

    fn light(&self, scale: f32, fingers: [bool; 5], joints: Joints, rng: &mut impl Rng) -> Drawn {
        let mut towards = [0.9 * normal(rng), -0.6 * normal(rng).abs(), rng.random_range(0.3..1.0)];
        let length = towards.iter().map(|v| v * v).sum::<f32>().sqrt();
        towards.iter_mut().for_each(|v| *v /= length);
        let (strength, ambient) = (rng.random_range(0.4..1.0), rng.random_range(0.15..0.5));
        let hollow = rng.random_range(0.3..1.0);
        let depth = Canvas {
            width: SIDE,
            height: SIDE,
            channels: 1,
            values: self.depth.iter().map(|z| z.max(-1.0)).collect(),
        };
        let around = depth.blurred(1.6);
        let mut texture = Canvas::new(SIDE, SIDE, 1);
        texture.values.iter_mut().for_each(|v| *v = normal(rng));
        let texture = texture.blurred(1.2);
        let rough = rng.random_range(0.0..0.25);
        let (mut shade, mut mask, mut arm) =
            (vec![0; SIDE * SIDE], vec![0; SIDE * SIDE], vec![0; SIDE * SIDE]);
        for i in 0..SIDE * SIDE {
            let Some(part) = self.part[i] else { continue };
            let lit: f32 = (0..3).map(|k| self.normal[i][k] * towards[k]).sum::<f32>().clamp(0.0, 1.0);
            // What lies deeper than what surrounds it is in its shadow.
            let sunk = ((around.values[i] - depth.values[i]) / scale * 4.0).clamp(0.0, 0.5);
            let value =
                (lit * strength + ambient) * (1.0 - sunk * hollow) * (1.0 + rough * texture.values[i]);
            shade[i] = (value * 140.0).clamp(0.0, 255.0) as u8;
            arm[i] = 255;
            if part != Part::Arm {
                mask[i] = 255;
            }
        }
        Drawn {
            shade: Pyramid::new(SIDE, SIDE, 1, shade),
            mask: Pyramid::new(SIDE, SIDE, 1, mask),
            arm: Pyramid::new(SIDE, SIDE, 1, arm),
            joints,
            fingers,
        }
    }
}
