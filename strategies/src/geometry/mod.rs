//! Distances and means that are kept up to date, for rules that would else compute them anew at every choice.

mod cluster;
mod neighbours;
mod points;
mod sum;

pub(crate) use cluster::Cluster;
pub(crate) use neighbours::Neighbours;
pub(crate) use sum::{Sum, narrow};
