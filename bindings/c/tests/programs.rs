//! Programs in C and C++, compiled against the header and run: by themselves, and under valgrind.
//!
//! What the machine lacks is skipped, by name and with the reason; `GESTALT_REQUIRE=valgrind` makes a failure of that.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output};

use libtest_mimic::{Arguments, Failed, Trial};

const MODEL: &str = "../../peer/vision/models/rendered.gestalt";

/// How a program is built.
#[derive(Clone, Copy)]
struct Build {
    compiler: &'static str,
    options: &'static [&'static str],
    library: &'static str,
}

const C: Build = Build { compiler: "cc", options: &["-std=c11"], library: "libgestalt_c.a" };
const SHARED: Build = Build { library: "libgestalt_c.so", ..C };
const CPP: Build =
    Build { compiler: "c++", options: &["-std=c++17", "-x", "c++"], library: "libgestalt_c.a" };
const SANITISED: Build = Build { options: &["-std=c11", "-fsanitize=address,undefined"], ..C };

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g"];

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    // Two of these at a time are enough beside the other tests.
    arguments.test_threads.get_or_insert(2);
    let missing = |program: &str| {
        let found =
            Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
        (!found).then(|| format!("{program} is not installed"))
    };
    let required = std::env::var("GESTALT_REQUIRE").unwrap_or_default();
    let mut trials = Vec::new();
    let mut skipped = Vec::new();
    let mut trial = |name: &str, needs: &[&str], run: fn()| {
        let is_required = |need: &&str| required.split(',').any(|name| name == *need);
        let reason = needs.iter().filter(|need| !is_required(need)).find_map(|need| missing(need));
        if let Some(reason) = &reason {
            skipped.push(format!("skipped: {name}: {reason}"));
        }
        let run = move || {
            run();
            Ok::<(), Failed>(())
        };
        trials.push(Trial::test(name, run).with_ignored_flag(reason.is_some()));
    };
    trial("three_minds_in_c_agree_over_a_radio_that_loses_every_third_message", &["cc"], || {
        let said = run(&program("examples/lossy_radio.c", C), &[]);
        assert_eq!(said.matches("all 3 robots hold class").count(), 6, "{said}");
    });
    trial("the_same_program_says_the_same_twice_and_with_the_shared_library", &["cc"], || {
        let program = program("examples/lossy_radio.c", SHARED);
        assert_eq!(run(&program, &[]), run(&program, &[]));
    });
    trial("the_header_is_c_plus_plus_as_well", &["c++"], || {
        run(&program("examples/lossy_radio.c", CPP), &[]);
    });
    trial("misuse_is_refused_with_words", &["cc"], || {
        run(&program("tests/misuse.c", C), &[model().as_str()]);
    });
    trial("a_sanitised_program_finds_no_misuse_of_memory", &["cc"], || {
        run(&program("tests/misuse.c", SANITISED), &[model().as_str()]);
    });
    trial("valgrind_finds_no_error_and_no_leak_in_a_swarm", &["cc", "valgrind"], || {
        under_valgrind(&program("examples/lossy_radio.c", C), &[]);
    });
    trial("valgrind_finds_no_error_and_no_leak_in_misuse", &["cc", "valgrind"], || {
        under_valgrind(&program("tests/misuse.c", C), &[model().as_str()]);
    });
    let conclusion = libtest_mimic::run(&arguments, trials);
    if !arguments.list {
        skipped.iter().for_each(|line| println!("{line}"));
    }
    conclusion.exit_code()
}

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn model() -> String {
    here().join(MODEL).display().to_string()
}

/// Compiles a program, and links it with the library that cargo built for this test.
fn program(source: &str, build: Build) -> PathBuf {
    let this = std::env::current_exe().expect("this test");
    let libraries = this.parent().expect("its folder");
    let library = libraries.join(build.library);
    assert!(library.is_file(), "{} was not built", library.display());
    // A name of its own for each way to build it; tests may run side by side.
    let stem = Path::new(source).file_stem().expect("a name").to_string_lossy().into_owned();
    let extension = build.library.rsplit('.').next().expect("an extension");
    let name = format!("{stem}-{}-{}-{extension}", build.compiler.replace('+', "p"), build.options.len());
    let folder =
        tempfile::Builder::new().prefix(&name).tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
    let out = folder.keep().join(name);
    let mut compiler = Command::new(build.compiler);
    compiler
        .args(build.options)
        .args(WARNINGS)
        .arg("-I")
        .arg(here().join("include"))
        .arg(here().join(source));
    // What follows is no source of any language.
    compiler.args(["-x", "none"]).arg(&library).args(["-lpthread", "-ldl", "-lm"]);
    compiler.arg(format!("-Wl,-rpath,{}", libraries.display())).arg("-o").arg(&out);
    succeeded(&mut compiler);
    out
}

fn run(program: &Path, arguments: &[&str]) -> String {
    let output = succeeded(Command::new(program).args(arguments));
    String::from_utf8(output.stdout).expect("text")
}

fn under_valgrind(program: &Path, arguments: &[&str]) {
    let options = ["--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=definite,indirect,possible"];
    let leaks = "--errors-for-leak-kinds=definite,indirect,possible";
    let output = succeeded(Command::new("valgrind").args(options).arg(leaks).arg(program).args(arguments));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("ERROR SUMMARY: 0 errors"), "{said}");
}

#[track_caller]
fn succeeded(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{said}\n{complained}", output.status);
    output
}
