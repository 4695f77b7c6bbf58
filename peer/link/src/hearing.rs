//! Who can be heard by multicast, without taking part.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gestalt_protocol::{Keys, RobotId};
use zenoh::config::WhatAmI;

use crate::config::LinkConfig;
use crate::error::LinkError;
use crate::identity::{robot_of, swarm_checksum};

/// The most robots that are listened to.
const MAX_HEARD: usize = 4096;

/// Calls by multicast, and gives the robots of that swarm that answer within `patience`, with the endpoints they listen on.
/// Nobody answers where `link.scouting` is off.
///
/// # Errors
/// [`LinkError::Config`] names what Zenoh cannot take, [`LinkError::Open`] says why there is no calling: most often there is no
/// such network interface.
pub async fn hear(
    swarm: &str,
    link: &LinkConfig,
    patience: Duration,
) -> Result<BTreeMap<RobotId, Vec<String>>, LinkError> {
    Keys::new(swarm)?;
    if link.scouting.is_none() {
        return Ok(BTreeMap::new());
    }
    let checksum = swarm_checksum(swarm);
    let heard = Arc::<Mutex<BTreeMap<RobotId, Vec<String>>>>::default();
    let answers = heard.clone();
    let call = zenoh::scout(WhatAmI::Router, link.client()?)
        .callback(move |hello| {
            let mut heard = answers.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(robot) = robot_of(hello.zid(), checksum)
                && heard.len() < MAX_HEARD
            {
                heard.insert(robot, hello.locators().iter().map(ToString::to_string).collect());
            }
        })
        .await
        .map_err(|error| LinkError::open(&*error))?;
    tokio::time::sleep(patience).await;
    call.stop();
    Ok(std::mem::take(&mut *heard.lock().unwrap_or_else(PoisonError::into_inner)))
}
