//! The networks as robots run them, with the weights that training has reached: much faster than those that are trained.

use gestalt_vision::network::{FeatureMap, Finder, Refiner, WeightsError};

use crate::frames::{HEIGHT, WIDTH};
use crate::losses::sigmoid;
use crate::networks::{self, encode};
use crate::places::CROP;
use crate::train::planes;

/// The weights' files of finder and refiner, for as many robots as are wanted.
pub struct Weights {
    finder: Vec<u8>,
    refiner: Vec<u8>,
}

/// One robot's. It owns its buffers, so each thread has its own.
pub struct Robot {
    finder: Finder,
    refiner: Refiner,
    input: Vec<f32>,
    map: FeatureMap,
}

impl Weights {
    pub fn of(finder: &networks::Finder, refiner: &networks::Refiner) -> Self {
        Self { finder: encode(&finder.weights()), refiner: encode(&refiner.weights()) }
    }

    pub fn new(finder: Vec<u8>, refiner: Vec<u8>) -> Self {
        Self { finder, refiner }
    }

    pub fn robot(&self) -> Result<Robot, WeightsError> {
        Ok(Robot {
            finder: Finder::decode(&self.finder)?,
            refiner: Refiner::decode(&self.refiner)?,
            input: Vec::new(),
            map: FeatureMap::default(),
        })
    }
}

impl Robot {
    fn take(&mut self, picture: &[u8], width: usize, height: usize) {
        self.input.clear();
        planes(picture, width, false, [1.0; 3], &mut self.input);
        self.map.reshape(3, height, width);
        self.map.values_mut().copy_from_slice(&self.input);
    }

    /// The finder's maps of a frame, five planes.
    pub fn find(&mut self, frame: &[u8]) -> &[f32] {
        self.take(frame, WIDTH, HEIGHT);
        self.finder.run(&self.map).values()
    }

    /// What the refiner says of a crop: six numbers, and the mask row by row, `0.0..=1.0`.
    pub fn refine(&mut self, crop: &[u8]) -> ([f32; 6], Vec<f32>) {
        self.take(crop, CROP, CROP);
        let (said, logits) = self.refiner.run_with_mask(&self.map);
        let six = [said.hand, said.right, said.down, said.larger, said.sine, said.cosine];
        (six, logits.iter().copied().map(sigmoid).collect())
    }
}
