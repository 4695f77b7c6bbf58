//! The one place where every key is explained.

/// A commented configuration file in which every key has its default: what `gestalt config` prints.
pub const TEMPLATE: &str = include_str!("../../template.json5");

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use gestalt_protocol::FusionRule;
    use gestalt_strategies::{ForgettingRule, Precision, SelectionRule};
    use gestalt_vision::camera_model::CameraModel;
    use serde_json::{Value, json};

    use super::*;
    use crate::config::{Config, Document, LearnFrom, StreamingSection};

    /// The comment right above each key of the template, by path.
    fn explained() -> BTreeMap<String, String> {
        let (mut explained, mut path, mut comment) = (BTreeMap::new(), Vec::new(), String::new());
        for line in TEMPLATE.lines().map(str::trim) {
            if let Some(words) = line.strip_prefix("//") {
                comment.push_str(words);
                continue;
            }
            if let Some((key, value)) = line.split_once(": ") {
                path.push(key);
                let key = path.join(".");
                assert!(
                    explained.insert(key, comment.clone()).is_none(),
                    "{path:?} stands in the template twice"
                );
                if value != "{" {
                    path.pop();
                }
            } else if line == "}," {
                path.pop();
            }
            comment.clear();
        }
        explained
    }

    fn keys(of: &Value, path: &str, all: &mut Vec<String>) {
        for (key, value) in of.as_object().into_iter().flatten() {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            keys(value, &path, all);
            all.push(path);
        }
    }

    #[test]
    fn every_key_stands_in_the_template_with_its_default_and_is_explained() {
        let default = serde_json::to_value(Config::default()).unwrap();
        let written: Value = Document::parse(TEMPLATE, "template").unwrap().meaning().unwrap();
        let mut wanted = Vec::new();
        keys(&default, "", &mut wanted);
        let explained = explained();
        for key in &wanted {
            let words = explained.get(key).unwrap_or_else(|| panic!("{key} is not in the template"));
            assert!(words.trim().len() > 10, "{key} is not explained: '{words}'");
            let pointer = format!("/{}", key.replace('.', "/"));
            assert_eq!(written.pointer(&pointer), default.pointer(&pointer), "{key} is not the default");
        }
        for key in explained.keys() {
            assert!(wanted.contains(key), "{key} is in the template, but is not a key");
        }
        assert_eq!(written, default);
    }

    #[test]
    fn every_choice_is_named_where_it_can_be_made() {
        let explained = explained();
        let names = |of: &[Value]| of.iter().map(|it| it.as_str().unwrap().to_owned()).collect::<Vec<_>>();
        let fields = |of: Value| of.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        let some = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let rules = FusionRule::ALL;
        for (key, choices) in [
            (
                "camera.source",
                some(&["none", "device", "images", "video", "rendered", "stream", "loop", "schedule"]),
            ),
            ("camera.model", some(&["footbot", "parrot", "laptop", "custom"])),
            ("camera.model", fields(serde_json::to_value(CameraModel::footbot()).unwrap())),
            ("model", some(&["none", "hands", "rendered", "file"])),
            ("rounds.rule", names(&rules.map(|rule| json!(rule)))),
            ("learning.from", names(&[json!(LearnFrom::Model), json!(LearnFrom::Nothing)])),
            ("learning.samples.selection", names(&SelectionRule::ALL.map(|rule| json!(rule)))),
            ("learning.samples.forgetting", names(&ForgettingRule::ALL.map(|rule| json!(rule)))),
            (
                "learning.samples.precision",
                names(&[Precision::F32, Precision::F16, Precision::I8].map(|p| json!(p))),
            ),
            ("center.fuse", some(&["central", "swarm"])),
            ("center.robots", fields(serde_json::to_value(StreamingSection::default()).unwrap())),
        ] {
            for choice in choices {
                assert!(explained[key].contains(&choice), "{key} does not name {choice}");
            }
        }
    }
}
