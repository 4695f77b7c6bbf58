//! The layout that ships.

use super::*;

/// The layout names what is there before anything has happened, and no field that messages have not.
#[test]
fn the_layout_names_topics_and_fields_that_there_are() {
    let keys = Keys::new("gestalt").unwrap();
    let channels = Entry::channels(&keys, None);
    let layout: Value = serde_json::from_str(server::LAYOUT).unwrap();
    let mut named = 0;
    let panels = layout["configById"].as_object().unwrap();
    for path in texts(&layout["configById"]).into_iter().filter(|text| text.starts_with('/')) {
        named += 1;
        let (topic, fields) = path.split_once('.').unwrap_or((&path, ""));
        if topic == service(&keys) {
            continue;
        }
        let (kind, _) =
            channels.iter().find(|(_, it)| it == topic).unwrap_or_else(|| panic!("{topic} is not there"));
        let mut at = schema(*kind).unwrap_or_default();
        for field in fields.split('.').filter(|field| !field.is_empty()) {
            let (name, is_list) = field.strip_suffix("[:]").map_or((field, false), |name| (name, true));
            let found = at["properties"].get(name).cloned();
            let open = at.get("additionalProperties").is_some().then(|| at["additionalProperties"].clone());
            at = found.or(open).unwrap_or_else(|| panic!("{path}: there is no {name}"));
            if is_list {
                at = at["items"].clone();
            }
        }
    }
    assert!(named >= 12, "{named}");
    for text in texts(&layout["layout"]).iter().filter(|text| text.contains('!')) {
        assert!(panels.contains_key(text), "{text} has no panel");
    }
    for panel in panels.values().filter(|panel| panel["serviceName"].is_string()) {
        let payload = panel["requestPayload"].as_str().unwrap();
        let last = ("5@2-3f9a01c7".parse().unwrap(), Some(gestalt_protocol::ClassId(3)));
        assert!(say::instruction(payload.as_bytes(), Some(last), None).is_ok(), "{payload}");
    }
}

fn texts(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => items.iter().flat_map(texts).collect(),
        Value::Object(fields) => fields.values().flat_map(texts).collect(),
        _ => Vec::new(),
    }
}
