//! The heterogeneity layer: what makes frames of different cameras alike before anything is measured in them.
//!
//! | stage | on | off |
//! |---|---|---|
//! | geometry (`frame`) | the aspect is kept, the hand is looked at closely in 192×192 pixels | every frame is squeezed onto 320×240, and the hand is measured there |
//! | colour (`white_balance`, `colour`) | the background is grey, and the hand is what differs from it | the camera's colours, and a hand is what has more colour than a fixed threshold |
//! | resolution (`resolution`) | blur and noise of the close view are brought to one measure | the hand is measured at the camera's own pixels |
//! | time | evidence counts by the seconds between frames | every frame counts alike; perception only carries this |

pub use crate::config::LayerConfig;
