//! Whole experiments, small ones.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use gestalt_protocol::{ClassId, FusionRule};
use gestalt_strategies::Fuse;
use gestalt_strategies::fusion::Fusion;

use super::*;
use crate::emulation::Rules;

const SMALL: &str = "{ title: 'two, or \"more\"', base: { rounds: 3, robots: 2 },
    axis: { name: 'by', values: [ { name: 'pool, as ever', set: {} }, { name: 'first', set: { own_rules: 'first' } } ] },
    hands: { places: 2, people: 4 }, seeds: 2 }";

/// Whoever comes first decides.
#[derive(Debug)]
struct First(Arc<AtomicUsize>);

impl Fuse for First {
    fn rule(&self) -> FusionRule {
        FusionRule::Other("first".parse().unwrap())
    }

    fn fuse(&self, _: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let vote = votes.first()?;
        let top = (0..classes).max_by(|a, b| vote[*a].total_cmp(&vote[*b]))?;
        let probabilities = (0..classes).map(|class| f64::from(u8::from(class == top))).collect();
        Some(Fusion { probabilities, top: ClassId(top as u32), margin: 1.0 })
    }
}

fn small(folder: &Path, threads: usize) -> (String, usize, Vec<Progress>) {
    let asked = Arc::new(AtomicUsize::new(0));
    let fusion: Arc<dyn Fuse> = Arc::new(First(asked.clone()));
    let rules = [("first".to_owned(), Rules { fusion: Some(fusion), ..Rules::default() })].into();
    let said = std::sync::Mutex::new(Vec::new());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let table = pool.install(|| {
        let materials = (&Materials::default(), &rules);
        conduct_by((SMALL, Path::new("small")), materials, folder, None, |progress| {
            said.lock().unwrap().push(progress)
        })
    });
    (table.unwrap(), asked.load(Ordering::Relaxed), said.into_inner().unwrap())
}

#[test]
fn the_number_of_threads_changes_nothing_and_what_is_done_is_not_done_again() {
    let (one, three) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (table, asked, _) = small(one.path(), 1);
    assert!(asked > 0, "the user's rule was never asked");
    assert!(table.contains("| pool, as ever |") && table.contains("| first |"), "{table}");
    let csv = |folder: &Path| std::fs::read_to_string(folder.join("results.csv")).unwrap();
    assert_eq!(table, small(three.path(), 3).0);
    assert_eq!(csv(one.path()), csv(three.path()));

    // The last run is lost, in the midst of a line.
    let whole = csv(one.path());
    std::fs::write(one.path().join("results.csv"), &whole[..whole.len() - 30]).unwrap();
    let (again, _, said) = small(one.path(), 2);
    assert_eq!((again, csv(one.path())), (table, whole));
    let ran: Vec<_> = said.into_iter().filter(|progress| matches!(progress, Progress::Ran(..))).collect();
    assert_eq!(ran, [Progress::Ran(3, 4), Progress::Ran(4, 4)]);
}

/// Also where it sees no hand in some of what is asked.
#[test]
fn a_swarm_of_one_is_right_as_often_as_its_robot() {
    const ONE: &str = "{ title: 't', base: { rounds: 6, robots: 1 }, axis: { name: 'x', values: [ { name: 'a', set: {} } ] },
        hands: { places: 3, people: 8 }, seeds: 3 }";
    let folder = tempfile::tempdir().unwrap();
    conduct((ONE, Path::new("one")), &Materials::default(), folder.path(), None, |_| ()).unwrap();
    let table = std::fs::read_to_string(folder.path().join("results.csv")).unwrap();
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let column = |name: &str| names.iter().position(|it| *it == name).unwrap();
    let (single, swarm) = (column("single"), column("swarm"));
    let rows: Vec<Vec<&str>> = lines.collect();
    assert!(rows.len() >= 18, "{table}");
    for row in rows {
        assert_eq!(row[swarm], row[single], "{row:?}");
    }
}

#[test]
fn rules_that_nobody_brought_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let refused = conduct((SMALL, Path::new("small")), &Materials::default(), folder.path(), None, |_| ());
    assert!(refused.unwrap_err().to_string().contains("'first'"));
    let none = BTreeMap::<String, Rules>::new();
    assert!(
        conduct_by((SMALL, Path::new("small")), (&Materials::default(), &none), folder.path(), None, |_| ())
            .is_err()
    );
    assert!(!folder.path().join("run.json").exists(), "nothing is begun");
}

#[test]
fn a_recognition_experiment_goes_on_where_it_stopped() {
    const ONE: &str =
        "{ title: 't', swarms: [ { line: 'alone', robots: [{ camera: 'footbot', count: 1 }] } ],
        showings: 2, training_frames: 200, shown_for: '1s', seeds: 2 }";
    let conduct = |folder: &Path| {
        let ran = AtomicUsize::new(0);
        let table = recognition::conduct((ONE, Path::new("one")), folder, None, |progress| {
            ran.fetch_add(
                usize::from(matches!(progress, Progress::Ran(done, _) if done > 0)),
                Ordering::Relaxed,
            );
        });
        (table.unwrap(), ran.into_inner())
    };
    let folder = tempfile::tempdir().unwrap();
    let (table, ran) = conduct(folder.path());
    assert_eq!(ran, 2);
    // All is there: nothing is run again, and the table is the same.
    let (again, said) = conduct(folder.path());
    assert_eq!((again, said), (table, 1));
    let changed = ONE.replace("'t'", "'other'");
    let refused = recognition::conduct((&changed, Path::new("one")), folder.path(), None, |_| ());
    assert!(matches!(refused, Err(ExperimentError::Other(_))));
}

#[test]
fn learned_eyes_start_from_the_shipped_model_or_say_what_they_miss() {
    const LEARNED: &str = "{ title: 'bare hands', base: { rounds: 4, robots: 2, start: 'shipped' },
        axis: { name: 'B', values: [ { name: '1', set: {} } ] },
        hands: { places: 2, people: 4, glove: 'skin', features: 'embedding' }, seeds: 1 }";
    let conduct = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        conduct((text, Path::new("learned")), &Materials::default(), folder.path(), None, |_| ())
    };
    let table = conduct(LEARNED).unwrap();
    assert!(table.contains("| 1 |"), "{table}");
    for (from, to, named) in [
        (", features: 'embedding'", "", "features: 'embedding'"),
        ("start: 'shipped'", "start: 'shipped', components: 8", "all its 24 numbers"),
        ("start: 'shipped'", "start: 'model'", "--start-dataset"),
    ] {
        let error = conduct(&LEARNED.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}
