//! The liveliness token by which others see that a robot is alive.

use std::time::Duration;

use tokio::sync::watch;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

/// How long after a lost link a token is declared anew: by then the links have found themselves.
const REDECLARE: Duration = Duration::from_secs(3);

/// Keeps a robot's liveliness token declared, and declares it anew some time after it lost a link: of a robot that
/// was frozen or cut off and came back, some others were measured never to learn again, in about one case of eight,
/// neither by Zenoh's news nor by a query, until the token was new. Runs until it is ended, or fails.
pub(crate) async fn keep_token(
    session: Session,
    key: String,
    mut lost_links: watch::Receiver<u64>,
    token: Option<LivelinessToken>,
) -> Result<(), String> {
    let declare = async || {
        let declared = session.liveliness().declare_token(&key).await;
        declared.map_err(|error| format!("declaring the liveliness token: {error}"))
    };
    let mut token = match token {
        Some(token) => token,
        None => declare().await?,
    };
    // An error says that the robot has gone.
    while lost_links.changed().await.is_ok() {
        tokio::time::sleep(REDECLARE).await;
        if let Err(error) = token.undeclare().await {
            tracing::debug!("withdrawing the liveliness token: {error}");
        }
        token = declare().await?;
    }
    Ok(())
}
