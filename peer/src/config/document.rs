//! A configuration as a tree of values: read from JSON5, changed by `--cfg`, then given its meaning.

use std::path::Path;
use std::str::FromStr;

use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::ConfigError;
use super::strict::Strict;

/// A configuration file's tree of values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    root: Map<String, Value>,
}

/// One `--cfg KEY:VALUE`: a path such as `rounds.deadline` or `rounds/deadline`, and a JSON5 value.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    given: String,
    path: Vec<String>,
    value: Value,
}

impl FromStr for Override {
    type Err = ConfigError;

    fn from_str(given: &str) -> Result<Self, ConfigError> {
        let refuse = |fix: &str| ConfigError::Override { given: given.to_owned(), fix: fix.to_owned() };
        let (key, value) =
            given.split_once(':').ok_or_else(|| refuse("write KEY:VALUE, for example rounds.deadline:8s"))?;
        let path: Vec<String> = key.split(['.', '/']).map(str::to_owned).collect();
        if path.iter().any(String::is_empty) {
            return Err(refuse("the key is a path of names separated by dots, for example rounds.deadline"));
        }
        // What is neither JSON5 nor meant to be is a string without its quotes: mode:client, rounds.deadline:8s.
        let value = json(value).or_else(|cause| {
            if value.is_empty() || value.starts_with(['{', '[', '"', '\'']) {
                Err(refuse(&format!("the value is not JSON5: {cause}")))
            } else {
                Ok(Value::String(value.to_owned()))
            }
        })?;
        Ok(Self { given: given.to_owned(), path, value })
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
        let refuse = |cause| ConfigError::Syntax { origin: origin.to_owned(), cause };
        match json(text).map_err(refuse)? {
            Value::Object(root) => Ok(Self { root }),
            other => Err(refuse(format!("{other} is no object: write {{section: {{key: value}}}}"))),
        }
    }

    /// Applies one `--cfg`. A path whose first name is not one of the robot's own sections (`ours`) but a key of Zenoh is
    /// taken as a path into Zenoh's configuration, so that `--cfg transport/link/tx/lease:500` means what Zenoh's users mean.
    ///
    /// # Errors
    /// [`ConfigError::Override`] when the first name is neither, or the path leads through something that is not an
    /// object.
    pub fn apply(&mut self, change: &Override, ours: &[&str]) -> Result<(), ConfigError> {
        let mut path: Vec<&str> = change.path.iter().map(String::as_str).collect();
        let first = path[0];
        if !ours.contains(&first) {
            let zenoh = keys_of_zenoh();
            if !zenoh.iter().any(|key| key == first) {
                let known = ours.iter().copied().chain(zenoh.iter().map(String::as_str));
                let nearest = nearest(first, known);
                let hint = nearest.map_or(String::new(), |near| format!(" did you mean '{near}'?"));
                let fix = format!(
                    "there is no section '{first}':{hint} Sections: {}; or a key of Zenoh's",
                    ours.join(", ")
                );
                return Err(ConfigError::Override { given: change.given.clone(), fix });
            }
            path.insert(0, "zenoh");
        }
        self.set(&path, change.value.clone()).map_err(|error| match error {
            ConfigError::Override { fix, .. } => ConfigError::Override { given: change.given.clone(), fix },
            other => other,
        })
    }

    /// Whether the file or a flag says anything about a key.
    #[must_use]
    pub fn says(&self, path: &[&str]) -> bool {
        let Some((first, rest)) = path.split_first() else { return true };
        let mut here = self.root.get(*first);
        for name in rest {
            here = here.and_then(|value| value.get(name));
        }
        here.is_some()
    }

    /// Sets the value at a path, making the objects on the way.
    ///
    /// # Errors
    /// [`ConfigError::Override`] when the path leads through something that is not an object.
    pub fn set(&mut self, path: &[&str], value: Value) -> Result<(), ConfigError> {
        let Some((last, way)) = path.split_last() else { return Ok(()) };
        let mut here = &mut self.root;
        for name in way {
            here = match here.entry(*name).or_insert_with(|| Value::Object(Map::new())) {
                Value::Object(object) => object,
                other => {
                    return Err(ConfigError::Override {
                        given: path.join("."),
                        fix: format!(
                            "'{name}' is {other}, not an object: set '{name}' itself, or choose another key"
                        ),
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
            cause: with_example(error.into_inner().to_string()),
        })
    }

    /// Gives the tree its meaning as far as it has one: what has none is left out, and said.
    pub fn meaning_in_part<T: DeserializeOwned>(mut self) -> (Option<T>, Vec<ConfigError>) {
        let mut found: Vec<ConfigError> = Vec::new();
        let mut left_out: Vec<String> = Vec::new();
        loop {
            let error = match self.clone().meaning() {
                Ok(meaning) => return (Some(meaning), found),
                Err(error) => error,
            };
            let ConfigError::Value { key, .. } = &error else {
                found.push(error);
                return (None, found);
            };
            let key = key.clone();
            // What surrounds something left out may be wrong for that alone.
            if !left_out.iter().any(|inner| inner.starts_with(&format!("{key}."))) {
                found.push(error);
            }
            // Each time around the tree gets smaller.
            if !remove(&mut self.root, &key.split('.').collect::<Vec<_>>()) {
                return (None, found);
            }
            left_out.push(key);
        }
    }
}

/// Removes the value at a path, or, where the path leads on into what is not an object, the last that is there.
fn remove(object: &mut Map<String, Value>, path: &[&str]) -> bool {
    let Some((first, rest)) = path.split_first() else { return false };
    if let Some(Value::Object(inner)) = object.get_mut(*first)
        && !rest.is_empty()
        && remove(inner, rest)
    {
        return true;
    }
    object.remove(*first).is_some()
}

/// The first names of Zenoh's own configuration.
fn keys_of_zenoh() -> Vec<String> {
    match serde_json::to_value(zenoh::Config::default()) {
        Ok(Value::Object(config)) => config.into_iter().map(|(key, _)| key).collect(),
        // Zenoh's configuration is an object; if it ever were not, its keys would have to stand in the zenoh block.
        _ => Vec::new(),
    }
}

/// The name that was probably meant; `None` when nothing resembles it.
fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let by_likeness = known.map(|known| (strsim::jaro_winkler(name, known), known));
    by_likeness
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}

/// What serde says names what was expected; a duration's form is worth an example.
fn with_example(mut cause: String) -> String {
    if cause.ends_with("expected a duration") {
        cause.push_str(": write a number with a unit, like \"500ms\" or \"2s\"");
    }
    cause
}

/// How deep brackets may lie within each other: the parser has a stack that ends.
const DEEPEST: usize = 100;

/// Reads JSON5; says why it is none.
fn json(text: &str) -> Result<Value, String> {
    if is_too_deep(text) {
        return Err(format!("brackets within brackets, more than {DEEPEST} deep"));
    }
    json5::from_str(text).map(|Strict(value)| value).map_err(|cause| cause.to_string())
}

/// Whether brackets are open so deep, as if none stood in text.
fn is_too_deep(text: &str) -> bool {
    let mut deep = 0_usize;
    text.bytes().any(|byte| {
        match byte {
            b'{' | b'[' => deep += 1,
            b'}' | b']' => deep = deep.saturating_sub(1),
            _ => {}
        }
        deep > DEEPEST
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    fn document(text: &str, changes: &[&str]) -> Result<Document, ConfigError> {
        let mut document = Document::parse(text, "test")?;
        for change in changes {
            document.apply(&change.parse()?, Config::SECTIONS)?;
        }
        Ok(document)
    }

    #[test]
    fn a_change_reaches_its_key_and_leaves_the_others() {
        for change in ["rounds/alpha:0.2", "rounds.alpha:0.2"] {
            let changed = document("{rounds: {alpha: 0.1, quorum: 2}}", &[change]).unwrap();
            assert_eq!(changed, document("{rounds: {alpha: 0.2, quorum: 2}}", &[]).unwrap());
        }
    }

    #[test]
    fn brackets_without_end_are_an_error() {
        for deep in ["{a:", "["] {
            let refused = document(&deep.repeat(100_000), &[]).unwrap_err().to_string();
            assert!(refused.contains("more than 100 deep"), "{refused}");
            let change = format!("zenoh.a:{}", deep.repeat(100_000));
            let refused = change.parse::<Override>().unwrap_err().to_string();
            assert!(refused.contains("more than 100 deep"));
        }
        assert!(document("{zenoh: {a: [[[[{}]]]]}}", &[]).is_ok());
    }

    #[test]
    fn what_is_no_number_is_not_taken_for_nothing() {
        for odd in ["NaN", "Infinity", "-Infinity", "1e999"] {
            for text in [format!("{{\n trust: {{keys: {odd}}}}}"), format!("{{\n a: [{odd}]}}")] {
                let refused = document(&text, &[]).unwrap_err().to_string();
                assert!(refused.contains("write a number, or null at line 2"), "{refused}");
            }
        }
        let whole = "{a: 1, c: [1, -2, 0.5, 'x', null, true, {b: {}}]}";
        let plain: Value = serde_json::json!({"a": 1, "c": [1, -2, 0.5, "x", null, true, {"b": {}}]});
        assert_eq!(Value::Object(document(whole, &[]).unwrap().root), plain);
        assert!(document("[1]", &[]).unwrap_err().to_string().contains("no object"));
    }

    #[test]
    fn a_key_that_stands_twice_is_refused_with_its_second_place() {
        let text = "{links: {\n  cells: {size: 32},\n  max_links: 4,\n  'cells': null}}";
        for text in [text.to_owned(), format!("{{zenoh: [{{a: 1}}, {text}]}}")] {
            let refused = document(&text, &[]).unwrap_err().to_string();
            assert!(refused.contains("'cells'") && refused.contains("at line 4"), "{refused}");
        }
        let refused = "links:{cells: 1, cells: 2}".parse::<Override>().unwrap_err().to_string();
        assert!(refused.contains("'cells'"), "{refused}");
        // In two objects it stands once in each.
        assert!(document("{a: {b: {a: 1}}, b: [{a: 1}, {a: 1}]}", &[]).is_ok());
    }

    #[test]
    fn strings_and_durations_need_no_quotes() {
        let changes =
            ["rounds.deadline:8s", "robot.name:by the window", "camera.decorrelation:null", "robot.id:7"];
        let meant = "{rounds: {deadline: '8s'}, robot: {name: 'by the window', id: 7}, camera: {decorrelation: null}}";
        assert_eq!(document("{}", &changes).unwrap(), document(meant, &[]).unwrap());
    }

    #[test]
    fn a_key_of_zenoh_goes_to_zenoh() {
        let changed = document("{}", &["transport/link/tx/lease:500", "mode:client"]).unwrap();
        let meant = "{zenoh: {transport: {link: {tx: {lease: 500}}}, mode: 'client'}}";
        assert_eq!(changed, document(meant, &[]).unwrap());
    }

    #[test]
    fn an_unknown_section_is_refused_with_the_nearest() {
        for (change, near) in [
            ("round.deadline:8s", "'rounds'"),
            ("Rounds.deadline:8s", "'rounds'"),
            ("learn.enabled:true", "'learning'"),
            ("trasport/link:1", "'transport'"),
        ] {
            let error = document("{}", &[change]).unwrap_err().to_string();
            assert!(error.contains(near) && error.contains(change), "{error}");
        }
        let error = document("{}", &["qqq:1"]).unwrap_err().to_string();
        assert!(!error.contains("did you mean") && error.contains("rounds"), "{error}");
    }

    #[test]
    fn a_bad_change_names_itself() {
        for bad in ["alpha", "rounds//alpha:1", "rounds/alpha:{", "rounds.alpha:", ":1"] {
            let error = document("{}", &[bad]).unwrap_err().to_string();
            assert!(error.contains(bad), "{error}");
        }
        let through = document("{rounds: 3}", &["rounds/alpha:1"]).unwrap_err().to_string();
        assert!(through.contains("not an object"), "{through}");
    }

    #[test]
    fn every_value_without_a_meaning_is_found() {
        let text = "{rouns: {}, robot: {id: -1, name: 'x'}, camera: {source: {rendered: {pose: {bearing_deg: 'x'}}}, \
                    model: {custom: {name: 'x', fps: 'fast'}}}, rounds: {deadline: 5, rule: 'vote'}}";
        let (config, found) = document(text, &[]).unwrap().meaning_in_part::<Config>();
        let keys: Vec<String> =
            found.iter().map(|error| error.to_string().split(": ").next().unwrap().to_owned()).collect();
        for key in ["rouns", "robot.id", "rounds.deadline", "rounds.rule"] {
            assert!(keys.iter().any(|found| found == key), "{key} of {keys:?}");
        }
        for key in ["camera.source.rendered.pose", "camera.model.custom"] {
            assert_eq!(keys.iter().filter(|found| found.starts_with(key)).count(), 1, "{key} of {keys:?}");
        }
        assert_eq!(keys.len(), 6, "{keys:?}");
        assert_eq!(config.unwrap().robot.name, "x");
    }
}
