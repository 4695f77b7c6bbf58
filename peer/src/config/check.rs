//! Whether the files that a configuration names can be used: what keeps a robot from starting, found before it starts.

use std::time::Duration;

use gestalt_link::LinkError;
use gestalt_vision::model::RobotModel;

use super::{Config, ConfigError, Document, SourceSection};
use crate::body::learning;
use crate::camera_source::open_source;
use crate::model;

/// Everything that keeps a robot with that configuration from starting: keys, values, and files; empty when it can start.
/// Reads the model and opens the source; the memory is tried on a copy in this process. A camera device that is not there is not among
/// it: a robot starts without, and waits for it.
#[must_use]
pub fn problems(document: Document) -> (Option<Config>, Vec<ConfigError>) {
    let (config, mut found) = document.meaning_in_part::<Config>();
    if let Some(config) = &config {
        found.extend(config.problems());
        found.extend(files(config));
    }
    (config, found)
}

/// The problems of the files that a configuration names.
fn files(config: &Config) -> Vec<ConfigError> {
    let mut found = Vec::new();
    if let SourceSection::Images(_) | SourceSection::Video(_) = config.camera.source
        && let Err(error) = open_source(&config.camera, config.robot.id, Duration::ZERO)
    {
        found.push(ConfigError::value("camera.source", error));
    }
    match model::load(&config.model) {
        Ok(Some(model)) => match share_bytes(config, &model) {
            Ok(()) => {
                let tried = memory(config, &model);
                found.extend(tried.err().map(|error| ConfigError::value("learning.memory", said(&error))));
            }
            Err(error) => found.push(error),
        },
        Ok(None) => {}
        Err(error) => found.push(ConfigError::value("model", error)),
    }
    found
}

/// Whether the robot may share as many bytes in a round as one sample of its model takes. What is wrong with its parameters by themselves is said already.
pub(crate) fn share_bytes(config: &Config, model: &RobotModel) -> Result<(), ConfigError> {
    let samples = &config.learning.samples;
    if !config.learning.enabled || samples.validate().is_err() {
        return Ok(());
    }
    let checked = samples.check_share_bytes(model.classifier.space(), config.trust.keys.is_some());
    checked.map_err(|error| ConfigError::value("learning.samples", error))
}

/// Whether the robot's memory is its own, and fits its model.
pub(crate) fn memory(config: &Config, model: &RobotModel) -> Result<(), LinkError> {
    let Some(learning) = learning(&config.learning, model) else { return Ok(()) };
    let Some(path) = &learning.memory else { return Ok(()) };
    let wrong = |cause: String| LinkError::Config { key: "learning.memory".to_owned(), cause };
    // Of a link it is the folder that it leads to.
    let end = gestalt_file::target(path).map_err(|cause| wrong(format!("{}: {cause}", path.display())))?;
    let folder = gestalt_file::folder(&end);
    if !folder.is_dir() {
        return Err(wrong(format!("the folder {} does not exist: create it", folder.display())));
    }
    if path.exists() { learning.check(config.robot.id, &config.rounds) } else { Ok(()) }
}

/// What is wrong, without the key.
pub(crate) fn said(error: &LinkError) -> String {
    match error {
        LinkError::Config { cause, .. } => cause.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use gestalt_link::{LinkConfig, Robot, RobotConfig, fresh_nonce};

    use super::*;

    fn found(text: &str) -> Vec<String> {
        problems(Document::parse(text, "test").unwrap()).1.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_shipped_can_start() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
        for name in ["template", "footbot", "parrot", "laptop", "fusion-center"] {
            let document = Document::read(&folder.join(format!("{name}.json5"))).unwrap();
            let (config, found) = problems(document);
            assert!(config.is_some() && found.is_empty(), "{name}: {found:?}");
        }
    }

    #[test]
    fn every_kind_of_problem_is_found_in_one_go() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("hands.gestalt");
        std::fs::write(&model, "no model").unwrap();
        let found = found(&format!(
            "{{rounds: {{deadline: 5, alpha: 0.9}}, model: {{file: {model:?}}}, camera: {{source: {{video: {{path: \
             '/nowhere/hand.mp4'}}}}, motion: {{area: 7}}}}}}"
        ));
        for (key, cause) in [
            ("rounds.deadline", "duration"),
            ("rounds", "alpha"),
            ("camera.source", "/nowhere/hand.mp4"),
            ("camera.motion", "area"),
            ("model", "hands.gestalt"),
        ] {
            let start = format!("{key}: ");
            assert!(found.iter().any(|it| it.starts_with(&start) && it.contains(cause)), "{key}: {found:?}");
        }
        assert_eq!(found.len(), 5, "{found:?}");
    }

    #[test]
    fn what_is_too_little_for_one_sample_of_the_model_is_named_once() {
        let samples = "samples: {share_bytes: 128, precision: 'f32'}";
        let with =
            |enabled| found(&format!("{{model: 'rendered', learning: {{enabled: {enabled}, {samples}}}}}"));
        let short = with(true);
        assert!(
            short.len() == 1 && short[0].starts_with("learning.samples: share_bytes is 128"),
            "{short:?}"
        );
        assert_eq!(with(false), Vec::<String>::new());
    }

    #[test]
    fn a_memory_that_is_not_there_yet_needs_its_folder_alone() {
        let folder = tempfile::tempdir().unwrap();
        let with = |path: &Path| {
            found(&format!("{{model: 'rendered', learning: {{enabled: true, memory: {path:?}}}}}"))
        };
        assert_eq!(with(&folder.path().join("robot.memory")), Vec::<String>::new());
        let missing = with(&folder.path().join("missing/robot.memory"));
        assert!(missing.len() == 1 && missing[0].contains("missing does not exist"), "{missing:?}");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_memory_of_another_robot_or_garbage_is_refused_and_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.memory");
        std::fs::write(&path, "not a database at all").unwrap();
        let text = format!("{{model: 'rendered', learning: {{enabled: true, memory: {path:?}}}}}");
        let garbage = found(&text);
        assert!(garbage.len() == 1 && garbage[0].contains("robot.memory"), "{garbage:?}");
        assert_eq!(std::fs::read(&path).unwrap(), b"not a database at all");

        std::fs::remove_file(&path).unwrap();
        let (config, _) = problems(Document::parse(&text, "test").unwrap());
        let (config, model) = (config.unwrap(), RobotModel::rendered().unwrap());
        let robot = Robot::start(RobotConfig {
            id: gestalt_protocol::RobotId(7),
            name: String::new(),
            boot: 1,
            swarm: "check".to_owned(),
            mind: config.rounds.clone(),
            fusion: None,
            link: LinkConfig::default(),
            vocabulary: None,
            learning: learning(&config.learning, &model),
            nonce: fresh_nonce(),
            seal: None,
        });
        robot.await.unwrap().stop().await;
        let before = std::fs::read(&path).unwrap();
        let others = found(&text);
        assert!(
            others.len() == 1 && others[0].contains("robot 7") && others[0].contains("robot.memory"),
            "{others:?}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), before);
        assert_eq!(found(&text.replace("{model", "{robot: {id: 7}, model")), Vec::<String>::new());
    }
}
