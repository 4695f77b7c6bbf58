//! Every second pixel of pictures: what a stride of two sees, and what enlarging and halving are made of.

use rayon::prelude::*;

use super::planes::Planes;

/// First row and column of each.
pub const PHASES: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Every second pixel: those from row `y` and column `x` on, with a border.
pub fn phase(of: &Planes, (y, x): (usize, usize), border: usize) -> Planes {
    let size = (of.height.div_ceil(2), of.width.div_ceil(2));
    let mut out = Planes::new(of.channels, of.pictures, size, border);
    let (block, stride, shape) = (out.block(), out.stride(), out.like(0));
    let (each_block, each) = (out.each_block(), out.each());
    out.values_mut().par_chunks_mut(each_block).enumerate().for_each(|(number, out)| {
        for (channel, out) in out.chunks_exact_mut(each).enumerate() {
            for picture in 0..block {
                let start = shape.start(0, picture);
                let lines = of.rows(channel, number * block + picture).skip(y).step_by(2);
                for (row, line) in out[start..].chunks_mut(stride).zip(lines) {
                    let (pairs, last) = line.as_chunks::<2>();
                    // Two loops of known steps, which take the widest instructions.
                    match x {
                        0 => row.iter_mut().zip(pairs).for_each(|(to, [even, _])| *to = *even),
                        _ => row.iter_mut().zip(pairs).for_each(|(to, [_, odd])| *to = *odd),
                    }
                    if let (0, [last]) = (x, last) {
                        row[pairs.len()] = *last;
                    }
                }
            }
        }
    });
    out
}

/// Adds to `to` what [`phase`] took of it.
pub fn add_phase(part: &Planes, (y, x): (usize, usize), to: &mut Planes) {
    let (block, stride, shape) = (to.block(), to.stride(), to.like(0));
    let (each_block, each, width, height) = (to.each_block(), to.each(), to.width, to.height);
    to.values_mut().par_chunks_mut(each_block).enumerate().for_each(|(number, to)| {
        for (channel, to) in to.chunks_exact_mut(each).enumerate() {
            for picture in 0..block {
                let start = shape.start(0, picture);
                let lines = to[start..].chunks_mut(stride).take(height).skip(y).step_by(2);
                for (line, row) in lines.zip(part.rows(channel, number * block + picture)) {
                    let (pairs, last) = line[..width].as_chunks_mut::<2>();
                    match x {
                        0 => pairs.iter_mut().zip(row).for_each(|([even, _], from)| *even += from),
                        _ => pairs.iter_mut().zip(row).for_each(|([_, odd], from)| *odd += from),
                    }
                    if let (0, [last]) = (x, last) {
                        *last += row[pairs.len()];
                    }
                }
            }
        }
    });
}
