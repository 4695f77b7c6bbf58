//! The power is cut at every write and every sync: all that was acknowledged is there again.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::{Place, Records, Store};
use super::faulty::{Disk, Kept};
use super::{ME, applied, change};

/// Writes some changes, until the power goes. Gives the records as they were at each acknowledgement, and once more as
/// they would be after the next.
fn live(disk: &Disk) -> (Records, Vec<Records>) {
    let (mut acknowledged, mut later) = (Records::new(), vec![]);
    let Ok((store, _)) = Store::open(Arc::new(disk.clone()), ME, 1) else { return (acknowledged, later) };
    for step in 0..6_u8 {
        let changes = [change(step, Some(step)), change(step / 2, Some(100 + step)), change(step / 3, None)];
        let mut next = acknowledged.clone();
        applied(&mut next, &changes);
        if store.write(&changes, None).is_err() {
            later.push(next);
            break;
        }
        acknowledged = next;
    }
    (acknowledged, later)
}

#[test]
fn the_power_cut_at_every_write_and_every_sync_loses_nothing_acknowledged() {
    let whole = Disk::default();
    live(&whole);
    let operations = whole.operations();
    assert!(operations > 50, "{operations} operations are no test");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut reopened = 0;
    for at in 1..=operations {
        let disk = Disk::default();
        disk.cut_at(at);
        let (acknowledged, later) = live(&disk);
        // Nothing, all, and any part of what was not synced may have reached the disk.
        for chance in 0..6 {
            let after = disk.after_cut(|| match chance {
                0 => Kept::None,
                1 => Kept::All,
                _ => [Kept::None, Kept::Half, Kept::All][rng.random_range(0..3)],
            });
            if !after.is_there().unwrap() {
                assert!(acknowledged.is_empty(), "cut at {at}: the file is gone");
                continue;
            }
            let opened = Store::open(Arc::new(after), ME, 1);
            let (store, _) = opened.unwrap_or_else(|error| panic!("cut at {at}, chance {chance}: {error}"));
            let records = store.records().unwrap();
            assert!(
                records == acknowledged || later.contains(&records),
                "cut at {at}, chance {chance}: {records:?} is neither {acknowledged:?} nor what was on the way"
            );
            reopened += 1;
        }
    }
    assert!(reopened > 200, "only {reopened} were reopened");
}

#[test]
fn a_full_disk_is_called_full_and_takes_all_once_there_is_room() {
    let disk = Disk::default();
    let (store, _) = Store::open(Arc::new(disk.clone()), ME, 1).unwrap();
    store.write(&[change(1, Some(1))], None).unwrap();
    let run = store.run();
    disk.fill(true);
    let error = store.write(&[change(2, Some(2))], None).unwrap_err();
    assert!(error.is_of_the_disk() && error.to_string().contains("make room"), "{error}");
    drop(store);
    disk.fill(false);
    let store = Store::reopen(Arc::new(disk), ME, run).unwrap();
    assert_eq!(store.records().unwrap().len(), 1, "what was there is there");
    store.write(&[change(2, Some(2))], None).unwrap();
    assert_eq!(store.records().unwrap().len(), 2);
}
