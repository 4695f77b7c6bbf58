//! Who is linked to whom.

use std::str::FromStr;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A text that names no topology.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no topology: take line, ring, grid, star, random or full")]
pub struct ShapeError(String);

/// The shape of a network of links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkShape {
    /// Each to the next.
    Line,
    /// A line, closed.
    Ring,
    /// Rows of ⌈√n⌉, each robot linked to its right and lower neighbour.
    Grid,
    /// All to the first.
    Star,
    /// A random tree, and half as many further links at random: connected, of mean degree 3 at most.
    #[default]
    Random,
    /// All to all.
    Full,
}

impl NetworkShape {
    /// The links between `n` robots as pairs of positions `(a, b)` with `a < b`, each once, in ascending order.
    /// The graph is connected. Only [`NetworkShape::Random`] draws from `chance`.
    pub fn links(self, n: usize, chance: &mut impl Rng) -> Vec<(usize, usize)> {
        let mut links: Vec<(usize, usize)> = match self {
            Self::Line => (1..n).map(|b| (b - 1, b)).collect(),
            Self::Ring => {
                let closing = (n > 2).then(|| (0, n - 1));
                (1..n).map(|b| (b - 1, b)).chain(closing).collect()
            }
            Self::Grid => {
                let side = (1..).find(|side| side * side >= n).unwrap_or(1);
                let right = (0..n).filter(|i| (i + 1) % side != 0 && i + 1 < n).map(|i| (i, i + 1));
                let down = (0..n.saturating_sub(side)).map(|i| (i, i + side));
                right.chain(down).collect()
            }
            Self::Star => (1..n).map(|b| (0, b)).collect(),
            Self::Random => random(n, chance),
            Self::Full => (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect(),
        };
        links.sort_unstable();
        links
    }
}

fn random(n: usize, chance: &mut impl Rng) -> Vec<(usize, usize)> {
    let mut links: Vec<(usize, usize)> = (1..n).map(|b| (chance.random_range(0..b), b)).collect();
    for _ in 0..n / 2 {
        let (a, b) = (chance.random_range(0..n), chance.random_range(0..n));
        let link = (a.min(b), a.max(b));
        if a != b && !links.contains(&link) {
            links.push(link);
        }
    }
    links
}

impl FromStr for NetworkShape {
    type Err = ShapeError;

    fn from_str(text: &str) -> Result<Self, ShapeError> {
        Ok(match text {
            "line" => Self::Line,
            "ring" => Self::Ring,
            "grid" => Self::Grid,
            "star" => Self::Star,
            "random" => Self::Random,
            "full" => Self::Full,
            other => return Err(ShapeError(other.to_owned())),
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const ALL: [NetworkShape; 6] = [
        NetworkShape::Line,
        NetworkShape::Ring,
        NetworkShape::Grid,
        NetworkShape::Star,
        NetworkShape::Random,
        NetworkShape::Full,
    ];

    fn links(topology: NetworkShape, n: usize) -> Vec<(usize, usize)> {
        topology.links(n, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn every_topology_connects_all_with_links_named_once() {
        for topology in ALL {
            for n in 0..40 {
                let links = links(topology, n);
                assert!(links.is_sorted_by(|x, y| x < y), "{topology:?} {n}: {links:?}");
                assert!(links.iter().all(|&(a, b)| a < b && b < n));
                let mut reached: Vec<bool> = (0..n).map(|i| i == 0).collect();
                for _ in 0..n {
                    for &(a, b) in &links {
                        let either = reached[a] || reached[b];
                        (reached[a], reached[b]) = (either, either);
                    }
                }
                assert!(reached.iter().all(|&r| r), "{topology:?} {n}: {links:?}");
            }
        }
    }

    #[test]
    fn a_grid_of_nine_has_twelve_links() {
        assert_eq!(links(NetworkShape::Grid, 9).len(), 12);
    }

    #[test]
    fn a_random_topology_is_sparse() {
        for n in 3..60 {
            assert!(links(NetworkShape::Random, n).len() <= n - 1 + n / 2);
        }
    }
}
