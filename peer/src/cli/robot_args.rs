//! The flags that say what a robot is and sees, each for one key of its configuration.

use serde_json::{Value, json};

use super::config_args::Setting;
use super::source_arg::{Kind, SourceArg, SourceArgError, kind};
use crate::config::{CameraChoice, ModelSection};

/// Who the robot is.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct IdentityArgs {
    /// Robot id, unique within the swarm (robot.id)
    #[arg(long, value_name = "N")]
    id: Option<u32>,

    /// Display name of the robot (robot.name)
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
}

/// What the robot sees with.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct CameraArgs {
    /// Camera source: a device (/dev/video0), a video, a folder of images (both repeat), a ROS 2 topic
    /// (`ros:/camera/image_raw/compressed`), `rendered`, or a synthetic hand
    /// seen from elsewhere: `rendered:bearing=-30,elevation=5,distance=1.2,seed=7` (camera.source)
    #[arg(long, value_name = "SOURCE")]
    source: Option<SourceArg>,

    /// Camera model (camera.model) [default with a device: laptop]
    #[arg(long, value_name = "MODEL", value_parser = super::choice::camera())]
    camera: Option<CameraChoice>,
}

/// What the robot judges with.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ModelArgs {
    /// Model file written by `gestalt train`, `hands` (bare hands before any camera), `rendered` (synthetic hands) or `none`
    /// (model) [default with --source: hands, or rendered with a rendered source]
    #[arg(long, value_name = "FILE|hands|rendered|none")]
    pub model: Option<ModelSection>,
}

impl IdentityArgs {
    pub(super) fn settings(&self) -> Vec<Setting> {
        let id = self.id.map(|id| Setting::new(&["robot", "id"], json!(id)));
        let name = self.name.as_ref().map(|name| Setting::new(&["robot", "name"], json!(name)));
        id.into_iter().chain(name).collect()
    }
}

impl CameraArgs {
    /// # Errors
    /// [`SourceArgError`] for a source that a robot cannot look at.
    pub(super) fn settings(&self) -> Result<Vec<Setting>, SourceArgError> {
        let mut settings = Vec::new();
        if let Some(source) = &self.source {
            settings.push(Setting::new(&["camera", "source"], value(&source.section()?)));
            settings.push(Setting::unless_said(&["model"], value(&source.usual_model())));
            if matches!(source, SourceArg::Path(path) if kind(path) == Kind::Device) {
                settings.push(Setting::unless_said(&["camera", "model"], value(&CameraChoice::Laptop)));
            }
        }
        settings.extend(self.camera.as_ref().map(|camera| Setting::new(&["camera", "model"], value(camera))));
        Ok(settings)
    }
}

impl ModelArgs {
    pub(super) fn settings(&self) -> Vec<Setting> {
        self.model.as_ref().map(|model| Setting::new(&["model"], value(model))).into_iter().collect()
    }
}

fn value(section: &impl serde::Serialize) -> Value {
    serde_json::to_value(section).expect("a section of the configuration has a place in JSON")
}
