//! The flags that choose and change a configuration, as every Zenoh user knows them.

use std::path::PathBuf;

use serde_json::{Value, json};

#[cfg(feature = "opencv")]
use crate::config::ModelSection;
use crate::config::{Config, ConfigError, Document, Override};
use gestalt_link::{LinkConfig, LinkError};

/// Where a configuration names its swarm.
pub(super) const SWARM: &[&str] = &["swarm"];

/// Which configuration, and what to change in it.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ConfigArgs {
    /// Configuration file (JSON5; `gestalt config` prints a commented template, configs/ has examples)
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,

    /// Override one key: `rounds.deadline:8s`, or one of Zenoh's, `transport.link.tx.lease:500` (dots or slashes; repeatable)
    #[arg(long, value_name = "KEY:VALUE")]
    pub cfg: Vec<Override>,

    /// Zenoh session mode; robots default to router, so that messages are relayed over several hops
    #[arg(short, long, value_parser = ["router", "peer", "client"])]
    pub mode: Option<String>,

    /// Endpoint to connect to, `tls/192.168.1.5:7447`, or tcp/ in an open swarm; repeatable
    #[arg(short = 'e', long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,

    /// Endpoint to listen on, `tls/[::]:7447`, or tcp/127.0.0.1:7447 in an open swarm; repeatable
    #[arg(short, long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,

    /// Disable multicast discovery: use --connect and --listen only
    #[arg(long)]
    pub no_multicast_scouting: bool,

    /// Name of the swarm [default: gestalt; for a client that of its keys]
    #[arg(long, value_name = "NAME")]
    pub swarm: Option<String>,

    /// Folder of keys, as `gestalt trust` writes it: lets in to a sealed swarm (trust.keys)
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
}

/// What another flag sets.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    path: &'static [&'static str],
    value: Value,
    /// Gives way to what the file and the other flags say.
    yields: bool,
}

impl Setting {
    /// A key's value, whatever the file says.
    #[cfg(feature = "opencv")]
    pub(super) fn new(path: &'static [&'static str], value: Value) -> Self {
        Self { path, value, yields: false }
    }

    /// A key's value where neither the file nor a flag says another.
    #[cfg(feature = "opencv")]
    pub(super) fn unless_said(path: &'static [&'static str], value: Value) -> Self {
        Self { path, value, yields: true }
    }
}

impl ConfigArgs {
    /// The configuration these flags describe, checked.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub fn load(&self) -> Result<Config, ConfigError> {
        self.load_with(Vec::new())
    }

    /// The same, with what other flags set.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub(super) fn load_with(&self, settings: Vec<Setting>) -> Result<Config, ConfigError> {
        Config::from_document(self.document(settings)?)
    }

    /// The swarm these flags name, or that of the keys, and how a client reaches it: at the endpoints given, or else by
    /// scouting. The rest of a robot's configuration does not concern a client.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub fn client(&self) -> Result<(String, LinkConfig), ConfigError> {
        let document = self.document(Vec::new())?;
        let is_named = document.says(SWARM);
        client_of(&mut Config::from_document(document)?, is_named)
    }

    /// The configuration of a robot that only streams: it needs no classifier, and how it reaches the others is a client's
    /// way.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    #[cfg(feature = "opencv")]
    pub(super) fn streaming(&self, settings: Vec<Setting>) -> Result<(Config, LinkConfig), ConfigError> {
        let document = self.document(settings)?;
        let is_named = document.says(SWARM);
        let mut config: Config = document.meaning()?;
        // Mind and model are those of whoever processes its frames.
        config.model = ModelSection::None;
        config.learning.enabled = false;
        let source = std::mem::take(&mut config.camera.source);
        config.validate()?;
        config.camera.source = source;
        let (_, link) = client_of(&mut config, is_named)?;
        Ok((config, link))
    }

    /// The tree of values that the file and the flags describe.
    ///
    /// # Errors
    /// A file that cannot be read, and flags that name no key.
    pub(super) fn document(&self, settings: Vec<Setting>) -> Result<Document, ConfigError> {
        let mut document = match &self.config {
            Some(path) => Document::read(path)?,
            None => Document::default(),
        };
        for change in &self.cfg {
            document.apply(change, Config::SECTIONS)?;
        }
        let mut set = |path: &[&str], value: Value| document.set(path, value);
        if let Some(mode) = &self.mode {
            set(&["zenoh", "mode"], json!(mode))?;
        }
        if !self.connect.is_empty() {
            set(&["zenoh", "connect", "endpoints"], json!(self.connect))?;
        }
        if !self.listen.is_empty() {
            set(&["zenoh", "listen", "endpoints"], json!(self.listen))?;
        }
        if self.no_multicast_scouting {
            set(&["links", "scouting", "enabled"], json!(false))?;
        }
        if let Some(swarm) = &self.swarm {
            set(SWARM, json!(swarm))?;
        }
        if let Some(keys) = &self.keys {
            set(&["trust", "keys"], json!(keys))?;
        }
        let (weak, strong): (Vec<Setting>, Vec<Setting>) = settings.into_iter().partition(|it| it.yields);
        for Setting { path, value, .. } in strong {
            document.set(path, value)?;
        }
        for Setting { path, value, .. } in weak {
            if !document.says(path) {
                document.set(path, value)?;
            }
        }
        Ok(document)
    }
}

/// The swarm, how a client reaches it, and what it shows to be let in. Of a swarm that is not named the keys know the name.
fn client_of(config: &mut Config, is_named: bool) -> Result<(String, LinkConfig), ConfigError> {
    let wrong = |error| match error {
        LinkError::Config { key, cause } => ConfigError::Value { key, cause },
        other => ConfigError::value("trust.keys", other),
    };
    let named = is_named.then_some(config.swarm.0.as_str());
    if let Some(swarm) = config.trust.client_swarm(named).map_err(wrong)? {
        config.swarm.0 = swarm;
    }
    let mut link = config.link();
    link.credentials = config.trust.credentials(config.robot.id).map_err(wrong)?;
    link.zenoh.remove("listen");
    let endpoints = link.zenoh.get("connect").and_then(|connect| connect.get("endpoints"));
    if endpoints.is_some_and(|endpoints| !endpoints.as_array().is_some_and(Vec::is_empty)) {
        link.scouting = None;
    } else {
        link.zenoh.remove("connect");
    }
    Ok((config.swarm.0.clone(), link))
}

#[cfg(feature = "opencv")]
#[cfg(test)]
mod tests {
    use clap::Parser;
    use gestalt_protocol::RobotId;
    use gestalt_trust::Roles;

    use super::*;
    use crate::cli::robot_args::{CameraArgs, IdentityArgs, ModelArgs};
    use crate::cli::trust::Authority;
    use crate::config::{CameraChoice, SourceSection};

    #[derive(Parser)]
    struct Flags {
        #[command(flatten)]
        config: ConfigArgs,
        #[command(flatten)]
        identity: IdentityArgs,
        #[command(flatten)]
        camera: CameraArgs,
        #[command(flatten)]
        model: ModelArgs,
    }

    fn load(flags: &[&str]) -> Result<Config, Box<dyn std::error::Error>> {
        let flags = Flags::try_parse_from(["gestalt"].iter().chain(flags))?;
        let Flags { config, identity, camera, model } = flags;
        let settings = [identity.settings(), camera.settings()?, model.settings()].concat();
        Ok(config.load_with(settings)?)
    }

    #[test]
    fn a_robot_is_described_by_flags_alone() {
        let config = load(&["--id", "3", "--name", "window", "--source", "/dev/video0"]).unwrap();
        assert_eq!((config.robot.id.0, config.name()), (3, "window".to_owned()));
        assert!(matches!(config.camera.source, SourceSection::Device(_)));
        assert!(matches!(config.camera.model, CameraChoice::Laptop));
        assert_eq!(config.model, ModelSection::Hands);
    }

    #[test]
    fn a_client_with_keys_is_of_their_swarm_and_of_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let mut authority = Authority::create(folder.path(), "demo", Roles::NONE).unwrap();
        authority.enrol_here(RobotId(1)).unwrap();
        authority.save().unwrap();
        let client = |swarm: Option<&str>| {
            let cfg = vec!["robot.id:1".parse().unwrap()];
            let (swarm, keys) = (swarm.map(str::to_owned), Some(folder.path().to_owned()));
            let flags = ConfigArgs { cfg, swarm, keys, ..ConfigArgs::default() };
            let (streaming, _) = flags.streaming(Vec::new()).map_err(|error| error.to_string())?;
            let (swarm, link) = flags.client().map_err(|error| error.to_string())?;
            assert!(link.credentials.is_some() && streaming.swarm.0 == swarm);
            Ok::<_, String>(swarm)
        };
        assert_eq!([client(None), client(Some("demo"))], [Ok("demo".to_owned()), Ok("demo".to_owned())]);
        let error = client(Some("gestalt")).unwrap_err();
        assert!(error.contains("write --swarm demo"), "{error}");
        let open = ConfigArgs::default().client().unwrap();
        assert_eq!(open.0, "gestalt");
    }

    #[test]
    fn flags_outdo_the_file_and_defaults_give_way_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.json5");
        std::fs::write(&file, "{robot: {id: 7}, model: {file: 'hands.gestalt'}, camera: {model: 'parrot'}}")
            .unwrap();
        let file = file.to_str().unwrap();
        let config = load(&["-c", file, "--source", "/dev/video0", "--id", "8"]).unwrap();
        assert_eq!(config.robot.id.0, 8);
        assert_eq!(config.model, ModelSection::File("hands.gestalt".into()));
        assert!(matches!(config.camera.model, CameraChoice::Parrot));
        let config = load(&["-c", file, "--model", "none", "--camera", "footbot"]).unwrap();
        assert_eq!(config.model, ModelSection::None);
        assert!(matches!(config.camera.model, CameraChoice::Footbot));
        let error = load(&["--source", "rendered:3"]).unwrap_err().to_string();
        assert!(error.contains("fingers"), "{error}");
        let error = load(&["--camera", "kite"]).unwrap_err().to_string();
        assert!(error.contains("parrot"), "{error}");
    }
}
