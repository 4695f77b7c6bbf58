//! Waiting for a moment that may never come.

use std::time::Instant;

/// Waits until then; for ever without.
pub(crate) async fn sleep_until(wake: Option<Instant>) {
    match wake {
        Some(wake) => tokio::time::sleep_until(wake.into()).await,
        None => std::future::pending().await,
    }
}
