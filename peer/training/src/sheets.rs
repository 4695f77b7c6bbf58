//! Sheets of what the networks are shown, for people to look at.

use std::path::Path;

use opencv::core::{CV_8UC3, Mat, Rect, Scalar, Size};
use opencv::imgproc::{INTER_AREA, INTER_LINEAR, resize};
use opencv::prelude::*;

use crate::counting;
use crate::frames;
use crate::pools::{drawn, with_truth};
use crate::scenery::Scenery;

/// Draws them all into a folder.
pub fn all(
    out: &Path,
    scenery: &Scenery,
    frames: &[frames::Frame],
    crops: &[frames::Crop],
) -> Result<(), Box<dyn std::error::Error>> {
    let mat = |w: usize, h: usize, bytes: &[u8]| -> Result<Mat, opencv::Error> {
        let mut mat = Mat::new_rows_cols_with_default(h as i32, w as i32, CV_8UC3, Scalar::all(0.0))?;
        mat.data_bytes_mut()?.copy_from_slice(bytes);
        Ok(mat)
    };
    let mut all = Vec::new();
    for frame in frames.iter().take(60) {
        let mut picture = frame.picture.clone();
        for hand in &frame.hands {
            for k in 0..100 {
                let t = k as f32 / 100.0;
                let (s, c) = hand.up.sin_cos();
                let up = (hand.x + s * t * hand.side / 2.0, hand.y - c * t * hand.side / 2.0);
                let edge = (hand.x - hand.side / 2.0 + t * hand.side, hand.y + hand.side / 2.0);
                for (i, (x, y)) in [up, edge].into_iter().enumerate() {
                    if x >= 0.0 && y >= 0.0 && (x as usize) < 160 && (y as usize) < 120 {
                        let at = 3 * (y as usize * 160 + x as usize);
                        picture[at..at + 3].copy_from_slice(&[[0, 0, 255], [255, 0, 0]][i]);
                    }
                }
            }
        }
        all.push(mat(160, 120, &picture)?);
    }
    sheet(&out.join("frames.png"), &all, 10, 160)?;
    let mut all = Vec::new();
    for crop in crops.iter().take(100) {
        let picture: Vec<u8> = crop
            .picture
            .chunks(3)
            .zip(&crop.mask)
            .flat_map(|(p, m)| [p[0], if *m > 127 { p[1].saturating_add(60) } else { p[1] }, p[2]])
            .collect();
        all.push(mat(64, 64, &picture)?);
    }
    sheet(&out.join("crops.png"), &all, 20, 64)?;
    let mut all = Vec::new();
    for i in 0..100 {
        let photo = &scenery.photos.hands[i * scenery.photos.hands.len() / 100];
        let shown = with_truth(photo);
        let Some(shown) = shown else { continue };
        let picture: Vec<u8> = shown
            .picture
            .pixels()
            .chunks(3)
            .zip(shown.mask.pixels().iter().zip(shown.arm.pixels()))
            .flat_map(|(p, (m, a))| {
                [
                    if *a > 127 { p[0].saturating_add(60) } else { p[0] },
                    if *m > 127 { p[1].saturating_add(60) } else { p[1] },
                    p[2],
                ]
            })
            .collect();
        all.push(mat(128, 128, &picture)?);
    }
    sheet(&out.join("truth.png"), &all, 20, 96)?;
    let real = scenery.photos.hands.iter().filter_map(with_truth).collect();
    let pool = [(1.0, real), (1.0, scenery.drawn.iter().take(300).filter_map(drawn).collect())];
    let mut all = Vec::new();
    for (x, _) in counting::batch(&pool, 120, 1, 0) {
        let n = x.picture.len() / 2;
        let bytes: Vec<u8> = (0..n)
            .flat_map(|i| {
                let g = ((x.picture[i] + 3.0) * 42.0) as u8;
                [g, if x.picture[n + i] > 0.0 { g.saturating_add(40) } else { g }, g]
            })
            .collect();
        all.push(mat(48, 48, &bytes)?);
    }
    sheet(&out.join("shown.png"), &all, 20, 72)?;
    Ok(())
}

/// Writes pictures side by side, for people.
fn sheet(path: &Path, pictures: &[Mat], columns: usize, side: i32) -> Result<(), opencv::Error> {
    let rows = pictures.len().div_ceil(columns) as i32;
    let mut all =
        Mat::new_rows_cols_with_default(rows * side, columns as i32 * side, CV_8UC3, Scalar::all(0.0))?;
    for (i, picture) in pictures.iter().enumerate() {
        let (x, y) = ((i % columns) as i32 * side, (i / columns) as i32 * side);
        let mut small = Mat::default();
        let longest = picture.cols().max(picture.rows());
        let size = Size::new(picture.cols() * side / longest, picture.rows() * side / longest);
        let how = if longest > side { INTER_AREA } else { INTER_LINEAR };
        resize(picture, &mut small, size, 0.0, 0.0, how)?;
        let mut part = Mat::roi_mut(&mut all, Rect::new(x, y, size.width, size.height))?;
        small.copy_to(&mut part)?;
    }
    opencv::imgcodecs::imwrite_def(path, &all)?;
    Ok(())
}
