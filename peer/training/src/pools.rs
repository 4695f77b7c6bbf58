//! The hands that the counter is taught with, by shares.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::chance::normal;
use crate::counting::{self, Shown};
use crate::drawn::Drawn;
use crate::frames;
use crate::image::Outside;
use crate::look;
use crate::mining;
use crate::photos::Photo;
use crate::places::{MASK, Place, onto_mask};
use crate::robots::Weights;
use crate::scenery::{self, Scenery};

/// A photo with its own mask, as the counter is shown it.
pub fn with_truth(photo: &Photo) -> Option<Shown> {
    let map = onto_mask(&photo.place);
    let picture = photo.picture.warp(&map, MASK, MASK, Outside::Nearest).to_pyramid();
    let frame = counting::frame(&photo.mask, photo.place.up)?;
    Some(Shown {
        picture,
        mask: photo.mask.clone(),
        arm: photo.arm.clone(),
        frame,
        count: photo.count,
        hand: true,
        origin: photo.origin,
        fingers: photo.fingers,
        joints: Some(map.joints(&photo.joints)),
        drawn: false,
        seen: false,
    })
}

/// A drawn hand, as the counter is shown it.
pub fn drawn(hand: &Drawn) -> Option<Shown> {
    Some(Shown {
        picture: hand.shade.clone(),
        mask: hand.mask.clone(),
        arm: hand.arm.clone(),
        frame: counting::frame(&hand.mask, 0.0)?,
        count: Some(hand.fingers.iter().filter(|f| **f).count() as u8),
        fingers: Some(hand.fingers),
        joints: Some(hand.joints),
        hand: true,
        origin: scenery::DRAWN,
        drawn: true,
        seen: false,
    })
}

/// What the counter is shown, by shares: real hands with good masks and with those that robots get, and drawn ones.
pub fn pools(scenery: &Scenery, weights: &Weights, seed: u64, scenes: usize) -> Vec<(f32, Vec<Shown>)> {
    let mut pools = Vec::new();
    let by_set = scenery.photos.by_set();
    for set in &scenery.photos.sets {
        let Some(all) = by_set.get(set.name.as_str()) else { continue };
        let share = set.counter;
        let good: Vec<Shown> = all.par_iter().filter_map(|&i| with_truth(&scenery.photos.hands[i])).collect();
        pools.push((0.5 * share, good));
        let all: Vec<&Photo> = all.iter().map(|&i| &scenery.photos.hands[i]).collect();
        pools.push((1.4 * share, seen(&all, weights, seed)));
    }
    pools.push((1.2, scenery.drawn.iter().filter_map(drawn).collect()));
    // Hands in any surroundings, as a look shows them, and what else it takes for hands.
    let mined = mining::mine(scenery, weights, seed + 1, scenes);
    let (hands, wrong): (Vec<_>, Vec<_>) = mined.shown.into_iter().partition(|shown| shown.hand);
    pools.push((2.6, hands));
    pools.push((1.0, wrong));
    pools.retain(|(share, pool): &(f32, Vec<Shown>)| *share > 0.0 && !pool.is_empty());
    pools
}

pub fn iou(a: &[u8], b: &[u8]) -> f32 {
    let both = a.iter().zip(b).filter(|(a, b)| **a > 127 && **b > 127).count();
    let any = a.iter().zip(b).filter(|(a, b)| **a > 127 || **b > 127).count();
    both as f32 / any.max(1) as f32
}

/// Real hands with the masks that a look gives: from about where they are, as the finder would say it.
fn seen(photos: &[&Photo], weights: &Weights, seed: u64) -> Vec<Shown> {
    let robot = || weights.robot().expect("the weights are those of the networks");
    photos
        .par_iter()
        .enumerate()
        .map_init(robot, |robot, (i, photo)| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(i as u64);
            let mut all = Vec::new();
            for _ in 0..4 {
                let off = 0.07 * photo.place.side;
                let start = Place {
                    x: photo.place.x + off * normal(&mut rng),
                    y: photo.place.y + off * normal(&mut rng),
                    side: photo.place.side * (0.1 * normal(&mut rng)).exp(),
                    up: photo.place.up
                        + 0.2 * normal(&mut rng)
                        + if rng.random::<f32>() < 0.04 { 1.5 } else { 0.0 },
                };
                let (six, _) = robot.refine(&frames::crop_at(&photo.picture, &start));
                let crop = look::corrected(&start, &six);
                let (six, mask) = robot.refine(&frames::crop_at(&photo.picture, &crop));
                let mask = look::largest(mask);
                let truth = frames::mask_at(&photo.mask, &photo.place, &crop);
                let bytes: Vec<u8> = mask.iter().map(|m| (m * 255.0) as u8).collect();
                if iou(&bytes, &truth) < 0.5 {
                    continue;
                }
                let found = look::Found { place: look::corrected(&crop, &six), crop, mask };
                all.extend(look::shown(&photo.picture, &found).map(|shown| Shown {
                    count: photo.count,
                    fingers: photo.fingers,
                    joints: Some(onto_mask(&found.place).joints(&photo.joints)),
                    origin: photo.origin,
                    ..shown
                }));
            }
            all
        })
        .flatten_iter()
        .collect()
}
