//! What the simulator says of each showing.

/// One line of its table.
#[derive(Clone, Debug, PartialEq)]
pub struct Showing {
    /// The radio's range, in metres.
    pub range_m: f64,
    pub number: u32,
    pub shown: u8,
    pub robots: u32,
    /// How many robots the largest group has that can reach each other, over others if need be.
    pub reach: u32,
    /// How many hold the same decision.
    pub agree: u32,
    /// Which.
    pub gesture: Option<u8>,
    /// Envelopes and packets that were none.
    pub refused: u32,
}

pub fn read(table: &str) -> Vec<Showing> {
    let mut lines = table.lines();
    let heading = lines.next().expect("a heading");
    assert_eq!(heading, "range_m,showing,shown,robots,reach,agree,gesture,right,packets,refused");
    lines.map(line).collect()
}

fn line(text: &str) -> Showing {
    let fields: Vec<&str> = text.split(',').collect();
    let number = |n: usize| -> u32 { fields[n].parse().unwrap_or_else(|_| panic!("{text}")) };
    let showing = Showing {
        range_m: fields[0].parse().expect("a range"),
        number: number(1),
        shown: fields[2].parse().expect("a gesture"),
        robots: number(3),
        reach: number(4),
        agree: number(5),
        gesture: fields[6].parse().ok(),
        refused: number(9),
    };
    assert_eq!(fields[7] == "1", showing.gesture == Some(showing.shown), "{text}");
    showing
}
