use super::*;
use crate::testing::{authority, have, members, robot, roster};

fn channels(me: u32) -> Channels {
    Channels::new(RobotId(me), Arc::new(robot(me)), roster(1).swarm_id())
}

fn at(boot: u32, sequence: u32) -> Stamp {
    Stamp { boot, sequence }
}

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);

#[test]
fn what_one_says_to_another_is_heard_by_that_one_alone_and_as_from_nobody_else() {
    let (mut one, mut two, mut three) = (channels(1), channels(2), channels(3));
    let said = have(1, 1);
    let tag = one.tag(&roster(1), TWO, &said).unwrap();
    let at = at(1, 1);
    assert_eq!(two.check(&roster(1), (RobotId(3), at), &said, Some(&tag)), Err(Distrust::Forged));
    assert_eq!(three.check(&roster(1), (ONE, at), &said, Some(&tag)), Err(Distrust::Forged));
    // Nor is it sent back to who said it.
    assert_eq!(one.check(&roster(1), (TWO, at), &said, Some(&tag)), Err(Distrust::Forged));
    assert_eq!(two.check(&roster(1), (ONE, at), &said, Some(&tag)), Ok(()));
}

#[test]
fn every_bit_of_a_message_and_of_its_tag_is_looked_at() {
    let (mut one, mut two) = (channels(1), channels(2));
    let said = have(1, 1);
    let tag = one.tag(&roster(1), TWO, &said).unwrap();
    let mut refuses = |said: &[u8], tag: &[u8], cause| {
        assert_eq!(two.check(&roster(1), (ONE, at(1, 1)), said, Some(tag)), Err(cause));
    };
    for bit in 0..8 * said.len() {
        let mut other = said.clone();
        other[bit / 8] ^= 1 << (bit % 8);
        refuses(&other, &tag, Distrust::Forged);
    }
    for bit in 0..8 * tag.len() {
        let mut other = tag;
        other[bit / 8] ^= 1 << (bit % 8);
        refuses(&said, &other, Distrust::Forged);
    }
    // As long as it is, and not one byte of it that was guessed.
    for length in 0..tag.len() {
        refuses(&said, &tag[..length], Distrust::Unsigned);
    }
    refuses(&said, &[tag.as_slice(), &[0]].concat(), Distrust::Unsigned);
    assert_eq!(two.check(&roster(1), (ONE, at(1, 1)), &said, None), Err(Distrust::Unsigned));
}

#[test]
fn nothing_counts_twice_or_behind_what_was_said_after_it() {
    let (mut one, mut two) = (channels(1), channels(2));
    let mut hears = |stamp: Stamp| {
        let said = [stamp.boot.to_le_bytes(), stamp.sequence.to_le_bytes()].concat();
        let tag = one.tag(&roster(1), TWO, &said).unwrap();
        two.check(&roster(1), (ONE, stamp), &said, Some(&tag))
    };
    assert_eq!(hears(at(3, 5)), Ok(()));
    assert_eq!(hears(at(3, 5)), Err(Distrust::Repeated));
    assert_eq!(hears(at(3, 4)), Err(Distrust::Repeated));
    assert_eq!(hears(at(3, 7)), Ok(()));
    // A robot whose disk was lost and whose clock went back is heard all the same; what was said before, never again.
    assert_eq!(hears(at(1, 1)), Ok(()));
    assert_eq!(hears(at(3, 7)), Err(Distrust::Repeated));
    for boot in 4..4 + REMEMBERED as u32 - 1 {
        assert_eq!(hears(at(boot, 9)), Ok(()));
        assert_eq!(hears(at(1, boot)), Ok(()), "it speaks on");
    }
    assert_eq!(hears(at(1, 4)), Err(Distrust::Repeated));
    assert_eq!(two.with[&ONE].heard.len(), REMEMBERED, "and no more is kept");
}

#[test]
fn strangers_and_the_expelled_have_none_and_a_new_key_begins_anew() {
    let (mut one, mut two) = (channels(1), channels(2));
    let said = have(1, 1);
    let tag = one.tag(&roster(1), TWO, &said).unwrap();
    assert_eq!(two.check(&roster(1), (ONE, at(9, 9)), &said, Some(&tag)), Ok(()));
    assert_eq!(one.tag(&roster(1), RobotId(9), &said), Err(Distrust::Stranger));

    let mut expelled = members(2);
    let key = expelled.robots.remove(&ONE).unwrap();
    expelled.expelled.insert(ONE, key);
    let expelled = expelled.sign(&authority()).unwrap();
    assert_eq!(two.check(&expelled, (ONE, at(9, 10)), &said, Some(&tag)), Err(Distrust::Expelled));

    let mut renewed = members(3);
    renewed.robots.insert(ONE, robot(91).public_key());
    let renewed = renewed.sign(&authority()).unwrap();
    assert_eq!(two.check(&renewed, (ONE, at(9, 10)), &said, Some(&tag)), Err(Distrust::Forged));
    let mut one = Channels::new(ONE, Arc::new(robot(91)), roster(1).swarm_id());
    let tag = one.tag(&renewed, TWO, &said).unwrap();
    assert_eq!(two.check(&renewed, (ONE, at(1, 1)), &said, Some(&tag)), Ok(()));
}

#[test]
fn the_tag_never_changes() {
    // By another program, from the same keys: X25519 of the package cryptography and HMAC of Python's own library.
    let tag = channels(1).tag(&roster(1), TWO, b"said").unwrap();
    assert_eq!(gestalt_protocol::hex::Hex(&tag).to_string(), "276f979e99dcf009b8d8c6b3e627dc35");
}

#[test]
fn a_log_says_whose_they_are_and_no_secret() {
    let mut one = channels(1);
    one.tag(&roster(1), TWO, &have(1, 1)).unwrap();
    assert_eq!(format!("{one:?}"), "Channels { me: RobotId(1), .. }");
}
