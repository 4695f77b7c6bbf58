//! Tries a robot's camera: opens it as the robot would, and takes a few frames.

use std::time::{Duration, Instant};

use gestalt_protocol::Camera;
use gestalt_vision::source::{Frame, Pipe, Reader, Scene};
use opencv::core::{Mat, Vector, mean_std_dev, no_array};
use opencv::prelude::*;

use super::since_1970;
use crate::camera_source::{describe, open_source};
use crate::config::{CameraSection, Config, SourceSection};
use crate::doctor::robot::{CameraFacts, Given, has};

/// How long a camera is looked at, and how many frames are enough: of one that runs by itself, and of files.
const LOOK: Duration = Duration::from_secs(2);
const LIVE_FRAMES: usize = 40;
const FRAMES: usize = 2;

/// What the robot's camera gives; `None` for one without a camera of this machine. The one that the robot has, by what it says of it
/// while it runs, is left alone.
pub(super) async fn look(config: &Config, said: Option<&Camera>) -> Option<CameraFacts> {
    let camera = &config.camera;
    let (setting, live) = match &camera.source {
        SourceSection::None | SourceSection::Stream(_) => return None,
        SourceSection::Rendered(_) => ("source: {rendered: {}}".to_owned(), false),
        SourceSection::Device(it) => {
            (format!("source: {{device: {{path: \"{}\"}}}}", it.path.display()), true)
        }
        SourceSection::Ros(it) => (format!("source: {{ros: {{topic: \"{}\"}}}}", it.topic), true),
        SourceSection::Images(it) => {
            (format!("source: {{images: {{path: \"{}\"}}}}", it.path.display()), false)
        }
        SourceSection::Video(it) => {
            (format!("source: {{video: {{path: \"{}\"}}}}", it.path.display()), Pipe::is_at(&it.path))
        }
    };
    let model = camera.model.properties();
    let source = describe(camera);
    let held = said.is_some_and(|said| has(said, &source));
    let gave =
        if held && live { Err("the running robot has it".to_owned()) } else { take(config, live).await };
    Some(CameraFacts {
        source,
        held,
        setting: format!("camera: {{{setting}}}"),
        devices: devices(),
        live,
        size: [side(model.width_px), side(model.height_px)],
        fps: model.fps,
        gave,
    })
}

/// Takes frames until there are enough or the time is up.
async fn take(config: &Config, live: bool) -> Result<Given, String> {
    let (section, robot, clock) = (config.camera.clone(), config.robot.id, since_1970());
    let scene = scene(&section);
    let zero = Instant::now();
    // A driver may hang, and a pipe waits for its writer: both in a thread that keeps nobody.
    let reader: Reader = Reader::start(None, Box::new(move || open_source(&section, robot, clock)), zero)
        .map_err(|error| format!("no thread to read the camera: {error}"))?;
    reader.want(Some(scene));
    let mut frames = Vec::new();
    let mut trouble = None;
    let enough = if live { LIVE_FRAMES } else { FRAMES };
    while frames.len() < enough {
        let Some(left) = LOOK.checked_sub(zero.elapsed()) else { break };
        match tokio::time::timeout(left, reader.next()).await {
            Ok(Ok(frame)) => frames.push(note(&frame).map_err(|error| format!("OpenCV: {error}"))?),
            Ok(Err(error)) => {
                trouble = Some(error.to_string());
                // One bad file says nothing of the next; all else would only be tried again.
                if !error.is_of_one_picture() {
                    break;
                }
            }
            Err(_) => break,
        }
    }
    let Some(last) = frames.last() else {
        return Err(trouble.unwrap_or_else(|| {
            format!(
                "{}: no frame within {} s: check the camera, its cable and its driver",
                describe(&config.camera),
                LOOK.as_secs()
            )
        }));
    };
    let first = &frames[0];
    let seconds = last.at.saturating_sub(first.at).as_secs_f64();
    Ok(Given {
        size: last.size,
        fps: (live && frames.len() > 4 && seconds > 0.0).then(|| (frames.len() - 1) as f64 / seconds),
        contrast: frames.iter().map(|frame| frame.contrast).fold(0.0, f64::max),
        same: live && frames.len() > 4 && frames.iter().all(|frame| frame.checksum == first.checksum),
    })
}

/// What a rendered camera is shown: a hand, whatever it does in the swarm's rounds.
fn scene(camera: &CameraSection) -> Scene {
    let seed = if let SourceSection::Rendered(rendered) = &camera.source { rendered.seed } else { 0 };
    Scene { gesture: Some(3), seed }
}

/// What is kept of a frame.
struct Note {
    at: Duration,
    size: [u32; 2],
    contrast: f64,
    checksum: u32,
}

fn note(Frame { image, at }: &Frame) -> opencv::Result<Note> {
    let (mut mean, mut deviation) = (Vector::<f64>::new(), Vector::<f64>::new());
    mean_std_dev(image, &mut mean, &mut deviation, &no_array())?;
    Ok(Note {
        at: *at,
        size: [side(image.cols()), side(image.rows())],
        contrast: deviation.iter().fold(0.0, f64::max),
        checksum: checksum(image),
    })
}

fn side(length: i32) -> u32 {
    u32::try_from(length).unwrap_or_default()
}

/// Of the whole picture: two of a real sensor never agree.
fn checksum(image: &Mat) -> u32 {
    image.data_bytes().map(crc32fast::hash).unwrap_or_default()
}

/// The cameras of this machine.
fn devices() -> Vec<String> {
    let Ok(entries) = std::fs::read_dir("/dev") else { return Vec::new() };
    let names = entries.flatten().map(|entry| entry.path()).filter(|path| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.strip_prefix("video").is_some_and(|number| number.parse::<u32>().is_ok())
    });
    let mut names: Vec<String> = names.map(|path| path.display().to_string()).collect();
    names.sort();
    names
}
