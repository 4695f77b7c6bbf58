//! A swarm live in Foxglove, served by a verb.

use gestalt_desk::{Address, Foxglove, Viewing};
use gestalt_link::{Client, LinkConfig};
use serde_json::json;

use super::Failure;
use super::show::line;
use super::web::{chosen_token, from_elsewhere};

/// Where viewers may connect; as flags of a verb.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct FoxgloveArgs {
    /// Serve the channels of `gestalt record` to Foxglove, Lichtblick and other viewers (WebSocket, foxglove.sdk.v1), with a
    /// service that teaches, and print the address; port 0 is any that is free. Elsewhere than on this machine viewers need
    /// the token that the address ends with (GESTALT_WEB_TOKEN chooses it)
    #[arg(long, value_name = "[HOST:]PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    foxglove: Option<Address>,

    /// Let pages of this origin connect, too, such as a Lichtblick of one's own: http://localhost:8080
    #[arg(long, value_name = "ORIGIN", requires = "foxglove")]
    foxglove_origin: Vec<String>,

    /// Serve the pictures that robots stream, too
    #[arg(long, requires = "foxglove")]
    frames: bool,
}

impl FoxgloveArgs {
    /// Serves what was asked for, if anything was, of a swarm that is reached like that, and says where.
    pub(super) async fn open(
        &self,
        swarm: &str,
        link: &LinkConfig,
        as_json: bool,
    ) -> Result<Option<Foxglove>, Failure> {
        let Some(address) = &self.foxglove else { return Ok(None) };
        let mut viewing = Viewing { frames: self.frames, ..Viewing::at(address.clone()) };
        viewing.origins.extend(self.foxglove_origin.iter().cloned());
        viewing.door.token = chosen_token()?;
        let server = Foxglove::open(Client::open(swarm, link).await?, swarm, viewing).await?;
        let url = server.url();
        let layout = url.replacen("ws://", "http://", 1);
        let layout = match layout.split_once('?') {
            Some((host, query)) => format!("{host}layout.json?{query}"),
            None => format!("{layout}layout.json"),
        };
        let hint = from_elsewhere(server.address());
        line(
            as_json,
            &json!({"event": "foxglove", "url": url, "layout": layout}),
            &format!("Foxglove: {url}{hint}\nlayout:   {layout}"),
        )?;
        Ok(Some(server))
    }

    /// Closes it, and says what became of its clients where some were lost or refused.
    pub(super) async fn close(server: Foxglove, as_json: bool) -> Result<(), Failure> {
        let visits = server.visits();
        server.close().await;
        if as_json || visits.dropped + visits.refused > 0 {
            let words = format!(
                "Foxglove: {} clients, {} dropped for taking nothing, {} requests refused",
                visits.clients, visits.dropped, visits.refused
            );
            line(as_json, &json!({"event": "foxglove_closed", "visits": visits}), &words)?;
        }
        Ok(())
    }
}
