//! What somebody does who has photographs of gestures, a video, and the README.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_trials::data;
use gestalt_vision::source::read_image;
use opencv::core::{CV_8UC3, Mat, Rect, Scalar, Size, add_def, randn};
use opencv::prelude::*;
use opencv::videoio::{CAP_FFMPEG, VideoWriter};

use crate::stage::{Stage, root};

/// What the person in the video shows.
const SHOWN: u8 = 3;

/// Frames per second of the video.
const FPS: f64 = 15.0;

/// How long the robot has to decide: it learns the empty scene first, and the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(120);

pub fn photographs_and_a_video_lead_to_a_model_and_a_robot_that_decides() {
    let stage = Stage::new(99);
    let photographs = data().join("webcam-fingers");
    let mut filmed = Vec::new();
    for gesture in 1..=5_u8 {
        let (from, to) = (photographs.join(gesture.to_string()), stage.path("DIR").join(gesture.to_string()));
        fs::create_dir_all(&to).unwrap();
        let mut files: Vec<_> = fs::read_dir(&from).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        // What is filmed is not among the photographs.
        let last = files.split_off(files.len() - 3);
        if gesture == SHOWN {
            filmed = last;
        }
        // Several sittings, as a person would take them who reads that file names tell subjects apart.
        for (number, file) in files.iter().enumerate() {
            fs::copy(file, to.join(format!("s{:03}_{number}.jpg", number % 6))).unwrap();
        }
    }
    let empty = fs::read_dir(photographs.join("background")).unwrap().next().unwrap().unwrap().path();
    let hands: Vec<Mat> = filmed.iter().map(|file| read_image(file).unwrap()).collect();
    film(&stage.path("hand.mp4"), &read_image(&empty).unwrap(), &hands);

    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let line = |begins: &str| {
        let found = readme.lines().find(|line| line.starts_with(begins));
        found.unwrap_or_else(|| panic!("the README says nothing of: {begins}")).to_owned()
    };
    for begins in ["gestalt train --dataset DIR --out", "gestalt evaluate --dataset DIR --model"] {
        let ran = stage.run(&line(begins));
        let (said, told) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
        assert!(ran.status.success() && said.contains("accuracy"), "{begins}: {said}{told}");
    }
    assert!(stage.path("confusion.svg").exists());
    // As its comment says.
    let peer =
        line("gestalt peer --id 3 --camera laptop --source /dev/video0").replace("/dev/video0", "hand.mp4");
    let ran = stage.run(&peer);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let began = Instant::now();
    let decision = loop {
        let said = said(&stage);
        if let Some(decision) = said.lines().find(|line| line.contains(" → \"")) {
            break decision.to_owned();
        }
        assert!(began.elapsed() < PATIENCE, "no decision: {said}");
        std::thread::sleep(Duration::from_millis(200));
    };
    assert!(decision.contains(&format!("→ \"{SHOWN}\"")), "{decision}");
}

/// What runs beside the lines has said.
fn said(stage: &Stage) -> String {
    let logs = fs::read_dir(stage.path(".")).unwrap().flatten().map(|entry| entry.path());
    let logs = logs.filter(|path| path.file_stem().is_some_and(|stem| stem == "log"));
    logs.map(|log| fs::read_to_string(log).unwrap_or_default()).collect()
}

/// A video of an empty scene into which a hand comes, is held up and turned a little, and leaves.
fn film(path: &Path, empty: &Mat, hands: &[Mat]) {
    let size = empty.size().unwrap();
    let (first, last) = (hands.first().unwrap(), hands.last().unwrap());
    assert!(hands.iter().all(|hand| hand.size().unwrap() == size), "photographs of one camera");
    let codec = VideoWriter::fourcc('m', 'p', '4', 'v').unwrap();
    let mut writer =
        VideoWriter::new_with_backend(path.to_str().unwrap(), CAP_FFMPEG, codec, FPS, size, true).unwrap();
    assert!(writer.is_opened().unwrap(), "FFmpeg writes a video");
    let seconds = |seconds: f64| (seconds * FPS) as u32;
    let mut show = |picture: &Mat, frames: u32| {
        for _ in 0..frames {
            writer.write(&noisy(picture, size)).unwrap();
        }
    };
    show(empty, seconds(5.0));
    for part in [0.25, 0.5, 0.75] {
        show(&slid(empty, first, part), 2);
    }
    for hand in hands {
        show(hand, seconds(4.0 / hands.len() as f64));
    }
    for part in [0.75, 0.5, 0.25] {
        show(&slid(empty, last, part), 2);
    }
    show(empty, seconds(3.0));
    writer.release().unwrap();
}

/// The part of the hand's picture that has come in from below.
fn slid(empty: &Mat, hand: &Mat, part: f64) -> Mat {
    let mut picture = empty.try_clone().unwrap();
    let rows = (f64::from(hand.rows()) * part) as i32;
    let from = hand.roi(Rect::new(0, 0, hand.cols(), rows)).unwrap().try_clone().unwrap();
    let to = Rect::new(0, hand.rows() - rows, hand.cols(), rows);
    from.copy_to(&mut picture.roi_mut(to).unwrap()).unwrap();
    picture
}

/// As a sensor gives it, with a standard deviation of two grey levels.
fn noisy(picture: &Mat, size: Size) -> Mat {
    let mut noise = Mat::new_size_with_default(size, CV_8UC3, Scalar::all(0.0)).unwrap();
    randn(&mut noise, &Scalar::all(4.0), &Scalar::all(2.0)).unwrap();
    let mut noisy = Mat::default();
    add_def(picture, &noise, &mut noisy).unwrap();
    noisy
}
