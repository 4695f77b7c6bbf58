//! Eight processes in a line of network namespaces: each hears its two neighbours only.

use std::time::{Duration, Instant};

use crate::field::Field;
use gestalt_tests::not_permitted;

#[test]
fn the_eighth_in_a_line_decides_what_only_the_first_sees() {
    if not_permitted() {
        return;
    }
    let links: Vec<_> = (0..7).map(|i| (i, i + 1)).collect();
    let mut field = Field::new(8, &links, |node| (node == 0).then_some(4));
    let began = Instant::now();
    field.robots[0].order("open");
    let (class, _) = field.robots[7].decision(1, Duration::from_secs(8)).expect("the eighth decides");
    eprintln!("line of 8: the eighth decided after {:?}", began.elapsed());
    assert_eq!(class, Some(4));
    assert_eq!(field.decisions(1, Duration::from_secs(3)), vec![Some(Some(4)); 8]);
    let far = field.robots[7].told();
    let neighbours = far.iter().rev().find(|told| told["event"] == "neighbours").expect("it has neighbours");
    assert_eq!(neighbours["robots"], serde_json::json!([6]), "the line is no line");
}
