//! Prints each decision of a running swarm, from any robot of it: nothing but Zenoh and JSON.
//!
//! ```text
//! cargo run -p gestalt-examples --example subscribe -- tcp/127.0.0.1:7447 gestalt
//! ```

use serde_json::{Value, json};

#[tokio::main]
async fn main() -> zenoh::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let endpoint = arguments.next().unwrap_or_else(|| "tcp/127.0.0.1:7447".to_owned());
    let swarm = arguments.next().unwrap_or_else(|| "gestalt".to_owned());

    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "'client'")?;
    config.insert_json5("connect/endpoints", &json!([endpoint]).to_string())?;
    let session = zenoh::open(config).await?;
    let decisions = session.declare_subscriber(format!("gestalt/{swarm}/decision")).await?;

    while let Ok(sample) = decisions.recv_async().await {
        let decision: Value = match serde_json::from_slice(&sample.payload().to_bytes()) {
            Ok(decision) => decision,
            Err(error) => {
                eprintln!("what is no decision: {error}");
                continue;
            }
        };
        let what = what(&decision);
        let robots = decision["certificate"]["votes"].as_array().map_or(0, Vec::len);
        println!(
            "round {}: {what} ({}, {robots} robots)",
            decision["round"]["counter"], decision["confidence"]
        );
    }
    Ok(())
}

/// What was decided. The class is null where nothing was; the label also where whoever says it has another vocabulary.
fn what(decision: &Value) -> String {
    match (&decision["class"], decision["label"].as_str()) {
        (Value::Null, _) => "no decision".to_owned(),
        (_, Some(label)) => label.to_owned(),
        (class, None) => format!("class {class}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gesture_without_a_label_is_a_decision() {
        let cases = [
            (json!({"class": 2, "label": "two"}), "two"),
            (json!({"class": 2, "label": null}), "class 2"),
            (json!({"class": null, "label": null}), "no decision"),
        ];
        for (decision, said) in cases {
            assert_eq!(what(&decision), said);
        }
    }
}
