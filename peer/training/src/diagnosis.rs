//! Where in a look things go wrong: how often the count is right with what robots find, with the place known, with the mask known.

use std::error::Error;
use std::path::Path;

use gestalt_vision::eyes::Eyes;
use gestalt_vision::network::{Counter, FeatureMap};
use gestalt_vision::perception::NoObservation;
use opencv::imgcodecs::{IMREAD_COLOR, imread};

use crate::counting::{self, Shown};
use crate::folder;
use crate::frames::{crop_at, mask_at};
use crate::look::{Found, corrected, largest, shown};
use crate::photos::{Photo, Photos};
use crate::places::overlap;
use crate::pools::{iou, with_truth};
use crate::robots::{Robot, Weights};
use crate::sets::Sets;

/// A hand lies where it was found if the squares overlap more than this.
const NEAR: f32 = 0.3;
/// Degrees by which a hand is turned otherwise than it was found.
const TURNED: f32 = 20.0;

/// How many photos, and of them how many …
#[derive(Default)]
struct Tally {
    photos: usize,
    found: usize,
    near: usize,
    turned: usize,
    right: usize,
    right_with_place: usize,
    right_with_mask: usize,
    /// Of the masks with the place known: intersection over union with those of the photos.
    overlaps: Vec<f32>,
}

/// What the counter takes a hand for.
fn count(net: &mut Counter, shown: &Shown) -> u8 {
    let mut map = FeatureMap::new(2, counting::SIDE, counting::SIDE);
    map.values_mut().copy_from_slice(&counting::turned(shown, 0.0, 1.0));
    highest(&net.run(&map).counts)
}

fn highest(values: &[f32; 6]) -> u8 {
    (0..6).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or_default() as u8
}

/// Prints a row for each set. `folder`: of the weights.
pub fn print(folder: &Path, sets: &Sets, photos: &Photos) -> Result<(), Box<dyn Error>> {
    let [finder, refiner, counter] = folder::weights(folder)?;
    let (mut eyes, mut counter) = (Eyes::new(&finder, &refiner, &counter)?, Counter::decode(&counter)?);
    let mut robot = Weights::new(finder, refiner).robot()?;
    println!(
        "| set | photos | found | near it | turned > {TURNED}° | right | with the place known | with the mask known | mask: mean | a tenth below |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (set, all) in photos.by_set() {
        let mut tally = Tally::default();
        let counted = |photo: &&Photo| photo.count.is_some_and(|count| count < 6);
        for photo in all.iter().map(|&i| &photos.hands[i]).filter(counted) {
            tally.add(photo, sets, &mut eyes, &mut robot, &mut counter)?;
        }
        tally.print(set);
    }
    Ok(())
}

impl Tally {
    fn add(
        &mut self,
        photo: &Photo,
        sets: &Sets,
        eyes: &mut Eyes,
        robot: &mut Robot,
        counter: &mut Counter,
    ) -> Result<(), Box<dyn Error>> {
        let right = |said: Option<u8>| usize::from(said == photo.count);
        self.photos += 1;
        match eyes.look(&imread(sets.picture(&photo.path), IMREAD_COLOR)?, None) {
            Ok(look) => {
                let near = overlap(&look.place, &photo.place) > NEAR;
                let turn = (look.place.up - photo.place.up).to_degrees().rem_euclid(360.0);
                self.found += 1;
                self.near += usize::from(near);
                self.turned += usize::from(near && turn.min(360.0 - turn) > TURNED);
                self.right += right(Some(highest(&look.counts)));
            }
            Err(NoObservation::NoHand(_)) => (),
            Err(error) => return Err(error.into()),
        }
        let (six, _) = robot.refine(&crop_at(&photo.picture, &photo.place));
        let crop = corrected(&photo.place, &six);
        let (six, mask) = robot.refine(&crop_at(&photo.picture, &crop));
        let mask = largest(mask);
        let bytes: Vec<u8> = mask.iter().map(|share| (share * 255.0) as u8).collect();
        self.overlaps.push(iou(&bytes, &mask_at(&photo.mask, &photo.place, &crop)));
        let found = Found { place: corrected(&crop, &six), crop, mask };
        self.right_with_place += right(shown(&photo.picture, &found).map(|shown| count(counter, &shown)));
        self.right_with_mask += right(with_truth(photo).map(|shown| count(counter, &shown)));
        Ok(())
    }

    fn print(mut self, set: &str) {
        if self.photos == 0 {
            return;
        }
        self.overlaps.sort_by(f32::total_cmp);
        let mean = self.overlaps.iter().sum::<f32>() / self.overlaps.len() as f32;
        let Self { photos, found, near, turned, right, right_with_place, right_with_mask, .. } = self;
        let share = |n: usize| format!("{:.3}", n as f32 / photos as f32);
        let [found, near, turned] = [found, near, turned].map(share);
        let [right, with_place, with_mask] = [right, right_with_place, right_with_mask].map(share);
        let tenth = self.overlaps[self.overlaps.len() / 10];
        println!(
            "| {set} | {photos} | {found} | {near} | {turned} | {right} | {with_place} | {with_mask} | {mean:.3} | {tenth:.3} |"
        );
    }
}
