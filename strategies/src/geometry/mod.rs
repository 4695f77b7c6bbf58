//! Distances and means that are kept up to date: what a user's rule needs to be as fast as those that come with
//! Gestalt.
//!
//! [`Points`] measures from one point to many, [`Neighbours`] knows who is whose nearest, [`ExactSum`] and [`Cluster`] have
//! means that do not depend on the order of what was added and taken out. All distances are squared and Euclidean, in the
//! units of the feature space, and ties go to the smaller key.

mod cluster;
mod neighbours;
mod points;
mod sum;

pub use cluster::Cluster;
pub use neighbours::{NearestPair, Neighbours};
pub use points::Points;
pub use sum::{ExactSum, narrow};
