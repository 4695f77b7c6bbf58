//! Whole swarms on real Zenoh, one scenario a file. Run them one after the other: they measure time.

mod in_process;
