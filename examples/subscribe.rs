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
        let decision: Value = serde_json::from_slice(&sample.payload().to_bytes())?;
        let what = decision["label"].as_str().unwrap_or("no decision");
        let robots = decision["certificate"]["votes"].as_array().map_or(0, Vec::len);
        println!(
            "round {}: {what} ({}, {robots} robots)",
            decision["round"]["counter"], decision["confidence"]
        );
    }
    Ok(())
}
