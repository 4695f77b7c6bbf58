//! What a user would write first. Run one with `cargo run -p gestalt-examples --example subscribe`:
//!
//! - `subscribe.rs`, `subscribe.py`: print each decision of a running swarm, from any Zenoh client;
//! - `embed.rs`: your own controller around a robot;
//! - `in_process.rs`: your own test with robots in one process;
//! - `own_rules.rs`: rules of your own for sharing, forgetting and fusing, in an emulated swarm;
//! - `own_source.rs`: a camera of your own in a robot (feature `eyes`: it needs OpenCV).
