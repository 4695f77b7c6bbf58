//! What schemas say, and that they are published.

use super::*;

/// What is wrong with a schema in the eyes of Foxglove's and Lichtblick's reader.
fn refused(schema: &Value, path: &str) -> Vec<String> {
    let Some(properties) = schema["properties"].as_object() else {
        return vec![format!("{path} has no properties")];
    };
    let each = |(name, field): (&String, &Value)| {
        let path = format!("{path}.{name}");
        let inner = if field["type"] == "array" { &field["items"] } else { field };
        match inner["type"].as_str() {
            Some("object") => refused(inner, &path),
            Some("boolean" | "string" | "number" | "integer") => Vec::new(),
            other => vec![format!("{path} is of type {other:?}")],
        }
    };
    properties.iter().flat_map(each).collect()
}

#[test]
fn viewers_can_read_every_schema() {
    for kind in Kind::ALL.into_iter().filter(|kind| kind.is_json()) {
        let schema = schema(kind).expect("JSON has a schema");
        assert_eq!(schema["type"], "object");
        assert_eq!(refused(&schema, kind.schema()), Vec::<String>::new());
    }
}

#[test]
fn the_published_schemas_are_these() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
    for kind in Kind::ALL.into_iter().filter(|kind| kind.is_json()) {
        let file = folder.join(format!("{}.json", kind.schema()));
        let schema = schema(kind).expect("JSON has a schema");
        if std::env::var_os("GESTALT_BLESS").is_some() {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(&file, format!("{schema:#}\n")).unwrap();
        }
        let published = std::fs::read(&file).unwrap_or_default();
        let published: Value = serde_json::from_slice(&published).unwrap_or_default();
        assert_eq!(published, schema, "run this test with GESTALT_BLESS=1 to write {}", file.display());
    }
}
