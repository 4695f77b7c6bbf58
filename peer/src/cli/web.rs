//! The page of a swarm, served by a verb.

use std::net::SocketAddr;

use gestalt_desk::{Address, Desk, Door, Token};
use gestalt_link::{Client, LinkConfig};
use serde_json::json;

use super::Failure;
use super::show::line;

/// What chooses the page's token; else one is drawn where one is needed.
const TOKEN: &str = "GESTALT_WEB_TOKEN";

/// Where a page is served; as flags of a verb.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct WebArgs {
    /// Serve a page to watch and teach the swarm in a browser, and its metrics at /metrics, and print the address; port 0 is
    /// any that is free. Elsewhere than on this machine readers need the token that the address ends with
    /// (GESTALT_WEB_TOKEN chooses it)
    #[arg(long, value_name = "[HOST:]PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8420")]
    web: Option<Address>,
}

impl WebArgs {
    /// The address that was asked for, or else another.
    #[cfg(feature = "opencv")]
    pub(super) fn or(&self, other: Option<&Address>) -> Self {
        Self { web: self.web.as_ref().or(other).cloned() }
    }

    /// Serves the page that was asked for, if any, of a swarm that is reached like that.
    pub(super) async fn open(&self, swarm: &str, link: &LinkConfig) -> Result<Option<Desk>, Failure> {
        let Some(address) = &self.web else { return Ok(None) };
        let door = Door { token: chosen_token()?, ..Door::at(address.clone()) };
        Ok(Some(Desk::open(Client::open(swarm, link).await?, swarm, door).await?))
    }
}

/// Says where a page is served.
pub(super) fn say_where(page: &Desk, as_json: bool) -> Result<(), Failure> {
    let (url, hint) = (page.url(), from_elsewhere(page.address()));
    line(as_json, &json!({"event": "page", "url": url}), &format!("page: {url}{hint}"))
}

/// The token that the environment chooses, if it does.
pub(super) fn chosen_token() -> Result<Option<Token>, Failure> {
    let Ok(token) = std::env::var(TOKEN) else { return Ok(None) };
    Ok(Some(Token::new(&token).map_err(|error| format!("{TOKEN}: {error}"))?))
}

/// What to say behind a URL that is listened to at all of this machine's addresses.
pub(super) fn from_elsewhere(address: SocketAddr) -> &'static str {
    if address.ip().is_unspecified() {
        " · from elsewhere with this machine's own address in it"
    } else {
        ""
    }
}
