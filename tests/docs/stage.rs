//! A folder in which the documentation's commands can run.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use gestalt_peer::picture::write_png;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, Source};

/// The folder, with what runs in it; all of it ends with the stage.
pub struct Stage {
    folder: tempfile::TempDir,
    scouting: u32,
}

/// The root of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

impl Stage {
    /// With the configurations, the examples and the program, which is called as in the documentation.
    pub fn new(number: u32) -> Self {
        let stage = Self {
            folder: tempfile::tempdir().unwrap(),
            // A group and a port of this process alone.
            scouting: 20_000 + (std::process::id() + 37 * number) % 20_000,
        };
        for shared in ["configs", "examples"] {
            std::os::unix::fs::symlink(root().canonicalize().unwrap().join(shared), stage.path(shared))
                .unwrap();
        }
        std::fs::create_dir(stage.path("bin")).unwrap();
        stage.program("gestalt", include_str!("gestalt.sh"));
        // Whoever runs these tests has built it.
        stage.program("make", "#!/bin/sh\n");
        stage.program("cargo", "#!/bin/sh\n");
        stage
    }

    fn program(&self, name: &str, text: &str) {
        use std::os::unix::fs::PermissionsExt;
        let path = self.path("bin").join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A dataset of rendered bare hands: three gestures, each by eight persons.
    pub fn dataset(&self, name: &str, seed: u64) {
        for fingers in [1, 3, 5] {
            let folder = self.path(name).join(fingers.to_string());
            std::fs::create_dir_all(&folder).unwrap();
            for person in 0..8 {
                let pose = Pose { bearing_deg: f64::from(person * 9 - 30), distance_m: 0.7, ..Pose::FRONTAL };
                let seed = seed + u64::from(person as u32);
                let mut source = RenderedSource::new(CameraModel::laptop(), pose, Glove::Skin, seed).unwrap();
                let scene = Scene { gesture: Some(fingers), seed };
                let image = source.next_frame(Duration::ZERO, &scene).unwrap().image;
                write_png(&folder.join(format!("s{person:03}_a.png")), &image).unwrap();
            }
        }
    }

    /// Runs lines of shell, and stops at the first that fails.
    pub fn run(&self, lines: &str) -> Output {
        let path = std::env::var("PATH").unwrap_or_default();
        Command::new("bash")
            .args(["-euo", "pipefail", "-c", lines])
            .current_dir(self.folder.path())
            .env("PATH", format!("{}:{path}", self.path("bin").display()))
            .env("GESTALT", env!("CARGO_BIN_EXE_test-gestalt"))
            .env("STAGE", self.folder.path())
            .env("SCOUTING", self.scouting.to_string())
            .output()
            .expect("there is a shell")
    }

    /// The port of what listens on this stage.
    pub fn port(&self) -> u32 {
        self.scouting
    }

    /// Ends what runs beside the blocks.
    pub fn clear(&self) {
        let robots = std::fs::read_to_string(self.path("robots")).unwrap_or_default();
        for robot in robots.split_whitespace() {
            // It may have ended already.
            let _ = Command::new("kill").args(["-9", robot]).output();
        }
        let _ = std::fs::remove_file(self.path("robots"));
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.clear();
    }
}
