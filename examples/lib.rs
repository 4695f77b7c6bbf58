//! What a user would write first. Run one with `cargo run -p gestalt-examples --example subscribe`:
//!
//! - `subscribe.rs`, `subscribe.py`: print each decision of a running swarm, from any Zenoh client;
//! - `embed.rs`: a controller of one's own around a robot;
//! - `in_process.rs`: a test of one's own with robots in one process;
//! - `own_source.rs`: a camera of your own in a robot (feature `eyes`: it needs OpenCV).
