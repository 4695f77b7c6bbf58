//! What goes when there is no more room.

use gestalt_strategies::ForgettingRule;

use super::*;

/// Whether all robots of a ring end with the newest that came, by a rule that drops the oldest.
fn keep_the_newest(author_shares: bool) -> bool {
    let mut scenario = learning(4, 1.0, NetworkShape::Ring);
    let robots = &mut scenario.learning.as_mut().unwrap().robots;
    (robots.capacity, robots.forgetting, robots.author_shares) = (30, ForgettingRule::Fifo, author_shares);
    let mut emulation = emulation(&scenario, 1);
    while emulation.show_next() {}
    (0..4).all(|i| {
        let set = emulation.training_set(i).unwrap();
        set.len() == 30 && set.iter().map(|sample| sample.key).eq(set.next_key() - 30..set.next_key())
    })
}

#[test]
fn without_shares_of_authors_the_rule_alone_says_what_goes() {
    assert!(keep_the_newest(false));
    assert!(!keep_the_newest(true), "own samples stay, though they are older");
}
