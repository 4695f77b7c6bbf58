//! What one robot says to another alone, which is not signed: that it comes from there all the same.
//!
//! A signature is for everybody and for ever; what neighbours tell each other several times a second concerns the two alone, and now. The two have a
//! secret in common that follows from their keys (X25519, RFC 7748, of the Ed25519 keys that they sign with), and a tag by it takes a quarter of the bytes of a signature, and a
//! hundredth of the time of its check (`cargo bench -p gestalt-trust`). That one pair of keys serves both is sound: E. Thormarker, "On using the same key pair for Ed25519 and an X25519 based KEM", 2021.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::Arc;

use gestalt_protocol::{RobotId, Stamp};
use hmac::{Hmac, KeyInit, Mac};
use sha2::{Digest, Sha256};
use zeroize::Zeroizing;

use crate::distrust::Distrust;
use crate::identity::Identity;
use crate::public_key::PublicKey;
use crate::roster::Roster;
use crate::scheme::{Ed25519, Scheme};
use crate::statement::SwarmId;

/// Stands first in what the secret of two robots is made of.
pub const CHANNEL_DOMAIN: &[u8; 18] = b"gestalt-channel-1\0";

/// Of how many starts of another robot it is remembered what was heard last.
const REMEMBERED: usize = 4;

/// Shows to one robot who says something: the first 16 bytes of HMAC-SHA-256 (RFC 2104), under the secret of the two, over who says it, to whom (u32 each, little-endian), and
/// what.
pub type Tag = [u8; 16];

/// The channels of one robot to every other one of its roster.
///
/// Memory is bounded by the roster: some hundred bytes for each robot on it that was spoken with.
pub struct Channels<S: Scheme = Ed25519> {
    me: RobotId,
    identity: Arc<Identity<S>>,
    swarm: SwarmId,
    with: BTreeMap<RobotId, Channel>,
}

/// That to one robot, as long as it has this key.
struct Channel {
    key: PublicKey,
    secret: Zeroizing<[u8; 32]>,
    /// The last that was heard of each of its latest starts: nothing counts twice.
    heard: VecDeque<Stamp>,
}

impl<S: Scheme> Channels<S> {
    /// Those of robot `me` in that swarm.
    #[must_use]
    pub fn new(me: RobotId, identity: Arc<Identity<S>>, swarm: SwarmId) -> Self {
        Self { me, identity, swarm, with: BTreeMap::new() }
    }

    /// The tag under what this robot says to that one.
    ///
    /// # Errors
    /// [`Distrust::Stranger`] and [`Distrust::Expelled`]: nothing is said to those.
    pub fn tag(&mut self, roster: &Roster<S>, to: RobotId, message: &[u8]) -> Result<Tag, Distrust> {
        let me = self.me;
        let made = authenticated(self.with(roster, to)?, me, to, message).finalize().into_bytes();
        let mut tag = Tag::default();
        tag.copy_from_slice(&made[..size_of::<Tag>()]);
        Ok(tag)
    }

    /// Whether that robot said this to this one, after all else that it was heard to say in that start. What is behind its stamp is not looked into.
    ///
    /// # Errors
    /// [`Distrust::Unsigned`] without a tag, [`Distrust::Stranger`] and [`Distrust::Expelled`], [`Distrust::Forged`] for a tag that is not theirs, and
    /// [`Distrust::Repeated`] for what was heard before, or comes behind what was said after it.
    pub fn check(
        &mut self,
        roster: &Roster<S>,
        (from, stamp): (RobotId, Stamp),
        message: &[u8],
        tag: Option<&[u8]>,
    ) -> Result<(), Distrust> {
        let tag = tag.filter(|tag| tag.len() == size_of::<Tag>()).ok_or(Distrust::Unsigned)?;
        let me = self.me;
        let channel = self.with(roster, from)?;
        let is_theirs = authenticated(channel, from, me, message).verify_truncated_left(tag).is_ok();
        if !is_theirs {
            return Err(Distrust::Forged);
        }
        let before = channel.heard.iter().position(|heard| heard.boot == stamp.boot);
        if before.is_some_and(|place| stamp <= channel.heard[place]) {
            return Err(Distrust::Repeated);
        }
        // The start that was heard of longest ago is forgotten.
        let gone = before.or_else(|| (channel.heard.len() == REMEMBERED).then_some(0));
        if let Some(place) = gone {
            channel.heard.remove(place);
        }
        channel.heard.push_back(stamp);
        Ok(())
    }

    /// The channel to that robot, with the key that it has today.
    fn with(&mut self, roster: &Roster<S>, robot: RobotId) -> Result<&mut Channel, Distrust> {
        let ready = roster.key(robot)?;
        let key = *roster.members().robots.get(&robot).ok_or(Distrust::Stranger)?;
        let secret = || secret(&self.identity, &self.swarm, ready, &key);
        let new = || Channel { key, secret: secret(), heard: VecDeque::new() };
        let channel = self.with.entry(robot).or_insert_with(new);
        if channel.key != key {
            *channel = new();
        }
        Ok(channel)
    }
}

/// SHA-256 over [`CHANNEL_DOMAIN`], the swarm, what follows from both keys, and the two public ones, the lower first.
fn secret<S: Scheme>(
    identity: &Identity<S>,
    swarm: &SwarmId,
    ready: &S::Key,
    theirs: &PublicKey,
) -> Zeroizing<[u8; 32]> {
    let mine = identity.public_key();
    let (first, second) = (mine.min(*theirs), mine.max(*theirs));
    let hash = Sha256::new()
        .chain_update(CHANNEL_DOMAIN)
        .chain_update(swarm.as_bytes())
        .chain_update(identity.agree(ready))
        .chain_update(first.as_bytes())
        .chain_update(second.as_bytes());
    Zeroizing::new(hash.finalize().into())
}

impl<S: Scheme> fmt::Debug for Channels<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Channels").field("me", &self.me).finish_non_exhaustive()
    }
}

/// That message of one to the other, under the secret of the two.
fn authenticated(channel: &Channel, from: RobotId, to: RobotId, message: &[u8]) -> Hmac<Sha256> {
    Hmac::<Sha256>::new_from_slice(&*channel.secret)
        .expect("a key of any length is one")
        .chain_update(from.0.to_le_bytes())
        .chain_update(to.0.to_le_bytes())
        .chain_update(message)
}

#[cfg(test)]
mod tests;
