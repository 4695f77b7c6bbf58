//! Agreement over the range of the radio, as a picture.

use gestalt_draw::{Anchor, Letters, Place, Sheet};

/// One range: what part of the swarm the largest connected group is, and what part agrees, both `0.0..=1.0`.
pub struct Bar {
    pub range_m: f64,
    pub connected: f64,
    pub agree: f64,
}

const CONNECTED: u32 = 0x00b9_c4d0;
const AGREE: u32 = 0x0000_72b2;
const INK: u32 = 0x0022_2222;

/// Two bars for each range, as SVG.
pub fn draw(bars: &[Bar], title: &str) -> String {
    let (left, top, height, step) = (70.0, 66.0, 260.0, 78.0);
    let width = step * bars.len() as f64;
    let mut sheet = Sheet::new(left + width + 20.0, top + height + 66.0, 0x00ff_ffff);
    let small = Letters::new(14.0, INK);
    sheet.write(title, (left, 26.0), Letters::new(17.0, INK), width);
    for (n, (tone, what)) in
        [(CONNECTED, "largest connected group"), (AGREE, "hold the same decision")].iter().enumerate()
    {
        let x = left + 220.0 * n as f64;
        sheet.fill(Place::new(x, 40.0, 14.0, 14.0), *tone);
        sheet.write(what, (x + 20.0, 52.0), small, 190.0);
    }
    for percent in [0, 25, 50, 75, 100] {
        let y = top + height * (1.0 - f64::from(percent) / 100.0);
        sheet.fill(Place::new(left, y, width, 1.0), 0x00e1_e1e1);
        sheet.write(&format!("{percent} %"), (left - 8.0, y + 5.0), small.anchored(Anchor::End), 60.0);
    }
    for (n, bar) in bars.iter().enumerate() {
        let x = left + step * n as f64;
        for (at, part, tone) in [(10.0, bar.connected, CONNECTED), (38.0, bar.agree, AGREE)] {
            let tall = height * part;
            sheet.fill(Place::new(x + at, top + height - tall, 26.0, tall), tone);
        }
        let middle = (x + step / 2.0, top + height + 22.0);
        sheet.write(&bar.range_m.to_string(), middle, small.anchored(Anchor::Middle), step);
    }
    let below = (left + width / 2.0, top + height + 48.0);
    sheet.write("range of the radio, m", below, small.anchored(Anchor::Middle), width);
    sheet.svg()
}
