//! The Python package, driven by the interpreter of this machine: the tests in `tests/*.py`, each file a trial.
//!
//! `GESTALT_PYTHON` names another interpreter than `python3` and the system's, such as that of a virtual environment with scikit-learn.
//! What the interpreter lacks is skipped, by name and with the reason.

mod expected;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::{Arc, OnceLock};

use libtest_mimic::{Arguments, Failed, Trial};

/// Each file of tests, and the packages that it needs.
const FILES: [(&str, &[&str]); 7] = [
    ("test_native", &[]),
    ("test_wire", &[]),
    ("test_training_set", &[]),
    ("test_mind", &[]),
    ("test_panics", &[]),
    ("test_classifier", &["numpy"]),
    ("test_sklearn", &["numpy", "sklearn"]),
];

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    if arguments.list {
        return libtest_mimic::run(&arguments, trials(&Arc::default()).0).exit_code();
    }
    let package = Arc::new(Package::lay_out());
    let (trials, skipped) = trials(&package);
    let conclusion = libtest_mimic::run(&arguments, trials);
    skipped.iter().for_each(|line| println!("{line}"));
    conclusion.exit_code()
}

/// The trials, and a line for each that is skipped.
fn trials(package: &Arc<Package>) -> (Vec<Trial>, Vec<String>) {
    let (mut trials, mut skipped) = (Vec::new(), Vec::new());
    let mut trial = |name: String, needs: &[&str], arguments: Vec<String>| {
        let missing = missing(needs);
        if let Some(reason) = &missing {
            skipped.push(format!("skipped: {name}: {reason}"));
        }
        let package = package.clone();
        let run = move || package.run(&arguments).map_err(Failed::from);
        trials.push(Trial::test(name, run).with_ignored_flag(missing.is_some()));
    };
    let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
    for (file, needs) in FILES {
        trial(file.to_owned(), needs, words(&["-m", "unittest", "-v", file]));
    }
    let example = here().join("examples/selection.py").display().to_string();
    trial(
        "the_example_compares_all_rules".to_owned(),
        &["numpy"],
        words(&[&example, "--runs", "2", "--rounds", "6"]),
    );
    let notebook = |options: &[&str]| {
        let mut all = vec![here().join("tests/notebook.py").display().to_string()];
        all.push(here().join("examples/selection.ipynb").display().to_string());
        all.extend(words(options));
        all
    };
    trial("the_notebook_runs_and_shows_what_it_kept".to_owned(), &["numpy"], notebook(&[]));
    let strict = ["-m", "mypy", "--strict", "--package", "gestalt_swarm"];
    trial("the_types_are_strict".to_owned(), &["numpy", "mypy"], words(&strict));
    let stubs = ["-m", "mypy.stubtest", "gestalt_swarm._native"];
    trial("the_stubs_are_those_of_the_extension".to_owned(), &["mypy"], words(&stubs));
    (trials, skipped)
}

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn python() -> Command {
    static INTERPRETER: OnceLock<String> = OnceLock::new();
    let mut python = Command::new(INTERPRETER.get_or_init(interpreter));
    python.env("PYTHONDONTWRITEBYTECODE", "1");
    python
}

/// The interpreter that is asked for; else `python3`, unless that of the system alone has numpy, as where another one is in its way.
fn interpreter() -> String {
    let has_numpy = |python: &&str| {
        Command::new(python).args(["-c", "import numpy"]).output().is_ok_and(|output| output.status.success())
    };
    std::env::var("GESTALT_PYTHON").unwrap_or_else(|_| {
        ["python3", "/usr/bin/python3"].into_iter().find(has_numpy).unwrap_or("python3").to_owned()
    })
}

/// What the interpreter lacks of these packages.
fn missing(packages: &[&str]) -> Option<String> {
    let version = "import sys; sys.exit(sys.version_info < (3, 9))";
    let can = |code: &str| python().args(["-c", code]).output().is_ok_and(|output| output.status.success());
    if !can(version) {
        return Some("no Python 3.9 or later; GESTALT_PYTHON names one".to_owned());
    }
    let lacking = packages.iter().find(|package| !can(&format!("import {package}")))?;
    Some(format!("this Python has no {lacking}; GESTALT_PYTHON names another"))
}

/// The package as a wheel would install it, in a folder of its own.
#[derive(Default)]
struct Package {
    folder: PathBuf,
}

impl Package {
    fn lay_out() -> Self {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("gestalt_swarm_package");
        let package = folder.join("gestalt_swarm");
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&package).expect("a folder for the package");
        for entry in std::fs::read_dir(here().join("python/gestalt_swarm")).expect("the package") {
            let path = entry.expect("a file").path();
            if path.is_file() {
                std::fs::copy(&path, package.join(path.file_name().expect("a name"))).expect("a copy");
            }
        }
        std::fs::copy(extension(), package.join("_native.abi3.so")).expect("a copy of the extension");
        expected::write(&folder.join("expected.json"));
        Self { folder }
    }

    fn run(&self, arguments: &[String]) -> Result<(), String> {
        let paths = std::env::join_paths([self.folder.clone(), here().join("tests")]).expect("plain paths");
        let mut python = python();
        python
            .args(arguments)
            .current_dir(&self.folder)
            .env("PYTHONPATH", &paths)
            .env("MYPYPATH", &self.folder);
        python.env("GESTALT_EXPECTED", self.folder.join("expected.json"));
        // Of the notebook, enough to see that it runs.
        python.env("RUNS", "2").env("ROUNDS", "6");
        python.env("GESTALT_MODEL", here().join("../../peer/vision/models/rendered.gestalt"));
        let output = python.output().map_err(|error| error.to_string())?;
        if output.status.success() {
            return Ok(());
        }
        let (said, complained) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        Err(format!("{}\n{said}{complained}", output.status))
    }
}

/// The extension that cargo built for this test.
fn extension() -> PathBuf {
    let this = std::env::current_exe().expect("this test");
    let built = this.parent().map(|folder| folder.join("libgestalt_python.so"));
    built.filter(|path| Path::is_file(path)).expect("cargo builds the extension before this test")
}
