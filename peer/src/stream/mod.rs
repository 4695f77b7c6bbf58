//! A camera here, the eyes that look through it elsewhere.
//!
//! ```text
//! thin client                                                 centre, or a peer
//!   camera ─► newest frame ─► JPEG ──── robot/<id>/frame ────► newest frame ─► decode ─► sight
//!                  ▲ overwritten              one in flight         │
//!                  └── credit ◄─────── robot/<id>/taken ◄───────────┘
//! ```

mod credit;
mod feed;
mod inlet;
mod sender;

pub use credit::{Credit, PROBE};
pub use feed::{Content, Feed, Shot};
pub use inlet::{Inlet, MAX_MEGAPIXELS, StreamSource};
pub use sender::{Sender, SenderConfig, StreamEvent};
