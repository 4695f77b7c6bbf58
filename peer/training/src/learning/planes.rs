//! What flows through a network in training: for each channel, a stack of pictures.

use std::cell::RefCell;
use std::collections::HashMap;

thread_local! {
    /// Memory of planes that are no longer used, by its length: step after step needs the same, and new memory costs a fifth of the
    /// time.
    static SPARE: RefCell<HashMap<usize, Vec<Vec<f32>>>> = RefCell::default();
}

/// Memory for so many values, of any content.
fn memory(length: usize) -> Vec<f32> {
    let spare = SPARE.with_borrow_mut(|spare| spare.get_mut(&length).and_then(Vec::pop));
    spare.unwrap_or_else(|| vec![0.0; length])
}

impl Drop for Planes {
    fn drop(&mut self) {
        let values = std::mem::take(&mut self.values);
        // A thread that ends has no more use for it.
        let _ = SPARE.try_with(|spare| spare.borrow_mut().entry(values.len()).or_default().push(values));
    }
}

impl Clone for Planes {
    fn clone(&self) -> Self {
        let mut values = memory(self.values.len());
        values.copy_from_slice(&self.values);
        Self { values, ..*self }
    }
}

/// Pictures of a batch, some at a time: for each block of pictures its channels, in each channel its pictures, row by row. Each row
/// is followed by some zeros, each picture by some rows of zeros: so a step to any neighbour of a pixel is the same number of values
/// everywhere, and finds zeros outside of the picture. A block is what stays in a core's cache.
#[derive(Debug)]
pub struct Planes {
    pub channels: usize,
    pub pictures: usize,
    pub height: usize,
    pub width: usize,
    /// How many zeros: as far as neighbours are from each other.
    pub border: usize,
    values: Vec<f32>,
}

/// Pixels that a channel of a block has about.
const BLOCK: usize = 2048;

impl Planes {
    /// Nothing but zeros.
    pub fn new(channels: usize, pictures: usize, (height, width): (usize, usize), border: usize) -> Self {
        let mut planes = Self { channels, pictures, height, width, border, values: Vec::new() };
        planes.values = memory(planes.blocks() * planes.each_block());
        planes.values.fill(0.0);
        planes
    }

    /// Zeros of the same shape, with another number of channels.
    pub fn like(&self, channels: usize) -> Self {
        Self::new(channels, self.pictures, (self.height, self.width), self.border)
    }

    /// From values in the order `[picture][channel][y][x]`.
    pub fn of(values: &[f32], channels: usize, size: (usize, usize), border: usize) -> Self {
        let area = size.0 * size.1;
        let mut planes = Self::new(channels, values.len() / (channels * area), size, border);
        for (plane, values) in values.chunks_exact(area).enumerate() {
            let start = planes.start(plane % channels, plane / channels);
            let rows = planes.values[start..].chunks_mut(size.1 + border);
            rows.zip(values.chunks_exact(size.1))
                .for_each(|(row, values)| row[..size.1].copy_from_slice(values));
        }
        planes
    }

    /// Its values in the order `[picture][channel][y][x]`.
    pub fn to_values(&self) -> Vec<f32> {
        let mut out = Vec::with_capacity(self.pictures * self.channels * self.height * self.width);
        for picture in 0..self.pictures {
            for channel in 0..self.channels {
                self.rows(channel, picture).for_each(|row| out.extend_from_slice(row));
            }
        }
        out
    }

    /// Pictures of a block: the most that divide them all and have not too many pixels.
    pub fn block(&self) -> usize {
        let most = (BLOCK / self.area().max(1)).clamp(1, self.pictures.max(1));
        (1..=most).rev().find(|block| self.pictures.is_multiple_of(*block)).unwrap_or(1)
    }

    pub fn blocks(&self) -> usize {
        self.pictures / self.block()
    }

    /// From a pixel to that below it.
    pub fn stride(&self) -> usize {
        self.width + self.border
    }

    /// From a pixel to that of the next picture of the block.
    fn area(&self) -> usize {
        (self.height + self.border) * self.stride()
    }

    /// Where the first pixel of a channel of a block is.
    pub fn first(&self) -> usize {
        self.border * (self.stride() + 1)
    }

    /// Values of a channel of a block.
    pub fn each(&self) -> usize {
        self.first() + self.block() * self.area()
    }

    /// Values of a block.
    pub fn each_block(&self) -> usize {
        self.channels * self.each()
    }

    /// From the first pixel of a channel of a block to behind its last: with zeros between them.
    pub fn span(&self) -> usize {
        self.block() * self.area() - self.border * (self.stride() + 1)
    }

    /// Pixels of a channel.
    pub fn pixels(&self) -> usize {
        self.pictures * self.height * self.width
    }

    pub fn same_shape(&self, other: &Self) -> bool {
        let shape = |p: &Self| (p.channels, p.pictures, p.height, p.width, p.border);
        shape(self) == shape(other)
    }

    pub fn values(&self) -> &[f32] {
        &self.values
    }

    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    pub fn channel(&self, channel: usize, block: usize) -> &[f32] {
        &self.values[block * self.each_block() + channel * self.each()..][..self.each()]
    }

    /// Where a picture's channel begins.
    pub fn start(&self, channel: usize, picture: usize) -> usize {
        let block = self.block();
        let within = self.first() + picture % block * self.area();
        picture / block * self.each_block() + channel * self.each() + within
    }

    /// Where the rows begin within a channel of a block, picture by picture.
    pub fn row_starts(&self) -> Vec<usize> {
        let (first, area, stride, height) = (self.first(), self.area(), self.stride(), self.height);
        (0..self.block())
            .flat_map(|picture| (0..height).map(move |y| first + picture * area + y * stride))
            .collect()
    }

    /// The rows of a picture's channel.
    pub fn rows(&self, channel: usize, picture: usize) -> impl Iterator<Item = &[f32]> {
        let rows = self.values[self.start(channel, picture)..].chunks(self.stride());
        rows.take(self.height).map(|row| &row[..self.width])
    }

    /// Makes zero again what is not a pixel of a channel of a block.
    pub fn clear_border(&self, channel: &mut [f32]) {
        if self.border == 0 {
            return;
        }
        let (first, stride) = (self.first(), self.stride());
        channel[..first].fill(0.0);
        for picture in channel[first..].chunks_exact_mut(self.area()) {
            let (rows, below) = picture.split_at_mut(self.height * stride);
            rows.chunks_exact_mut(stride).for_each(|row| row[self.width..].fill(0.0));
            below.fill(0.0);
        }
    }

    pub fn add(&mut self, other: &Self) {
        assert!(self.same_shape(other));
        self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a += b);
    }
}
