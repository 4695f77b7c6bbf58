//! The colours of pictures, as `0xRRGGBB`.

use gestalt_draw::Tone;

pub(super) const BACKGROUND: Tone = 0x16_1a_20;
pub(super) const CARD: Tone = 0x24_2a_33;
pub(super) const TRACK: Tone = 0x38_40_4c;
pub(super) const TEXT: Tone = 0xf2_f4_f7;
pub(super) const MUTED: Tone = 0x9a_a5_b4;
pub(super) const AGREES: Tone = 0x3f_b9_7f;
pub(super) const DIFFERS: Tone = 0xf0_7a_52;
