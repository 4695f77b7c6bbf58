//! What the writing thread makes of disks that fail, come late, or lose the file.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use gestalt_protocol::{ClassId, Status};
use gestalt_strategies::{
    Classifier, Components, FeatureSpace, Learner, LearnerOptions, RecordChange, ScalingMethod, Vocabulary,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;
use tokio::sync::broadcast;

use super::super::{Assignment, Place, Records, Scribe, Store, Told};
use super::faulty::Disk;
use super::{ME, change, open, place};
use crate::account::Account;
use crate::event::Event;
use crate::failure::Part;
use crate::supervisor::Supervisor;

const PATIENCE: Duration = Duration::from_secs(30);

/// A scribe, and all that it tells.
struct Watched {
    scribe: Scribe,
    told: Receiver<Told>,
    supervisor: Arc<Supervisor>,
    events: broadcast::Receiver<Event>,
}

fn start(place: Arc<dyn Place>, store: Option<Store>) -> Watched {
    let known = store.as_ref().map_or_else(Records::new, |store| store.records().unwrap());
    let classifier = store.as_ref().and_then(|store| store.classifier().unwrap());
    start_knowing(place, store, known, classifier.map(Arc::new))
}

fn start_knowing(
    place: Arc<dyn Place>,
    store: Option<Store>,
    known: Records,
    classifier: Option<Arc<Classifier>>,
) -> Watched {
    let account = Account::new(Status::new(ME, "seven".to_owned(), 1), Instant::now());
    let (sender, events) = broadcast::channel(64);
    let supervisor = Supervisor::new(Arc::new(account), sender);
    let (tell, told) = channel();
    let assignment = Assignment { place, robot: ME, boot: 1, known, classifier, store };
    let tell = move |what| drop(tell.send(what));
    Watched { scribe: Scribe::start(assignment, supervisor.clone(), tell).unwrap(), told, supervisor, events }
}

fn start_at(path: &Path) -> Watched {
    start(place(path), Some(open(path).unwrap()))
}

/// One that has met two gestures.
fn trained() -> Arc<Classifier> {
    let views = [[0.0_f32, 0.1], [0.1, 0.0], [1.0, 0.9], [0.9, 1.0]];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = views.iter().map(|view| &view[..]);
    let space = FeatureSpace::fit("test", rows, ScalingMethod::Common, Components::Count(2), &mut rng);
    let vocabulary = Vocabulary::new(["left", "right"]).unwrap();
    let mut learner = Learner::new(Arc::new(space), vocabulary, LearnerOptions::default()).unwrap();
    for (key, view) in (0..).zip(&views) {
        let vector = learner.space().project(view).unwrap();
        learner.insert(key, ClassId(u8::from(key > 1).into()), &vector).unwrap();
    }
    learner.learn().unwrap()
}

/// What stands in a memory: the keys of its records, and of how many samples of each gesture its classifier is.
fn standing(store: &Store) -> (Vec<Vec<u8>>, Option<Vec<u32>>) {
    let classifier = store.classifier().unwrap();
    (store.records().unwrap().into_keys().collect(), classifier.map(|it| it.learned().to_vec()))
}

/// A scribe that has something to write, and where its disk will be.
fn start_without_disk(folder: &TempDir) -> (PathBuf, Watched) {
    let late = folder.path().join("late");
    let watched = start(place(&late.join("m")), None);
    watched.scribe.remember(1, vec![change(1, Some(1))]);
    watched.wait_for_error("its folder is not there");
    (late, watched)
}

impl Watched {
    /// Waits for the first of what is told that suits.
    fn wait<T>(&self, what: &str, suits: impl Fn(Told) -> Option<T>) -> T {
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let told = self.told.recv_timeout(left).unwrap_or_else(|_| panic!("never told: {what}"));
            if let Some(found) = suits(told) {
                return found;
            }
        }
    }

    fn wait_for_revision(&self, revision: u64) {
        self.wait("written", |told| matches!(told, Told::Wrote(wrote) if wrote >= revision).then_some(()));
    }

    fn wait_for_error(&self, words: &str) {
        self.wait(words, |told| match told {
            Told::Failed(error) => error.to_string().contains(words).then_some(()),
            _ => None,
        });
    }
}

#[test]
fn what_is_handed_over_is_written_and_said_to_be() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m");
    let watched = start_at(&path);
    for revision in 1..=20_u8 {
        watched.scribe.remember(u64::from(revision), vec![change(revision, Some(1))]);
    }
    watched.wait_for_revision(20);
    drop(watched);
    assert_eq!(open(&path).unwrap().records().unwrap().len(), 20);
}

#[test]
fn a_full_disk_is_told_and_tried_again_until_all_is_written() {
    let disk = Disk::default();
    let (store, _) = Store::open(Arc::new(disk.clone()), ME, 1).unwrap();
    let watched = start(Arc::new(disk.clone()), Some(store));
    disk.fill(true);
    watched.scribe.remember(1, vec![change(1, Some(1))]);
    watched.wait_for_error("make room");
    watched.wait_for_error("make room");
    disk.fill(false);
    watched.wait_for_revision(1);
}

#[test]
fn a_file_removed_while_running_is_written_anew_with_all_that_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m");
    open(&path).unwrap().write(&[change(1, Some(1))], None).unwrap();
    let watched = start_at(&path);
    watched.scribe.remember(1, vec![change(2, Some(2))]);
    watched.wait_for_revision(1);
    fs::remove_file(&path).unwrap();
    // Noticed though nothing is to be written.
    watched.wait_for_error("removed while running");
    watched.wait_for_revision(1);
    watched.scribe.remember(2, vec![change(3, Some(3))]);
    watched.wait_for_revision(2);
    drop(watched);
    let records = open(&path).unwrap().records().unwrap();
    assert_eq!(records.into_keys().collect::<Vec<_>>(), [[1], [2], [3]]);
}

/// Whichever write or sync it is at which the disk fails for a while, and though nothing was trained in this life.
#[test]
fn a_file_removed_where_the_disk_fails_too_is_written_anew_with_its_classifier() {
    const FAILURES: u64 = 100;
    let classifier = trained();
    let swarm: Vec<(Disk, Watched)> = (1..=FAILURES)
        .map(|at| {
            let disk = Disk::default();
            let (store, _) = Store::open(Arc::new(disk.clone()), ME, 1).unwrap();
            store.write(&[change(1, Some(1))], Some(&classifier)).unwrap();
            let watched = start(Arc::new(disk.clone()), Some(store));
            disk.cut_at(disk.operations() + at);
            disk.remove();
            (disk, watched)
        })
        .collect();
    let failed = swarm.iter().filter(|(disk, watched)| {
        watched.wait_for_error("removed while running");
        let failed = watched.wait("it is tried", |told| Some(matches!(told, Told::Failed(_))));
        disk.cut_at(u64::MAX);
        failed
    });
    let failed = failed.count() as u64;
    assert!((10..FAILURES).contains(&failed), "each is met, and all went well after {failed}");
    for ((disk, watched), at) in swarm.into_iter().zip(1..) {
        watched.scribe.remember(1, vec![change(2, Some(2))]);
        watched.wait_for_revision(1);
        drop(watched);
        let store = Store::look(Arc::new(disk), ME).unwrap().0;
        assert_eq!(standing(&store), (vec![vec![1], vec![2]], Some(vec![2, 2])), "failed at {at}");
    }
}

#[test]
fn a_disk_that_comes_late_and_empty_takes_all() {
    let folder = tempfile::tempdir().unwrap();
    let (late, watched) = start_without_disk(&folder);
    fs::create_dir(&late).unwrap();
    watched.wait_for_revision(1);
    drop(watched);
    assert_eq!(open(&late.join("m")).unwrap().records().unwrap().len(), 1);
}

#[test]
fn what_could_be_read_alone_and_went_then_is_written_anew() {
    let folder = tempfile::tempdir().unwrap();
    let late = folder.path().join("late");
    let known = Records::from([(vec![1], vec![1; 40])]);
    let watched = start_knowing(place(&late.join("m")), None, known, Some(trained()));
    watched.scribe.remember(1, vec![change(2, Some(2))]);
    watched.wait_for_error("its folder is not there");
    fs::create_dir(&late).unwrap();
    watched.wait_for_revision(1);
    drop(watched);
    assert_eq!(standing(&open(&late.join("m")).unwrap()), (vec![vec![1], vec![2]], Some(vec![2, 2])));
}

#[test]
fn what_is_found_late_and_not_taken_up_is_never_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let (late, watched) = start_without_disk(&folder);
    let made = folder.path().join("made");
    fs::create_dir(&made).unwrap();
    // Whose it is, and nothing else.
    let owner = [&[3, ME.0 as u8][..], &1_u64.to_le_bytes(), &[1]].concat();
    let owner = RecordChange { key: vec![0], value: Some(owner) };
    open(&made.join("m")).unwrap().write(&[owner], None).unwrap();
    fs::rename(&made, &late).unwrap();
    watched.wait("found", |told| matches!(told, Told::Found(_)).then_some(()));
    // As whoever is told to moves it away.
    fs::remove_file(late.join("m")).unwrap();
    watched.scribe.remember(2, vec![change(2, Some(2))]);
    let told = watched.told.recv_timeout(Duration::from_millis(2500));
    assert!(told.is_err() && !late.join("m").exists());
    drop(watched);
    assert!(!late.join("m").exists());
}

#[test]
fn a_file_damaged_late_is_refused_again_and_again_and_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let (late, watched) = start_without_disk(&folder);
    fs::create_dir(folder.path().join("made")).unwrap();
    fs::write(folder.path().join("made/m"), "redb\x1a, but no more").unwrap();
    fs::rename(folder.path().join("made"), &late).unwrap();
    watched.wait_for_error("damaged");
    watched.wait_for_error("damaged");
    assert_eq!(fs::read(late.join("m")).unwrap(), b"redb\x1a, but no more");
}

#[test]
fn records_that_are_refused_late_count_no_start_however_often_they_are_tried() {
    let folder = tempfile::tempdir().unwrap();
    let (late, watched) = start_without_disk(&folder);
    let made = folder.path().join("made");
    fs::create_dir(&made).unwrap();
    let store = open(&made.join("m")).unwrap();
    let head = RecordChange { key: vec![0], value: Some(vec![99; 40]) };
    store.write(&[head], None).unwrap();
    let before = (store.boot(), store.records().unwrap());
    drop(store);
    fs::rename(&made, &late).unwrap();
    watched.wait_for_error("layout 99");
    watched.wait_for_error("layout 99");
    drop(watched);
    let store = Store::look(place(&late.join("m")), ME).unwrap().0;
    assert_eq!((store.boot(), store.records().unwrap()), before);
}

#[test]
fn a_panic_is_told_and_what_waits_is_written_then() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m");
    let mut watched = start_at(&path);
    watched.supervisor.make_fail(Part::Memory);
    watched.scribe.remember(1, vec![change(1, Some(1))]);
    watched.wait_for_revision(1);
    let told = watched.events.try_recv().unwrap();
    assert!(matches!(told, Event::Failed { part: Part::Memory, .. }), "{told:?}");
    drop(watched);
    assert_eq!(open(&path).unwrap().records().unwrap().len(), 1);
}
