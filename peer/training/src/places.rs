//! Where hands are, and the squares that are cut out around them.

pub use gestalt_vision::eyes::Place;

use crate::image::Affine;

/// Side of the refiner's crop, and how many sides of the hand it covers.
pub const CROP: usize = 64;
pub const ROOM: f32 = 1.55;

/// Side of a mask's picture; it covers [`COVERED`] sides of the hand.
pub const MASK: usize = 128;
pub const COVERED: f32 = 1.7;

/// The same place in a picture that is `k` times as large.
pub fn scaled(place: &Place, k: f32) -> Place {
    let at = |v: f32| (v + 0.5) * k - 0.5;
    Place { x: at(place.x), y: at(place.y), side: place.side * k, up: place.up }
}

/// How much the squares overlap: what both cover of what either does.
pub fn overlap(one: &Place, other: &Place) -> f32 {
    let along = |a: f32, b: f32| {
        let low = (a - one.side / 2.0).max(b - other.side / 2.0);
        let high = (a + one.side / 2.0).min(b + other.side / 2.0);
        (high - low).max(0.0)
    };
    let both = along(one.x, other.x) * along(one.y, other.y);
    both / (one.side * one.side + other.side * other.side - both)
}

/// From a picture to the refiner's crop of a place, its fingers up.
pub fn onto_crop(place: &Place) -> Affine {
    let middle = CROP as f32 / 2.0 - 0.5;
    let scale = CROP as f32 / (ROOM * place.side);
    Affine::similar((place.x, place.y), (middle, middle), -place.up, scale, 1.0, 1.0)
}

/// From a picture to the square of a mask around a place, not turned.
pub fn onto_mask(place: &Place) -> Affine {
    let middle = (MASK as f32 - 1.0) / 2.0;
    let scale = MASK as f32 / (COVERED * place.side);
    Affine::similar((place.x, place.y), (middle, middle), 0.0, scale, 1.0, 1.0)
}
