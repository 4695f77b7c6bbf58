//! The JSON Schemas of what is recorded.
//!
//! Foxglove and Lichtblick make a flat description of each message out of its schema and take a part of JSON Schema only: each
//! property has one type, there are no references, and no lists of lists. So what is absent is left out, never `null`, and every
//! schema is spelt out. Published as files in `docs/schemas/`.

use gestalt_protocol::{MAX_CLASSES, PROTOCOL_VERSION};
use serde_json::{Map, Value, json};

use crate::kind::Kind;

/// A property and whether it is always there.
type Field = (&'static str, Value, bool);

/// The JSON Schema of a kind of message; `None` for what is recorded as protobuf.
#[must_use]
pub fn schema(kind: Kind) -> Option<Value> {
    let (about, fields) = match kind {
        Kind::Vote => ("A robot's evidence in a round: the latest replaces all earlier ones.", vote_of()),
        Kind::Sample => ("Samples that a robot shares with all.", samples()),
        Kind::Holding => ("Which decision a robot holds, in short.", holding()),
        Kind::Decision => ("The swarm's decision, with the votes it rests on.", decision()),
        Kind::Question => ("A question of the swarm to its instructor.", question()),
        Kind::Status => ("A robot's account of itself, asked for every few seconds.", status()),
        Kind::Alive => (
            "A robot came or left.",
            vec![must("robot", robot()), must("alive", flag("Whether it is there."))],
        ),
        Kind::Feedback => ("An instructor's word to the swarm.", feedback()),
        Kind::Answer => ("What became of an instructor's word.", answer()),
        Kind::Evidence => ("Proof that a member lied.", vec![must("bytes", count("How long it is."))]),
        Kind::Unreadable => {
            ("What came under a key of the swarm and is no message of that key.", unreadable())
        }
        Kind::Recorder => ("What the recorder received, wrote and lost so far.", recorder()),
        Kind::Frame | Kind::Log => return None,
    };
    let mut schema = object(about, fields.into_iter().chain([may("wire", wire())]).collect());
    let head = schema.as_object_mut()?;
    head.insert("$schema".to_owned(), json!("https://json-schema.org/draft/2020-12/schema"));
    head.insert("title".to_owned(), json!(kind.schema()));
    head.insert("$comment".to_owned(), json!(format!("Gestalt protocol version {PROTOCOL_VERSION}")));
    Some(schema)
}

fn must(name: &'static str, schema: Value) -> Field {
    (name, schema, true)
}

fn may(name: &'static str, schema: Value) -> Field {
    (name, schema, false)
}

fn object(about: &str, fields: Vec<Field>) -> Value {
    let required: Vec<&str> = fields.iter().filter(|field| field.2).map(|field| field.0).collect();
    let properties: Map<String, Value> =
        fields.iter().map(|(name, schema, _)| ((*name).to_owned(), schema.clone())).collect();
    json!({
        "type": "object", "description": about, "properties": properties, "required": required,
        "additionalProperties": false,
    })
}

fn list(about: &str, of: Value) -> Value {
    json!({"type": "array", "description": about, "items": of})
}

fn text(about: &str) -> Value {
    json!({"type": "string", "description": about})
}

fn flag(about: &str) -> Value {
    json!({"type": "boolean", "description": about})
}

fn number(about: &str) -> Value {
    json!({"type": "number", "description": about})
}

fn count(about: &str) -> Value {
    json!({"type": "integer", "minimum": 0, "description": about})
}

fn one_of(about: &str, words: &[&str]) -> Value {
    json!({"type": "string", "enum": words, "description": about})
}

fn probability(about: &str) -> Value {
    json!({"type": "number", "minimum": 0, "maximum": 1, "description": about})
}

/// Counts by name; which names there are is open.
fn counts(about: &str) -> Value {
    let each = json!({"type": "integer", "minimum": 0});
    json!({"type": "object", "description": about, "properties": {}, "additionalProperties": each})
}

/// What a section of a configuration says; its values are of many types.
fn settings() -> Value {
    json!({
        "type": "object", "description": "How it takes part in rounds, key by key.", "properties": {},
        "additionalProperties": {},
    })
}

fn robot() -> Value {
    json!({"type": "integer", "minimum": 0, "maximum": u32::MAX, "description": "Which robot."})
}

fn class(about: &str) -> Value {
    json!({"type": "integer", "minimum": 0, "maximum": 0x0fff_ffff, "description": about})
}

fn wire() -> Value {
    json!({
        "type": "string", "contentEncoding": "base64",
        "description": "The bytes as they travelled, where this JSON alone does not give them.",
    })
}

fn round() -> Value {
    object(
        "One showing of a gesture.",
        vec![
            must("counter", count("Highest counter heard of, plus one.")),
            must("opener", robot()),
            must("life", count("A number that the opener drew when it started.")),
        ],
    )
}

fn stamp() -> Value {
    object(
        "Its place among all that its author says.",
        vec![
            must("boot", count("Grows at every start.")),
            must("sequence", count("Grows with every message.")),
        ],
    )
}

fn evidence() -> Value {
    let mut evidence = list(
        "Log-evidence per class, in nats, centred and clipped; empty: has seen nothing.",
        number("Nats."),
    );
    evidence["maxItems"] = json!(MAX_CLASSES);
    evidence
}

fn vote() -> Value {
    object(
        "What the robot sees.",
        vec![
            must("round", round()),
            must("vocabulary", count("Which list of gestures; 0: it can tell none.")),
            must("evidence", evidence()),
            must("looks", number("How many independent looks are behind it.")),
            may(
                "unknown",
                number("Nats for a gesture that the robot was never taught, on the scale of the evidence."),
            ),
            must("named", named()),
        ],
    )
}

fn named() -> Value {
    list("The gestures named since the list was made: the last values are theirs.", class("One of them."))
}

fn signature() -> Value {
    text("The author's signature, in hexadecimal; only in a sealed swarm.")
}

fn vote_of() -> Vec<Field> {
    vec![must("robot", robot()), must("stamp", stamp()), must("vote", vote()), may("signature", signature())]
}

fn decision() -> Vec<Field> {
    let counted = vec![
        must("robot", robot()),
        must("stamp", stamp()),
        must("class", class("The class that it finds likeliest.")),
        must("weight", number("What it weighed in the fusion.")),
        must("vote", vote()),
        may("signature", signature()),
    ];
    let pool = vec![
        must("likeness", probability("How alike the evidence of two robots is.")),
        must("temperature", number("By how much one robot overstates its evidence.")),
        must("rounds", count("On how many confirmed rounds these rest.")),
    ];
    let terms = vec![
        must("clip", number("c: the bound on a robot's evidence, in nats.")),
        must("alpha", probability("α: a gesture needs 1 - α.")),
        must("majority", flag("Whether the quorum is a majority of the robots.")),
        must("liars", count("f: how many liars a decision withstands.")),
        must("committee", count("How many robots vote at least where not all do; 0: all do.")),
    ];
    let certificate = vec![
        must("vocabulary", count("The list of gestures that the probabilities stand for.")),
        must("rule", text("The fusion rule.")),
        may("pool", object("How alike a correlated pool takes its robots to be.", pool)),
        must("probabilities", list("The fused probability of each class.", probability("Of one class."))),
        may("unknown", probability("The fused probability of a gesture that nobody taught.")),
        must("named", named()),
        must("votes", list("The votes counted, by robot.", object("One of them.", counted))),
        must("others", list("Votes of those who took part and are not counted.", object("One.", vote_of()))),
        must("robots", count("n: how many robots its author had heard lately.")),
        must("quorum", count("q: how many it needed.")),
        must("elapsed_ms", count("Milliseconds from the opening of the round to the decision.")),
        must("terms", object("What it goes by beside the rule and the quorum.", terms)),
    ];
    vec![
        must("round", round()),
        may("class", class("The gesture; absent: no decision.")),
        must("confidence", probability("The fused probability of the top class.")),
        must("author", robot()),
        must("final", flag("Whether enough robots are known to hold it.")),
        must("certificate", object("What it was drawn from.", certificate)),
        may("label", text("The label of its class.")),
        must("announcer", robot()),
        must("stamp", stamp()),
        may("signature", text("The announcer's signature, in hexadecimal; only in a sealed swarm.")),
    ]
}

fn question() -> Vec<Field> {
    let ask = vec![
        must("kind", one_of("What is asked.", &["between", "again", "name"])),
        may("classes", list("between: the two gestures.", class("One of them."))),
        may("nearest", class("again, name: the gesture that it is likest.")),
    ];
    vec![
        must("round", round()),
        must("ask", object("What is asked.", ask)),
        must("labels", list("What the gestures in question are called.", text("One of them."))),
        must("entropy", number("The entropy of the pooled opinion, in nats.")),
        must("disagreement", number("The Jensen-Shannon divergence of the votes, in nats.")),
        must("robot", robot()),
        must("stamp", stamp()),
        may("signature", signature()),
    ]
}

fn holding() -> Vec<Field> {
    let rank = vec![
        must("decided", flag("Whether it names a gesture.")),
        must("robots", count("How many votes it rests on.")),
        must("looks", number("The looks behind these votes.")),
        must("confidence", probability("The fused probability of its top class.")),
        must("author", robot()),
    ];
    let holding = vec![
        must("round", round()),
        may("class", class("The gesture; absent: none.")),
        must("rank", object("Its place among the decisions of its round.", rank)),
        must("changed", flag("Whether the robot held another gesture before.")),
    ];
    vec![
        must("robot", robot()),
        must("stamp", stamp()),
        must("holding", object("What it holds.", holding)),
        may("signature", signature()),
    ]
}

fn samples() -> Vec<Field> {
    let sample = vec![
        must("author", robot()),
        must("life", count("The author's life.")),
        must("number", count("Counts up from 1 in that life.")),
        must("class", class("The gesture it shows.")),
        must("round", round()),
        must("vector", list("Its components, as they travelled.", number("One component."))),
        must("precision", one_of("How a component travelled.", &["f32", "f16", "i8"])),
    ];
    vec![
        must("robot", robot()),
        must("stamp", stamp()),
        must("space", text("The feature space, in hexadecimal.")),
        must("samples", list("The samples.", object("One sample.", sample))),
        may("signature", signature()),
    ]
}

fn status() -> Vec<Field> {
    let motion = vec![
        must("state", one_of("What it sees.", &["empty", "moving", "still"])),
        must("delay_ms", number("How late a change is noticed.")),
    ];
    let opinion = vec![
        must("gesture", text("Its label.")),
        must("probability", probability("Its probability.")),
        must("at_ms", count("When, since the robot's start.")),
    ];
    let states = ["none", "opening", "live", "frozen", "failing", "ended"];
    let camera = vec![
        must("source", text("What it is, in words.")),
        must("state", one_of("How it goes.", &states)),
        must("trouble", text("What is wrong with it, and the mend.")),
        must("size", list("Width and height in pixels.", count("Pixels."))),
        must("fps", number("Frames per second, lately.")),
        must("delay_ms", number("Milliseconds from taking a frame to judging it.")),
        may("motion", object("What moves before it.", motion)),
        may("opinion", object("What its last frame showed, in its own opinion.", opinion)),
    ];
    let classes = |about| list(about, count("Of one class."));
    let titled = vec![
        must("class", class("Its number.")),
        must("label", text("What it is called.")),
        must("samples", count("The samples that show it.")),
    ];
    let doubted = vec![
        must("robot", robot()),
        must("held", count("How many samples of it are held.")),
        must("trained", count("How many of these are trained on.")),
    ];
    let learning = vec![
        must("space", text("The feature space of its samples.")),
        must("capacity", count("T: how many samples it may hold.")),
        must("personal", classes("Its own samples that it has not shared, by class.")),
        must("shared", classes("Its own samples that it has shared, by class.")),
        must("external", classes("The samples it has from others, by class.")),
        must("aside", count("Samples kept aside until it is known what they show.")),
        must("common", text("A digest of the common knowledge.")),
        must("lessons", count("Rounds of which it knows what an instructor said.")),
        must("memory", text("Where it keeps all this.")),
        must("named", list("The gestures that were named since, and are in use.", object("One.", titled))),
        must("trainings", count("How often it has trained.")),
        may(
            "doubted",
            list("Other robots whose samples it does not all train on.", object("One of them.", doubted)),
        ),
    ];
    let error = vec![must("at_ms", count("Since the robot's start.")), must("what", text("Cause and mend."))];
    vec![
        must("robot", robot()),
        must("name", text("Its name for people.")),
        must("boot", count("How often it has started.")),
        must("camera", object("What it sees with.", camera)),
        must("model", text("Its classifier, in words.")),
        must("sealed", flag("Whether it signs what it says.")),
        must("vocabulary", list("The labels of the gestures, by class.", text("A label."))),
        must("neighbours", list("Robots it is linked to.", robot())),
        must("alive", list("Robots it knows to be alive.", robot())),
        may("round", round()),
        must("open", flag("Whether that round is open.")),
        may("learning", object("What it has learned from.", learning)),
        must("counters", counts("Counters since its start, by name.")),
        must("errors", list("The latest errors.", object("One error.", error))),
        must("protocol", count("The version of the wire that it speaks.")),
        must("session", text("Its Zenoh session.")),
        may("clock_ms", count("Its clock, in milliseconds since 1970.")),
        must("rounds", settings()),
    ]
}

fn feedback() -> Vec<Field> {
    let words = ["open", "was", "right", "wrong", "retract", "new", "same", "retire", "restore"];
    vec![
        must("say", one_of("What is said.", &words)),
        may("round", round()),
        may("class", class("was, same, retire, restore: the gesture, by class.")),
        may("class_label", text("was, same, retire, restore: the gesture, by label.")),
        may("label", text("new: what the gesture is called.")),
        may("of", class("right, wrong: the gesture decided, by class; same: what the other is.")),
        may("of_label", text("right, wrong: the gesture decided, by label; same: what the other is.")),
    ]
}

fn answer() -> Vec<Field> {
    let outcomes = [
        "learned",
        "known",
        "nothing_seen",
        "unknown_round",
        "unknown_gesture",
        "no_room",
        "not_learning",
        "not_allowed",
    ];
    vec![
        must("robot", robot()),
        must("at", count("The time of the word that is answered, as NTP64.")),
        must("to", object("The word that is answered.", feedback())),
        must("outcome", one_of("What became of it.", &outcomes)),
        may("class", class("The gesture that the round's samples stand for.")),
        may("looks_like", class("Of a gesture that was named: what the swarm took it for.")),
        must("samples", count("How many samples of that round the robot holds.")),
    ]
}

fn unreadable() -> Vec<Field> {
    vec![
        must("key", text("The key it came under.")),
        must("cause", text("Why it is no message.")),
        must("bytes", count("How long it is.")),
    ]
}

fn recorder() -> Vec<Field> {
    vec![
        must("received", counts("Messages that arrived, by kind.")),
        must("written", counts("Messages that are on the disk, by kind.")),
        must("dropped", counts("Messages that found the queue full, by kind.")),
        must("bytes", count("Bytes on the disk.")),
        must("unattached_ms", count("For how long nothing could be heard, attached to no robot.")),
    ]
}

#[cfg(test)]
mod tests;
