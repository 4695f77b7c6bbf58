//! What the tests of the simulator share: the programs, and what their cameras see.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The root of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the project has a folder")
}

/// The classifier of drawn hands.
pub fn model() -> PathBuf {
    root().join("peer/vision/models/rendered.gestalt")
}

/// A folder for what the tests make; each run of them begins with what is there.
fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("simulator");
    std::fs::create_dir_all(&folder).expect("a folder for the simulator");
    folder
}

/// What cameras see: `gestalt views` with these arguments, and what it said.
pub fn write_views(out: &Path, arguments: &[&str]) -> Output {
    let mut gestalt = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
    gestalt.arg("views").arg("--out").arg(out).args(arguments).output().expect("the program runs")
}

/// The table of views that all runs look at, made once.
pub fn views() -> &'static Path {
    static VIEWS: OnceLock<PathBuf> = OnceLock::new();
    VIEWS.get_or_init(|| {
        let out = folder().join("views.csv");
        said(&write_views(&out, &["--hands", "3", "--frames", "2"]));
        out
    })
}

/// A program of the simulator, built by CMake.
pub fn program(name: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let build = BUILT.get_or_init(|| {
        let this = std::env::current_exe().expect("this test");
        let library = this.parent().expect("its folder").join("libgestalt_c.a");
        assert!(library.is_file(), "{} was not built", library.display());
        let build = folder().join("build");
        let mut configure = Command::new("cmake");
        configure.arg("-S").arg(root().join("examples/simulator")).arg("-B").arg(&build);
        configure.arg(format!("-DGESTALT_LIBRARY={}", library.display()));
        // A warning in what users copy is an error here.
        configure.arg("-DCMAKE_CXX_FLAGS=-Werror").arg("-DCMAKE_BUILD_TYPE=RelWithDebInfo");
        said(&configure.output().expect("cmake runs"));
        let targets = ["enki-swarm", "radio-test"];
        said(
            &Command::new("cmake")
                .arg("--build")
                .arg(&build)
                .arg("--target")
                .args(targets)
                .output()
                .expect("cmake builds"),
        );
        build
    });
    build.join(name)
}

/// The simulation of ten marXbots.
pub fn swarm(arguments: &[&str]) -> Command {
    let mut swarm = Command::new(program("enki-swarm"));
    swarm.arg("--views").arg(views()).arg("--model").arg(model()).args(arguments);
    swarm
}

/// What a program that did what it should wrote.
#[track_caller]
pub fn said(output: &Output) -> String {
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{}\n{said}\n{complained}", output.status);
    said.into_owned()
}
