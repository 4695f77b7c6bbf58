//! A hand as a skeleton of bones, each a capsule: palm, five fingers, wrist, sleeve.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::config::Glove;
use crate::vocabulary::{Finger, HandPose, Thumb, Which};

/// A bone with its flesh: a sphere swept along a segment, growing or shrinking on the way. Metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    pub from: Point3<f32>,
    pub to: Point3<f32>,
    pub from_radius: f32,
    pub to_radius: f32,
    /// Blue, green, red in full light, 0..=255.
    pub colour: [f32; 3],
}

/// Thumb, index, middle, ring, little finger.
const FINGERS: usize = 5;
const THUMB: usize = 0;

/// The first joint of each long finger, and where its metacarpal begins at the wrist, in metres: right hand, palm
/// towards the viewer, palm centre at the origin, y along the middle finger.
const KNUCKLES: [(f32, f32); 4] = [(0.029, 0.024), (0.009, 0.030), (-0.011, 0.026), (-0.029, 0.014)];
const WRIST: [(f32, f32); 4] = [(0.017, -0.062), (0.006, -0.064), (-0.006, -0.064), (-0.016, -0.062)];
/// Lengths of the three phalanges of each long finger, in metres: an adult's.
const PHALANGES: [[f32; 3]; 4] =
    [[0.042, 0.026, 0.022], [0.046, 0.030, 0.023], [0.043, 0.028, 0.023], [0.034, 0.021, 0.020]];
/// How far each long finger leans outward in a relaxed open hand, in degrees.
const SPLAY_DEG: [f32; 4] = [9.0, 1.5, -7.0, -17.0];
/// Half the thickness of each long finger, in metres, glove included.
const RADIUS: [f32; 4] = [0.0098, 0.0102, 0.0096, 0.0086];

/// One person's hand held in one way: what a scene's seed decides.
#[derive(Clone, Debug)]
pub(super) struct Hand {
    pose: HandPose,
    left: bool,
    size: f32,
    lengths: [f32; FINGERS],
    /// Factor on [`SPLAY_DEG`].
    spread: f32,
    /// Radians that each finger leans beside that.
    lean: [f32; FINGERS],
    /// Radians by which raised fingers are bent and folded ones not quite closed.
    slack: [f32; FINGERS],
    /// Radians about the line of sight, the horizontal and the vertical.
    roll: f32,
    tilt: f32,
    turn: f32,
    hand_colour: [f32; 3],
    sleeve_colour: [f32; 3],
    /// Lightness of the head's cover, in grey levels.
    head: f32,
    /// Phases of the tremble.
    phases: [f32; 6],
}

impl Hand {
    /// The hand of the person that `seed` stands for, raising `count` fingers (0 to 5).
    pub fn new(count: u8, seed: u64, glove: Glove) -> Self {
        Self::of(seed, glove, |rng| counting(count, rng))
    }

    /// The same person's hand held in that way.
    pub fn posed(pose: HandPose, seed: u64, glove: Glove) -> Self {
        Self::of(seed, glove, |_| pose)
    }

    fn of(seed: u64, glove: Glove, pose: impl FnOnce(&mut ChaCha8Rng) -> HandPose) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        // The person first, then what they show: the same seed is the same person whatever they show.
        let hand_colour = hand_colour(glove, rng);
        let sleeve_colour = sleeve_colour(rng);
        let mut between = |low: f32, high: f32| rng.random_range(low..high);
        let mut hand = Self {
            left: between(0.0, 1.0) < 0.3,
            size: between(0.92, 1.1),
            lengths: std::array::from_fn(|_| between(0.94, 1.06)),
            spread: between(0.85, 1.5),
            lean: std::array::from_fn(|_| between(-0.035, 0.035)),
            slack: std::array::from_fn(|_| between(0.0, 0.12)),
            roll: (between(-1.0, 1.0) + between(-1.0, 1.0)) * 12.5_f32.to_radians(),
            tilt: between(-8.0, 8.0).to_radians(),
            turn: between(-10.0, 10.0).to_radians(),
            phases: std::array::from_fn(|_| between(0.0, std::f32::consts::TAU)),
            hand_colour,
            sleeve_colour,
            head: rng.random_range(60.0..170.0),
            pose: pose(rng),
        };
        match hand.pose.hand {
            Which::Either => {}
            Which::Right => hand.left = false,
            Which::Left => hand.left = true,
        }
        hand.spread *= hand.pose.spread;
        hand.roll += hand.pose.roll_deg.to_radians();
        hand.tilt += hand.pose.tilt_deg.to_radians();
        hand.turn += hand.pose.turn_deg.to_radians();
        hand
    }

    /// The bones at `seconds` since the gesture began: a held hand trembles a little.
    pub fn capsules(&self, seconds: f32) -> Vec<Capsule> {
        // Slow sway and the faster tremor of an outstretched arm, in radians or, for the last two, in metres.
        let sway = |i: usize, amplitude: f32, hertz: f32| {
            amplitude * (std::f32::consts::TAU * hertz * seconds + self.phases[i]).sin()
        };
        let mut bones = Vec::with_capacity(24);
        self.palm(&mut bones);
        for finger in 1..FINGERS {
            self.long_finger(finger, sway(finger, 0.03, 0.7 + 0.2 * finger as f32), &mut bones);
        }
        self.thumb(&mut bones);

        let wrist = Point3::new(0.0, -0.066, 0.0);
        let lean_arm = 0.55;
        let mirror = if self.left { -1.0 } else { 1.0 };
        let rotation = |share: f32| {
            UnitQuaternion::from_euler_angles(
                share * (self.tilt + sway(0, 0.025, 0.45)),
                share * (self.turn + sway(1, 0.03, 0.35)),
                share * (self.roll + sway(2, 0.02, 0.6)),
            )
        };
        let drift = Translation3::new(sway(4, 0.004, 0.5), sway(5, 0.004, 0.8), 0.0);
        let place = Isometry3::from_parts(drift, rotation(1.0));
        let sized = |bone: &Capsule| Capsule {
            from: place
                * Point3::new(
                    mirror * self.size * bone.from.x,
                    self.size * bone.from.y,
                    self.size * bone.from.z,
                ),
            to: place
                * Point3::new(mirror * self.size * bone.to.x, self.size * bone.to.y, self.size * bone.to.z),
            from_radius: self.size * bone.from_radius,
            to_radius: self.size * bone.to_radius,
            colour: bone.colour,
        };
        let mut hand: Vec<Capsule> = bones.iter().map(sized).collect();

        // The arm follows the roll of the hand only in part: the rest is the wrist's.
        let hinge = place * (wrist * self.size);
        let down = rotation(lean_arm) * Vector3::new(0.0, -1.0, -0.25).normalize();
        let along = |metres: f32| hinge + down * metres;
        hand.push(Capsule {
            from: hinge,
            to: along(0.05),
            from_radius: 0.0255 * self.size,
            to_radius: 0.029 * self.size,
            colour: self.hand_colour,
        });
        hand.push(Capsule {
            from: along(0.062),
            to: along(0.34),
            from_radius: 0.036 * self.size,
            to_radius: 0.054 * self.size,
            colour: self.sleeve_colour,
        });
        hand
    }

    /// The person behind the hand: upper arm, trunk, and a head in a grey hood, so that the hand is the one thing of
    /// its colour.
    pub fn body(&self) -> Vec<Capsule> {
        let mirror = if self.left { -1.0 } else { 1.0 };
        let part = |from: [f32; 3], to: [f32; 3], from_radius, to_radius, colour| Capsule {
            from: Point3::new(mirror * from[0], from[1], from[2]),
            to: Point3::new(mirror * to[0], to[1], to[2]),
            from_radius,
            to_radius,
            colour,
        };
        let cloth = self.sleeve_colour.map(|channel| channel * 0.9);
        let hood = [self.head; 3];
        let mut body = vec![
            part([0.20, -0.36, -0.34], [0.52, -0.36, -0.34], 0.075, 0.075, cloth),
            part([0.36, -0.40, -0.35], [0.36, -1.60, -0.35], 0.150, 0.130, cloth),
            part([0.36, -0.26, -0.36], [0.36, -0.14, -0.34], 0.055, 0.055, hood),
            part([0.36, -0.10, -0.33], [0.36, -0.01, -0.34], 0.078, 0.092, hood),
        ];
        if let Some(forearm) = self.capsules(0.0).last() {
            let shoulder = Point3::new(mirror * 0.20, -0.36, -0.34);
            let (from_radius, to_radius) = (forearm.to_radius, 0.070);
            body.push(Capsule { from: forearm.to, to: shoulder, from_radius, to_radius, colour: cloth });
        }
        body
    }

    fn bone(&self, from: Vector3<f32>, to: Vector3<f32>, from_radius: f32, to_radius: f32) -> Capsule {
        Capsule { from: from.into(), to: to.into(), from_radius, to_radius, colour: self.hand_colour }
    }

    fn palm(&self, bones: &mut Vec<Capsule>) {
        for (wrist, knuckle) in WRIST.iter().zip(KNUCKLES) {
            let from = Vector3::new(wrist.0, wrist.1, 0.0);
            bones.push(self.bone(from, Vector3::new(knuckle.0, knuckle.1 - 0.004, 0.0), 0.0145, 0.0122));
        }
        // The ball of the little finger, and the web between the metacarpals.
        bones.push(self.bone(
            Vector3::new(-0.018, -0.045, 0.006),
            Vector3::new(-0.024, -0.012, 0.003),
            0.015,
            0.013,
        ));
        bones.push(self.bone(Vector3::new(0.016, 0.004, 0.0), Vector3::new(-0.018, 0.0, 0.0), 0.015, 0.014));
    }

    /// Forward kinematics: each joint bends further towards the palm (z).
    fn long_finger(&self, finger: usize, tremble: f32, bones: &mut Vec<Capsule>) {
        let i = finger - 1;
        let held = self.pose.fingers()[i];
        // How far each phalanx is bent towards the palm, against the back of the hand.
        let bends_deg: [f32; 3] = match held {
            Finger::Straight => [3.0, 6.0, 9.0],
            Finger::Folded => [76.0, 172.0, 238.0],
            Finger::Hooked => [12.0, 100.0, 150.0],
            Finger::Forward => [80.0, 88.0, 93.0],
            Finger::Pinched => [52.0, 105.0, 150.0],
        };
        let splay = if held == Finger::Folded {
            // Folded fingers close up beside each other.
            SPLAY_DEG[i].to_radians() * 0.25
        } else {
            SPLAY_DEG[i].to_radians() * self.spread + self.lean[finger]
        };
        let slack = if held == Finger::Folded { -self.slack[finger] } else { self.slack[finger] };
        let outward = Vector3::new(splay.sin(), splay.cos(), 0.0);
        let mut joint = Vector3::new(KNUCKLES[i].0, KNUCKLES[i].1, 0.0);
        for (phalanx, length) in PHALANGES[i].iter().enumerate() {
            let bend = bends_deg[phalanx].to_radians() + slack * (phalanx + 1) as f32 + tremble;
            let direction = outward * bend.cos() + Vector3::z() * bend.sin();
            let next = joint + direction * (length * self.lengths[finger]);
            let (thick, thin) = (1.0 - 0.07 * phalanx as f32, 0.93 - 0.07 * phalanx as f32);
            bones.push(self.bone(joint, next, RADIUS[i] * thick, RADIUS[i] * thin));
            joint = next;
        }
    }

    fn thumb(&self, bones: &mut Vec<Capsule>) {
        let root = Vector3::new(0.018, -0.050, 0.006);
        let length = self.lengths[THUMB];
        // The thumb stretched in the plane of the palm, at that angle from the index finger.
        let stretched = |away: f32| {
            let knuckle = Vector3::new(0.042, -0.020, 0.012);
            let joint = knuckle + Vector3::new(away.sin(), away.cos(), 0.12).normalize() * (0.036 * length);
            let tip = joint
                + Vector3::new((away - 0.12).sin(), (away - 0.12).cos(), 0.06).normalize() * (0.029 * length);
            (knuckle, joint, tip)
        };
        let (knuckle, joint, tip) = match self.pose.thumb {
            // 38° to 55° from the index finger.
            Thumb::Out => {
                stretched((38.0_f32 + 17.0 * (self.spread - 0.85) / 0.65).to_radians() + self.lean[THUMB])
            }
            Thumb::Wide => stretched(88.0_f32.to_radians() + self.lean[THUMB]),
            Thumb::Beside => stretched(4.0_f32.to_radians() + self.lean[THUMB]),
            Thumb::Pinched => (
                Vector3::new(0.042, -0.020, 0.022),
                Vector3::new(0.047, 0.008, 0.046),
                Vector3::new(0.039, 0.026, 0.064),
            ),
            // Laid across the open palm, its tip at the ring finger's root.
            Thumb::Folded if self.pose.index != Finger::Folded && self.pose.middle != Finger::Folded => (
                Vector3::new(0.031, -0.022, 0.020),
                Vector3::new(0.009, -0.006, 0.026),
                Vector3::new(-0.013, 0.001, 0.024),
            ),
            // Across the folded fingers.
            Thumb::Folded => (
                Vector3::new(0.034, -0.020, 0.026),
                Vector3::new(0.022, 0.002, 0.047),
                Vector3::new(0.0, 0.010, 0.053),
            ),
        };
        bones.push(self.bone(root, knuckle, 0.0185, 0.0135));
        bones.push(self.bone(knuckle, joint, 0.0118, 0.0108));
        bones.push(self.bone(joint, tip, 0.0108, 0.0088));
    }
}

/// Which fingers make up a count: most people begin with the index finger, some with the thumb.
fn counting(count: u8, rng: &mut impl Rng) -> HandPose {
    let from_thumb = rng.random_bool(0.2);
    let fingers: &[usize] = match (count, from_thumb) {
        (0, _) => &[],
        (1, _) => &[1],
        (2, false) => &[1, 2],
        (2, true) => &[0, 1],
        (3, false) => &[1, 2, 3],
        (3, true) => &[0, 1, 2],
        (4, _) => &[1, 2, 3, 4],
        _ => &[0, 1, 2, 3, 4],
    };
    let held = |finger| if fingers.contains(&finger) { Finger::Straight } else { Finger::Folded };
    HandPose {
        thumb: if fingers.contains(&THUMB) { Thumb::Out } else { Thumb::Folded },
        index: held(1),
        middle: held(2),
        ring: held(3),
        little: held(4),
        ..HandPose::default()
    }
}

fn hand_colour(glove: Glove, rng: &mut impl Rng) -> [f32; 3] {
    let base: [f32; 3] = match glove {
        Glove::Cyan => [178.0, 168.0, 22.0],
        Glove::Orange => [18.0, 118.0, 240.0],
        Glove::Skin => {
            const TONES: [[f32; 3]; 4] =
                [[150.0, 190.0, 242.0], [105.0, 160.0, 222.0], [75.0, 125.0, 192.0], [45.0, 85.0, 141.0]];
            TONES[rng.random_range(0..TONES.len())]
        }
    };
    let shade = rng.random_range(0.85..1.12);
    base.map(|channel| (channel * shade * rng.random_range(0.94..1.06)).min(255.0))
}

/// Everyday cloth: dark to medium, hardly saturated.
fn sleeve_colour(rng: &mut impl Rng) -> [f32; 3] {
    let lightness = rng.random_range(45.0..150.0);
    std::array::from_fn(|_| lightness * rng.random_range(0.95_f32..1.05))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_fingers_are_raised_as_the_count_says() {
        for seed in 0..50 {
            for count in 0..=5 {
                let hand = Hand::new(count, seed, Glove::Cyan);
                let fingers = hand.pose.fingers().into_iter().filter(|finger| *finger == Finger::Straight);
                let thumb = usize::from(hand.pose.thumb == Thumb::Out);
                assert_eq!(fingers.count() + thumb, usize::from(count));
            }
        }
    }

    #[test]
    fn raised_fingers_reach_beyond_folded_ones() {
        let top = |count| {
            let hand = Hand { roll: 0.0, ..Hand::new(count, 7, Glove::Cyan) };
            hand.capsules(0.0).iter().map(|bone| bone.from.y.max(bone.to.y)).fold(f32::MIN, f32::max)
        };
        assert!(top(4) > top(0) + 0.04);
    }

    #[test]
    fn a_hand_points_where_its_pose_says_whoever_it_belongs_to() {
        // Where the tip of the index finger is, seen from the middle of the palm.
        let tip = |pose: HandPose, seed| {
            let hand = Hand { roll: pose.roll_deg.to_radians(), ..Hand::posed(pose, seed, Glove::Cyan) };
            let bones = hand.capsules(0.0);
            // After the palm's six bones come the index finger's three.
            bones[8].to
        };
        let pointing = HandPose { index: Finger::Straight, ..HandPose::default() };
        for seed in 0..20 {
            let up = tip(pointing, seed);
            assert!(up.y > 0.1 && up.x.abs() < 0.06, "{up}");
            let left = tip(HandPose { roll_deg: 90.0, ..pointing }, seed);
            assert!(left.x < -0.1 && left.y.abs() < 0.06, "{left}");
            let down = tip(HandPose { roll_deg: 180.0, ..pointing }, seed);
            assert!(down.y < -0.1, "{down}");
            let you = tip(HandPose { index: Finger::Forward, ..pointing }, seed);
            assert!(you.z > 0.07, "{you}");
            // Its tip and the thumb's, the last bone of the hand, all but meet.
            let ring = HandPose { thumb: Thumb::Pinched, index: Finger::Pinched, ..HandPose::default() };
            let ring = Hand::posed(ring, seed, Glove::Cyan).capsules(0.0);
            let gap = (ring[8].to - ring[20].to).norm();
            assert!(gap < 0.028, "{gap}");
        }
    }

    #[test]
    fn a_held_hand_trembles_by_millimetres() {
        let hand = Hand::new(5, 1, Glove::Cyan);
        let tip = |seconds| hand.capsules(seconds)[17].to;
        let moved = (tip(0.0) - tip(0.5)).norm();
        assert!((0.0002..0.02).contains(&moved), "{moved}");
    }
}
