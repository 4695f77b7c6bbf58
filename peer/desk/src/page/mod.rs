//! The page: a web server for one swarm, small on purpose.

mod files;
mod server;
#[cfg(test)]
mod tests;

pub(crate) use server::{Server, serve};
