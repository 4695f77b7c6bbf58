//! The service by which a swarm is taught.

use gestalt_protocol::{ClassId, Gesture, Instruction, RoundId};
use gestalt_tape::{Kind, schema};
use serde::Deserialize;
use serde_json::{Value, json};

use super::wire::text;
use crate::word::Word;

/// The number of the one service.
pub(super) const SERVICE: u32 = 1;

/// The one encoding of what is asked and answered.
pub(super) const ENCODING: &str = "json";

/// The round that words are about that name none, and what was decided of it.
pub(super) type Last = (RoundId, Option<ClassId>);

/// What a call says: the words of `gestalt teach`, or the instruction that any Zenoh client puts, of which the round may be left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    say: String,
    #[serde(default)]
    round: Option<Round>,
    #[serde(default)]
    class: Option<Gesture>,
    #[serde(default)]
    of: Option<Gesture>,
    #[serde(default)]
    label: Option<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Round {
    Whole(RoundId),
    Text(String),
}

/// What is to be said to the swarm, by the JSON of a call. What is withdrawn is what was said last, of whichever round that was.
///
/// # Errors
/// What there is to say instead.
pub(super) fn instruction(
    payload: &[u8],
    last: Option<Last>,
    said_last: Option<RoundId>,
) -> Result<Instruction, String> {
    let said: Said = serde_json::from_slice(payload)
        .map_err(|error| format!("{error}: write {{\"say\": \"was three\"}}, as gestalt teach takes it"))?;
    let round = match said.round {
        None => None,
        Some(Round::Whole(round)) => Some(round),
        Some(Round::Text(text)) => Some(text.parse::<RoundId>().map_err(|error| error.to_string())?),
    };
    let words: Vec<&str> = said.say.split_whitespace().collect();
    let word = match (words.as_slice(), said.class, said.of, said.label) {
        (["was"], Some(class), None, None) => Word::Was(class),
        (["new"], None, None, Some(label)) => Word::New(label),
        (["same"], Some(class), Some(of), None) => Word::Same(class, of),
        (["retire"], Some(class), None, None) => Word::Retire(class),
        (["restore"], Some(class), None, None) => Word::Restore(class),
        (["right" | "wrong"], None, Some(of), None) => {
            let (round, _) = about(round, last)?;
            let is_right = words == ["right"];
            return Ok(if is_right {
                Instruction::Right { round, of }
            } else {
                Instruction::Wrong { round, of }
            });
        }
        (words, None, None, None) => Word::read(words)?,
        (words, ..) => return Err(format!("class, of or label do not go with '{}'", words.join(" "))),
    };
    if word == Word::Open {
        return Ok(Instruction::Open);
    }
    if let Some(instruction) = word.of_names(round) {
        return Ok(instruction);
    }
    let round = round.or(said_last.filter(|_| word == Word::Undo));
    let (round, decided) = about(round, last)?;
    word.about(round, decided)?
        .ok_or_else(|| "there is nothing to leave here: close the connection".to_owned())
}

fn about(round: Option<RoundId>, last: Option<Last>) -> Result<Last, String> {
    match round {
        Some(round) => Ok((round, last.filter(|last| last.0 == round).and_then(|last| last.1))),
        None => last.ok_or_else(|| {
            "no round has been decided yet: open one with {\"say\": \"look\"}, or name one as \"round\""
                .to_owned()
        }),
    }
}

/// What a call says, as JSON Schema.
fn request() -> Value {
    let about = "open (or look), was GESTURE, class NUMBER, right, wrong, undo, new LABEL, same GESTURE as GESTURE, \
                 retire GESTURE or restore GESTURE";
    let gesture = |about: &str| json!({"type": "string", "description": about});
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gestalt.Say",
        "type": "object",
        "required": ["say"],
        "properties": {
            "say": {"type": "string", "description": about},
            "round": {"type": "string", "description": "Which round it is about, such as 5@2-3f9a01c7; absent: the one decided last; of undo the one last spoken of here."},
            "class": gesture("Beside was, same, retire or restore alone: the gesture, by label; a number is its class."),
            "of": gesture("Beside right or wrong: the gesture decided; beside same: what the other is."),
            "label": {"type": "string", "description": "Beside new: what the gesture is called."},
        },
    })
}

/// What is answered, as JSON Schema.
fn response() -> Value {
    let mut answer = schema(Kind::Answer).unwrap_or_default();
    if let Some(fields) = answer.as_object_mut() {
        fields.retain(|name, _| !name.starts_with('$') && name != "title");
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gestalt.Said",
        "type": "object",
        "required": ["words"],
        "properties": {
            "words": {"type": "string", "description": "What became of it, in words."},
            "answer": answer,
        },
    })
}

/// Says that the service is there.
pub(super) fn advertise(name: &str) -> axum::extract::ws::Message {
    let schema = |schema: &Value| {
        json!({
            "encoding": ENCODING, "schemaName": schema["title"], "schemaEncoding": "jsonschema",
            "schema": schema.to_string(),
        })
    };
    text(&json!({
        "op": "advertiseServices",
        "services": [{
            "id": SERVICE, "name": name, "type": "gestalt.Say", "request": schema(&request()),
            "response": schema(&response()),
        }],
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_taken_as_people_type_them_and_as_programs_put_them() {
        let (last, other): (RoundId, RoundId) =
            ("5@2-3f9a01c7".parse().unwrap(), "4@1-3f9a01c7".parse().unwrap());
        let said = |json: Value| {
            instruction(json.to_string().as_bytes(), Some((last, Some(ClassId(3)))), None).unwrap()
        };
        let label = |label: &str| Gesture::Label(label.to_owned());
        let three = Gesture::Class(ClassId(3));
        for open in ["open", "look", " look "] {
            assert_eq!(said(json!({"say": open})), Instruction::Open);
        }
        let was = Instruction::Was { round: last, class: label("3") };
        assert_eq!(said(json!({"say": "was 3"})), was);
        assert_eq!(said(json!({"say": "was", "class": "3"})), was);
        assert_eq!(said(json!({"say": "was", "class": "3", "round": last})), was);
        assert_eq!(said(json!({"say": "was", "class": "3", "round": "5@2-3f9a01c7", "of": null})), was);
        assert_eq!(
            said(json!({"say": "was", "class": 3})),
            Instruction::Was { round: last, class: three.clone() }
        );
        assert_eq!(said(json!({"say": "right"})), Instruction::Right { round: last, of: three.clone() });
        assert_eq!(
            said(json!({"say": "wrong", "of": 3, "round": other})),
            Instruction::Wrong { round: other, of: three }
        );
        assert_eq!(said(json!({"say": "undo"})), Instruction::Retract { round: last });
        assert_eq!(said(json!({"say": "retract", "round": other})), Instruction::Retract { round: other });
        let new = Instruction::New { label: "big circle".to_owned(), round: None };
        assert_eq!(said(json!({"say": "new big circle"})), new);
        assert_eq!(said(json!({"say": "new", "label": "big circle"})), new);
        let same = Instruction::Same { class: label("ring"), of: label("circle") };
        assert_eq!(said(json!({"say": "same ring as circle"})), same);
        assert_eq!(said(json!({"say": "same", "class": "ring", "of": "circle"})), same);
    }

    #[test]
    fn undo_withdraws_what_was_said_last_whatever_round_that_was_of() {
        let round = |text: &str| text.parse::<RoundId>().unwrap();
        let (decided, spoken) = (round("6@2-3f9a01c7"), round("4@1-3f9a01c7"));
        let said = |json: &str| {
            instruction(json.as_bytes(), Some((decided, Some(ClassId(3)))), Some(spoken)).unwrap()
        };
        assert_eq!(said(r#"{"say":"undo"}"#), Instruction::Retract { round: spoken });
        let named = Instruction::Retract { round: round("5@1-3f9a01c7") };
        assert_eq!(said(r#"{"say":"undo","round":"5@1-3f9a01c7"}"#), named);
        assert_eq!(said(r#"{"say":"was 2"}"#).round(), Some(decided));
    }

    #[test]
    fn every_instruction_of_a_zenoh_client_is_taken_as_it_is() {
        let round: RoundId = "5@2-3f9a01c7".parse().unwrap();
        let (class, of) = (Gesture::Class(ClassId(3)), Gesture::Label("three".to_owned()));
        for all in [
            Instruction::Open,
            Instruction::Was { round, class: class.clone() },
            Instruction::Right { round, of: of.clone() },
            Instruction::Wrong { round, of: of.clone() },
            Instruction::Retract { round },
            Instruction::New { label: "circle".to_owned(), round: Some(round) },
            Instruction::Same { class: class.clone(), of: of.clone() },
            Instruction::Retire { class: of.clone() },
            Instruction::Restore { class: of },
        ] {
            assert_eq!(instruction(&serde_json::to_vec(&all).unwrap(), None, None), Ok(all));
        }
    }

    #[test]
    fn what_means_nothing_is_refused_with_what_there_is_to_say() {
        for (json, hint) in [
            ("", "gestalt teach"),
            ("[]", "gestalt teach"),
            (r#"{"say":"dance"}"#, "use open"),
            (r#"{"say":"right"}"#, "no round has been decided"),
            (r#"{"say":"was 3","round":"x"}"#, ""),
            (r#"{"say":"was 3","of":"4"}"#, "do not go with"),
            (r#"{"say":"open","sudo":true}"#, "sudo"),
            (r#"{"say":"quit","round":"5@2-3f9a01c7"}"#, "nothing to leave"),
        ] {
            let refused = instruction(json.as_bytes(), None, None).unwrap_err();
            assert!(refused.contains(hint), "{json}: {refused}");
        }
    }

    #[test]
    fn the_published_schemas_are_these() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
        for schema in [request(), response()] {
            let file = folder.join(format!("{}.json", schema["title"].as_str().unwrap()));
            if std::env::var_os("GESTALT_BLESS").is_some() {
                std::fs::write(&file, format!("{schema:#}\n")).unwrap();
            }
            let published = std::fs::read(&file).unwrap_or_default();
            let published: Value = serde_json::from_slice(&published).unwrap_or_default();
            assert_eq!(published, schema, "run this test with GESTALT_BLESS=1 to write {}", file.display());
        }
    }
}
