//! How a robot of a Gestalt swarm sees, talks, and gets run.
