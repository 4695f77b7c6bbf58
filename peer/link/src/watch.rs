//! Whether a robot's session is still open.

use std::sync::Arc;
use std::time::Duration;

use zenoh::Session;

use crate::failure::Part;
use crate::supervisor::Supervisor;

/// How often it is made sure that a session is still open.
const LOOK_AFTER: Duration = Duration::from_millis(500);

/// Ends a robot whose session has been closed, by whomever. Never returns before.
pub(crate) async fn watch_session(session: Session, supervisor: Arc<Supervisor>) -> Result<(), String> {
    loop {
        tokio::time::sleep(LOOK_AFTER).await;
        if session.is_closed() {
            supervisor.end(Part::Session, "Zenoh closed it".to_owned());
            return Ok(());
        }
    }
}
