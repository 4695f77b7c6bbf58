//! Files that were damaged, cut short, exchanged or removed: each is called what it is, and none is passed over.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;

use gestalt_protocol::RobotId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use redb::{Database, TableDefinition};

use super::super::{Records, Store, StoreError};
use super::{ME, applied, change, open, place};

/// A memory that has seen some changes, closed, and what it holds.
fn written(folder: &tempfile::TempDir) -> (PathBuf, Records) {
    let path = folder.path().join("robot.memory");
    let mut records = Records::new();
    let store = open(&path).unwrap();
    for step in 0..60_u8 {
        let changes = [change(step, Some(step)), change(step / 2, Some(200))];
        store.write(&changes, None).unwrap();
        applied(&mut records, &changes);
    }
    (path, records)
}

/// Opens a file of these bytes: all is there again, or it is called damaged.
fn all_or_damaged(path: &PathBuf, bytes: &[u8], records: &Records, what: &str) -> bool {
    fs::write(path, bytes).unwrap();
    match open(path) {
        Ok(store) => {
            assert!(store.records().unwrap() == *records, "{what}: records are lost in silence");
            false
        }
        Err(StoreError::Damaged { .. }) => true,
        // The head of the file may be damaged beyond recognition.
        Err(error) => panic!("{what}: {error}"),
    }
}

#[test]
fn a_damaged_byte_is_called_damage_or_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let (path, records) = written(&folder);
    let whole = fs::read(&path).unwrap();
    let touched = folder.path().join("touched");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    // The first bytes say which of two commits counts; of the rest, much is room.
    let used: Vec<usize> = (0..whole.len()).filter(|&at| whole[at] != 0).collect();
    let anywhere = (0..100).map(|_| used[rng.random_range(0..used.len())]);
    let places: Vec<usize> = (0..100).chain(anywhere).collect();
    let mut damaged = 0;
    for at in places {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << rng.random_range(0..8);
        damaged += usize::from(all_or_damaged(&touched, &bytes, &records, &format!("byte {at}")));
    }
    eprintln!("{damaged} of 200 damaged bytes were noticed, the others did no harm");
    assert!(damaged > 10, "only {damaged} of 200 were noticed");
}

#[test]
fn a_file_cut_short_at_any_length_is_called_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let (path, records) = written(&folder);
    let whole = fs::read(&path).unwrap();
    let touched = folder.path().join("touched");
    let lengths = (0..whole.len()).step_by(whole.len() / 60).chain([1, 8, 9, 64, 320, 4095, 4096, 4097]);
    for length in lengths {
        let noticed = all_or_damaged(&touched, &whole[..length], &records, &format!("cut at {length}"));
        assert!(noticed, "cut at {length} of {}", whole.len());
    }
}

#[test]
fn another_programs_file_is_foreign_whatever_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text");
    fs::write(&text, "a text of another program, long enough").unwrap();
    assert!(matches!(open(&text), Err(StoreError::Foreign(_))));
    let database = folder.path().join("database");
    let other = Database::create(&database).unwrap();
    let write = other.begin_write().unwrap();
    write.open_table(TableDefinition::<u64, u64>::new("accounts")).unwrap().insert(1, 2).unwrap();
    write.commit().unwrap();
    drop(other);
    assert!(matches!(open(&database), Err(StoreError::Foreign(_))));
    assert_eq!(fs::read(&text).unwrap(), b"a text of another program, long enough", "and left alone");
}

#[test]
fn another_robots_file_one_in_use_and_one_of_another_schema_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.memory");
    let store = open(&path).unwrap();
    assert!(matches!(open(&path), Err(StoreError::InUse(_))));
    drop(store);
    let other = Store::open(place(&path), RobotId(8), 1);
    assert!(matches!(other, Err(StoreError::Robot { found: 7, .. })));
    let database = Database::create(&path).unwrap();
    let write = database.begin_write().unwrap();
    write.open_table(TableDefinition::<&str, u64>::new("about")).unwrap().insert("schema", 9).unwrap();
    write.commit().unwrap();
    drop(database);
    assert!(matches!(open(&path), Err(StoreError::Schema { found: 9, .. })));
}

#[test]
fn what_was_written_is_there_again_and_each_start_counts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.memory");
    let mut before = 0;
    for start in 1..4_u8 {
        let (store, new) = Store::open(place(&path), ME, 1).unwrap();
        assert_eq!((store.boot() > before, store.boot() == 1, new), (true, start == 1, start == 1));
        before = store.boot();
        assert_eq!(store.records().unwrap().len(), usize::from(start) - 1);
        store.write(&[change(start, Some(9)), change(99, Some(1))], None).unwrap();
        store.write(&[change(99, None)], None).unwrap();
    }
    assert_eq!(Store::open(place(&path), ME, 1 << 30).unwrap().0.boot(), 1 << 30, "never below the clock's");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no draft is left");
}

#[test]
fn starts_beyond_the_clock_go_on_by_little_and_by_chance() {
    let folder = tempfile::tempdir().unwrap();
    let (path, copy) = (folder.path().join("robot.memory"), folder.path().join("copy"));
    let first = open(&path).unwrap().boot();
    for _ in 0..20 {
        drop(open(&path).unwrap());
    }
    fs::copy(&path, &copy).unwrap();
    let last = open(&path).unwrap().boot();
    assert!((first + 21..=first + 21 * 4096).contains(&last), "{last} after {first}");
    let mut of_copies = std::collections::BTreeSet::new();
    for _ in 0..20 {
        let old = folder.path().join("old");
        fs::copy(&copy, &old).unwrap();
        of_copies.insert(open(&old).unwrap().boot());
    }
    assert!(of_copies.len() > 8, "{of_copies:?}");
}

#[test]
fn a_link_to_no_file_yet_stays_and_the_file_is_made_where_it_leads() {
    let folder = tempfile::tempdir().unwrap();
    let [path, disk] = ["robot.memory", "disk"].map(|name| folder.path().join(name));
    symlink("disk/m", &path).unwrap();
    assert!(matches!(open(&path), Err(StoreError::NoFolder(_))), "and no folder either");
    fs::create_dir(&disk).unwrap();
    open(&path).unwrap().write(&[change(1, Some(1))], None).unwrap();
    assert!(fs::symlink_metadata(&path).unwrap().is_symlink());
    assert_eq!(open(&disk.join("m")).unwrap().records().unwrap().len(), 1);
    assert_eq!(fs::read_dir(&disk).unwrap().count(), 1, "no draft is left");
}

#[test]
fn a_copy_is_read_and_the_file_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.memory");
    assert!(Store::copy(place(&path), ME).unwrap().is_none() && !path.exists());
    open(&path).unwrap().write(&[change(1, Some(1))], None).unwrap();
    let before = fs::read(&path).unwrap();
    let mut copy = Store::copy(place(&path), ME).unwrap().unwrap();
    copy.count(1).unwrap();
    assert_eq!(copy.records().unwrap().len(), 1);
    drop(copy);
    assert_eq!(fs::read(&path).unwrap(), before);
    assert!(matches!(Store::copy(place(&path), RobotId(8)), Err(StoreError::Robot { .. })));
    let error = Store::copy(place(folder.path()), ME).unwrap_err();
    assert!(error.to_string().contains("no file"), "{error}");
}

#[test]
fn records_that_are_no_memory_are_damage() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder.path().join("m")).unwrap();
    assert!(store.memory().unwrap().is_empty());
    store.write(&[change(200, Some(1))], None).unwrap();
    assert!(matches!(store.memory(), Err(StoreError::Damaged { .. })));
}

#[test]
fn a_folder_that_is_missing_is_the_disks_fault_and_a_read_only_one_too() {
    let folder = tempfile::tempdir().unwrap();
    let error = open(&folder.path().join("no/such/folder")).unwrap_err();
    assert!(matches!(error, StoreError::NoFolder(_)) && error.is_of_the_disk(), "{error}");
    // Root may write anywhere but to the kernel.
    let path = folder.path().join("proc");
    symlink("/proc/self", &path).unwrap();
    let error = open(&path.join("memory")).unwrap_err();
    assert!(error.is_of_the_disk(), "{error}");
    let refused = std::io::Error::from(std::io::ErrorKind::ReadOnlyFilesystem);
    let error = StoreError::of_system(&path, &refused);
    assert!(matches!(error, StoreError::ReadOnly { .. }) && error.is_of_the_disk(), "{error}");
}

#[test]
fn a_file_removed_or_exchanged_while_open_acknowledges_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.memory");
    let store = open(&path).unwrap();
    let run = store.run();
    fs::remove_file(&path).unwrap();
    assert!(matches!(store.write(&[change(1, Some(1))], None), Err(StoreError::Removed(_))));
    let other = open(&path).unwrap();
    assert!(matches!(store.check(), Err(StoreError::Replaced(_))));
    drop((store, other));
    let reopened = Store::reopen(place(&path), ME, run);
    assert!(matches!(reopened, Err(StoreError::Replaced(_))), "this robot's, but not of this run");
    fs::remove_file(&path).unwrap();
    let reopened = Store::reopen(place(&path), ME, run).unwrap();
    assert_eq!((reopened.boot(), reopened.records().unwrap()), (run.boot, Records::new()));
    drop(reopened);
    assert!(open(&path).unwrap().boot() > run.boot, "it is signed");
}

#[test]
fn a_file_that_was_begun_in_place_of_a_removed_one_is_this_robots() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m");
    let run = open(&path).unwrap().run();
    // Another run's stays what it is.
    fs::remove_file(&path).unwrap();
    drop(open(&path).unwrap());
    let replaced = Store::reopen(place(&path), ME, run).map(drop).unwrap_err();
    assert!(matches!(replaced, StoreError::Replaced(_)), "{replaced}");
    // Begun, and then the disk was full.
    fs::remove_file(&path).unwrap();
    drop(Store::look(place(&path), ME).unwrap());
    let store = Store::reopen(place(&path), ME, run).unwrap();
    assert_eq!(store.boot(), run.boot);
    store.write(&[change(1, Some(1))], None).unwrap();
    drop(store);
    // And stays this run's.
    let store = Store::reopen(place(&path), ME, run).unwrap();
    assert_eq!((store.boot(), store.records().unwrap().len()), (run.boot, 1));
}
