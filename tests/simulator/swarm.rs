//! What must hold of a swarm in the simulator.

use std::path::Path;
use std::process::Command;

use crate::built::{program, root, said, swarm, write_views};
use crate::picture::{Bar, draw};
use crate::showing::{Showing, read};

pub fn ten_marxbots_in_range_hold_one_decision_in_each_of_twenty_showings() {
    let showings = read(&said(&swarm(&["--showings", "20"]).output().unwrap()));
    assert_eq!(showings.len(), 20);
    for showing in &showings {
        let Showing { robots, reach, agree, refused, .. } = *showing;
        assert_eq!((robots, reach, agree, refused), (10, 10, 10, 0), "{showing:?}");
    }
    // One of them is a hand that most of these cameras misread.
    let right = showings.iter().filter(|showing| showing.gesture == Some(showing.shown)).count();
    assert!(right >= 18, "{right} of 20 decisions are right: {showings:?}");
}

const RANGES: &str = "0.2,0.3,0.35,0.4,0.45,0.5,0.6,0.8,1.5";

pub fn over_radio_ranges_those_agree_who_can_reach_each_other() {
    let showings = read(&said(&swarm(&["--showings", "20", "--range", RANGES]).output().unwrap()));
    assert_eq!(showings.len(), 20 * RANGES.split(',').count());
    for showing in &showings {
        let Showing { robots, reach, agree, .. } = *showing;
        // A majority that can reach each other agrees, all of it; nobody else ever holds what it holds.
        let expected = if 2 * reach > robots { reach..=reach } else { 0..=reach };
        assert!(expected.contains(&agree), "{showing:?}");
    }
    let bars: Vec<Bar> = showings
        .chunk_by(|one, other| one.range_m == other.range_m)
        .map(|of_range| {
            let mean = |part: fn(&Showing) -> u32| {
                let shares = of_range.iter().map(|one| f64::from(part(one)) / f64::from(one.robots));
                shares.sum::<f64>() / of_range.len() as f64
            };
            Bar {
                range_m: of_range[0].range_m,
                connected: mean(|one| one.reach),
                agree: mean(|one| one.agree),
            }
        })
        .collect();
    for Bar { range_m, connected, agree } in &bars {
        println!("range {range_m} m: connected {:.1} %, agree {:.1} %", 100.0 * connected, 100.0 * agree);
    }
    // The ranges lead from a swarm in pieces to a whole one, and agreement with them.
    let (first, last) = (&bars[0], &bars[bars.len() - 1]);
    assert!(first.connected < 0.3 && first.agree < 0.3, "{} {}", first.connected, first.agree);
    assert_eq!((last.connected, last.agree), (1.0, 1.0));
    let correlation = correlation(&showings);
    assert!(correlation > 0.9, "reach and agreement correlate by {correlation:.3}");
    let svg = draw(&bars, "Ten marXbots before a human: who agrees, over how far they hear");
    let picture = match std::env::var_os("GESTALT_BLESS") {
        Some(_) => root().join("docs/simulator.png"),
        None => Path::new(env!("CARGO_TARGET_TMPDIR")).join("simulator/ranges.png"),
    };
    gestalt_draw::write(&svg, &picture).unwrap();
}

/// Pearson's, of how many can reach each other and how many agree.
fn correlation(showings: &[Showing]) -> f64 {
    let n = showings.len() as f64;
    let mean = |part: fn(&Showing) -> u32| showings.iter().map(|one| f64::from(part(one))).sum::<f64>() / n;
    let (x, y) = (mean(|one| one.reach), mean(|one| one.agree));
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for one in showings {
        let (dx, dy) = (f64::from(one.reach) - x, f64::from(one.agree) - y);
        (xy, xx, yy) = (xy + dx * dy, xx + dx * dx, yy + dy * dy);
    }
    xy / (xx * yy).sqrt()
}

pub fn the_same_seed_gives_the_same_trace_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let trace = |name: &str, seed: &str| {
        let path = folder.path().join(name);
        let arguments = ["--showings", "5", "--range", "0.5", "--seed", seed, "--trace"];
        said(&swarm(&arguments).arg(&path).output().unwrap());
        std::fs::read(path).unwrap()
    };
    let once = trace("once", "7");
    assert!(once.len() > 100_000, "{} bytes", once.len());
    // No assert_eq: nobody wants to read half a megabyte.
    assert!(once == trace("twice", "7"), "two runs with one seed differ");
    assert!(once != trace("other", "8"), "the seed changes nothing");
}

pub fn valgrind_finds_no_error_and_no_leak() {
    let run = swarm(&["--showings", "2"]);
    let kinds = "definite,indirect,possible";
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--error-exitcode=9", "--leak-check=full"]);
    valgrind.arg(format!("--show-leak-kinds={kinds}")).arg(format!("--errors-for-leak-kinds={kinds}"));
    let output = valgrind.arg(run.get_program()).args(run.get_args()).output().unwrap();
    let table = said(&output);
    assert!(String::from_utf8_lossy(&output.stderr).contains("ERROR SUMMARY: 0 errors"));
    assert_eq!(read(&table).iter().map(|showing| showing.agree).collect::<Vec<_>>(), [10, 10]);
}

pub fn what_cannot_be_run_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let torn = folder.path().join("torn.csv");
    let whole = std::fs::read_to_string(crate::built::views()).unwrap();
    let refused = |views: &Path, arguments: &[&str]| {
        let mut run = Command::new(program("enki-swarm"));
        run.arg("--views").arg(views).arg("--model").arg(crate::built::model()).args(arguments);
        let output = run.output().unwrap();
        assert!(output.status.code().is_some_and(|code| code > 0), "{views:?} {arguments:?}: {output:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    for (text, named) in [
        ("", "line 1: this is no table of views"),
        (&whole[..whole.find('\n').unwrap() + 1], "there are no views"),
        (&whole[..whole.len() / 2], "line "),
        (&whole.replacen(",0,0,0.", ",0,0,x.", 1), "line 2: not a view"),
        (&whole.replacen("\n0,-75,0.6,0,1,", "\n0,-75,0.7,0,1,", 1), "line 3: it is out of order"),
    ] {
        std::fs::write(&torn, text).unwrap();
        let said = refused(&torn, &[]);
        assert!(said.contains(named) && said.contains("gestalt views"), "{said}");
    }
    assert!(refused(&folder.path().join("none.csv"), &[]).contains("cannot be read"));
    for (arguments, named) in [
        (&["--robots", "0"][..], "--robots is 0"),
        (&["--range", "near"], "--range"),
        (&["--loss"], "--loss needs a value"),
        (&["--walls", "4"], "--walls is no option"),
        (&["--model", "/dev/null"], "model"),
    ] {
        let said = refused(crate::built::views(), arguments);
        assert!(said.contains(named), "{said}");
    }
}

pub fn the_radio_alone_survives_garbage_under_sanitizers() {
    let output = Command::new(program("radio-test")).output().unwrap();
    assert!(said(&output).contains("all as it should be"));
}

pub fn views_are_the_same_twice_and_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["--hands", "1", "--frames", "2", "--bearings", "-30,0,89", "--distances", "0.8,6"];
    let write = |name: &str, seed: &str| {
        let out = folder.path().join(name);
        let summary = said(&write_views(&out, &[&small[..], &["--seed", seed]].concat()));
        assert!(summary.starts_with("72 views, a hand found in "), "{summary}");
        std::fs::read_to_string(out).unwrap()
    };
    let once = write("once.csv", "1");
    assert!(once == write("twice.csv", "1") && once != write("other.csv", "2"));
    let features = once.lines().next().unwrap().split(',').count() - 6;
    for line in once.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        // A quality and all features, or neither.
        match fields[5] {
            "" => assert_eq!(fields.len(), 6, "{line}"),
            quality => {
                assert!((0.0..=1.0).contains(&quality.parse::<f64>().unwrap()), "{line}");
                assert_eq!(fields.len(), 6 + features, "{line}");
            }
        }
    }
    assert!(once.lines().any(|line| line.ends_with(',')), "from six metres some hands are too small to find");
    for (arguments, named) in [
        (&["--distances", "0.1"][..], "distance_m"),
        (&["--bearings", "nan"], "bearing_deg"),
        (&["--hands", "1000", "--frames", "100"], "more than 200000"),
        (&["--camera", "pinhole"], "pinhole"),
    ] {
        let output = write_views(&folder.path().join("none.csv"), arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(named), "{said}");
    }
    let output = write_views(Path::new("/nowhere/views.csv"), &[]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write /nowhere/views.csv"));
}
