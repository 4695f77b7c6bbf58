//! Why a frame says nothing of a hand.

use thiserror::Error;

/// Why a frame gave no observation. It never becomes a vote; perception is ready for the next frame.
#[derive(Debug, Error)]
pub enum NoObservation {
    /// The frame has no pixels.
    #[error("the frame is empty: the source delivered no image")]
    EmptyFrame,
    /// The frame is not 8-bit BGR.
    #[error(
        "the frame has {channels} channels of OpenCV depth {depth}, not 3 of depth 0: convert it to 8-bit BGR"
    )]
    Format {
        /// Its channels.
        channels: i32,
        /// Its depth, as OpenCV numbers them (0 is 8-bit unsigned).
        depth: i32,
    },
    /// The frame is so long and narrow that nothing is left of its shorter side on the canvas.
    #[error("a frame of {width}×{height} pixels is too narrow to show a hand")]
    TooNarrow {
        /// Columns.
        width: i32,
        /// Rows.
        height: i32,
    },
    /// The frame shows no hand.
    #[error("no hand: {0}")]
    NoHand(#[from] NoHand),
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// Why a frame shows no hand.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum NoHand {
    /// Nothing differs from the background in colour, or what does is not of one colour.
    #[error("nothing stands out from the background (colour contrast {contrast:.2})")]
    NothingStandsOut {
        /// The contrast found, nats.
        contrast: f32,
    },
    /// The largest blob is smaller than [`HandConfig::minimum_pixels`](super::HandConfig::minimum_pixels), or next to nothing of the frame.
    #[error("the largest hand-coloured blob covers {share:.4} of the frame: too small")]
    TooSmall {
        /// Its share of the frame, `0.0..=1.0`.
        share: f32,
    },
    /// The largest blob is larger than [`HandConfig::maximum_area`](super::HandConfig::maximum_area).
    #[error("the largest hand-coloured blob covers {share:.2} of the frame: too large to be one hand")]
    TooLarge {
        /// Its share of the frame, `0.0..=1.0`.
        share: f32,
    },
    /// The blob runs along most of the frame's edge: a hand comes in from one side.
    #[error("the largest hand-coloured blob covers {share:.2} of the frame's edge: a background, not a hand")]
    AlongTheEdge {
        /// The covered share of the frame's edge, `0.0..=1.0`.
        share: f32,
    },
    /// Nothing is likely enough to be a hand, to eyes that learned what hands are.
    #[error("nothing is recognised as one (confidence {confidence:.2}, at least {needed:.2} is needed)")]
    Unrecognised {
        /// How likely the likeliest place is a hand, at most, `0.0..=1.0`.
        confidence: f32,
        /// How likely it must be.
        needed: f32,
    },
}
