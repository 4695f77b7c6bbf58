//! The masks of learned eyes against outlines of bare hands that were checked by eye. The outlines are in `truth/masks.csv`; the
//! pictures are not part of the project: `GESTALT_DATA`, or `../shared/data` seen from the workspace; skipped where there are
//! none. Most of them but the plain walls' had a part in making the weights, there with masks that were made without an eye on
//! them: only what is said of plain walls is said of a camera and a person never seen.
//!
//! `cargo test -p gestalt-vision --test masks -- --nocapture` prints the figures.

#![cfg(feature = "opencv")]

use std::collections::BTreeMap;

use gestalt_vision::eyes::{Eyes, Look};
use gestalt_vision::perception::NoObservation;
use gestalt_vision::source::read_image;
use opencv::core::{
    BORDER_CONSTANT, CMP_GT, CMP_LE, Mat, Scalar, bitwise_and_def, compare, copy_make_border,
};
use opencv::imgproc::{DIST_L2, connected_components_def, distance_transform_def};
use opencv::prelude::*;

const TRUTH: &str = include_str!("truth/masks.csv");
/// Its pictures show a hand before a plain wall, and no picture of it had a part in making the weights.
const PLAIN: &str = "webcam-fingers";
/// Pixels of a mask, and how many sides of its view it is wide.
const SIDE: usize = 64;
const ROOM: f64 = 1.55;

/// What today's weights do, with a little room. What is wanted of them: a mean intersection over union of .90 of all pictures, and
/// .97 of the fingers' pixels before plain walls.
struct Least {
    /// Share of the pictures in which a hand is found.
    found: f64,
    /// Mean intersection over union, of all pictures, 0 where none is found.
    overlap: f64,
    /// The same of each set.
    overlap_of_each_set: f64,
    /// Mean share of the fingers' pixels that are the mask's, of the pictures before plain walls.
    fingers: f64,
}

const LEAST: Least = Least { found: 0.82, overlap: 0.68, overlap_of_each_set: 0.49, fingers: 0.94 };

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works] every_outline_is_a_hands,
        [Works] fingers_are_what_sticks_out,
        [Works, Data] masks_cover_hands_and_little_else,
    ])
}

/// Pixels of a picture.
#[derive(Clone, PartialEq)]
struct Pixels {
    width: usize,
    inside: Vec<bool>,
}

impl Pixels {
    fn of(width: usize, height: usize, inside: impl Fn(usize, usize) -> bool) -> Self {
        Self { width, inside: (0..width * height).map(|i| inside(i % width, i / width)).collect() }
    }

    fn count(&self) -> usize {
        self.inside.iter().filter(|inside| **inside).count()
    }

    fn shared_with(&self, other: &Self) -> usize {
        assert_eq!((self.width, self.inside.len()), (other.width, other.inside.len()));
        self.inside.iter().zip(&other.inside).filter(|(ours, theirs)| **ours && **theirs).count()
    }

    fn intersection_over_union(&self, other: &Self) -> f64 {
        let shared = self.shared_with(other);
        shared as f64 / (self.count() + other.count() - shared) as f64
    }

    /// Which share of these are the other's.
    fn recall(&self, other: &Self) -> f64 {
        self.shared_with(other) as f64 / self.count() as f64
    }
}

/// The outline of a hand.
struct Outline {
    picture: &'static str,
    width: usize,
    height: usize,
    rings: Vec<Vec<(f64, f64)>>,
}

impl Outline {
    fn all() -> Vec<Self> {
        TRUTH.lines().filter(|line| !line.starts_with('#')).map(Self::read).collect()
    }

    fn read(line: &'static str) -> Self {
        let mut fields = line.split(',');
        let picture = fields.next().unwrap();
        let mut size = || fields.next().unwrap().parse().unwrap();
        let (width, height) = (size(), size());
        let ring = |text: &str| -> Vec<(f64, f64)> {
            let numbers: Vec<f64> = text.split(' ').map(|number| number.parse().unwrap()).collect();
            numbers.chunks(2).map(|point| (point[0], point[1])).collect()
        };
        Self { picture, width, height, rings: fields.map(ring).collect() }
    }

    fn set(&self) -> &'static str {
        self.picture.split('/').next().unwrap()
    }

    /// The pixels whose centres are inside an odd number of rings.
    fn pixels(&self) -> Pixels {
        let mut pixels = Pixels::of(self.width, self.height, |_, _| false);
        for (y, row) in pixels.inside.chunks_mut(self.width).enumerate() {
            let y = y as f64;
            for ring in &self.rings {
                for (from, to) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                    if (from.1 <= y) != (to.1 <= y) {
                        let x = from.0 + (y - from.1) / (to.1 - from.1) * (to.0 - from.0);
                        let first = (x.ceil().max(0.0) as usize).min(row.len());
                        row[first..].iter_mut().for_each(|inside| *inside = !*inside);
                    }
                }
            }
        }
        pixels
    }
}

/// A hand's fingers: the parts that a disc half as wide as the palm cannot reach, and that stick out of what it reaches by more
/// than .7 of the palm's radius, which is that of the largest disc within the hand. Also how many there are.
fn fingers(hand: &Pixels) -> (Pixels, usize) {
    let (width, height) = (hand.width, hand.inside.len() / hand.width);
    let bytes: Vec<u8> = hand.inside.iter().map(|inside| 255 * u8::from(*inside)).collect();
    let image = Mat::new_rows_cols_with_data(height as i32, width as i32, &bytes).unwrap();
    let mut padded = Mat::default();
    copy_make_border(&image, &mut padded, 1, 1, 1, 1, BORDER_CONSTANT, Scalar::default()).unwrap();
    let mut within = Mat::default();
    distance_transform_def(&padded, &mut within, DIST_L2, 5).unwrap();
    let radius = f64::from(within.data_typed::<f32>().unwrap().iter().copied().fold(0.0, f32::max));
    let (mut off, mut away) = (Mat::default(), Mat::default());
    compare(&within, &Scalar::all(radius / 2.0), &mut off, CMP_LE).unwrap();
    distance_transform_def(&off, &mut away, DIST_L2, 5).unwrap();
    let (mut beyond, mut rest) = (Mat::default(), Mat::default());
    compare(&away, &Scalar::all(radius / 2.0), &mut beyond, CMP_GT).unwrap();
    bitwise_and_def(&beyond, &padded, &mut rest).unwrap();
    let mut labels = Mat::default();
    let count = connected_components_def(&rest, &mut labels).unwrap();
    let labels = labels.data_typed::<i32>().unwrap();
    let mut reach = vec![0.0_f32; count as usize];
    for (label, away) in labels.iter().zip(away.data_typed::<f32>().unwrap()) {
        let reach = &mut reach[*label as usize];
        *reach = reach.max(*away);
    }
    let far: Vec<bool> =
        (0..).zip(&reach).map(|(label, reach)| label > 0 && f64::from(*reach) > 1.2 * radius).collect();
    let label = |x: usize, y: usize| labels[(y + 1) * (width + 2) + x + 1] as usize;
    let pixels = Pixels::of(width, height, |x, y| far[label(x, y)]);
    (pixels, far.iter().filter(|far| **far).count())
}

/// Where the pixels of a frame are in a look's mask.
fn onto_mask(look: &Look) -> impl Fn(f64, f64) -> (f64, f64) {
    let view = look.view;
    let scale = SIDE as f64 / (ROOM * f64::from(view.side));
    let (sin, cos) = f64::from(view.up).sin_cos();
    let centre = (SIDE as f64 - 1.0) / 2.0;
    move |x, y| {
        let (right, down) = (x - f64::from(view.x), y - f64::from(view.y));
        (centre + scale * (cos * right + sin * down), centre + scale * (cos * down - sin * right))
    }
}

/// The pixels of a frame of that size where a mask is above a half, between whose pixels it runs straight.
fn enlarged(mask: &[f32], look: &Look, width: usize, height: usize) -> Pixels {
    let onto = onto_mask(look);
    let value = |x: f64, y: f64| {
        let within = (0.0..SIDE as f64).contains(&x) && (0.0..SIDE as f64).contains(&y);
        if within { f64::from(mask[y as usize * SIDE + x as usize]) } else { 0.0 }
    };
    Pixels::of(width, height, |x, y| {
        let (x, y) = onto(x as f64, y as f64);
        let (left, top) = (x.floor(), y.floor());
        let (right, down) = (x - left, y - top);
        let row = |y| value(left, y) * (1.0 - right) + value(left + 1.0, y) * right;
        row(top) * (1.0 - down) + row(top + 1.0) * down > 0.5
    })
}

/// The best mask that could be had of that view: which share of each of its pixels is the hand's.
fn ideal(hand: &Outline, look: &Look) -> Vec<f32> {
    // Each pixel is judged at 6 by 6 points; the hand is drawn in the mask's own frame.
    const POINTS: usize = 6;
    let onto = onto_mask(look);
    let fine = |at: f64| (at + 0.5) * POINTS as f64 - 0.5;
    let turned = |&(x, y): &(f64, f64)| {
        let (x, y) = onto(x, y);
        (fine(x), fine(y))
    };
    let rings = hand.rings.iter().map(|ring| ring.iter().map(turned).collect()).collect();
    let pixels =
        Outline { picture: hand.picture, width: SIDE * POINTS, height: SIDE * POINTS, rings }.pixels();
    let mut mask = vec![0.0; SIDE * SIDE];
    for (i, _) in pixels.inside.iter().enumerate().filter(|(_, inside)| **inside) {
        let (x, y) = (i % pixels.width / POINTS, i / pixels.width / POINTS);
        mask[y * SIDE + x] += 1.0 / (POINTS * POINTS) as f32;
    }
    mask
}

fn every_outline_is_a_hands() {
    let outlines = Outline::all();
    assert!(outlines.len() >= 66, "{}", outlines.len());
    for outline in &outlines {
        let hand = outline.pixels();
        let share = hand.count() as f64 / hand.inside.len() as f64;
        assert!((0.01..0.6).contains(&share), "{}: {share} of the picture", outline.picture);
        if outline.set() == PLAIN {
            let raised: usize = outline.picture.split('/').nth(1).unwrap().parse().unwrap();
            assert_eq!(fingers(&hand).1, raised, "{}", outline.picture);
        }
    }
    let mut pictures: Vec<_> = outlines.iter().map(|outline| outline.picture).collect();
    pictures.dedup();
    assert_eq!(pictures.len(), outlines.len());
}

fn fingers_are_what_sticks_out() {
    let palm = |x: usize, y: usize| x.abs_diff(50).pow(2) + y.abs_diff(60).pow(2) <= 400;
    let first = |x: usize, y: usize| (38..=46).contains(&x) && (10..60).contains(&y);
    let second = |x: usize, y: usize| (56..=64).contains(&x) && (10..60).contains(&y);
    let hand = Pixels::of(100, 100, |x, y| palm(x, y) || first(x, y) || second(x, y));
    let (seen, count) = fingers(&hand);
    assert_eq!(count, 2);
    let drawn = Pixels::of(100, 100, |x, y| (first(x, y) || second(x, y)) && y < 40);
    assert!(seen.recall(&hand) == 1.0 && drawn.recall(&seen) > 0.9, "{}", drawn.recall(&seen));
    assert!(seen.intersection_over_union(&drawn) > 0.8);
    let (none, count) = fingers(&Pixels::of(100, 100, palm));
    assert_eq!((none.count(), count), (0, 0));
}

/// Of the pictures of one set, sums.
#[derive(Default)]
struct Sums {
    pictures: f64,
    found: f64,
    overlap: f64,
    ideal: f64,
    fingers: f64,
    ideal_fingers: f64,
    with_fingers: f64,
}

impl Sums {
    fn print(&self, set: &str) {
        let Self { pictures, found, overlap, ideal, fingers, ideal_fingers, with_fingers } = self;
        eprintln!(
            "{set:>15}: a hand in {found} of {pictures}; intersection over union {:.3} of those found, {:.3} of all; \
             of the fingers {:.3} where found; best of 64×64: {:.3}, {:.3}",
            overlap / found,
            overlap / pictures,
            fingers / with_fingers,
            ideal / found,
            ideal_fingers / with_fingers
        );
    }
}

fn masks_cover_hands_and_little_else() {
    let mut eyes = Eyes::shipped().unwrap();
    let mut sets = BTreeMap::<&str, Sums>::new();
    for outline in Outline::all() {
        let path = gestalt_trials::data().join(outline.picture);
        let frame = read_image(&path).unwrap();
        assert_eq!((frame.cols(), frame.rows()), (outline.width as i32, outline.height as i32));
        let look = match eyes.look(&frame, None) {
            Ok(look) => Some(look),
            Err(NoObservation::NoHand(_)) => None,
            Err(error) => panic!("{}: {error}", outline.picture),
        };
        let hand = outline.pixels();
        let (fingers, count) = fingers(&hand);
        for set in [outline.set(), "all"] {
            let sums = sets.entry(set).or_default();
            sums.pictures += 1.0;
            let Some(look) = &look else { continue };
            let seen = enlarged(&look.mask, look, outline.width, outline.height);
            let best = enlarged(&ideal(&outline, look), look, outline.width, outline.height);
            let overlap = hand.intersection_over_union(&seen);
            sums.found += 1.0;
            sums.overlap += overlap;
            sums.ideal += hand.intersection_over_union(&best);
            if count > 0 {
                sums.with_fingers += 1.0;
                sums.fingers += fingers.recall(&seen);
                sums.ideal_fingers += fingers.recall(&best);
            }
            if overlap < 0.75 && set != "all" {
                eprintln!("{}: {overlap:.3}", outline.picture);
            }
        }
    }
    for (set, sums) in &sets {
        sums.print(set);
        let overlap = sums.overlap / sums.pictures;
        assert!(overlap >= LEAST.overlap_of_each_set, "{set}: {overlap}");
    }
    let (all, plain) = (&sets["all"], &sets[PLAIN]);
    assert!(all.found / all.pictures >= LEAST.found && all.overlap / all.pictures >= LEAST.overlap);
    assert!(plain.fingers / plain.with_fingers >= LEAST.fingers);
}
