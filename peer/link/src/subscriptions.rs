//! Everything that a robot hears.

use std::sync::Arc;

use gestalt_protocol::{Keys, RobotId, Topic};
use zenoh::Session;
use zenoh::sample::Locality;

use crate::inbox::Inbox;

/// Takes in everything that concerns a robot, until its session is closed.
pub(crate) async fn listen(
    session: &Session,
    keys: &Keys,
    me: RobotId,
    inbox: &Arc<Inbox>,
) -> zenoh::Result<()> {
    let of_interest = [
        keys.every_robot("vote"),
        keys.every_robot("sample"),
        keys.key(&Topic::Repair(me)),
        keys.every_robot("decision"),
        keys.key(&Topic::Decision),
        keys.key(&Topic::Question),
        keys.key(&Topic::Evidence),
        keys.every_instructor("feedback"),
        keys.every_instructor("word"),
        keys.key(&Topic::Roster),
        keys.key(&Topic::RosterFor(me)),
        keys.every_instructor("answer"),
    ];
    for key in of_interest {
        let inbox = inbox.clone();
        session
            .declare_subscriber(key)
            .allowed_origin(Locality::Remote)
            .callback(move |sample| inbox.on_sample(&sample))
            .background()
            .await?;
    }
    let inbox = inbox.clone();
    session
        .liveliness()
        .declare_subscriber(keys.every_robot("alive"))
        .history(true)
        .callback(move |sample| inbox.on_liveliness(&sample))
        .background()
        .await
}
