//! The real pictures: where the hand is in each, which pixels it has, and what it shows.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_vision::dataset::LabelledImage;
use gestalt_vision::source::{Scene, Source, SourceError, Video};
use opencv::core::{CV_8UC1, Mat, Point, Rect, Scalar, Vector};
use opencv::imgcodecs::{IMREAD_COLOR, imread};
use opencv::imgproc::{
    FILLED, GC_BGD, GC_FGD, GC_INIT_WITH_MASK, GC_PR_BGD, GC_PR_FGD, LINE_8, circle, fill_poly_def, grab_cut,
    line,
};
use opencv::prelude::*;
use rayon::prelude::*;
use thiserror::Error;

use crate::image::{Affine, Joints, Outside, Pyramid};
use crate::places::{MASK, Place, onto_mask};
use crate::sets::{Damaged, NONE, Set, Sets, Shows};

const HANDS: &str = include_str!("../truth/hands.csv");
const FACES: &str = include_str!("../truth/faces.csv");

/// Why a picture cannot be used.
#[derive(Debug, Error)]
pub enum PhotoError {
    #[error("{0}: no picture there: say where the data sets are with --data")]
    Missing(PathBuf),
    #[error(transparent)]
    Truth(#[from] Damaged),
    #[error(transparent)]
    Video(#[from] SourceError),
    #[error(transparent)]
    OpenCv(#[from] opencv::Error),
}

/// One real picture with one hand.
pub struct Photo {
    pub set: String,
    pub path: String,
    pub picture: Pyramid,
    pub place: Place,
    pub joints: Joints,
    /// Of the hand alone, around its place, not turned: [`MASK`] pixels are [`COVERED`] sides.
    pub mask: Pyramid,
    /// The same of hand and forearm.
    pub arm: Pyramid,
    /// The number of its set.
    pub origin: u32,
    /// The number of fingers; `None` for other gestures.
    pub count: Option<u8>,
    /// Which fingers, thumb first, where the set says it.
    pub fingers: Option<[bool; 5]>,
}

pub struct Photos {
    pub hands: Vec<Photo>,
    /// Faces, of 96 by 96 pixels each, to be taken for no hand.
    pub faces: Vec<Pyramid>,
    /// Pictures without any raised hand: of each set, how often they are taken.
    pub empty: Vec<(f32, Vec<Pyramid>)>,
    /// The sets that the pictures are of.
    pub sets: Vec<Set>,
    files: Vec<PathBuf>,
}

impl Photos {
    /// Reads all sets that are there but some. Masks are kept in the folder `cache`, for they take minutes.
    pub fn read(sets: &Sets, cache: &Path, left_out: &[String]) -> Result<Self, PhotoError> {
        let (there, missing): (Vec<_>, Vec<_>) = sets
            .all
            .iter()
            .filter(|set| !left_out.contains(&set.name))
            .cloned()
            .partition(|set| sets.folder(&set.name).is_some());
        for set in missing {
            println!("{}: not there, passed over", set.name);
        }
        let kept = |line: &&str| !line.starts_with('#') && there.iter().any(|set| set.name == set_of(line));
        let lines: Vec<_> = HANDS.lines().filter(kept).collect();
        let hands = lines.par_iter().map(|line| photo(sets, cache, line)).collect::<Result<Vec<_>, _>>()?;
        let hands = hands.into_iter().flatten().collect();
        let mut files: Vec<PathBuf> = lines.iter().map(|line| sets.picture(path_of(line))).collect();
        let mut faces = Vec::new();
        for line in FACES.lines().filter(kept) {
            let fields: Vec<&str> = line.split(',').collect();
            let [_, _, x, y, w, h] = numbers(&fields[1..])
                .and_then(|n| n.try_into().ok())
                .ok_or_else(|| Damaged(line.to_owned()))?;
            let file = sets.picture(fields[0]);
            let picture = read(&file)?;
            files.push(file);
            // 96 pixels, the face in the middle 75.
            let scale = 75.0 / f32::max(w, h);
            let map = Affine::similar((x + w / 2.0, y + h / 2.0), (48.0, 50.0), 0.0, scale, 1.0, 1.0);
            faces.push(picture.warp(&map, 96, 96, Outside::Nearest).to_pyramid());
        }
        let mut empty = Vec::new();
        for set in &there {
            let folder = sets.picture(&set.name);
            let folder = if set.shows == Shows::Nothing { folder } else { folder.join(NONE) };
            let pictures = without_hands(&folder, &mut files)?;
            if !pictures.is_empty() {
                empty.push((set.scenes, pictures));
            }
        }
        Ok(Self { hands, faces, empty, sets: there, files })
    }

    /// What tells its pictures from others, ascending: whoever judges with them is to know.
    pub fn fingerprints(&self) -> std::io::Result<Vec<u64>> {
        let image = |path: &PathBuf| LabelledImage { path: path.clone(), class: ClassId(0), person: None };
        let prints: BTreeSet<u64> =
            self.files.iter().map(|path| image(path).fingerprint()).collect::<Result<_, _>>()?;
        Ok(prints.into_iter().collect())
    }

    /// The hands of each set.
    pub fn by_set(&self) -> BTreeMap<&str, Vec<usize>> {
        let mut sets = BTreeMap::<_, Vec<usize>>::new();
        for (i, photo) in self.hands.iter().enumerate() {
            sets.entry(photo.set.as_str()).or_default().push(i);
        }
        sets
    }
}

/// The pictures of a folder and of those in it, and of its films one in ten seconds; of films of those who sign, the first, before
/// they begin. Adds the pictures to `files`.
fn without_hands(folder: &Path, files: &mut Vec<PathBuf>) -> Result<Vec<Pyramid>, PhotoError> {
    let mut open = vec![folder.to_owned()];
    let mut paths = Vec::new();
    while let Some(folder) = open.pop() {
        for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if path.is_dir() { open.push(path) } else { paths.push(path) }
        }
    }
    paths.sort();
    let mut all = Vec::new();
    for path in paths {
        let frames = match path.extension().and_then(|extension| extension.to_str()) {
            Some("mkv") => 1,
            Some("mp4") => usize::MAX,
            Some("jpg" | "jpeg" | "png") => {
                all.push(read(&path)?);
                files.push(path);
                continue;
            }
            _ => continue,
        };
        let mut video = Video::open(&path, false)?;
        for second in (0..).step_by(10).take(frames) {
            match video.next_frame(Duration::from_secs(second), &Scene::default()) {
                Ok(frame) => all.push(pyramid(&frame.image)?),
                Err(error) if error.is_the_end() => break,
                Err(error) if error.is_of_one_picture() => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
    Ok(all)
}

fn path_of(line: &str) -> &str {
    line.split(',').next().unwrap_or_default()
}

fn set_of(path: &str) -> &str {
    path.split('/').next().unwrap_or_default()
}

fn numbers(fields: &[&str]) -> Option<Vec<f32>> {
    fields.iter().map(|field| field.trim().parse().ok()).collect()
}

pub fn read(path: &Path) -> Result<Pyramid, PhotoError> {
    let image = imread(path, IMREAD_COLOR)?;
    if image.empty() {
        return Err(PhotoError::Missing(path.into()));
    }
    Ok(pyramid(&image)?)
}

fn pyramid(image: &Mat) -> Result<Pyramid, opencv::Error> {
    Ok(Pyramid::new(image.cols() as usize, image.rows() as usize, 3, image.data_bytes()?.to_vec()))
}

/// The place of a hand with these joints.
pub fn place(joints: &[(f32, f32)]) -> Place {
    let size = (joints[9].0 - joints[0].0).hypot(joints[9].1 - joints[0].1);
    let span = |pick: fn(&(f32, f32)) -> f32| {
        let all = joints.iter().map(pick);
        (all.clone().fold(f32::MAX, f32::min), all.fold(f32::MIN, f32::max))
    };
    let ((x0, x1), (y0, y1)) = (span(|p| p.0), span(|p| p.1));
    let side = ((x1 - x0).max(y1 - y0) + 0.35 * size) * 1.12;
    let (dx, dy) = (joints[9].0 - joints[0].0, joints[9].1 - joints[0].1);
    Place { x: (x0 + x1) / 2.0, y: (y0 + y1) / 2.0, side, up: dx.atan2(-dy) }
}

/// `None` where no mask can be had.
fn photo(sets: &Sets, cache: &Path, text: &str) -> Result<Option<Photo>, PhotoError> {
    let fields: Vec<&str> = text.split(',').collect();
    let path = fields[0];
    let damaged = || Damaged(text.to_owned());
    let all = numbers(&fields[1..]).filter(|all| all.len() == 44).ok_or_else(damaged)?;
    let set = set_of(path).to_owned();
    let origin = sets.number(&set).ok_or_else(damaged)? as u32;
    let joint = |k: usize| (all[2 + 2 * k] / 1000.0 * all[0], all[3 + 2 * k] / 1000.0 * all[1]);
    let joints: Joints = std::array::from_fn(joint);
    let picture = read(&sets.picture(path))?;
    let place = place(&joints);
    let copy = cache.join(format!("{:08x}.mask", crc32fast::hash(text.as_bytes())));
    let masks = match kept(&copy) {
        Some(masks) => masks,
        None => {
            let masks = masks(&picture, &joints, &place)?;
            keep(&copy, &masks);
            masks
        }
    };
    let Some((mask, arm)) = masks else {
        return Ok(None);
    };
    let folder = path.split('/').nth(1).unwrap_or_default();
    let (count, fingers) = sets.meaning(&set, folder);
    Ok(Some(Photo { set, origin, path: path.to_owned(), picture, place, joints, mask, arm, count, fingers }))
}

/// The hand's pixels and those of hand and arm; `None` where they cannot be had.
type Masks = Option<(Pyramid, Pyramid)>;

/// What a copy of masks holds that cannot be had. Where nothing is in it, it could not be written.
const NO_MASKS: [u8; 1] = [0];

/// The masks of a copy; `None` where they are to be made anew.
fn kept(copy: &Path) -> Option<Masks> {
    let bytes = std::fs::read(copy).ok()?;
    if bytes == NO_MASKS {
        return Some(None);
    }
    let (hand, arm) = (bytes.len() == 2 * MASK * MASK).then(|| bytes.split_at(MASK * MASK))?;
    Some(Some([hand, arm].map(|mask| Pyramid::new(MASK, MASK, 1, mask.to_vec())).into()))
}

fn keep(copy: &Path, masks: &Masks) {
    let bytes = match masks {
        Some((hand, arm)) => [hand.pixels(), arm.pixels()].concat(),
        None => NO_MASKS.into(),
    };
    // Without the copy it takes longer the next time, no more.
    let _ = gestalt_file::replace(copy, &bytes);
}

const BONES: [(usize, usize); 23] = [
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 4),
    (0, 5),
    (5, 6),
    (6, 7),
    (7, 8),
    (0, 9),
    (9, 10),
    (10, 11),
    (11, 12),
    (0, 13),
    (13, 14),
    (14, 15),
    (15, 16),
    (0, 17),
    (17, 18),
    (18, 19),
    (19, 20),
    (5, 9),
    (9, 13),
    (13, 17),
];

/// By GrabCut that starts from the joints.
fn masks(picture: &Pyramid, joints: &[(f32, f32)], place: &Place) -> Result<Masks, opencv::Error> {
    let map = onto_mask(place);
    let crop = picture.warp(&map, MASK, MASK, Outside::Nearest);
    let size = MASK as i32;
    let mut image = Mat::new_rows_cols_with_default(size, size, opencv::core::CV_8UC3, Scalar::all(0.0))?;
    image.data_bytes_mut()?.copy_from_slice(&crop.to_bytes());
    let at: Vec<Point> = joints
        .iter()
        .map(|&(x, y)| map.apply(x, y))
        .map(|(x, y)| Point::new(x.round() as i32, y.round() as i32))
        .collect();
    // Of the wrist to the middle finger's root; a hand seen along its axis is judged by its other lengths.
    let far = |a: usize, b: usize| f64::from((at[a].x - at[b].x).pow(2) + (at[a].y - at[b].y).pow(2)).sqrt();
    let palm = far(0, 9).max(1.6 * far(5, 17)).max(12.0);
    let mut seeds = Mat::new_rows_cols_with_default(size, size, CV_8UC1, Scalar::all(f64::from(GC_BGD)))?;
    let mut paint = |reach: f64, value: i32| -> Result<(), opencv::Error> {
        let colour = Scalar::all(f64::from(value));
        let thick = ((reach * palm) as i32).max(1);
        for (a, b) in BONES {
            line(&mut seeds, at[a], at[b], colour, thick, LINE_8, 0)?;
        }
        let outline: Vector<Point> = [0, 1, 5, 9, 13, 17].into_iter().map(|k| at[k]).collect();
        if reach < 0.3 {
            let all: Vector<Vector<Point>> = Vector::from_iter([outline]);
            fill_poly_def(&mut seeds, &all, colour)?;
        }
        for tip in [4, 8, 12, 16, 20] {
            circle(&mut seeds, at[tip], thick / 2, colour, FILLED, LINE_8, 0)?;
        }
        Ok(())
    };
    paint(0.95, GC_PR_BGD)?;
    paint(0.42, GC_PR_FGD)?;
    paint(0.10, GC_FGD)?;
    let (mut back, mut front) = (Mat::default(), Mat::default());
    if grab_cut(&image, &mut seeds, Rect::default(), &mut back, &mut front, 4, GC_INIT_WITH_MASK).is_err() {
        return Ok(None);
    }
    let up = (place.up.sin(), -place.up.cos());
    let wrist = at[0];
    let reach = 0.28 * palm as f32;
    let labels = seeds.data_bytes()?;
    let mut hand = vec![0_u8; MASK * MASK];
    let mut arm = vec![0_u8; MASK * MASK];
    for (i, label) in labels.iter().enumerate() {
        if i32::from(*label) == GC_FGD || i32::from(*label) == GC_PR_FGD {
            let (x, y) = ((i % MASK) as f32 - wrist.x as f32, (i / MASK) as f32 - wrist.y as f32);
            arm[i] = 255;
            if x * up.0 + y * up.1 > -reach {
                hand[i] = 255;
            }
        }
    }
    let share = hand.iter().filter(|v| **v > 0).count() as f32 / (75.3_f32 * 75.3);
    // Nearly nothing or nearly all of the hand's square is no hand's shape.
    if !(0.1..0.9).contains(&share) {
        return Ok(None);
    }
    let soft = |mask: Vec<u8>| Pyramid::new(MASK, MASK, 1, mask);
    Ok(Some((soft(hand), soft(arm))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_kept_or_known_not_to_be_had_and_else_made_anew() {
        let cache = tempfile::tempdir().unwrap();
        let copy = cache.path().join("0123abcd.mask");
        assert!(kept(&copy).is_none());
        keep(&copy, &None);
        assert!(matches!(kept(&copy), Some(None)));
        let mask = |value: u8| Pyramid::new(MASK, MASK, 1, vec![value; MASK * MASK]);
        keep(&copy, &Some((mask(7), mask(9))));
        let (hand, arm) = kept(&copy).flatten().unwrap();
        assert_eq!((hand.pixels()[0], arm.pixels()[0]), (7, 9));
        // What a disk without room leaves.
        let whole = std::fs::read(&copy).unwrap();
        for part in [0, 4096] {
            std::fs::write(&copy, &whole[..part]).unwrap();
            assert!(kept(&copy).is_none(), "{part} bytes");
        }
    }
}
