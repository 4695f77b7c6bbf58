//! A configuration as a tree of values: read from JSON5, changed by `--cfg`, then given its meaning.

use std::path::Path;
use std::str::FromStr;

use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::ConfigError;

/// A configuration file's tree of values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    root: Map<String, Value>,
}

/// One `--cfg KEY:VALUE`: a path such as `rounds/alpha` and a JSON5 value.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    path: Vec<String>,
    value: Value,
}

impl FromStr for Override {
    type Err = ConfigError;

    fn from_str(given: &str) -> Result<Self, ConfigError> {
        let refuse = |mend: &str| ConfigError::Override { given: given.to_owned(), mend: mend.to_owned() };
        let (key, value) = given
            .split_once(':')
            .ok_or_else(|| refuse("write KEY:VALUE, for example rounds/deadline:\"8s\""))?;
        let path: Vec<String> = key.split('/').map(str::to_owned).collect();
        if path.iter().any(String::is_empty) {
            return Err(refuse(
                "the key is a path of names with '/' between them, for example rounds/deadline",
            ));
        }
        // A bare word is meant as a string: mode:client, as on Zenoh's own command line.
        let value = json5::from_str(value).or_else(|cause| {
            let word = value.chars().all(|c| c.is_ascii_alphanumeric() || "._-/:".contains(c));
            if word && !value.is_empty() {
                Ok(Value::String(value.to_owned()))
            } else {
                Err(refuse(&format!("the value is not JSON5: {cause}")))
            }
        })?;
        Ok(Self { path, value })
    }
}

impl Document {
    /// Reads a JSON5 file.
    ///
    /// # Errors
    /// [`ConfigError::Unreadable`], [`ConfigError::Syntax`].
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| ConfigError::Unreadable { path: path.to_owned(), cause })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Reads JSON5 text; `origin` is named in errors.
    ///
    /// # Errors
    /// [`ConfigError::Syntax`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, ConfigError> {
        let root = json5::from_str(text)
            .map_err(|cause| ConfigError::Syntax { origin: origin.to_owned(), cause: cause.to_string() })?;
        Ok(Self { root })
    }

    /// Applies one `--cfg`. A path whose first name is none of the robot's own sections (`ours`) is taken as a
    /// path into Zenoh's configuration, so that `--cfg transport/link/tx/lease:500` means what Zenoh's users mean.
    ///
    /// # Errors
    /// [`ConfigError::Override`] when the path leads through something that is no object.
    pub fn apply(&mut self, change: &Override, ours: &[&str]) -> Result<(), ConfigError> {
        let mut path: Vec<&str> = change.path.iter().map(String::as_str).collect();
        if !ours.contains(&path[0]) {
            path.insert(0, "zenoh");
        }
        self.set(&path, change.value.clone())
    }

    /// Sets the value at a path, making the objects on the way.
    ///
    /// # Errors
    /// [`ConfigError::Override`] when the path leads through something that is no object.
    pub fn set(&mut self, path: &[&str], value: Value) -> Result<(), ConfigError> {
        let Some((last, way)) = path.split_last() else { return Ok(()) };
        let mut here = &mut self.root;
        for name in way {
            here = match here.entry(*name).or_insert_with(|| Value::Object(Map::new())) {
                Value::Object(object) => object,
                other => {
                    return Err(ConfigError::Override {
                        given: path.join("/"),
                        mend: format!("'{name}' is {other}, not an object: set it whole, or another key"),
                    });
                }
            };
        }
        here.insert((*last).to_owned(), value);
        Ok(())
    }

    /// Gives the tree its meaning.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the path of the key.
    pub fn meaning<T: DeserializeOwned>(self) -> Result<T, ConfigError> {
        serde_path_to_error::deserialize(Value::Object(self.root)).map_err(|error| ConfigError::Value {
            key: match error.path().to_string() {
                path if path == "." => "the configuration".to_owned(),
                path => path,
            },
            cause: with_mend(error.into_inner().to_string()),
        })
    }
}

/// What serde says names what was expected; a duration's form is worth an example.
fn with_mend(mut cause: String) -> String {
    if cause.ends_with("expected a duration") {
        cause.push_str(": write a number with a unit, like \"500ms\" or \"2s\"");
    }
    cause
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str, changes: &[&str]) -> Result<Document, ConfigError> {
        let mut document = Document::parse(text, "test")?;
        for change in changes {
            document.apply(&change.parse()?, &["rounds", "zenoh"])?;
        }
        Ok(document)
    }

    #[test]
    fn a_change_reaches_its_key_and_leaves_the_others() {
        let changed = document("{rounds: {alpha: 0.1, quorum: 2}}", &["rounds/alpha:0.2"]).unwrap();
        assert_eq!(changed, document("{rounds: {alpha: 0.2, quorum: 2}}", &[]).unwrap());
    }

    #[test]
    fn a_key_of_zenoh_goes_to_zenoh() {
        let changed = document("{}", &["transport/link/tx/lease:500", "mode:client"]).unwrap();
        let meant = "{zenoh: {transport: {link: {tx: {lease: 500}}}, mode: 'client'}}";
        assert_eq!(changed, document(meant, &[]).unwrap());
    }

    #[test]
    fn a_bad_change_names_itself() {
        for bad in ["alpha", "rounds//alpha:1", "rounds/alpha:{", ":1"] {
            let error = document("{}", &[bad]).unwrap_err().to_string();
            assert!(error.contains(bad), "{error}");
        }
        let through = document("{rounds: 3}", &["rounds/alpha:1"]).unwrap_err().to_string();
        assert!(through.contains("not an object"), "{through}");
    }
}
