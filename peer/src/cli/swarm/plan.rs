//! Who takes part: one configuration for each robot.

use std::path::Path;

use gestalt_protocol::RobotId;
use serde_json::json;

use super::super::Failure;
use super::{Args, By, SCHEDULE};
use crate::config::{CameraSection, Config, LearningSection, MotionConfig, RenderedSection, SourceSection};
use gestalt_vision::pose::place;

/// One configuration for each robot: all around one person, listening on a free port of this machine.
pub(super) fn configs(args: &Args, keys: Option<&Path>) -> Result<Vec<Config>, Failure> {
    let cameras = args.robots.cameras();
    // Clients of this computer attach without a key.
    let listen: &[&str] = match keys {
        Some(_) => &["tls/127.0.0.1:0", "tcp/127.0.0.1:0"],
        None => &["tcp/127.0.0.1:0"],
    };
    let schedule = (args.by == By::Motion).then_some(SCHEDULE);
    let mut configs = Vec::with_capacity(cameras.len());
    for (id, (camera, pose)) in (1..).zip(cameras.iter().zip(place(cameras.len(), args.seed))) {
        let mut config = Config::default();
        config.robot.id = RobotId(id);
        config.robot.name = format!("{}-{id}", camera.name());
        config.swarm.0.clone_from(&args.swarm);
        config.camera = CameraSection {
            model: camera.clone(),
            source: SourceSection::Rendered(RenderedSection {
                pose,
                glove: args.glove,
                seed: args.seed,
                schedule,
            }),
            motion: MotionConfig { enabled: args.by == By::Motion, ..MotionConfig::default() },
            ..CameraSection::default()
        };
        config.model = args.model.clone();
        config.rounds.rule = args.rule;
        config.trust.keys = keys.map(Path::to_owned);
        if let Some(from) = args.learn {
            let memory = args.memory.as_ref().map(|folder| folder.join(format!("robot-{id}.memory")));
            config.learning = LearningSection {
                enabled: true,
                from,
                memory,
                seed: args.seed,
                ..LearningSection::default()
            };
        }
        config.links.scouting.enabled = false;
        config.zenoh.insert("listen".to_owned(), json!({"endpoints": listen}));
        if !args.processes {
            // Robots of one process live and die together; a short lease would only mistake a busy processor for a
            // lost robot.
            config.zenoh.insert("transport".to_owned(), json!({"link": {"tx": {"lease": 10_000}}}));
        }
        config.validate()?;
        configs.push(config);
    }
    Ok(configs)
}
