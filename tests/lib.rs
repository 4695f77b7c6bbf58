//! What the whole-swarm scenarios share: a classifier without pictures, robots that learn, robots in this process,
//! robots as processes, and network namespaces to put them in.

#[path = "set_up/browser.rs"]
mod browser;
#[path = "set_up/classifier.rs"]
mod classifier;
#[path = "set_up/crowd.rs"]
mod crowd;
#[path = "set_up/learning.rs"]
mod learning;
#[path = "set_up/namespaces.rs"]
mod namespaces;
#[path = "set_up/process.rs"]
mod process;
#[path = "set_up/robots.rs"]
mod robots;
#[path = "set_up/sealed.rs"]
mod sealed;
#[path = "set_up/streaming.rs"]
mod streaming;

pub use browser::Browser;
pub use classifier::{Fixed, look};
pub use crowd::{in_crowd, processor_time, sums};
pub use learning::{between, gesture, learning, short_rounds, space};
pub use namespaces::Namespaces;
pub use process::Process;
pub use robots::{Watched, agreed, config, start, start_learning, start_looking, unique};
pub use sealed::{by_tls, credentials, key, seal, sealed, tag, with_eve};
pub use streaming::{Hands, center_config, model, sender_config};
