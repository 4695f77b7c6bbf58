//! What the networks take for a hand, rightly and wrongly, in pictures made like those they learned from: to be taught anew.

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::counting::Shown;
use crate::frames::{Crop, Frame, Hand, Scene, crop_at, generator};
use crate::image::{Outside, Pyramid};
use crate::look::{Candidate, Found, candidates, corrected, largest, shown};
use crate::losses::sigmoid;
use crate::places::{CROP, Place, ROOM, onto_crop, onto_mask, overlap};
use crate::robots::{Robot, Weights};
use crate::scenery::Scenery;

/// A candidate that overlaps every hand less is none; one that overlaps a hand more is that hand.
const NONE: f32 = 0.15;
const SAME: f32 = 0.35;
/// What convinces less than this does no harm.
const HARMLESS: f32 = 0.1;
/// What convinces more than this is worth being taught anew.
const ALARMING: f32 = 0.25;

#[derive(Default)]
pub struct Mined {
    /// Frames in which something was taken for a hand.
    pub frames: Vec<Frame>,
    /// Hands that were looked at closely.
    pub hands: Vec<Crop>,
    /// What was taken for a hand, and how likely.
    pub others: Vec<(f32, Crop)>,
    pub shown: Vec<Shown>,
}

impl Mined {
    fn and(mut self, mut other: Self) -> Self {
        self.frames.append(&mut other.frames);
        self.hands.append(&mut other.hands);
        self.others.append(&mut other.others);
        self.shown.append(&mut other.shown);
        self
    }

    /// The close looks: all at hands, and as many at what was most likely taken for one.
    pub fn crops(mut self) -> Vec<Crop> {
        self.others.sort_by(|a, b| b.0.total_cmp(&a.0));
        let others = self.others.into_iter().take(self.hands.len());
        self.hands.into_iter().chain(others.map(|(_, crop)| crop)).collect()
    }
}

/// Looks at so many scenes.
pub fn mine(scenery: &Scenery, weights: &Weights, seed: u64, count: usize) -> Mined {
    let robot = || weights.robot().expect("the weights are those of the networks");
    let look = |robot: &mut Robot, i| look_at(scenery, robot, &mut generator(seed, i));
    // In order, whoever comes first: the same seed gives the same.
    let all: Vec<Mined> = (0..count as u64).into_par_iter().map_init(robot, look).collect();
    all.into_iter().fold(Mined::default(), Mined::and)
}

fn look_at(scenery: &Scenery, robot: &mut Robot, rng: &mut ChaCha8Rng) -> Mined {
    let scene = Scene::new(scenery, rng, 2);
    let picture = scene.canvas.to_pyramid();
    let mask = scene.mask.to_pyramid();
    let (window, corner) = scene.window(rng);
    let window_picture = window.canvas.to_pyramid();
    let mut mined = Mined::default();
    for (part, seen, (x, y)) in [(&scene, &picture, (0.0, 0.0)), (&window, &window_picture, corner)] {
        let mut fooled = false;
        for mut candidate in candidates(robot, seen, 3) {
            candidate.place.x += x;
            candidate.place.y += y;
            fooled |= close_up(&scene, (&picture, &mask), candidate, robot, &mut mined);
        }
        if fooled {
            mined.frames.push(part.frame());
        }
    }
    mined
}

/// Looks at one place twice, as robots do. Says whether something was taken for a hand that is none.
fn close_up(
    scene: &Scene,
    (picture, mask): (&Pyramid, &Pyramid),
    candidate: Candidate,
    robot: &mut Robot,
    mined: &mut Mined,
) -> bool {
    let of = |place: &Place| {
        let each = scene.hands.iter().map(|hand| (overlap(&hand.place, place), hand));
        each.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut place = candidate.place;
    let mut fooled = false;
    for pass in 0..2 {
        let near = of(&place);
        let overlap = near.as_ref().map_or(0.0, |near| near.0);
        let crop = crop_at(picture, &place);
        let (six, seen) = robot.refine(&crop);
        let confidence = candidate.score.sqrt() * sigmoid(six[0]);
        let found = || Found { place: corrected(&place, &six), crop: place, mask: largest(seen.clone()) };
        if overlap < NONE {
            if confidence < HARMLESS {
                return fooled;
            }
            fooled |= confidence > ALARMING;
            mined.others.push((confidence, Crop { picture: crop, mask: vec![0; CROP * CROP], hand: None }));
            if pass == 1 && confidence > ALARMING {
                let taken = shown(picture, &found());
                mined.shown.extend(taken.map(|taken| Shown { hand: false, ..taken }));
            }
        } else if let Some((_, hand)) = near.filter(|_| overlap > SAME) {
            mined.hands.extend(teachable(hand, &place, mask, crop));
            if pass == 1 {
                let found = found();
                let onto = onto_mask(&found.place);
                let taken = shown(picture, &found).filter(|_| hand.count.is_none_or(|count| count < 6));
                mined.shown.extend(taken.map(|taken| Shown {
                    count: hand.count,
                    fingers: hand.fingers,
                    joints: hand.joints.map(|joints| onto.joints(&joints)),
                    origin: hand.origin,
                    ..taken
                }));
            }
        } else {
            return fooled;
        }
        place = corrected(&place, &six);
    }
    fooled
}

/// What the refiner should say of a crop; `None` where that is more than it can say.
fn teachable(hand: &Hand, place: &Place, mask: &Pyramid, picture: Vec<u8>) -> Option<Crop> {
    let (s, c) = place.up.sin_cos();
    let (x, y) = (hand.place.x - place.x, hand.place.y - place.y);
    let sides = |v: f32| v / (ROOM * place.side);
    let (right, down) = (sides(x * c + y * s), sides(y * c - x * s));
    let larger = (hand.place.side / place.side).ln();
    if right.abs().max(down.abs()) > 0.4 || larger.abs() > 0.7 {
        return None;
    }
    let mask = mask.warp(&onto_crop(place), CROP, CROP, Outside::Zero).to_bytes();
    Some(Crop { picture, mask, hand: Some([right, down, larger, hand.place.up - place.up]) })
}
