//! `gestalt-trust` as it is used here: with the signatures of robots, checked by the robots' own rule, but once for all that are
//! played by one thread. A swarm and its double without the attack hear nearly the same, each robot of both checks it, and
//! that would be half of the time.

use gestalt_trust::Memoised;
pub(crate) use gestalt_trust::*;

pub(crate) type Channels = gestalt_trust::Channels<Memoised>;
pub(crate) type Identity = gestalt_trust::Identity<Memoised>;
pub(crate) type Judge = gestalt_trust::Judge<Memoised>;
pub(crate) type Roster = gestalt_trust::Roster<Memoised>;
pub(crate) type Verifier = gestalt_trust::Verifier<Memoised>;
