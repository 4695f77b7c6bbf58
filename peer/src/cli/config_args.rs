//! The flags that choose and change a configuration, as every Zenoh user knows them.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::config::{Config, ConfigError, Document, ModelSection, Override};
use gestalt_link::LinkConfig;

/// Which configuration, and what to change in it.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ConfigArgs {
    /// A robot's configuration: commented JSON5, see configs/
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,

    /// Change one key: a path and a JSON5 value, `rounds/deadline:"8s"` or Zenoh's `transport/link/tx/lease:500`
    #[arg(long, value_name = "KEY:VALUE")]
    pub cfg: Vec<Override>,

    /// Zenoh's mode: robots are routers, so that messages cross several hops
    #[arg(short, long, value_parser = ["router", "peer", "client"])]
    pub mode: Option<String>,

    /// An endpoint to connect to, `tcp/192.168.1.5:7447`; repeatable
    #[arg(short = 'e', long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,

    /// An endpoint to listen on, `tcp/[::]:7447`; repeatable
    #[arg(short, long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,

    /// Find others by --connect and --listen alone
    #[arg(long)]
    pub no_multicast_scouting: bool,

    /// The swarm's name
    #[arg(long, value_name = "NAME")]
    pub swarm: Option<String>,
}

impl ConfigArgs {
    /// The configuration these flags describe, checked.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub fn load(&self) -> Result<Config, ConfigError> {
        Config::from_document(self.document()?)
    }

    /// The swarm these flags name, and how a client reaches it: at the endpoints given, or else by scouting. The
    /// rest of a robot's configuration does not concern a client.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub fn client(&self) -> Result<(String, LinkConfig), ConfigError> {
        Ok(client_of(&self.load()?))
    }

    /// The configuration of a robot that only streams: it needs no classifier, and how it reaches the others is a client's
    /// way.
    ///
    /// # Errors
    /// Whatever is wrong with the file or a flag, by key.
    pub fn streaming(&self) -> Result<(Config, LinkConfig), ConfigError> {
        let mut config: Config = self.document()?.meaning()?;
        // What concerns a mind is that of whoever looks for it.
        config.model = ModelSection::None;
        config.learning.enabled = false;
        let source = std::mem::take(&mut config.camera.source);
        config.validate()?;
        config.camera.source = source;
        let (_, link) = client_of(&config);
        Ok((config, link))
    }

    fn document(&self) -> Result<Document, ConfigError> {
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
            set(&["swarm"], json!(swarm))?;
        }
        Ok(document)
    }
}

/// The swarm, and how a client reaches it.
fn client_of(config: &Config) -> (String, LinkConfig) {
    let mut link = config.link();
    link.zenoh.remove("listen");
    let endpoints = link.zenoh.get("connect").and_then(|connect| connect.get("endpoints"));
    if endpoints.is_some_and(|endpoints| !endpoints.as_array().is_some_and(Vec::is_empty)) {
        link.scouting = None;
    } else {
        link.zenoh.remove("connect");
    }
    (config.swarm.0.clone(), link)
}
