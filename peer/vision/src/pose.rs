//! Where robots stand around the human.

#[cfg(feature = "opencv")]
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A pose that no camera can have.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("pose: {field} is {value}, set it within {low}..={high}")]
pub struct PoseError {
    /// The field that is out of its range.
    pub field: &'static str,
    /// What it is.
    pub value: f64,
    /// The least it may be.
    pub low: f64,
    /// The most it may be.
    pub high: f64,
}

/// Where a camera is, seen from the hand; it looks at the hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Around the vertical, in degrees: 0 faces the palm, ±90 sees the hand edge on. Range −180..=180.
    pub bearing_deg: f64,
    /// Above the hand's height, in degrees: negative looks up from the floor. Range −90..=90.
    pub elevation_deg: f64,
    /// From the palm, in metres. Range 0.3..=20.
    pub distance_m: f64,
}

impl Pose {
    /// Before the palm, at its height, a good arm's length away.
    pub const FRONTAL: Self = Self { bearing_deg: 0.0, elevation_deg: 0.0, distance_m: 0.8 };

    /// Checks every field against its range.
    ///
    /// # Errors
    /// [`PoseError`] for the first field outside its range, or that is no number.
    pub fn validate(&self) -> Result<(), PoseError> {
        let fields = [
            ("bearing_deg", self.bearing_deg, -180.0, 180.0),
            ("elevation_deg", self.elevation_deg, -90.0, 90.0),
            ("distance_m", self.distance_m, 0.3, 20.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(PoseError { field, value, low, high });
            }
        }
        Ok(())
    }

    /// The position, in metres, with the palm at the origin, x to the right of who faces the palm, y up, z towards them.
    #[cfg(feature = "opencv")]
    pub(crate) fn position(&self) -> Point3<f32> {
        let (bearing, elevation) = (self.bearing_deg.to_radians(), self.elevation_deg.to_radians());
        let at =
            Vector3::new(bearing.sin() * elevation.cos(), elevation.sin(), bearing.cos() * elevation.cos())
                * self.distance_m;
        Point3::from(at.cast())
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::FRONTAL
    }
}

/// Where the robots of a swarm may stand: an arc before the human.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Placement {
    /// The robots spread over plus and minus this bearing, in degrees. Range 0..=90.
    pub half_deg: f64,
    /// Least and greatest elevation, in degrees. Range −60..=60.
    pub elevation_deg: [f64; 2],
    /// Least and greatest distance, in metres. Range 0.4..=3.
    pub distance_m: [f64; 2],
}

impl Default for Placement {
    /// ±75°, most of them looking up from the floor, at 0.6 to 1.15 m: near enough for a Foot-bot to see fingers.
    fn default() -> Self {
        Self { half_deg: 75.0, elevation_deg: [-25.0, 12.0], distance_m: [0.6, 1.15] }
    }
}

impl Placement {
    /// Places robots evenly over the arc, from the left to the right, each a little off its place. The same seed
    /// gives the same places.
    #[must_use]
    pub fn place(&self, robots: usize, seed: u64) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let sector = 2.0 * self.half_deg / robots.max(1) as f64;
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
        (0..robots)
            .map(|i| Pose {
                bearing_deg: sector * (i as f64 + 0.5 + between([-0.4, 0.4])) - self.half_deg,
                elevation_deg: between(self.elevation_deg),
                distance_m: between(self.distance_m),
            })
            .collect()
    }
}

/// Places robots on the default [`Placement`].
#[must_use]
pub fn place(robots: usize, seed: u64) -> Vec<Pose> {
    Placement::default().place(robots, seed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_out_of_range_is_named() {
        let field = |pose: Pose| pose.validate().err().map(|error| error.field);
        assert_eq!(field(Pose::FRONTAL), None);
        assert_eq!(field(Pose { distance_m: 0.0, ..Pose::FRONTAL }), Some("distance_m"));
        assert_eq!(field(Pose { bearing_deg: f64::NAN, ..Pose::FRONTAL }), Some("bearing_deg"));
        assert!(place(100, 1).iter().all(|pose| pose.validate().is_ok()));
    }

    #[test]
    fn robots_stand_on_the_arc_in_order_and_apart() {
        let poses = place(10, 3);
        assert_eq!(poses.len(), 10);
        assert!(poses.windows(2).all(|pair| pair[0].bearing_deg < pair[1].bearing_deg));
        assert!(poses.iter().all(|pose| pose.bearing_deg.abs() <= 75.0));
        assert_eq!(poses, place(10, 3));
        assert_ne!(poses, place(10, 4));
        let far = Placement { distance_m: [2.0, 2.5], ..Placement::default() }.place(5, 3);
        assert!(far.iter().all(|pose| (2.0..=2.5).contains(&pose.distance_m)));
    }
}
